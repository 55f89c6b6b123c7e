"""Laws of the muscle library: what it holds is loaded exactly, and what is no muscle is refused."""
