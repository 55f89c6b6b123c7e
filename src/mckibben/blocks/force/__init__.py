"""Muscle force by length and pressure: static laws, friction, and the pressure for a force."""
