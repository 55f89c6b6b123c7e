"""How parameters are found: one search of a kind."""
