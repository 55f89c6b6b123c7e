"""Ctrl-C: the first says what happens and stops the work, the second ends the program at once."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

from mckibben.cli.output import InterruptionError

if TYPE_CHECKING:
    from mckibben.comparison.results import Leaderboard

INTERRUPTED = 130
"""Exit code."""

PATIENCE = 1.9
"""How long the work may take to stop before the program ends without it [s]."""


@contextmanager
def stoppable(folder: Path | None) -> Iterator[None]:
    """Let long work be stopped: say what is kept, and see to it that it stops.

    Parameters
    ----------
    folder : path or None
        Where finished models are kept.

    Raises
    ------
    InterruptionError
        When it was stopped; the text says how to go on.
    """
    if folder is None:
        kept = "nothing is kept without -o DIR"
    else:
        kept = f"what is finished is kept in {folder}; the same command goes on from there"
    stopped = False

    def stop(signum: int, frame: FrameType | None) -> None:
        nonlocal stopped
        if stopped:
            os._exit(INTERRUPTED)
        stopped = True
        os.write(2, f"\nStopping: {kept}.\n".encode())  # safe wherever the signal finds us
        ending = threading.Timer(PATIENCE, os._exit, (INTERRUPTED,))
        ending.daemon = True
        ending.start()
        raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, stop)
    try:
        yield
    except (KeyboardInterrupt, InterruptionError) as error:
        said = str(error) or f"Stopped: {kept}."
        if (
            stopped
        ):  # leave without the interpreter's farewell, which takes long where much is loaded
            print(said, file=sys.stderr)
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(INTERRUPTED)
        raise InterruptionError(said) from None
    finally:
        signal.signal(signal.SIGINT, before)


def stop_short(board: Leaderboard) -> None:
    """Leave if a comparison was stopped before it was done.

    Raises
    ------
    InterruptionError
        Saying how far it was.
    """
    if board.pending:
        done = len(board.rows)
        raise InterruptionError(
            f"Stopped after {done} of {done + len(board.pending)} models; pending: "
            f"{', '.join(board.pending)}."
        )
