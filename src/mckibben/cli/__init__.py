"""The command line: one file per command, with calls into the package only."""
