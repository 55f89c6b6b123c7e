"""How blocks are found from recordings, one file per model family."""
