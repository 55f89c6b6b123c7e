"""Blocks of several muscles, or of a muscle and its load."""
