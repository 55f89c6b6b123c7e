"""Paper E: the activation pressure of a muscle."""
