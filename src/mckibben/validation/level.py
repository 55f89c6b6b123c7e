"""How often a right model may be accused, and what that takes."""

LEVEL = 0.01
"""How often a right model is said to miss something, all tests of all outputs together."""

FEWEST = 40.0
"""Independent samples that say as much as all do, below which tests do not hold their level."""
