"""HDF5 files: vectors and narrow matrices in any group, with units from attributes.

A data set of HDF5 can have its samples in another file, and a link can lead there. The first is refused
and the second not followed: whoever sends a file must not choose what else is read.
"""

from __future__ import annotations

from contextlib import suppress
from io import BufferedReader
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mckibben.errors import DataError
from mckibben.files import frames, objects, tree
from mckibben.files.table import Table, plain_meta
from mckibben.files.tree import INFO, Node, Unread
from mckibben.system.extras import demand

_PACKING = ("scale_factor", "add_offset")
"""Attributes of packed numbers, by "NetCDF Climate and Forecast Metadata Conventions", 8.1."""


def read(file: BufferedReader, path: Path) -> list[Table]:
    """Read the vectors of an HDF5 file, or of a MAT file of version 7.3."""
    demand("h5py", "hdf5", "HDF5", file=path)
    import h5py

    matlab = path.suffix.casefold() == ".mat"
    with h5py.File(file, "r") as root:
        found = _Tree(path, matlab).group(root)
        meta = _attributes(root)
        has_objects = matlab and "#subsystem#" in root and not _leads_out(root)
    if has_objects and (decoded := objects.variables(path)) is not None:
        found = decoded
    return tree.runs(found, path, dot="." if matlab else "/", meta=meta)


def _leads_out(root: Any) -> bool:
    """Return whether a file has links to names, or samples in other files, as MATLAB writes none."""
    import h5py

    def leads(_: str, item: Any) -> bool | None:
        if isinstance(item, h5py.Dataset):
            return (item.is_virtual or bool(item.external)) or None
        links = [item.get(name, getlink=True) for name in getattr(item, "keys", list)()]
        return any(not isinstance(link, h5py.HardLink) for link in links) or None

    return bool(leads("", root) or root.visititems(leads))


class _Tree:
    """Builds a plain tree of the groups of a file.

    In those that MATLAB wrote, text is numbers, and struct arrays and cells are references.
    """

    def __init__(self, path: Path, matlab: bool) -> None:
        self._path = path
        self._matlab = matlab
        self._seen: set[int] = set()

    def group(self, group: Any) -> dict[str, Node]:
        """Return the targets of hard links, each once, as links can be circular."""
        import h5py

        self._seen.add(h5py.h5o.get_info(group.id).addr)
        nodes: dict[str, Node] = {}
        for name in group:
            link = group.get(name, getlink=True)
            if isinstance(link, h5py.ExternalLink):
                nodes[name] = Unread("it is in another file")
            if not isinstance(link, h5py.HardLink) or (self._matlab and name.startswith("#")):
                continue  # a soft link leads to what is read under its own name, or out of the file
            item = group[name]
            at = h5py.h5o.get_info(item.id).addr
            about = {key.casefold(): value for key, value in _attributes(item).items()}
            if at not in self._seen and about.get("class") != "TINDEX":  # of PyTables, to search
                self._seen.add(at)
                nodes[name] = self._node(item)
                unit = about.get("unit") or about.get("units")
                if isinstance(unit, str) and name + INFO not in group:
                    nodes[name + INFO] = {"unit": unit}
        return frames.columns(nodes, group) if "pandas_type" in group.attrs else nodes

    def _node(self, item: Any) -> Node:
        import h5py

        if isinstance(item, h5py.Dataset):
            return self._values(item)
        if not isinstance(item, h5py.Group):
            return ""  # a type that has a name
        if self._matlab and "MATLAB_sparse" in item.attrs:
            return Unread("a sparse matrix")
        group = self.group(item)
        if not self._matlab:
            return group
        # a struct array has references in its fields, which unlike those of cells have no class
        arrays: dict[str, Any] = {
            name: node
            for name, node in group.items()
            if isinstance(node, list) and "MATLAB_class" not in item[name].attrs
        }
        if not arrays:
            return group
        rows = zip(*arrays.values(), strict=True)
        return [dict(zip(arrays, row, strict=True)) for row in rows]

    def _values(self, data: Any) -> Node:
        """Return the samples of a data set, its text, or the targets of its references."""
        import h5py

        if data.is_virtual or data.external:  # asking for its shape would open other files
            raise DataError(
                f"data set {data.name.strip('/')!r} has its samples in another file",
                file=self._path,
                remedy="save all samples in this file",
            )
        if data.shape is None or "MATLAB_empty" in data.attrs:
            return ""
        about = _attributes(data)
        kind = about.get("MATLAB_class") if self._matlab else None
        if "MATLAB_object_decode" in data.attrs:
            return objects.unread(str(kind), data.name.rpartition("/")[2])
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
        if any(name in data.attrs for name in _PACKING):
            return Unread("packed by a scale_factor or add_offset")
        samples = _fields(np.asarray(data[()]))
        missing = about.get("_FillValue", about.get("missing_value"))
        if isinstance(samples, np.ndarray) and isinstance(missing, int | float):
            return np.where(samples == missing, np.nan, samples)
        return samples


def _fields(samples: NDArray[Any]) -> Node:
    """Return samples, for a table one array per field."""
    names = samples.dtype.names
    if names == ("real", "imag"):
        return Unread("complex numbers")
    if names is not None:
        return {name: _fields(samples[name]) for name in names}
    if samples.dtype.kind == "S":
        return [each.decode("utf-8", "replace") for each in samples.reshape(-1)]
    return Unread("objects, or lists of several lengths") if samples.dtype.hasobject else samples


def _attributes(item: Any) -> dict[str, Any]:
    """Return the JSON-compatible attributes."""
    attributes: dict[str, Any] = {}
    for name in item.attrs:
        with suppress(TypeError):  # NumPy has no such type
            attributes[name] = item.attrs[name]
    return plain_meta(attributes)
