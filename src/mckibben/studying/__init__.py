"""The main job: what the muscle does, which model to use, how sure that is, and its inverse."""
