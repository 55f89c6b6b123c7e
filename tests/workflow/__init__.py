"""Laws of operations: commands and functions equal each other, and every option has an effect."""
