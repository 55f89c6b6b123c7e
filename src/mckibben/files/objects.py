"""Variables of MATLAB as a plain tree, with its tables, timetables, time series, dates and strings.

mat-io decodes them. A file that leads to another is not handed to it, nor elements of version 5 that are
not valid, as it indexes by their types as SciPy does; see `mckibben.files.matlab`.
"""

from __future__ import annotations

import warnings
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io.matlab import MatlabOpaque
from scipy.sparse import issparse

from mckibben.files.notices import warn
from mckibben.files.tree import INFO, Node, Unread
from mckibben.system.validation import reason

LINES = {
    "table": "writetable({}, 'run.csv')",
    "timetable": "writetimetable({}, 'run.csv')",
    "timeseries": "writematrix([{0}.Time, {0}.Data], 'run.csv')",
    "datetime": "{0} = posixtime({0})",
    "duration": "{0} = seconds({0})",
    "string": "{0} = cellstr({0})",
}
"""Class of an object -> what makes data of it in MATLAB."""

_SPLIT = "the columns of a variable have one unit: use splitvars in MATLAB"


def unread(kind: str, name: str = "x") -> Unread:
    """Return why an object is not read, and what makes it readable."""
    line = LINES.get(kind, "{0} = struct({0})").format(name)
    install = "" if find_spec("matio") else "pip install 'mckibben[matlab]', or "
    return Unread(f"an object of class {kind}; {install}in MATLAB {line}")


def variables(path: Path) -> dict[str, Node] | None:
    """Return the variables of a MAT file with objects, or None where mat-io cannot read these."""
    if find_spec("matio") is None:
        return None
    from matio import load_from_mat

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            warnings.filterwarnings("error", "Failed")  # and numbers of its own are then returned
            tree: dict[str, Any] = load_from_mat(str(path), add_table_attrs=True)
        return {
            name: node(value, name) for name, value in tree.items() if not name.startswith("__")
        }
    except Exception as error:  # of many types, as it trusts what it reads
        warn(path, f"its objects cannot be decoded ({reason(error)})")
        return None


def node(value: Any, name: str = "x") -> Node:
    """Return a variable of this name, as SciPy or mat-io reads it, as a plain tree."""
    if value is None or type(value).__name__ == "MatlabFunction":  # a struct without fields is None
        return ""
    if isinstance(value, MatlabOpaque):
        last = value.reshape(-1)[0]
        inner, kind = (last[field].decode("latin-1") for field in ("s0", "s2"))
        return unread(kind, inner or name)
    if issparse(value):
        return Unread("a sparse matrix")
    if not isinstance(value, np.ndarray | np.generic | list | str | int | float):
        return _object(value, name)
    array = np.asarray(value)
    if array.dtype.names is not None:
        fields = array.dtype.names
        items = array.ravel(order="F")
        structs = [
            {field: node(item[field], f"{name}.{field}") for field in fields} for item in items
        ]
        return structs[0] if len(structs) == 1 else structs
    if array.dtype.kind == "O":
        if min(array.shape, default=0) > 1:
            return [[node(item, name) for item in column.ravel(order="F")] for column in array.T]
        return [node(item, f"{name}{{{at}}}") for at, item in enumerate(array.reshape(-1), start=1)]
    if array.dtype.kind in "UST":
        lines = [str(line) for line in array.reshape(-1)]
        return lines if len(lines) > 1 else "".join(lines)
    return array


def _object(value: Any, name: str) -> Node:
    """Return an object that mat-io decoded as a plain tree."""
    kind = type(value).__name__
    if kind == "DataFrame":
        return _table(value)
    if kind == "Categorical":
        return [str(each) for each in np.asarray(value).reshape(-1)]
    kind = str(getattr(value, "classname", kind))
    if kind == "timeseries" and isinstance(value.properties, dict):
        return _timeseries(value.properties)
    return unread(kind, name)


def _table(frame: Any) -> Node:
    """Return the columns of a table with their units, and the times of its rows."""
    units = frame.attrs.get("VariableUnits") or frame.attrs.get("varUnits") or []
    if any(units) and len(units) != len(frame.columns):
        return Unread(_SPLIT)
    columns: dict[str, Node] = {}
    if frame.index.dtype.kind in "mM":
        columns[str(frame.index.name or "Time")] = frame.index.to_numpy()
    for name in frame:
        values = frame[name].to_numpy()
        texts = [each if isinstance(each, str) else "" for each in values]
        numbers = values.dtype.kind in "biufcmM"
        columns[str(name)] = values if numbers else texts if any(texts) else Unread("objects")
    for name, unit in zip(frame, units, strict=False):
        columns[f"{name}{INFO}"] = {"unit": unit}
    return columns


def _timeseries(fields: dict[str, Any]) -> Node:
    """Return the samples of a time series, and its times, which are counted where they are regular."""
    about, data = (getattr(fields.get(f"{of}Info"), "properties", {}) for of in ("Time", "Data"))
    times = np.asarray(fields.get("Time_", []))
    if not times.size:
        start, step, count = (np.ravel(about[name]) for name in ("Start_", "Increment_", "Length"))
        times = start + step * np.arange(int(count[0]))
    units = [_text(each.get("Units")) for each in (about, data)]
    return {
        "Time": times,
        f"Time{INFO}": {"Units": units[0]},
        "Data": np.asarray(fields["Data_"]),
        f"Data{INFO}": {"Units": units[1]},
        "Name": _text(fields.get("Name")),
    }


def _text(value: Any) -> str:
    values = np.ravel(value).tolist()
    return values[0] if len(values) == 1 and isinstance(values[0], str) else ""
