"""Refusals: how tests ask an error for its fields, not for its sentences."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from mckibben import DataError, ModelError
from mckibben.errors import MckibbenError

Kind = type[BaseException] | tuple[type[BaseException], ...]


class Refusal:
    """What was refused, once it was."""

    value: Any
    """The error; `MckibbenError` or one of another kind that was asked for."""


@contextmanager
def refused(
    kind: Kind = (DataError, ModelError),
    *,
    names: object = None,
    remedy: bool = True,
    **fields: object,
) -> Iterator[Refusal]:
    """Require an error of a kind, with these fields, and with a remedy.

    Parameters
    ----------
    kind : type or tuple of types
        Class of the error.
    names : object, optional
        A single name or number, or several of them in a tuple, that the error has to mention where no
        field holds it, such as the kind of a block.
    remedy : bool
        Whether it has to say what to do.
    **fields
        Fields of the error, and what they have to be: ``parameter``, ``channel``, ``row``, ``file``,
        ``options``.
    """
    told = Refusal()
    with pytest.raises(kind) as caught:
        yield told
    told.value = error = caught.value
    if isinstance(error, MckibbenError):
        assert bool(error.remedy) >= remedy, f"no remedy: {error}"
    has = {name: getattr(error, name) for name in fields}
    wanted = {
        name: Path(value) if name == "file" and isinstance(value, str) else value
        for name, value in fields.items()
    }
    assert has == wanted, f"{has}, not {wanted}: {error}"
    assert mentions(str(error), names), f"{names} not in: {error}"


def mentions(text: str, names: object) -> bool:
    """Tell whether a text mentions a name or number, or each of several, as a whole word."""
    every = names if isinstance(names, tuple) else () if names is None else (names,)
    for word in map(str, every):
        assert not re.search(r"[A-Za-z]{2},?\s+[A-Za-z]{2}", word), (
            f"{word!r} are words, not a name"
        )
    return all(
        re.search(rf"(?<!\w)(?<!\d\.){re.escape(str(one))}(?!\w)(?!(?<=\d)\.\d)", text)
        for one in every
    )
