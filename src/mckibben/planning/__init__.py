"""Plans of the next recording."""
