"""What operations have in common: their declaration for every interface, options, files and models."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, get_type_hints

from mckibben.errors import ModelError
from mckibben.options import Argument, Option, Options, ReadOptions, given_options
from mckibben.system.progress import Tell
from mckibben.system.showing import Result

if TYPE_CHECKING:
    from mckibben.blocks.base import Block

    Model = Block | Result | str | Path

Progress = bool | Tell | None

Run = TypeVar("Run", bound=Callable[..., Any])


@dataclass(frozen=True)
class Operation:
    """An operation as a command: what its function takes.

    Parameters
    ----------
    run : callable
        The function; its docstring, up to its parameters, is the help.
    arguments : mapping of str to (Argument or Option)
        Parameters that are data or models.
    options : type or None
        Dataclass of its options.
    out : Option or None
        What it writes, if it does.
    must_write : bool
        Whether a command has to write it.
    writes : tuple of str
        Files in a folder that is written.
    reads : bool
        Whether it reads recordings, so that it has the options of reading.
    """

    run: Callable[..., Any]
    arguments: Mapping[str, Argument | Option]
    options: type | None = None
    out: Option | None = None
    must_write: bool = False
    writes: tuple[str, ...] = ()
    reads: bool = True


OPERATIONS: dict[str, Operation] = {}
"""Operations by name, in the order in which they are declared."""


def operation(
    arguments: Mapping[str, Argument | Option], options: type | None = None, **declared: Any
) -> Callable[[Run], Run]:
    """Declare a function as an operation; see `Operation`."""

    def declare(run: Run) -> Run:
        OPERATIONS[run.__name__] = Operation(run, arguments, options, **declared)
        return run

    return declare


ARGUMENTS = ("out", "force", "progress")
"""Parameters of operations beside data and options."""


def options_of(
    kind: type[Options],
    options: Options | None,
    reading: ReadOptions | None,
    keywords: Mapping[str, Any],
) -> tuple[Options, ReadOptions]:
    """Return options of an operation and of reading, either with fields given by name."""
    names = [
        option.name for option in fields(ReadOptions) if option.name not in get_type_hints(kind)
    ]
    read_settings = {name: value for name, value in keywords.items() if name in names}
    settings = {name: value for name, value in keywords.items() if name not in read_settings}
    return (
        given_options(kind, options, settings, [*names, *ARGUMENTS]),
        given_options(ReadOptions, reading, read_settings),
    )


def refuse_reading(reading: ReadOptions, reason: str) -> None:
    """Raise an error for options of reading where nothing is read.

    ``reason`` is a phrase, such as "a rig is driven".
    """
    defaults = ReadOptions()
    for option in fields(defaults):
        if getattr(reading, option.name) != getattr(defaults, option.name):
            problem = f"nothing is read, as {reason}"
            raise ModelError(problem, parameter=option.name, remedy="leave it out")


def load_model(model: Any, settings: Mapping[str, Any] | None = None) -> Any:
    """Return a model, also from a file or a result of `fit` or `invert`, with some fields set."""
    from mckibben.blocks.base import Block
    from mckibben.blocks.saving import load
    from mckibben.blocks.setting import with_fields

    if model is None:
        return None
    if isinstance(model, Result):
        block = getattr(model, "model", None)
        model = block if isinstance(block, Block) else model
    model = load(model) if isinstance(model, str | Path) else model
    if not isinstance(model, Block):
        problem = f"a model is needed here, and this is {type(model).__name__}"
        raise ModelError(problem, remedy="give a model, a result that has one, or the file of one")
    return with_fields(model, settings or {})


def paths(*arguments: Any) -> list[Path]:
    """Return the files among arguments, also in lists."""
    files: list[Path] = []
    for argument in arguments:
        if isinstance(argument, str | Path):
            files.append(Path(argument))
        elif isinstance(argument, list | tuple):
            files += paths(*argument)
    return files


def claim_output(
    out: str | Path | None, read: Sequence[Path], force: bool, *, recording: bool = False
) -> Path | None:
    """Raise an error for a path that is an input or a user's file, before any work; return the path."""
    from mckibben.outputs import claim, claim_recording

    if out is None:
        return None
    (claim_recording if recording else claim)(out, inputs=read, force=force)
    return Path(out)
