"""Blocks: immutable parameter sets with dynamics, one file per model family."""
