"""HDF5: the one-dimensional data sets anywhere in its tree, with the units in their attributes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from mckibben.errors import DataError
from mckibben.files.table import Column, Table, column, of_equal_length, refuse_huge

_SIGNATURE = b"\x89HDF\r\n\x1a\n"


def is_hdf5(path: Path) -> bool:
    """Tell whether a file is HDF5, also behind the 512 bytes that MATLAB puts in front."""
    with path.open("rb") as file:
        start = file.read(520)
    return _SIGNATURE in (start[:8], start[512:])


def read(path: Path) -> list[Table]:
    """Read the vectors of an HDF5 file."""
    try:
        import h5py
    except ImportError:
        raise DataError(
            "HDF5 needs a library that is not installed",
            file=path,
            remedy="pip install mckibben[hdf5]",
        ) from None

    found: dict[str, Column] = {}

    def collect(place: str, item: Any) -> None:
        if not isinstance(item, h5py.Dataset) or place.startswith("#"):
            return
        vector = item.ndim == 1 or (item.ndim == 2 and 1 in item.shape)
        if vector and item.dtype.kind in "biuf" and not _is_text(item):
            refuse_huge(item.size + sum(_size(other) for other in found.values()), path)
            unit = _text(item.attrs.get("units", item.attrs.get("unit")))
            found[place] = column(place.rpartition("/")[2], item[()].reshape(-1), unit)

    with h5py.File(path, "r") as file:
        file.visititems(collect)
        meta = {name: _plain(value) for name, value in file.attrs.items()}
    return [
        of_equal_length(
            found, path, meta={name: value for name, value in meta.items() if value is not None}
        )
    ]


def _size(column: Column) -> int:
    return 0 if column.values is None else column.values.size


def _is_text(item: Any) -> bool:
    return _text(item.attrs.get("MATLAB_class")) in ("char", "cell", "struct")


def _text(value: Any) -> str | None:
    plain = _plain(value)
    return plain if isinstance(plain, str) else None


def _plain(value: Any) -> str | float | int | bool | None:
    """Return an attribute as JSON holds it, or None where it does not."""
    if isinstance(value, np.ndarray) and value.size == 1:
        value = value.reshape(-1)[0]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, bytes):
        value = value.decode("utf-8", "replace")
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value if isinstance(value, (str, int, float, bool)) else None
