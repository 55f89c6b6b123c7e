"""Ctrl-C: the first says what happens and stops the work, the second ends the program at once."""

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
from typing import TYPE_CHECKING

import typer

from mckibben.cli.output import InterruptionError, say
from mckibben.system.workers import leave

if TYPE_CHECKING:
    from mckibben.comparison.leaderboard import Leaderboard

INTERRUPTED = 130
"""Exit code."""

NO_MODEL = 1
"""Exit code where none of the models asked for could be fitted."""

PATIENCE = 1.3
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
    ours = threading.current_thread() is threading.main_thread()
    if not ours or signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        yield
        return
    what = "nothing is kept without -o DIR" if folder is None else "what is finished is kept"
    stopped = False

    def stop(signum: int, frame: FrameType | None) -> None:
        nonlocal stopped
        first, stopped = not stopped, True
        if first:
            raise KeyboardInterrupt

    before = signal.signal(signal.SIGINT, stop)
    with _watched(f"\nStopping: {what}.\n"), _quiet():
        try:
            yield
        except (KeyboardInterrupt, InterruptionError) as error:
            said = str(error) or _kept(folder)
            if stopped:  # without the interpreter's farewell, long where much is loaded
                with suppress(OSError, AttributeError):
                    say(said, error=True)
                    sys.stdout.flush()
                    sys.stderr.flush()
                leave(INTERRUPTED)
            raise InterruptionError(said) from None
        finally:
            signal.signal(signal.SIGINT, before)


@contextmanager
def _watched(message: str) -> Iterator[None]:
    """Hear of signals in a thread too: the main one hears nothing while it is in compiled code."""
    heard, told = os.pipe()
    os.set_blocking(told, False)

    def watch() -> None:
        if not os.read(heard, 1):
            return  # all is done
        with suppress(OSError):
            os.write(2, message.encode())
        ready, _, _ = select.select([heard], [], [], PATIENCE)
        if not ready or os.read(heard, 1):
            leave(INTERRUPTED)  # a second signal, or it takes too long

    threading.Thread(target=watch, daemon=True).start()
    before = signal.set_wakeup_fd(told, warn_on_full_buffer=False)
    try:
        yield
    finally:
        signal.set_wakeup_fd(before)
        os.close(told)


@contextmanager
def _quiet() -> Iterator[None]:
    """Do not print where an interruption is lost: in what compiled code calls, as a compiler does.

    The program then ends by what :func:`_watched` has heard.
    """
    printed = sys.unraisablehook

    def lost(what: sys.UnraisableHookArgs) -> None:
        if what.exc_type is not KeyboardInterrupt:
            printed(what)

    sys.unraisablehook = lost
    try:
        yield
    finally:
        sys.unraisablehook = printed


def _kept(folder: Path | None) -> str:
    """Return what was kept of work that was stopped, and how to go on."""
    if folder is None:
        return "Stopped."
    if not any((folder / "unfinished").rglob("*.*")):
        return "Stopped before anything was finished."
    return f"Stopped; the same command goes on from what is in {folder / 'unfinished'}."


def forget_kept(folder: Path | None) -> None:
    """Forget what was kept, now that everything is written; nothing interrupts that any more."""
    from mckibben.comparison.checkpoints import Checkpoints

    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    Checkpoints(folder).clear()


def stop_short(board: Leaderboard) -> None:
    """Leave if a comparison was stopped before it was done.

    Raises
    ------
    InterruptionError
        Saying how far it was.
    """
    if board.stopped:
        done = len(board.rows)
        raise InterruptionError(
            f"Stopped after {done} of {done + len(board.pending)} models; the same command goes on "
            "from there, where -o names a folder."
        )


def demand_a_model(board: Leaderboard) -> None:
    """Leave with another exit code where every model failed, as the board has said of each.

    Raises
    ------
    typer.Exit
        If so.
    """
    failed = sum(map(len, board.failures.values()))
    if board.rows and failed == len(board.rows):
        raise typer.Exit(NO_MODEL)
