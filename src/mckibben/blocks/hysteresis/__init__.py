"""Models made of play and stop operators: Prandtl-Ishlinskii and its relatives, and Maxwell-slip."""
