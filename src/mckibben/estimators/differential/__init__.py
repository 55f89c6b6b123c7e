"""Identification of hysteresis as a differential equation in the input."""
