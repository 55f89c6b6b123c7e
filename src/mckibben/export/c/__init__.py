"""Blocks as C99: hand-written primitives, and the numbers and wiring of a model around them."""
