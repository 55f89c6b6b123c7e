"""Entry point of the program; Ctrl-C during loading ends it without a traceback."""

from __future__ import annotations

import os


def run() -> None:
    """Load the command line and run it."""
    try:
        from mckibben.cli.main import run as command
    except KeyboardInterrupt:
        os._exit(130)
    command()


if __name__ == "__main__":
    run()
