"""The commands: a module each, of its name, with its help as docstring."""
