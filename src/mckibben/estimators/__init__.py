"""Identification of blocks from recordings, one file per model family."""
