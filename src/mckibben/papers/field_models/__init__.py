"""Paper B: comparison of models of the field."""
