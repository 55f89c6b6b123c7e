"""Tables that tests write, and what is read of files."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from nptdms import ChannelObject, TdmsWriter

import mckibben
from mckibben import DataError, DataWarning, Recording
from mckibben.files import formats
from mckibben.files.table import Column, Table

Cells = Sequence[object] | np.ndarray[Any, Any]


def rows(*columns: Cells, separator: str = ",", mark: str = ".") -> str:
    """Return lines of cells, numbers to the last bit."""
    lines = zip(*columns, strict=True)
    return "".join(separator.join(str(c).replace(".", mark) for c in each) + "\n" for each in lines)


def put(path: Path, header: str, *columns: Cells, separator: str = ",") -> Path:
    """Write columns of cells below a header, and return the path."""
    path.write_text(f"{header}\n{rows(*columns, separator=separator)}", encoding="utf-8")
    return path


def tdms(path: Path, **channels: tuple[Any, Mapping[str, Any]]) -> Path:
    """Write channels of samples and properties, and return the path."""
    with TdmsWriter(path) as writer:
        objects = [ChannelObject("run", name, *each) for name, each in channels.items()]
        writer.write_segment(objects)
    return path


def several(path: Path, **options: Any) -> list[Recording]:
    """Read a file or folder; what would be warned of is in the notes of recordings."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)
        return mckibben.read(path, **options)


def one(path: Path, **options: Any) -> Recording:
    """Read the one recording of a file or folder."""
    (recording,) = several(path, **options)
    return recording


def refused(path: Path, **options: Any) -> DataError:
    """Return how a file is refused, which names a remedy."""
    with pytest.raises(DataError) as caught:
        several(path, **options)
    assert caught.value.remedy
    return caught.value


def place(path: Path, **options: Any) -> tuple[str | None, int | None]:
    """Return the channel and the row by which a file is refused."""
    error = refused(path, **options)
    return error.channel, error.row


def table(path: Path) -> Table:
    """Return the one table of a file, or of a bag of ROS 2."""
    (found,) = formats.bag(path) if path.is_dir() else formats.tables(path)
    return found


def columns(path: Path) -> Mapping[str, Column]:
    """Return the columns of a file by their headers, before anything is made of them."""
    return {column.header: column for column in table(path).columns}
