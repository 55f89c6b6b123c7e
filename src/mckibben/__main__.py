"""The command line, as ``python -m mckibben``."""

from mckibben.cli.entry import run

if __name__ == "__main__":
    run()
