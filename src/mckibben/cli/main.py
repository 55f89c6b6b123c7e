"""Commands by name, loaded on use, and the handling of errors and warnings."""

from __future__ import annotations

import ast
import os
import re
import sys
import warnings
from contextlib import suppress
from importlib import import_module
from importlib.util import find_spec
from io import TextIOWrapper
from pathlib import Path

import click

from mckibben.cli.output import (
    INTERRUPTED,
    InterruptionError,
    finish,
    forget_notes,
    note,
    say,
    visible,
)
from mckibben.cli.parameters import COMMANDS, as_command, as_flag
from mckibben.errors import (
    CacheWarning,
    DataError,
    DataWarning,
    MckibbenError,
    ModelWarning,
    in_terms_of,
    rendered,
)
from mckibben.hints import former

BAD_INPUT = 2


class Commands(click.Group):
    """The commands; the help lists the first lines of their modules without loading them."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names of all commands."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return a command by its name, loading its module; None if there is none."""
        if cmd_name not in COMMANDS:
            return None
        if find_spec(f"mckibben.cli.commands.{cmd_name}") is None:
            from mckibben.cli.operations import operation_command

            return operation_command(cmd_name)
        module = import_module(f"mckibben.cli.commands.{cmd_name}")
        command: click.Command = module.__dict__[cmd_name]
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the list of commands, each with what it does."""
        summaries = {**_summaries("mckibben.workflow"), **_summaries("mckibben.cli.commands")}
        with formatter.section("Commands"):
            formatter.write_dl([(name, summaries[name]) for name in COMMANDS])


def _summaries(package: str) -> dict[str, str]:
    """Return the first lines of docstrings of modules and functions, by name, without loading them."""
    summaries: dict[str, str] = {}
    spec = find_spec(package)
    for folder in () if spec is None else spec.submodule_search_locations or ():
        for path in Path(folder).glob("*.py"):
            tree = ast.parse(path.read_text(encoding="utf-8"))
            summaries[path.stem] = (ast.get_docstring(tree) or "").partition("\n")[0]
            for node in tree.body:
                if isinstance(node, ast.FunctionDef):
                    text = ast.get_docstring(node) or ""
                    summaries.setdefault(node.name, text.partition("\n")[0])
    return summaries


def _show_version(context: click.Context, parameter: click.Parameter, wanted: bool) -> None:
    del parameter
    if wanted:
        from mckibben import __version__

        say(__version__)
        context.exit()


app = Commands(
    name="mckibben",
    help="Hysteresis of pneumatic artificial muscles: from a recording to a chosen, saved and "
    "inverted model. Start with: mckibben study FILE",
    no_args_is_help=True,
    params=[
        click.Option(
            ["--version"],
            is_flag=True,
            is_eager=True,
            expose_value=False,
            callback=_show_version,
            help="Show version.",
        )
    ],
)


def run() -> None:
    """Run the command line; errors are printed in one paragraph and set the exit code."""
    forget_notes()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for category in (CacheWarning, DataWarning, ModelWarning):
            warnings.simplefilter("always", category)
        warnings.showwarning = lambda message, *_: note(_text(message), error=True)
        for stream in (sys.stdout, sys.stderr):
            if isinstance(stream, TextIOWrapper):  # whatever letters the terminal lacks
                stream.reconfigure(errors="backslashreplace")
        sys.exit(_run())


def _run() -> int:
    """Run a command and return its exit code."""
    try:
        for word in sys.argv[1:]:  # a variable that is not set: as a path, it is this folder
            if not word.strip() or re.fullmatch(r"--[a-z-]+=", word):
                raise DataError(f"the argument {word!r} is empty", remedy="give it a value")
        code = app.main(standalone_mode=False)
        finish()
        return code or 0
    except click.UsageError as error:
        click.UsageError(visible(_usage(error)), error.ctx).show()
        return error.exit_code
    except (KeyboardInterrupt, click.Abort):
        return _say("Interrupted.", INTERRUPTED)
    except InterruptionError as error:
        return _say(str(error), INTERRUPTED)
    except MckibbenError as error:
        return _say(rendered(error, as_flag, as_command), BAD_INPUT)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except OSError as error:
        place = f"{error.filename}: " if error.filename else ""
        text = f"{place}{error.strerror or error}. Remedy: check the path and its rights."
        return _say(text, BAD_INPUT)
    except MemoryError:
        return _say("Not enough memory. Remedy: cut or resample the recordings.", BAD_INPUT)
    except Exception as error:
        if os.environ.get("MCKIBBEN_DEBUG"):
            raise
        text = f"Internal error, please report it: {type(error).__name__}: {error}. "
        return _say(f"{text}Set MCKIBBEN_DEBUG=1 to see where.", 1)


def _usage(error: click.UsageError) -> str:
    """Return what is wrong with a command line; of earlier versions, with what to do now."""
    message = error.format_message()
    if match := re.match(r"No such (?:option|command):? '?([\w-]+)'?\.?", message):
        context, command = error.ctx, list[str]()
        while context is not None and context.parent is not None:
            command.insert(0, context.info_name or "")
            context = context.parent
        if hint := former(command, match[1]):
            what = in_terms_of(hint, as_flag, as_command)
            return f"{match[0]} {what[0].upper()}{what[1:]}."
    return message


def _say(message: str, code: int) -> int:
    say(" ".join(message.split()), error=True)
    with suppress(OSError, AttributeError, ValueError, MckibbenError):
        finish()
    return code


def _text(warning: Warning | str) -> str:
    """Return the text of a warning."""
    return str(warning.args[0] if isinstance(warning, Warning) and warning.args else warning)
