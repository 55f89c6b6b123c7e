"""The papers, one folder each: protocol, printed results, and re-run."""
