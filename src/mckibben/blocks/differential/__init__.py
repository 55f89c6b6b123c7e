"""Hysteresis as a differential equation in the input: Bouc-Wen, its generalised form, and Duhem."""
