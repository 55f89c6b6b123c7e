"""Compensators that learn from what is measured while they run."""
