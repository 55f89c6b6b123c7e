"""Paper B: models of the field side by side."""
