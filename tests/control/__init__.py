"""Laws of closed loops: a plant is given only what its limits let, and what was measured is scored."""
