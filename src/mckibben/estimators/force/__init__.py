"""Identification of forces: static laws, friction, and activation pressure."""
