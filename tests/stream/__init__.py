"""Laws of streams: a bad sample holds the last good value and changes nothing else."""
