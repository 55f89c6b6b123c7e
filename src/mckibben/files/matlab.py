"""MATLAB files: vectors and matrices of a few, also in structs and cells; version 7.3 is HDF5."""

from __future__ import annotations

import warnings
from io import BufferedReader
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import loadmat
from scipy.io.matlab import MatlabFunction, MatlabOpaque
from scipy.sparse import issparse

from mckibben.files import hdf5, tree
from mckibben.files.table import Table
from mckibben.files.tree import Node, Unread

_OBJECTS = '"None"'
"""Name that SciPy gives to all objects, of which it returns the last."""


def read(file: BufferedReader, path: Path) -> list[Table]:
    """Read the vectors of a MAT file, of version 4 to 7.3."""
    if hdf5.is_hdf5(file):
        return hdf5.read(file, path)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        variables: dict[str, Any] = loadmat(file)  # type: ignore[arg-type]  # the stubs take no files
    said = [str(each.message) for each in caught]
    doubled = [each for each in said if each.startswith("Duplicate variable name")]
    objects = [each for each in doubled if _OBJECTS in each]
    if len(objects) < len(doubled):
        raise ValueError("two variables have one name")
    found: dict[str, Node] = {}
    for name, value in variables.items():
        if isinstance(value, MatlabOpaque):
            last = value.reshape(-1)[0]
            kind = f"an object of class {_word(last['s2'])}"
            more = f", and {len(objects)} more object(s)" if objects else ""
            found[_word(last["s0"])] = Unread(kind + more)
        elif not name.startswith("__"):  # a str is what SciPy has to say of one that it cannot read
            found[name] = Unread(value) if isinstance(value, str) else _node(value)
    return [tree.table(found, path)]


def _node(value: Any) -> Node:
    """Return a variable as a plain tree."""
    if value is None or isinstance(value, MatlabFunction):  # a struct without fields is None
        return ""
    if isinstance(value, MatlabOpaque):
        return Unread("an object")
    if issparse(value):
        return Unread("a sparse matrix")
    array = np.asarray(value)
    if array.dtype.names is not None:
        names = array.dtype.names
        structs = [{name: _node(each[name]) for name in names} for each in array.ravel(order="F")]
        return structs[0] if len(structs) == 1 else structs
    if array.dtype.kind == "O":
        if min(array.shape, default=0) > 1:
            return [[_node(each) for each in column.ravel(order="F")] for column in array.T]
        return [_node(each) for each in array.reshape(-1)]
    if array.dtype.kind in "US":
        lines = [str(line) for line in array.reshape(-1)]
        return lines if len(lines) > 1 else "".join(lines)
    return array


def _word(name: Any) -> str:
    return name.decode("latin-1") if isinstance(name, bytes) else str(name)
