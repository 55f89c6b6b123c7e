"""Errors with problem, place and remedy.

A remedy names parameters and operations in backquotes, and whoever shows it renders them in its own
terms: Python as arguments, the command line as options, the workbench as controls.

======================= ======================== =====================
in a remedy             Python                   command line
======================= ======================== =====================
gaps                    gaps                     --gaps
gaps=split              gaps='split'             --gaps split
columns[force]=F        columns={'force': 'F'}   --column force=F
track()                 track()                  mckibben track
======================= ======================== =====================
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from mckibben.printing import printable

_NAMED = re.compile(r"`(\w+)(\(\)|\[([^`\]]*)\])?(?:=([^`]*))?`")
"""A parameter or an operation in a remedy."""

Parameter = Callable[[str, str | None, str | None], str]
"""Renders a parameter from its name, its key and its value; the latter two may be None."""


class MckibbenError(Exception):
    """Base class of all errors that this package raises intentionally.

    Parameters
    ----------
    problem : str
        What is wrong, as a phrase without a final stop.
    remedy : str
        What to do about it, as a phrase without a final stop. Parameters and operations are in
        backquotes, see `mckibben.errors`.
    options : sequence of mapping, optional
        Arguments of which any one set is a remedy too, the best first, such as ``{"gaps": "split"}`` or
        ``{"units": {"pressure": "kPa"}}``; None leaves an argument out. The remedy begins with them.
    file : path, optional
        The file it was found in.
    channel : str, optional
        The channel or column it was found in.
    row : int, optional
        The row it was found in: the line of a text file as an editor counts it, or the
        sample counted from 1 where there is no text.
    parameter : str, optional
        The argument or setting that is wrong.
    """

    def __init__(
        self,
        problem: str,
        *,
        remedy: str = "",
        options: Sequence[Mapping[str, Any]] = (),
        file: str | Path | None = None,
        channel: str | None = None,
        row: int | None = None,
        parameter: str | None = None,
    ) -> None:
        self.problem = problem
        self.otherwise = remedy
        self.options = tuple(options)
        self.file = None if file is None else Path(file)
        self.channel = channel
        self.row = row
        self.parameter = parameter
        super().__init__(problem)

    def __reduce__(self) -> tuple[Any, ...]:
        """Return how to recreate it in another process."""
        return type(self), (self.problem,), self.__dict__

    @property
    def remedy(self) -> str:
        """What to do about it: any one set of options, or what is to be done otherwise."""
        use = " or ".join(map(argument_words, self.options))
        return ", or ".join(filter(None, (use and f"use {use}", self.otherwise)))

    def __str__(self) -> str:
        return rendered(self)


def python_parameter(name: str, key: str | None = None, value: str | None = None) -> str:
    """Return a parameter as a Python argument.

    >>> python_parameter("gaps", None, "split"), python_parameter("columns", "force", "F1")
    ("gaps='split'", "columns={'force': 'F1'}")
    >>> python_parameter("settings", "delay", "0"), python_parameter("settings", "ridge")
    ("settings={'delay': 0}", "settings['ridge']")
    """
    if value is None:
        return name if key is None else f"{name}[{key!r}]"
    word = value.capitalize() if value in ("true", "false", "none") else value
    plain = word.isupper() or not re.fullmatch(r"(?!True$|False$|None$)[A-Za-z_][\w.-]*", word)
    if not plain or (key is not None and name != "settings"):  # of columns and units, all is text
        word = repr(value)
    return f"{name}={word}" if key is None else f"{name}={{{key!r}: {word}}}"


def python_operation(name: str) -> str:
    """Return an operation as a call."""
    return f"{name}()"


def in_terms_of(
    text: str,
    parameter: Parameter = python_parameter,
    operation: Callable[[str], str] = python_operation,
) -> str:
    """Return a remedy with its parameters and operations in the terms of one interface.

    >>> in_terms_of("give `gaps=split`, or use `track()`")
    "give gaps='split', or use track()"
    """

    def render(match: re.Match[str]) -> str:
        name, call, key, value = match.groups()
        return operation(name) if call == "()" else parameter(name, key, value)

    return _NAMED.sub(render, text)


def rendered(
    error: MckibbenError,
    parameter: Parameter = python_parameter,
    operation: Callable[[str], str] = python_operation,
) -> str:
    """Return an error as one paragraph: place, problem and remedy, in the terms of one interface."""
    where = [] if error.file is None else [printable(error.file)]
    if error.parameter is not None:
        where.append(parameter(error.parameter, None, None))
    if error.channel is not None:
        where.append(f"channel {_short(error.channel, 100)!r}")
    if error.row is not None:
        where.append(f"row {error.row}")
    location = f"{', '.join(where)}: " if where else ""
    remedy = in_terms_of(_short(error.remedy), parameter, operation)
    problem = in_terms_of(_short(error.problem), parameter, operation)
    stop = "" if problem.endswith("?") else "."
    return f"{location}{problem}" + (f"{stop} Remedy: {remedy}." if remedy else "")


def argument_words(options: Mapping[str, Any]) -> str:
    """Return arguments in backquotes.

    >>> argument_words({"units": {"time": "ms"}, "gaps": "split", "raw": True, "rate": None})
    '`units[time]=ms` with `gaps=split` with `raw` without `rate`'
    """
    words = []
    for name, value_ in options.items():
        for key, value in value_.items() if isinstance(value_, Mapping) else [("", value_)]:
            argument = f"{name}[{key}]" if key else name
            word = argument if value in (None, True) else f"{argument}={value}"
            words.append(f"{'without' if value is None else 'with'} `{word}`")
    return " ".join(words).removeprefix("with ")


def _short(value: object, most: int = 1000) -> str:
    """Return a long text with its middle left out."""
    text = str(value)
    half = most // 2
    return text if len(text) <= most else f"{text[:half]} ... {text[-half:]}"


class DataError(MckibbenError, ValueError):
    """A recording, or a file with one, that cannot be used as it is."""


class ModelError(MckibbenError):
    """A model, or a file with one, that cannot do what is requested."""


class ContractError(ModelError):
    """A block or a rig that violates its contract."""


class KernelError(ModelError):
    """A kernel that is not written in the kernel language.

    Attributes
    ----------
    construct, instead : str
        What it has, and what to write instead.
    """

    def __init__(self, file: str, line: int, construct: str, instead: str) -> None:
        super().__init__(f"kernels cannot have {construct}", remedy=instead, file=file, row=line)
        self.construct, self.instead = construct, instead

    def __reduce__(self) -> tuple[Any, ...]:
        """Return how to recreate it in another process."""
        return type(self), (str(self.file), self.row, self.construct, self.instead)


class MckibbenWarning(UserWarning):
    """Base of every warning; parameters in its text are rendered as in remedies."""

    def __str__(self) -> str:
        return in_terms_of(str(self.args[0])) if self.args else ""


class DataWarning(MckibbenWarning):
    """An assumption or correction made while reading a recording."""


class ModelWarning(MckibbenWarning):
    """An event in a model's run, such as clipping of a reference."""


class CacheWarning(UserWarning):
    """Compiled functions cannot be cached, or were damaged and are compiled again."""


def require(
    holds: bool,
    parameter: str,
    value: object,
    expectation: str,
    kind: Callable[..., MckibbenError] = ModelError,
) -> None:
    """Raise an error for a parameter unless a condition holds.

    Parameters
    ----------
    wanted : str
        What may be given.

    Examples
    --------
    >>> require(False, "delay", -1, "0 or more")
    Traceback (most recent call last):
    mckibben.errors.ModelError: delay: it is -1. Remedy: give 0 or more.
    """
    if not holds:
        text = f"{value:g}" if isinstance(value, float) else f"{value!r:.60}"
        raise kind(f"it is {text}", parameter=parameter, remedy=f"give {expectation}")


def unforeseen(error: Exception) -> MckibbenError:
    """Return an unexpected exception as an internal error."""
    return MckibbenError(
        f"internal error, not an error in the data ({type(error).__name__}: {error})",
        remedy="try other settings or another model, and report it",
    )
