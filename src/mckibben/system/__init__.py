"""Operating-system services: files, processes, threads, compiled functions."""
