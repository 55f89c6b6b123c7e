"""The command line: one file a command, nothing but calls into the package."""
