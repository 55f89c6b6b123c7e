"""Laws of reports: whole, offline, legible; every number in a sentence is that of the result."""
