"""Laws of exports: the numbers of Python, to the last bit in double precision, wherever they run."""
