"""Blocks that say how far off a model may be."""
