"""Blocks as C99: translated from their kernels, with the numbers and wiring of a model around them."""
