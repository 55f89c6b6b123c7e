"""Paper C: multistate friction."""
