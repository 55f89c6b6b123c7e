"""What a muscle does, whether a model is right, and what recordings cannot identify."""
