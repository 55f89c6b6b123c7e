"""Set-ups of muscles in rigs, one file each."""
