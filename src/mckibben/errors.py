"""Errors that a person can act on: what is wrong, where, and what to do about it."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any


class MckibbenError(Exception):
    """Base of every error that this package raises on purpose.

    The command line prints it as one paragraph and leaves with exit code 2.
    """


class DataError(MckibbenError):
    """A recording, or a file with one, that cannot be used as it is.

    Parameters
    ----------
    problem : str
        What is wrong, as a phrase without a final stop.
    file : path, optional
        The file it was found in.
    channel : str, optional
        The channel or column it was found in.
    row : int, optional
        The row it was found in: the line of a text file as an editor counts it, or the
        sample counted from 1 where there is no text.
    remedy : str
        What to do about it, as a phrase without a final stop.
    """

    def __init__(
        self,
        problem: str,
        *,
        remedy: str,
        file: str | Path | None = None,
        channel: str | None = None,
        row: int | None = None,
    ) -> None:
        self.problem = problem
        self.remedy = remedy
        self.file = None if file is None else Path(file)
        self.channel = channel
        self.row = row
        super().__init__(problem)

    def __reduce__(self) -> tuple[Any, ...]:
        """Tell how it is made again in another process."""
        made = partial(
            type(self), remedy=self.remedy, file=self.file, channel=self.channel, row=self.row
        )
        return made, (self.problem,)

    def __str__(self) -> str:
        where = [] if self.file is None else [str(self.file)]
        if self.channel is not None:
            where.append(f"channel {_short(self.channel, 100)!r}")
        if self.row is not None:
            where.append(f"row {self.row}")
        place = f"{', '.join(where)}: " if where else ""
        return f"{place}{_short(self.problem)}. Remedy: {_short(self.remedy)}."


def _short(given: object, most: int = 1000) -> str:
    """Return a text without its middle where it is too long to be read, as one from a file can be."""
    text = str(given)  # whatever was given for a name
    half = most // 2
    return text if len(text) <= most else f"{text[:half]} ... {text[-half:]}"


class TooLargeError(DataError):
    """A file that holds more than is read: however it is read, that does not help."""


class ModelError(MckibbenError):
    """A model, or a file with one, that cannot do what was asked; the text ends with a remedy."""


class ContractError(ModelError):
    """A block or a rig that breaks a law of its contract."""


class DataWarning(UserWarning):
    """Something assumed or mended while reading a recording."""


class ModelWarning(UserWarning):
    """Something a model did that its user should know, such as clipping a reference."""


def unforeseen(error: Exception) -> str:
    """Return in words what nobody has foreseen: it is a fault of the program."""
    return (
        f"this is a fault of the program, not of the data ({type(error).__name__}: {error}). "
        "Remedy: try other settings or another model, and report it."
    )


class KernelError(ModelError):
    """A kernel that is not written in the kernel language.

    Attributes
    ----------
    file, line : str, int
        Where it is.
    construct, instead : str
        What it has, and what to write instead.
    """

    def __init__(self, file: str, line: int, construct: str, instead: str) -> None:
        self.file, self.line, self.construct, self.instead = file, line, construct, instead
        super().__init__(
            f"{file}, line {line}: kernels cannot have {construct}. Remedy: {instead}."
        )
