"""Blocks as C99: translated kernels with the coefficients and wiring of a model."""
