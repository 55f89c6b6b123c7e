"""Whether a model is right on recordings, and what it misses, in plain words."""
