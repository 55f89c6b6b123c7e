"""Least squares, descents and statistics of arrays."""
