"""Laws of re-runs: rows state what is printed beside what is found, and commands run as printed."""
