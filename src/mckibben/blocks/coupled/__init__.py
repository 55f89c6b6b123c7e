"""Blocks of several muscles, or of one muscle and its load."""
