"""Optional libraries."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from mckibben.errors import DataError


def demand(module: str, extra: str, what: str, *, file: Path | None = None) -> None:
    """Raise a `DataError` if a library is not installed, naming its extra.

    ``what`` needs it, in the plural or as a mass: "figures", "Parquet"; ``file`` is read with it.
    """
    if find_spec(module) is None:
        problem = f"{what}: the library {module} is not installed"
        raise DataError(problem, file=file, remedy=f"pip install 'mckibben[{extra}]'")
