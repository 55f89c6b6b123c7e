"""Entry point: the commands, and what becomes of errors and warnings.

Heavy modules are imported inside the commands that use them, so that help comes at once.
"""

from __future__ import annotations

import os
import re
import sys
import warnings
from contextlib import suppress
from io import TextIOWrapper
from typing import Annotated, Any

import typer

from mckibben.cli.app import app as workbench
from mckibben.cli.calibrate import calibrate
from mckibben.cli.characterize import characterize
from mckibben.cli.check import check
from mckibben.cli.compare import compare
from mckibben.cli.example import example
from mckibben.cli.export import app as export_app
from mckibben.cli.fit import fit
from mckibben.cli.info import info
from mckibben.cli.invert import invert
from mckibben.cli.link import link
from mckibben.cli.measured import measured
from mckibben.cli.muscles import app as muscles_app
from mckibben.cli.output import InterruptionError, finish, say, visible
from mckibben.cli.plan import plan
from mckibben.cli.plot import plot
from mckibben.cli.reproduce import reproduce
from mckibben.cli.rig import app as rig_app
from mckibben.cli.ros import ros
from mckibben.cli.simulate import simulate
from mckibben.cli.study import study
from mckibben.cli.track import track
from mckibben.errors import DataError, DataWarning, MckibbenError, ModelWarning
from mckibben.system.caches import CacheWarning

BAD_INPUT = 2
INTERRUPTED = 130

_UsageError: Any = typer.BadParameter.__mro__[1]
"""What is raised on options that there are not; under that name in no public module."""

app = typer.Typer(
    name="mckibben",
    help="Hysteresis of pneumatic artificial muscles: from a recording to a chosen, saved and "
    "inverted model. Start with: mckibben study FILE",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
for command in (
    *(study, characterize, fit, compare, check, calibrate, simulate, invert, track, plan, plot),
    *(reproduce, measured, info, link, ros, example),
):
    app.command()(command)
app.command("app")(workbench)
app.add_typer(export_app)
app.add_typer(rig_app)
app.add_typer(muscles_app)


def _show_version(wanted: bool) -> None:
    if wanted:
        from mckibben import __version__

        say(__version__)
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show version.")
    ] = False,
) -> None:
    del version


def run() -> None:
    """Run the command line: errors become one paragraph on standard error, and exit code 2."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for category in (CacheWarning, DataWarning, ModelWarning):
            warnings.simplefilter("always", category)
        warnings.showwarning = lambda message, *_: say(
            f"Note: {' '.join(str(message).split())}", error=True
        )
        for stream in (sys.stdout, sys.stderr):
            if isinstance(stream, TextIOWrapper):  # whatever letters the terminal lacks
                stream.reconfigure(errors="backslashreplace")
        _run()


def _run() -> None:
    try:
        _refuse_nothing(sys.argv[1:])
        code = app(standalone_mode=False)
        finish()
        if code == INTERRUPTED:
            _leave("Interrupted: nothing was finished that could be kept.", INTERRUPTED)
        sys.exit(code)
    except _UsageError as error:
        error.message = visible(error.message)
        error.show()
        sys.exit(error.exit_code)
    except InterruptionError as stopped:
        _leave(str(stopped), INTERRUPTED)
    except MckibbenError as error:
        _leave(str(error), BAD_INPUT)
    except (KeyboardInterrupt, typer.Abort):
        _leave("Interrupted: nothing was finished that could be kept.", INTERRUPTED)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
    except OSError as error:
        place = f"{error.filename}: " if error.filename else ""
        reason = error.strerror or error
        _leave(f"{place}{reason}. Remedy: check the path and its rights.", BAD_INPUT)
    except MemoryError:
        _leave("Not enough memory. Remedy: cut or resample the recordings first.", BAD_INPUT)
    except Exception as error:
        if os.environ.get("MCKIBBEN_DEBUG"):
            raise
        _leave(
            f"Internal error, please report it: {type(error).__name__}: {error}. "
            "Set MCKIBBEN_DEBUG=1 to see where.",
            1,
        )


def _refuse_nothing(arguments: list[str]) -> None:
    """Refuse an empty word, such as a variable that is not set: as a path it is this folder."""
    for word in arguments:
        if not word.strip() or re.fullmatch(r"--[a-z-]+=", word):
            raise DataError(
                f"the argument {word!r} says nothing",
                remedy="give it a value, or leave it out with its option",
            )


def _leave(message: str, code: int) -> None:
    say(" ".join(message.split()), error=True)
    with suppress(OSError, AttributeError, ValueError):
        try:
            sys.stdout.flush()
        except OSError:  # or it would be tried again, and complained of
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    sys.exit(code)


if __name__ == "__main__":
    run()
