"""Paper D: hysteresis under a varying load."""
