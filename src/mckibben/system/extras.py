"""Libraries that only some need: asked for when they are, with how to get them."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from mckibben.errors import DataError


def demand(module: str, extra: str, what: str, *, file: Path | None = None) -> None:
    """Refuse what needs a library that is not installed.

    Parameters
    ----------
    module : str
        The library, as it is imported.
    extra : str
        What brings it: ``pip install 'mckibben[extra]'``.
    what : str
        What needs it, in the plural or as a mass: "figures", "Parquet".
    file : Path, optional
        That is read with it.

    Raises
    ------
    DataError
        Naming the extra.
    """
    if find_spec(module) is None:
        raise DataError(
            f"{what}: the library {module} is not installed",
            file=file,
            remedy=f"pip install 'mckibben[{extra}]'",
        )
