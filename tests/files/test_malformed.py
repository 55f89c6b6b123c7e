"""A reader answers or raises a `DataError` that names the file, the channel and the row.

``CASES`` are files that are wrong, each in one way, for reading pressure and displacement. Sound files
of every format are damaged at random beside them.
"""

from __future__ import annotations

import io
import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import openpyxl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from nptdms import ChannelObject, TdmsWriter
from scipy.io import savemat

import mckibben
from mckibben import DataError, Recording
from tests.golden.rooms.files import FILES

N = 30
TIME = [k / 10 for k in range(N)]
PRESSURE = [round(2 + math.sin(k / 3), 4) for k in range(N)]
DISPLACEMENT = [round(10 - 3 * math.cos(k / 3), 4) for k in range(N)]
CHANNELS = ("pressure", "displacement")

Maker = Callable[[Path], object]


@dataclass(frozen=True)
class Case:
    """One malformed file.

    Parameters
    ----------
    name : str
        Of the file.
    content : bytes or callable
        What is in it, or what makes it when called with its path.
    channel, row : str, int, optional
        The channel and row that the error has to give.
    names : str
        A cell, column, unit, number or format that the problem has to name.
    options : mapping
        What to give to `mckibben.read` beside the channels.
    """

    name: str
    content: bytes | Maker
    channel: str | None = None
    row: int | None = None
    names: str = ""
    options: Mapping[str, Any] = field(default_factory=dict)

    def write(self, folder: Path) -> Path:
        """Make the file in a folder and return its path."""
        path = folder / self.name
        if callable(self.content):
            self.content(path)
        else:
            path.write_bytes(self.content)
        return path


# Makers --------------------------------------------------------------------------------


def csv(**columns: Sequence[object]) -> bytes:
    """Return a table of text."""
    rows = [",".join(columns)]
    rows += [",".join(map(str, row)) for row in zip(*columns.values(), strict=True)]
    return ("\n".join(rows) + "\n").encode()


def sound(**columns: Sequence[object]) -> dict[str, Sequence[object]]:
    """Return sound columns, some replaced or added."""
    return {
        "time_s": TIME,
        "pressure_bar": PRESSURE,
        "displacement_mm": DISPLACEMENT,
        **columns,
    }


def good(**columns: Sequence[object]) -> bytes:
    """Return a sound table, with columns replaced or added."""
    return csv(**sound(**columns))


def put(samples: Sequence[object], at: int, cell: object) -> list[object]:
    """Return samples with one replaced; sample ``at`` is line ``at + 2`` of the file."""
    return [cell if k == at else sample for k, sample in enumerate(samples)]


def line(number: int, text: str) -> bytes:
    """Return a sound table with one line, counted from 1, replaced."""
    lines = good().decode().splitlines()
    lines[number - 1] = text
    return ("\n".join(lines) + "\n").encode()


def gapped(lengths: Sequence[int], pause: float) -> bytes:
    """Return a sound table with pauses between stretches of these lengths."""
    time = [i * pause + k / 10 for i, length in enumerate(lengths) for k in range(length)]
    return good(time_s=time[:N])


def parquet(**columns: object) -> bytes:
    buffer = io.BytesIO()
    pq.write_table(pa.table(columns), buffer)
    return buffer.getvalue()


def mat(form: Any = "5", **variables: object) -> bytes:
    buffer = io.BytesIO()
    savemat(buffer, variables, format=form)  # type: ignore[arg-type]  # the stubs know no buffers
    return buffer.getvalue()


def hdf5(**datasets: object) -> bytes:
    """Return an HDF5 file; a tuple declares a data set of that shape and writes nothing."""
    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        for name, samples in datasets.items():
            if isinstance(samples, tuple):
                file.create_dataset(name, shape=samples, dtype="f8", chunks=True)
            else:
                file[name] = samples
    return buffer.getvalue()


def tdms(n: int = N) -> bytes:
    """Return a TDMS file with pressure and displacement."""
    buffer = io.BytesIO()
    channels = zip(CHANNELS, (PRESSURE, DISPLACEMENT), ("bar", "mm"), strict=True)
    with TdmsWriter(buffer) as writer:
        writer.write_segment(
            [
                ChannelObject(
                    "run", name, np.array(samples[:n]), {"unit_string": unit, "wf_increment": 0.1}
                )
                for name, samples, unit in channels
            ]
        )
    return buffer.getvalue()


def xlsx(**columns: Sequence[object]) -> bytes:
    """Return a spreadsheet."""
    book = openpyxl.Workbook(write_only=True)
    sheet = book.create_sheet("Data")
    sheet.append(list(columns))
    for row in zip(*columns.values(), strict=True):
        sheet.append(row)
    buffer = io.BytesIO()
    book.save(buffer)
    return buffer.getvalue()


def wrong_sum(path: Path) -> None:
    """Have a checksum that is not that of the samples."""
    with h5py.File(path, "w") as file:
        file.create_dataset("pressure_bar", data=PRESSURE, chunks=(N,), fletcher32=True)
    content, sample = path.read_bytes(), np.float64(PRESSURE[4]).tobytes()
    assert content.count(sample) == 1
    path.write_bytes(content.replace(sample, sample[::-1]))


def outside(path: Path) -> None:
    """Have the samples in another file."""
    (path.parent / "secret").write_bytes(bytes(range(160)))
    with h5py.File(path, "w") as file:
        where = [(str(path.parent / "secret"), 0, 160)]
        file.create_dataset("pressure_bar", (20,), "f8", external=where)


def apart(path: Path) -> None:
    """Have the pages of the columns in another file."""
    found: list[pq.FileMetaData] = []
    other = path.with_name("secret.parquet")
    pq.write_table(pa.table({"pressure_bar": PRESSURE}), other, metadata_collector=found)
    found[0].set_file_path(other.name)
    found[0].write_metadata_file(path)


def virtual(path: Path) -> None:
    """Have the samples in a data set of another file."""
    other = path.parent / "secret"
    other.write_bytes(HDF5)
    with h5py.File(path, "w") as file:
        layout = h5py.VirtualLayout((N,), "f8")
        layout[:] = h5py.VirtualSource(str(other), "pressure_bar", (N,))
        file.create_virtual_dataset("pressure_bar", layout)


GARBAGE = bytes(range(256)) * 4
PARQUET = parquet(pressure_bar=PRESSURE, displacement_mm=DISPLACEMENT)
MAT = mat(pressure=PRESSURE, displacement=DISPLACEMENT)
HDF5 = hdf5(pressure_bar=PRESSURE, displacement_mm=DISPLACEMENT)
XLSX = xlsx(pressure_bar=PRESSURE, displacement_mm=DISPLACEMENT)
BAG, MCAP, DB3 = (
    (FILES / name).read_bytes()
    for name in ("ros1.bag", "ros2-mcap/ros2-mcap.mcap", "ros2-db3/ros2-db3.db3")
)
UNITS = {"units": {"pressure": "bar", "displacement": "mm"}}
P, X, T = CHANNELS[0], CHANNELS[1], "time"

CASES: list[Case] = [
    # No file, or none that is known
    Case("missing.csv", lambda path: None),
    Case("pipe.csv", os.mkfifo),
    Case("device.mat", lambda path: path.symlink_to("/dev/zero")),
    Case("book.xls", b"\xd0\xcf\x11\xe0", names="'.xls'"),
    Case("no_ending", good()),
    # Content of another kind
    Case("parquet.csv", PARQUET, names="Parquet"),
    Case("mcap.bag", MCAP, names="MCAP"),
    Case("garbage.csv", GARBAGE),
    # Empty, or without samples
    Case("header_only.csv", b"time_s,pressure_bar,displacement_mm\n"),
    # Lines
    Case("short_line.csv", line(12, "1.0,2.0"), row=12, names="2 cells"),
    Case("short_header.csv", line(1, "time_s,pressure_bar"), row=2, names="3 cells"),
    Case("quote.csv", line(6, '"0.4,2.9,9.0'), row=6),
    Case("long.csv", line(3, "1" * 20_000_000), row=3, names="1 cells"),
    # Columns
    Case("no_displacement.csv", csv(time_s=TIME, pressure_bar=PRESSURE), X),
    Case("text_cell.csv", good(pressure_bar=put(PRESSURE, 8, "n.d.")), P, 10, "'n.d.'"),
    Case("two_times.csv", good(t_ms=TIME), T, names="'time_s' and 't_ms'"),
    Case("no_such_column.csv", good(), P, names="'P9'", options={"columns": {"pressure": "P9"}}),
    # Units
    Case("given_unit.csv", good(), P, names="'blub'", options={"units": {"pressure": "blub"}}),
    # Samples
    Case("blank_cell.csv", good(displacement_mm=put(DISPLACEMENT, 9, "")), X, 11, "1 of 30"),
    Case("constant.csv", good(pressure_bar=[2.5] * N), P, names="2.5"),
    # Time
    Case("text_instant.csv", good(time_s=put(TIME, 7, "late")), T, 9, "'late'"),
    Case("long_gap.csv", gapped((15, 15), 1e6), T, options={"gaps": "interpolate"}),
    Case("zero_rate.csv", good(), options={"rate": 0}),
    Case("other_rate.csv", good(), T, names="50", options={"rate": 50}),
    Case("policy.csv", good(), names="'ignore'", options={"gaps": "ignore"}),
    # Parquet
    Case("garbage.parquet", b"PAR1" + GARBAGE),
    Case("apart.parquet", apart),
    # MATLAB
    Case("garbage.mat", GARBAGE),
    Case("scalars.mat", mat(pressure=2.0, displacement=7.0)),
    Case(
        "nan.mat",
        mat(pressure=put(PRESSURE, 4, np.nan), displacement=DISPLACEMENT),
        P,
        5,
        "1 of 30",
        UNITS,
    ),
    Case("no_units.mat", mat(pressure=np.multiply(PRESSURE, 200)), X),
    # HDF5
    Case("huge.h5", hdf5(pressure_bar=(10**14,)), names="memory"),
    Case("unequal.h5", hdf5(pressure_bar=PRESSURE, displacement_mm=DISPLACEMENT[:20]), X),
    Case("wrong_sum.h5", wrong_sum),
    Case("outside.h5", outside, names="'pressure_bar'"),
    Case("virtual.h5", virtual, names="'pressure_bar'"),
    # TDMS
    Case("cut_off.tdms", tdms()[:-5]),
    Case("no_samples.tdms", tdms(n=0)),
    # Spreadsheets
    Case("garbage.xlsx", b"PK\x03\x04" + GARBAGE),
    Case("blank.xlsx", xlsx(**sound(pressure_bar=put(PRESSURE, 4, None))), P, 6, "1 of 30"),
    Case("word.xlsx", xlsx(**sound(pressure_bar=put(PRESSURE, 4, "high"))), P, 6, "'high'"),
    # Bags
    Case("garbage.mcap", b"\x89MCAP0\r\n" + GARBAGE),
    Case("no_topic.mcap", MCAP, P, names="/rig/pressure"),
    Case(
        "no_column.db3",
        DB3,
        "force",
        names="'/scale/data'",
        options={"columns": {"force": "/scale/data"}},
    ),
]


@pytest.mark.filterwarnings("ignore::mckibben.DataWarning")
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_a_malformed_file_is_refused_by_file_channel_and_row(case: Case, tmp_path: Path) -> None:
    path = case.write(tmp_path)
    with pytest.raises(DataError) as caught:
        mckibben.read(path, channels=CHANNELS, **case.options)
    error = caught.value
    assert (error.file, error.channel, error.row) == (path, case.channel, case.row)
    assert case.names in error.problem
    assert error.remedy
    assert "\n" not in str(error)
    assert len(str(error)) < 1500


# Damaged at random ------------------------------------------------------------------------------

SOUND: dict[str, bytes] = {
    ".csv": good(),
    ".parquet": PARQUET,
    ".mat": MAT,
    ".h5": HDF5,
    ".tdms": tdms(),
    ".xlsx": XLSX,
    ".bag": BAG,
    ".mcap": MCAP,
    ".db3": DB3,
}


def answers(path: Path, content: bytes) -> None:
    """Read a file, and fail unless the answer is recordings or an error that names the file."""
    path.write_bytes(content)
    try:
        assert all(isinstance(one, Recording) for one in mckibben.read(path))
    except DataError as error:
        assert error.file == path  # noqa: PT017
        assert error.remedy  # noqa: PT017


@pytest.mark.filterwarnings("ignore::mckibben.DataWarning")
@pytest.mark.parametrize("ending", SOUND)
def test_a_damaged_file_is_read_or_refused(ending: str, tmp_path: Path) -> None:
    content, path = SOUND[ending], tmp_path / f"run{ending}"
    rng = np.random.default_rng(len(content))
    answers(path, content)
    for length in (3, 100, *rng.integers(0, len(content), 6).tolist(), len(content) - 1):
        answers(path, content[:length])
    for _ in range(12):
        damaged = bytearray(content)
        for place in rng.integers(0, len(content), int(rng.integers(1, 5))):
            damaged[place] = rng.integers(256)
        answers(path, bytes(damaged))


def test_elements_of_unknown_type_in_mat_files_are_refused(tmp_path: Path) -> None:
    """SciPy would follow a pointer that such an element chooses."""
    path = tmp_path / "run.mat"
    savemat(path, {"pressure": np.arange(40.0), "displacement": np.arange(40.0)})
    content = bytearray(path.read_bytes())
    at = content.index(b"\x09\x00\x00\x00\x40\x01\x00\x00")  # the tag of 40 doubles
    content[at] = 250
    path.write_bytes(content)
    with pytest.raises(DataError):
        mckibben.read(path)
