"""Laws of the numerical parts: they agree with SciPy, and with the same written out."""
