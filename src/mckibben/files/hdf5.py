"""HDF5: the vectors, and matrices of a few, anywhere in its groups, with the units in their attributes.

A data set of HDF5 can have its samples in another file, and a link can lead there. The first is refused
and the second not followed: whoever sends a file must not choose what else is read.
"""

from __future__ import annotations

import math
from io import BufferedReader
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mckibben.errors import DataError
from mckibben.files import tree
from mckibben.files.table import MOST_TEXT, Table
from mckibben.files.tree import ATTRIBUTES, Node, Unread
from mckibben.system.extras import demand

SIGNATURE = b"\x89HDF\r\n\x1a\n"


def is_hdf5(file: BufferedReader) -> bool:
    """Return whether a file is HDF5, also behind the 512 bytes that MATLAB puts in front."""
    start = file.read(520)
    file.seek(0)
    return SIGNATURE in (start[:8], start[512:])


def read(file: BufferedReader, path: Path) -> list[Table]:
    """Read the vectors of an HDF5 file, or of a MAT file of version 7.3."""
    demand("h5py", "hdf5", "HDF5", file=path)
    import h5py

    matlab = path.suffix.casefold() == ".mat"
    with h5py.File(file, "r") as root:
        names = [name for name in root if not (matlab and name.startswith("#"))]
        found = _Tree(path, matlab).group(root, names)
        meta = {name: _attribute(root, name) for name in root.attrs}
    meta = {name: value for name, value in meta.items() if value is not None}
    return [tree.table(found, path, dot="." if matlab else "/", meta=meta)]


class _Tree:
    """Makes a plain tree of the groups of a file.

    Parameters
    ----------
    path : path
        The name to give in errors.
    matlab : bool
        Whether MATLAB wrote it: text are numbers then, and struct arrays and cells are references.
    """

    def __init__(self, path: Path, matlab: bool) -> None:
        self._path = path
        self._matlab = matlab
        self._seen: set[int] = set()

    def group(self, group: Any, names: list[str]) -> dict[str, Node]:
        """Return what hard links lead to, each once: they can lead round in circles."""
        import h5py

        self._seen.add(h5py.h5o.get_info(group.id).addr)
        found: dict[str, Node] = {}
        units: dict[str, Node] = {}
        for name in names:
            link = group.get(name, getlink=True)
            if isinstance(link, h5py.ExternalLink):
                found[name] = Unread("it is in another file")
            if not isinstance(link, h5py.HardLink):
                continue  # a soft link leads to what is read under its own name, or out of the file
            item = group[name]
            at = h5py.h5o.get_info(item.id).addr
            if at in self._seen:
                continue
            self._seen.add(at)
            found[name] = self._node(item)
            for attribute in ("unit", "units"):
                if isinstance(unit := _attribute(item, attribute), str) and unit:
                    units[name] = unit
        return found | {ATTRIBUTES: units}

    def _node(self, item: Any) -> Node:
        import h5py

        if isinstance(item, h5py.Dataset):
            return self._values(item)
        if not isinstance(item, h5py.Group):
            return ""  # a type that has a name
        if self._matlab and "MATLAB_sparse" in item.attrs:
            return Unread("a sparse matrix")
        found = self.group(item, list(item))
        # a struct array has references in its fields, which unlike those of cells have no class
        arrays = [
            name
            for name, node in found.items()
            if isinstance(node, list) and "MATLAB_class" not in item[name].attrs
        ]
        if not self._matlab or not arrays:
            return found
        columns: list[Any] = [found[name] for name in arrays]
        return [dict(zip(arrays, each, strict=True)) for each in zip(*columns, strict=True)]

    def _values(self, data: Any) -> Node:
        """Return the samples of a data set, or its text, or what its references lead to."""
        import h5py

        if data.is_virtual or data.external:  # asking for its shape would open other files
            raise DataError(
                f"data set {data.name.strip('/')!r} has its samples in another file",
                file=self._path,
                remedy="save all samples in this file",
            )
        kind = _attribute(data, "MATLAB_class") if self._matlab else None
        if data.shape is None or "MATLAB_empty" in data.attrs:
            return ""
        if kind is not None and "MATLAB_object_decode" in data.attrs:
            return Unread(f"an object of class {kind}")
        if h5py.check_string_dtype(data.dtype) is not None:
            text = data.asstr("utf-8", "replace")[()]
            return text if isinstance(text, str) else [str(each) for each in text.reshape(-1)]
        if self._matlab and h5py.check_ref_dtype(data.dtype) is h5py.Reference:
            columns = data[()] if min(data.shape, default=0) > 1 else data[()].reshape(1, -1)
            cells = [[self._node(data.file[at]) if at else "" for at in each] for each in columns]
            return cells if len(cells) > 1 else cells[0]
        if kind == "char":
            lines = [row.astype("<u2").tobytes() for row in np.atleast_2d(data[()].T)]
            texts = [line.decode("utf-16-le", "replace") for line in lines]
            return texts[0] if len(texts) == 1 else texts
        return _scaled(data, _fields(np.asarray(data[()])))


def _scaled(data: Any, samples: Node) -> Node:
    """Return samples in the unit that is stated, where the file has packed numbers.

    By "NetCDF Climate and Forecast Metadata Conventions", 8.1: scale_factor, add_offset.
    """
    gain, offset = (_attribute(data, name) for name in ("scale_factor", "add_offset"))
    if not isinstance(samples, np.ndarray) or samples.dtype.kind not in "iuf":
        return samples
    if gain is None and offset is None:
        return samples
    if isinstance(gain, str) or isinstance(offset, str):
        return Unread("a scale_factor or add_offset that is no number")
    unpacked: NDArray[Any] = samples * float(1.0 if gain is None else gain) + float(offset or 0.0)
    return unpacked


def _fields(samples: NDArray[Any]) -> Node:
    """Return samples, those of a table as one array a field."""
    names = samples.dtype.names
    if names is None:
        if samples.dtype.kind == "S":
            return [each.decode("utf-8", "replace") for each in samples.reshape(-1)]
        return (
            Unread("objects, or lists of several lengths") if samples.dtype.hasobject else samples
        )
    if names == ("real", "imag"):
        return Unread("complex numbers")
    return {name: _fields(samples[name]) for name in names}


def _attribute(item: Any, name: str) -> str | float | int | bool | None:
    """Return an attribute as JSON holds it, or None where it does not or there is none."""
    try:
        value = item.attrs.get(name)
    except TypeError:  # NumPy has no such type
        return None
    if isinstance(value, np.ndarray) and value.size == 1:
        value = value.reshape(-1)[0]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, bytes):
        value = value.decode("utf-8", "replace")
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, str) and len(value) > MOST_TEXT:
        return None
    return value if isinstance(value, (str, int, float, bool)) else None
