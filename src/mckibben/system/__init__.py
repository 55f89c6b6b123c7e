"""What the operating system is asked for, safely: files, processes, threads, compiled functions."""
