"""The commands: a module each, with its help as docstring and a ``command``."""
