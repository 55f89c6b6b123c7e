"""Text tables: CSV, TSV and their kin, with any common separator and decimal mark.

What this package writes is a plain header of channel names and, beside the file, a sidecar
``NAME.csv-metadata.json`` (named as in W3C's "CSV on the Web") with units, time grid and meta.
"""

from __future__ import annotations

import csv
import io
import os
import re
from io import BufferedReader
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mckibben.atomic import replacing
from mckibben.errors import DataError
from mckibben.files import stored
from mckibben.files.dialect import Dialect, detect
from mckibben.files.notices import warn
from mckibben.files.stored import Stored
from mckibben.files.table import Column, Table
from mckibben.ordinary import DESCRIPTION, read_bytes
from mckibben.recording import Recording

_CONTROL = re.compile(r"[\x00-\x08\x0e-\x1f\x7f]")
_SAMPLE = 200  # lines that the dialect is found from


def sidecar(path: Path) -> Path:
    """Return where the description of a text file lies.

    >>> sidecar(Path("run.csv")).name
    'run.csv-metadata.json'
    """
    return path.with_name(f"{path.name}-metadata.json")


def read(file: BufferedReader, path: Path) -> list[Table]:
    """Read the one table of a text file."""
    data = file.read()
    description = _described(path, data)
    return [_parse(_decode(data, path), path) if description is None else _own(data, description)]


def write(recording: Recording, path: Path) -> None:
    """Write a recording as text, and its description beside it."""
    time = {} if recording.sample_time is None else {"time": recording.time}
    columns = {**time, **recording.channels}
    separator = "\t" if path.suffix.casefold() == ".tsv" else ","
    text = io.StringIO()
    csv.writer(text, delimiter=separator, lineterminator="\n").writerow(columns)
    row = separator.join(["%r"] * len(columns)) + "\n"
    text.writelines(
        row % cells for cells in zip(*map(np.ndarray.tolist, columns.values()), strict=True)
    )
    data = text.getvalue().encode()
    description = Stored.describe(recording, data, path).to_json(path) + "\n"
    with replacing(path) as new:
        new.write_bytes(data)
    with replacing(sidecar(path)) as new:
        new.write_text(description, encoding="utf-8")


def _described(path: Path, data: bytes) -> Stored | None:
    """Return the sidecar's description, if there is one and it is of these bytes."""
    beside = sidecar(path)
    if not os.path.lexists(beside):
        return None
    try:
        description = stored.parse(read_bytes(beside, most=DESCRIPTION))
    except DataError as error:
        description = error.problem
    if isinstance(description, str):
        problem = f"is not a description by this package ({description})"
    elif description.sha256 != stored.digest(data):
        problem = "describes another version of the file"
    else:
        return description
    warn(beside, f"it {problem}; it is ignored, and units are taken from the header")
    return None


def _own(data: bytes, description: Stored) -> Table:
    import pandas as pd

    names = list(description.units)
    with_time = [*([] if description.sample_time is None else ["time"]), *names]
    separator = "\t" if b"\t" in data.partition(b"\n")[0] else ","
    frame = pd.read_csv(
        io.BytesIO(data),
        sep=separator,
        skiprows=1,
        header=None,
        names=with_time,
        dtype=np.float64,
        **_exact(pd.__version__),
    )
    return description.table({name: frame[name].to_numpy() for name in names})


def _decode(data: bytes, path: Path) -> str:
    wide = data.startswith((b"\xff\xfe", b"\xfe\xff"))
    try:
        text = data.decode("utf-16" if wide else "utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    text = text.rstrip("\x1a").replace("\r\n", "\n").replace("\r", "\n")
    if _CONTROL.search(text):
        raise DataError(
            "this is not text",
            file=path,
            remedy="give the file the ending of its format, or export it as CSV",
        )
    return text


def _parse(text: str, path: Path) -> Table:
    comment = ""
    lines: list[str] = []
    numbers: list[int] = []
    for number, line in enumerate(text.split("\n"), start=1):
        if line.lstrip().startswith(("#", "%")):
            comment = comment if lines else line.lstrip().lstrip("#% ")
        elif line.strip():
            lines.append(line)
            numbers.append(number)
    if not lines:
        raise DataError(
            "there is nothing in it", file=path, remedy="give a file with a header and samples"
        )
    for number, line in zip(numbers, lines, strict=True):
        if line.count('"') % 2:
            raise DataError(
                "a quotation mark is not closed",
                file=path,
                row=number,
                remedy="close it, and keep line breaks out of cells",
            )
    dialect = detect(lines[:_SAMPLE])
    headers, units, first = _head(lines, comment, dialect, path)
    lines, numbers = lines[first:], numbers[first:]
    if not lines:
        raise DataError(
            "there is a header and no samples", file=path, remedy="give a file with samples"
        )
    _refuse_ragged(lines, numbers, len(headers), dialect, path)
    columns = _columns(lines, headers, units, dialect)
    return Table(tuple(columns), lines=np.array(numbers))


def _head(
    lines: list[str], comment: str, dialect: Dialect, path: Path
) -> tuple[list[str], list[str | None], int]:
    """Return the headers, the units of a line of units, and where the samples begin."""
    cells = dialect.split(lines[0])
    none: list[str | None] = [None] * len(cells)
    if 2 * sum(map(dialect.is_number, cells)) >= len(cells):
        described = dialect.split_header(comment, len(cells))
        if len(described) == len(cells):
            return described, none, 0
        warn(path, f"no line of names: the columns are called column_1 to column_{len(cells)}")
        return [f"column_{i}" for i in range(1, len(cells) + 1)], none, 0
    following = [dialect.split(line) for line in lines[1:3]]
    n_columns = len(following[0]) if following else len(cells)
    headers = dialect.split_header(lines[0], n_columns)
    if len(following) == 2 and not any(map(dialect.is_number, following[0])):
        looks_like_units = any(map(dialect.is_number, following[1]))
        if looks_like_units and len(following[0]) == len(headers):
            return headers, [cell.strip("[]() ") or None for cell in following[0]], 2
    return headers, [None] * len(headers), 1


def _refuse_ragged(
    lines: list[str], numbers: list[int], expected: int, dialect: Dialect, path: Path
) -> None:
    for number, line in zip(numbers, lines, strict=True):
        if dialect.separator is None or '"' in line:
            found = len(dialect.split(line))
        else:
            found = line.count(dialect.separator) + 1
        if found != expected:
            raise DataError(
                f"there are {found} cells where the header has {expected}",
                file=path,
                row=number,
                remedy="complete or delete that line",
            )


def _columns(
    lines: list[str], headers: list[str], units: list[str | None], dialect: Dialect
) -> list[Column]:
    import pandas as pd

    frame = pd.read_csv(
        io.StringIO("\n".join(lines)),
        sep=r"\s+" if dialect.separator is None else dialect.separator,
        decimal=dialect.decimal,
        header=None,
        names=range(len(headers)),
        index_col=False,
        skipinitialspace=True,
        **_exact(pd.__version__),
        low_memory=False,
    )
    columns = []
    for i, (header, unit) in enumerate(zip(headers, units, strict=True)):
        cells = frame[i]
        if cells.isna().all():
            if header:
                columns.append(Column(header, None, unit, texts=[""] * len(cells)))
            continue
        header = header or f"column_{i + 1}"
        if pd.api.types.is_numeric_dtype(cells.dtype):
            columns.append(Column(header, cells.to_numpy(np.float64), unit))
        else:
            texts = cells.fillna("").astype(str).str.strip().tolist()
            columns.append(_mixed(header, texts, unit, dialect))
    return columns


def _mixed(header: str, texts: list[str], unit: str | None, dialect: Dialect) -> Column:
    """Return a column of text, or one of numbers whose flaw is the first cell that is none."""
    numbers = [dialect.is_number(cell) for cell in texts]
    filled = [bool(cell) for cell in texts]
    if 2 * sum(numbers) <= sum(filled):
        return Column(header, None, unit, texts=texts)
    flaw = next(i for i, cell in enumerate(texts) if cell and not numbers[i])
    values: NDArray[np.float64] = np.full(len(texts), np.nan)
    return Column(header, values, unit, flaw=(flaw, texts[flaw]))


def _exact(version: str) -> dict[str, Any]:
    """Return what makes pandas read decimals to the last bit, as it does unasked since 3.1."""
    major, minor = version.split(".")[:2]
    return {} if (int(major), int(minor)) >= (3, 1) else {"float_precision": "round_trip"}
