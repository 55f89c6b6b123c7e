"""Paper A: coupled hysteresis of a soft arm."""
