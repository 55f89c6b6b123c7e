"""A reader answers or raises a `DataError` that names the file, the channel and the row.

``CASES`` are files that are wrong, each in one way, for reading pressure and displacement. Sound files
of every format are damaged at random beside them.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from scipy.io import savemat

from mckibben import DataError
from tests.files.made import refused, several, tdms
from tests.golden.rooms.files import FILES

N = 30
K = np.arange(N)
PRESSURE, MOVED = np.round(2 + np.sin(K / 3), 4), np.round(10 - 3 * np.cos(K / 3), 4)
FRAME = pd.DataFrame({"time_s": K / 10, "pressure_bar": PRESSURE, "displacement_mm": MOVED})
CSV = FRAME.to_csv(index=False).encode()
WIDER = CSV.replace(b"5\n", b"5,7\n")
CHANNELS = ("pressure", "displacement")
P, X, T = *CHANNELS, "time"

Maker = Callable[[Path], object]


@dataclass(frozen=True)
class Case:
    """A file, what its error names beside it, and options of `mckibben.read`."""

    name: str
    content: bytes | Maker
    channel: str | None = None
    row: int | None = None
    names: str = ""
    options: Mapping[str, Any] = field(default_factory=dict)


# Makers --------------------------------------------------------------------------------


def csv(path: Path, **columns: Any) -> None:
    FRAME.assign(**columns).to_csv(path, index=False)


def parquet(path: Path) -> None:
    FRAME.to_parquet(path)


def xlsx(path: Path, **columns: Any) -> None:
    FRAME.assign(**columns).to_excel(path, index=False)


def mat(path: Path, **variables: Any) -> None:
    savemat(path, variables or {P: PRESSURE, X: MOVED})


def hdf5(path: Path, **datasets: Any) -> None:
    """Write data sets; a tuple declares one of that shape and writes nothing."""
    with h5py.File(path, "w") as file:
        for name, samples in (datasets or dict(FRAME)).items():
            if isinstance(samples, tuple):
                file.create_dataset(name, shape=samples, dtype="f8", chunks=True)
            else:
                file[name] = samples


def short_tdms(path: Path, n: int = N) -> None:
    clock = {"wf_increment": 0.1}
    tdms(path, **{name: (FRAME[name].to_numpy()[:n], clock) for name in FRAME.columns[1:]})


def cut_off(path: Path) -> None:
    short_tdms(path)
    path.write_bytes(path.read_bytes()[:-5])


def wrong_type(path: Path, kind: int) -> None:
    """Have an element of a type that numbers cannot have, where SciPy would follow any pointer."""
    mat(path, pressure=np.arange(40.0), displacement=np.arange(40.0))
    content = bytearray(path.read_bytes())
    content[content.index(b"\x09\x00\x00\x00\x40\x01\x00\x00")] = kind  # the tag of 40 doubles
    path.write_bytes(content)


def wrong_sum(path: Path) -> None:
    """Have a checksum that is not that of the samples."""
    with h5py.File(path, "w") as file:
        file.create_dataset("pressure_bar", data=PRESSURE, chunks=(N,), fletcher32=True)
    content, sample = path.read_bytes(), np.float64(PRESSURE[4]).tobytes()
    assert content.count(sample) == 1
    path.write_bytes(content.replace(sample, sample[::-1]))


def outside(path: Path) -> None:
    """Have the samples in another file."""
    secret = path.with_name("secret")
    secret.write_bytes(bytes(range(160)))
    with h5py.File(path, "w") as file:
        file.create_dataset("pressure_bar", (20,), "f8", external=[(str(secret), 0, 160)])


def apart(path: Path) -> None:
    """Have the pages of the columns in another file."""
    found: list[pq.FileMetaData] = []
    other = path.with_name("secret.parquet")
    pq.write_table(pa.table({"pressure_bar": PRESSURE}), other, metadata_collector=found)
    found[0].set_file_path(other.name)
    found[0].write_metadata_file(path)


def virtual(path: Path) -> None:
    """Have the samples in a data set of another file."""
    hdf5(path.with_name("secret"))
    with h5py.File(path, "w") as file:
        layout = h5py.VirtualLayout((N,), "f8")
        layout[:] = h5py.VirtualSource(str(path.with_name("secret")), "pressure_bar", (N,))
        file.create_virtual_dataset("pressure_bar", layout)


def golden(name: str) -> Maker:
    return partial(shutil.copy, FILES / name)


GARBAGE = bytes(range(256)) * 4
MCAP, DB3 = golden("ros2-mcap/ros2-mcap.mcap"), golden("ros2-db3/ros2-db3.db3")
PAUSED = K / 10 + 1e6 * (K >= 15)
UNITS = {"units": {P: "bar", X: "mm"}}
HOLE = FRAME["pressure_bar"].where(K != 4)

CASES: list[Case] = [
    # No file, or none that is known
    Case("pipe.csv", os.mkfifo),
    Case("device.mat", lambda path: path.symlink_to("/dev/zero")),
    Case("book.xls", b"\xd0\xcf\x11\xe0", names="'.xls'"),
    Case("no_ending", b"\xd0\xcf\x11\xe0"),
    # Content of another kind
    Case("parquet.csv", parquet),
    Case("mcap.bag", MCAP),
    Case("garbage.csv", GARBAGE),
    # Text
    Case("header_only.csv", b"time_s,pressure_bar,displacement_mm\n"),
    Case("short_header.csv", CSV.replace(b",displacement_mm", b""), row=2, names="3 cells"),
    Case("quote.csv", CSV.replace(b"\n0.4", b'\n"0.4'), row=6),
    Case("title.csv", b"Bench 3,by A,room 5,Monday\n" + CSV.partition(b"\n")[2], row=2, names="has 4"),
    Case("wider.csv", WIDER, row=WIDER[: WIDER.index(b",7\n")].count(b"\n") + 1, names="4 cells"),
    Case("two_times.csv", partial(csv, t_ms=1.0), T, names="'time_s' and 't_ms'"),
    # Time, and options
    Case("long_gap.csv", partial(csv, time_s=PAUSED), T, options={"gaps": "interpolate"}),
    Case("zero_rate.csv", csv, options={"rate": 0}),
    # Parquet
    Case("garbage.parquet", b"PAR1" + GARBAGE),
    Case("apart.parquet", apart),
    # MATLAB
    Case("garbage.mat", GARBAGE),
    Case("scalars.mat", partial(mat, pressure=2.0, displacement=7.0)),
    Case("nan.mat", partial(mat, pressure=HOLE, displacement=MOVED), P, 5, "1 of 30", UNITS),
    Case("no_units.mat", partial(mat, pressure=200 * PRESSURE), X),
    Case("unknown_type.mat", partial(wrong_type, kind=250)),
    Case("matrix_of_numbers.mat", partial(wrong_type, kind=14)),
    # HDF5
    Case("huge.h5", partial(hdf5, pressure_bar=(10**14,)), names="memory"),
    Case("unequal.h5", partial(hdf5, pressure_bar=PRESSURE, displacement_mm=PRESSURE[:20]), X),
    Case("wrong_sum.h5", wrong_sum),
    Case("outside.h5", outside, names="'pressure_bar'"),
    Case("virtual.h5", virtual, names="'pressure_bar'"),
    # TDMS
    Case("cut_off.tdms", cut_off),
    Case("no_samples.tdms", partial(short_tdms, n=0)),
    # Spreadsheets
    Case("garbage.xlsx", b"PK\x03\x04" + GARBAGE),
    Case("blank.xlsx", partial(xlsx, pressure_bar=HOLE), P, 6, "1 of 30"),
    # Bags
    Case("garbage.mcap", b"\x89MCAP0\r\n" + GARBAGE),
    Case("no_topic.mcap", MCAP, "displacement", names="/rig/pressure"),
    Case("no_column.db3", DB3, "force", names="'/s/data'", options={"columns": {"force": "/s/data"}}),
]  # fmt: skip


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_a_malformed_file_is_refused_by_file_channel_and_row(case: Case, tmp_path: Path) -> None:
    path = tmp_path / case.name
    make = case.content if callable(case.content) else lambda path: path.write_bytes(case.content)
    make(path)
    error = refused(path, channels=CHANNELS, **case.options)
    assert (error.file, error.channel, error.row) == (path, case.channel, case.row)
    assert case.names in error.problem
    assert "\n" not in str(error)
    assert len(str(error)) < 1500


# Damaged at random ------------------------------------------------------------------------------

SOUND: dict[str, Maker] = {
    ".csv": csv, ".parquet": parquet, ".mat": mat, ".h5": hdf5, ".tdms": short_tdms, ".xlsx": xlsx,
    ".bag": golden("ros1.bag"), ".mcap": MCAP, ".db3": DB3,
}  # fmt: skip


@pytest.mark.parametrize("ending", SOUND)
def test_a_damaged_file_is_read_or_refused(ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"run{ending}"
    SOUND[ending](path)
    assert several(path)
    content = path.read_bytes()
    rng = np.random.default_rng(len(content))
    lengths = (3, 100, *rng.integers(0, len(content), 6).tolist(), len(content) - 1)
    damaged = [bytearray(content[:length]) for length in lengths]
    for _ in range(12):
        damaged.append(bytearray(content))
        for at in rng.integers(0, len(content), int(rng.integers(1, 5))):
            damaged[-1][at] = rng.integers(256)
    for each in damaged:
        path.write_bytes(each)
        try:
            several(path)
        except DataError as error:
            assert error.file == path  # noqa: PT017
            assert error.remedy  # noqa: PT017
