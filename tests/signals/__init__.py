"""Laws of signals and recordings: what memory depends on is kept, and copies of data are found."""
