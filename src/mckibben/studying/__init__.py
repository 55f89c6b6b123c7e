"""Studies: characterization, model choice with uncertainty, and inverse."""
