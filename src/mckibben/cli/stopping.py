"""Ctrl-C: the first stops the work and reports what is finished, the second exits at once."""

from __future__ import annotations

import os
import select
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType
from typing import Any

from mckibben.cli.output import INTERRUPTED, InterruptionError, say
from mckibben.outputs import UNFINISHED
from mckibben.system.workers import leave

STOPPING_TIME = 1.3
"""How long the work may take to stop before the program ends without it [s]."""


@contextmanager
def stoppable(folder: Path | None) -> Iterator[None]:
    """Make long work interruptible.

    Parameters
    ----------
    folder : path or None
        Where finished parts are.

    Raises
    ------
    InterruptionError
        When it was stopped; the text says how to go on.
    """
    is_main = threading.current_thread() is threading.main_thread()
    if not is_main or signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        yield
        return
    stopped = False

    def stop(signum: int, frame: FrameType | None) -> None:
        nonlocal stopped
        first, stopped = not stopped, True
        if first:
            raise KeyboardInterrupt

    signal.signal(signal.SIGINT, stop)
    original_hook, sys.unraisablehook = sys.unraisablehook, _quiet(sys.unraisablehook)
    try:
        with _watched():
            try:
                yield
            except (KeyboardInterrupt, InterruptionError) as error:
                text = str(error) or how_to_go_on(folder)
                if stopped:  # without the interpreter's farewell, long where much is loaded
                    say(text, error=True)
                    with suppress(OSError, AttributeError):
                        sys.stdout.flush()
                    leave(INTERRUPTED)
                raise InterruptionError(text) from None
    finally:
        sys.unraisablehook = original_hook
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # all is done, but for printing


@contextmanager
def _watched() -> Iterator[None]:
    """Handle signals in a thread, as the main thread cannot while it runs compiled code."""
    read_end, write_end = os.pipe()
    os.set_blocking(write_end, False)

    def watch() -> None:
        if not os.read(read_end, 1):
            return  # all is done
        with suppress(OSError):
            os.write(2, b"\nStopping ...\n")
        ready, _, _ = select.select([read_end], [], [], STOPPING_TIME)
        if not ready or os.read(read_end, 1):
            leave(INTERRUPTED)  # a second signal, or it takes too long

    threading.Thread(target=watch, daemon=True).start()
    earlier = signal.set_wakeup_fd(write_end, warn_on_full_buffer=False)
    try:
        yield
    finally:
        signal.set_wakeup_fd(earlier)
        os.close(write_end)


def _quiet(original: Any) -> Any:
    """Suppress messages about interruptions that are lost in compiled code."""

    def hook(arguments: sys.UnraisableHookArgs) -> None:
        if arguments.exc_type is not KeyboardInterrupt:
            original(arguments)

    return hook


def how_to_go_on(folder: Path | None) -> str:
    """Return what was finished of the stopped work, and how to resume."""
    if folder is None:
        return "Stopped."
    place = folder / UNFINISHED
    if not any(place.rglob("*.*")):
        return "Stopped before anything was finished."
    return f"Stopped; the same command resumes from {place}."


def stop_short(result: Any, folder: Path | None) -> None:
    """Exit if a comparison, or a study, was stopped before it was done.

    Raises
    ------
    InterruptionError
        With how many models are done.
    """
    board = getattr(result, "leaderboard", result)
    if getattr(board, "stopped", False):
        done = len(board.rows)
        text = f"{done} of {done + len(board.pending)} models are done."
        raise InterruptionError(f"{how_to_go_on(folder)} {text}")
