"""The program's first lines: Ctrl-C while the commands are being loaded ends it with a plain word."""

from __future__ import annotations

import os
import signal
from contextlib import suppress
from types import FrameType


def run() -> None:
    """Load the commands and run the one that was typed."""
    before = signal.getsignal(signal.SIGINT)
    if before is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, _leave)
    from mckibben.cli.main import run as command

    signal.signal(signal.SIGINT, before)
    try:
        command()
    finally:  # all is done: there is nothing left to interrupt
        signal.signal(signal.SIGINT, signal.SIG_IGN)


def _leave(signum: int, frame: FrameType | None) -> None:
    with suppress(OSError):
        os.write(2, b"\nInterrupted before anything was begun.\n")
    os._exit(130)


if __name__ == "__main__":
    run()
