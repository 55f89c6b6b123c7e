"""What recordings tell of a model, and what to record next."""
