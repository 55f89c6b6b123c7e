"""MATLAB files: vectors, or structs of them; version 7.3 is HDF5 underneath."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from mckibben.files import hdf5
from mckibben.files.table import Column, Table, column, of_equal_length


def read(path: Path) -> list[Table]:
    """Read the vectors of a MAT file, of version 5 to 7.3."""
    if hdf5.is_hdf5(path):
        return hdf5.read(path)
    from scipy.io import loadmat

    variables = loadmat(path, squeeze_me=True, struct_as_record=True, chars_as_strings=True)
    found: dict[str, Column] = {}
    for name, value in variables.items():
        if not name.startswith("__"):
            _collect(name, value, found)
    return [of_equal_length(found, path, meta={})]


def _collect(place: str, value: Any, found: dict[str, Column]) -> None:
    """Add a variable, or the fields of a struct, under the dotted place where it stands."""
    array = np.asarray(value)
    if array.dtype.names:
        if array.size == 1:
            for name in array.dtype.names:
                _collect(f"{place}.{name}", array.reshape(-1)[0][name], found)
    elif array.dtype == object and array.size == 1 and isinstance(array.item(), np.ndarray):
        _collect(place, array.item(), found)
    elif array.dtype.kind in "biufU" and array.ndim == 1:
        found[place] = column(place.rpartition(".")[2], array)
