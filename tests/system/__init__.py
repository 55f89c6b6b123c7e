"""Laws of the machinery: outputs are whole or absent, and processes end with what they serve."""
