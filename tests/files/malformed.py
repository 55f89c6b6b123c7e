"""Input files that are wrong, each in one way, and the error that each has to give.

``CASES`` are files for reading pressure and displacement, as ``mckibben fit`` does; every one
of them must end in a `DataError`. To look at them: ``python tests/files/malformed.py FOLDER``.
"""

from __future__ import annotations

import io
import math
import os
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

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
    problem : str
        A part of the message.
    channel, row : str, int, optional
        The channel and row that the error names.
    options : mapping
        What to give to `mckibben.read` beside the channels.
    """

    name: str
    content: bytes | Maker
    problem: str
    channel: str | None = None
    row: int | None = None
    options: Mapping[str, Any] = field(default_factory=dict)

    def write(self, folder: Path) -> Path:
        """Make the file in a folder and return its path."""
        path = folder / self.name
        if callable(self.content):
            self.content(path)
        else:
            path.write_bytes(self.content)
        return path

    @property
    def arguments(self) -> list[str]:
        """The options as the command line takes them."""
        arguments: list[str] = []
        for channel, column in self.options.get("columns", {}).items():
            arguments += ["--column", f"{channel}={column}"]
        for channel, unit in self.options.get("units", {}).items():
            arguments += ["--unit", f"{channel}={unit}"]
        for name in ("rate", "gaps"):
            if name in self.options:
                arguments += [f"--{name}", str(self.options[name])]
        return arguments


# Makers --------------------------------------------------------------------------------


def csv(**columns: Sequence[object]) -> bytes:
    """Return a table of text."""
    rows = [",".join(columns)]
    rows += [",".join(map(str, row)) for row in zip(*columns.values(), strict=True)]
    return ("\n".join(rows) + "\n").encode()


def good(**columns: Sequence[object]) -> bytes:
    """Return a sound table, with columns replaced or added."""
    sound: dict[str, Sequence[object]] = {
        "time_s": TIME,
        "pressure_bar": PRESSURE,
        "displacement_mm": DISPLACEMENT,
    }
    return csv(**{**sound, **columns})


def put(samples: Sequence[object], at: int, cell: object) -> list[object]:
    """Return samples with one replaced; sample ``at`` is line ``at + 2`` of the file."""
    return [cell if k == at else sample for k, sample in enumerate(samples)]


def line(number: int, text: str) -> bytes:
    """Return a sound table with one line, counted from 1, replaced."""
    lines = good().decode().splitlines()
    lines[number - 1] = text
    return ("\n".join(lines) + "\n").encode()


def headers(text: str) -> bytes:
    """Return a sound table under another header."""
    return line(1, text)


def parquet(**columns: object) -> bytes:
    """Return a Parquet file."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    buffer = io.BytesIO()
    pq.write_table(pa.table(columns), buffer)
    return buffer.getvalue()


def mat(**variables: object) -> bytes:
    """Return a MAT file of version 5."""
    from scipy.io import savemat

    buffer = io.BytesIO()
    savemat(buffer, variables)  # type: ignore[arg-type]  # the stubs know no buffers
    return buffer.getvalue()


def hdf5(**datasets: object) -> bytes:
    """Return an HDF5 file; a tuple declares a data set of that shape and writes nothing."""
    import h5py

    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        for name, samples in datasets.items():
            if isinstance(samples, tuple):
                file.create_dataset(name, shape=samples, dtype="f8", chunks=True)
            else:
                file[name] = samples
    return buffer.getvalue()


def tdms(increments: Sequence[float] = (0.1, 0.1), n: int = N) -> bytes:
    """Return a TDMS file with pressure and displacement."""
    from nptdms import ChannelObject, TdmsWriter

    buffer = io.BytesIO()
    channels = zip(CHANNELS, (PRESSURE, DISPLACEMENT), ("bar", "mm"), increments, strict=True)
    with TdmsWriter(buffer) as writer:
        writer.write_segment(
            [
                ChannelObject(
                    "run", name, np.array(samples[:n]), {"unit_string": unit, "wf_increment": step}
                )
                for name, samples, unit, step in channels
            ]
        )
    return buffer.getvalue()


def gapped(lengths: Sequence[int], pause: float) -> bytes:
    """Return a sound table with pauses between stretches of these lengths."""
    time = [i * pause + k / 10 for i, length in enumerate(lengths) for k in range(length)]
    return good(time_s=time[:N])


def xlsx(**columns: Sequence[object]) -> bytes:
    """Return a spreadsheet."""
    import openpyxl

    book = openpyxl.Workbook(write_only=True)
    sheet = book.create_sheet("Data")
    sheet.append(list(columns))
    for row in zip(*columns.values(), strict=True):
        sheet.append(row)
    buffer = io.BytesIO()
    book.save(buffer)
    return buffer.getvalue()


def mcap(pressures: Sequence[float], topic: str = "/pressure_bar") -> bytes:
    """Return a bag of ROS 2 with a topic of numbers."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store, kind = get_typestore(Stores.ROS2_JAZZY), "std_msgs/msg/Float64"
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bag"
        with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            sent = writer.add_connection(topic, kind, typestore=store)
            for k, value in enumerate(pressures):
                message = store.serialize_cdr(store.types[kind](value), kind)
                writer.write(sent, 10**8 * k, message)
        return (path / "bag.mcap").read_bytes()


def described(text: str) -> Maker:
    """Make a sound table, and a description of its folder beside it."""

    def make(path: Path) -> None:
        path.write_bytes(good())
        (path.parent / "channels.toml").write_text(text)

    return make


def nothing(path: Path) -> None:
    """Make no file at all."""


def loop(path: Path) -> None:
    """Make a link to itself."""
    path.symlink_to(path.name)


GARBAGE = bytes(range(256)) * 4
PARQUET = parquet(pressure_bar=PRESSURE, displacement_mm=DISPLACEMENT)
MAT = mat(pressure=PRESSURE, displacement=DISPLACEMENT)
HDF5 = hdf5(pressure_bar=PRESSURE, displacement_mm=DISPLACEMENT)
XLSX = xlsx(pressure_bar=PRESSURE, displacement_mm=DISPLACEMENT)
MCAP = mcap(PRESSURE)
UNITS = {"units": {"pressure": "bar", "displacement": "mm"}}

CASES: list[Case] = [
    # No file, or none that is known
    Case("missing.csv", nothing, "no such file"),
    Case("folder.csv", Path.mkdir, "no recording in the folder"),
    Case("link.csv", loop, "it cannot be read"),
    Case("pipe.csv", os.mkfifo, "no ordinary file"),
    Case("book.xls", b"\xd0\xcf\x11\xe0", "'.xls' cannot be read"),
    Case("notes.docx", b"PK\x03\x04", "'.docx' cannot be read"),
    Case("no_ending", good(), "'nothing' cannot be read"),
    # Content of another kind
    Case("workbook.csv", b"PK\x03\x04\x14\0\x06\0", "a spreadsheet or an archive"),
    Case("old_workbook.csv", b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "Excel"),
    Case("parquet.csv", PARQUET, "by its content it is Parquet"),
    Case("hdf5.csv", HDF5, "by its content it is HDF5"),
    Case("matlab.csv", MAT, "by its content it is MATLAB"),
    Case("tdms.txt", tdms(), "by its content it is TDMS"),
    Case("picture.csv", b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", "not text"),
    Case("garbage.csv", GARBAGE, "not text"),
    Case("zeros.csv", bytes(1000), "not text"),
    Case("half_utf16.csv", "pressure".encode("utf-16")[:-1], "not text"),
    # Empty, or without samples
    Case("empty.csv", b"", "nothing in it"),
    Case("blank.csv", b"\n \n\n", "nothing in it"),
    Case("bom_only.csv", b"\xef\xbb\xbf", "nothing in it"),
    Case("comments.csv", b"# rig 1\n% date\n", "nothing in it"),
    Case("header_only.csv", b"time_s,pressure_bar,displacement_mm\n", "no samples"),
    Case(
        "units_only.csv",
        b"time,pressure,displacement\ns,bar,mm\n",
        "'s' is no time",
        "time",
        2,
    ),
    Case("prose.txt", b"This is no table.\nIt only says so.\n", "no such channel", "pressure"),
    Case("one_sample.csv", good().partition(b"0.1,")[0], "1 sample(s) are too few"),
    Case("nine_samples.csv", b"\n".join(good().splitlines()[:10]), "9 sample(s) are too few"),
    # Lines
    Case("short_line.csv", line(12, "1.0,2.0"), "2 cells where the header has 3", row=12),
    Case("long_line.csv", line(13, "1.1,2.0,9.0,7"), "4 cells where the header has 3", row=13),
    Case("cut_off.csv", good()[:-14], "cells where the header has 3", row=31),
    Case("short_header.csv", headers("time_s,pressure_bar"), "3 cells where", row=2),
    Case("quote.csv", line(6, '"0.4,2.9,9.0'), "quotation mark is not closed", row=6),
    Case("decimal_commas.csv", line(3, "0,1,2,3,7,0"), "6 cells where", row=3),
    # Columns
    Case("no_names.csv", good().partition(b"\n")[2], "columns are column_1", "pressure"),
    Case("other_names.csv", headers("time_s,a,b"), "columns are time_s, a, b", "pressure"),
    Case("no_displacement.csv", csv(time_s=TIME, pressure_bar=PRESSURE), "no such", "displacement"),
    Case(
        "text_only.csv", csv(pressure=["high"] * N, displacement=["low"] * N), "text", "pressure", 2
    ),
    Case("text_column.csv", good(pressure_bar=["high"] * N), "holds text", "pressure", 2),
    Case("text_cell.csv", good(pressure_bar=put(PRESSURE, 8, "n.d.")), "'n.d.' is", "pressure", 10),
    Case(
        "unit_in_cell.csv",
        good(displacement_mm=put(DISPLACEMENT, 3, "9 mm")),
        "'9 mm'",
        "displacement",
        5,
    ),
    Case(
        "hex_cell.csv", good(pressure_bar=put(PRESSURE, 0, "0x1F")), "'0x1F' is not", "pressure", 2
    ),
    Case("two_pressures.csv", good(p_kPa=PRESSURE), "'pressure_bar' and 'p_kPa'", "pressure"),
    Case("two_strokes.csv", good(**{"Stroke (mm)": DISPLACEMENT}), "both hold it", "displacement"),
    Case(
        "same_header.csv", headers("time_s,pressure_bar,pressure_bar"), "both hold it", "pressure"
    ),
    Case("two_times.csv", good(t_ms=TIME), "'time_s' and 't_ms'", "time"),
    Case(
        "no_such_column.csv",
        good(),
        "no column 'P9'",
        "pressure",
        options={"columns": {"pressure": "P9"}},
    ),
    Case(
        "mapped_text.csv",
        good(branch=["up"] * N),
        "holds text",
        "pressure",
        2,
        options={"columns": {"pressure": "branch"}},
    ),
    # Units
    Case(
        "unknown_unit.csv", headers("time_s,pressure [foo],displacement_mm"), "'foo' is", "pressure"
    ),
    Case(
        "pressure_in_mm.csv", headers("time_s,pressure_mm,displacement_mm"), "in 'mm'", "pressure"
    ),
    Case("stroke_in_kg.csv", headers("time_s,p_bar,displacement (kg)"), "in 'kg'", "displacement"),
    Case("time_in_volts.csv", headers("time (V),p_bar,displacement_mm"), "in 'V'", "time"),
    Case(
        "kilopascals.csv",
        csv(pressure=[100 * p for p in PRESSURE], displacement_mm=DISPLACEMENT),
        "cannot be bar",
        "pressure",
    ),
    Case(
        "given_unit.csv",
        good(),
        "'blub' is unknown",
        "pressure",
        options={"units": {"pressure": "blub"}},
    ),
    Case("given_volts.csv", good(), "in 'V'", "pressure", options={"units": {"pressure": "V"}}),
    Case("unit_of_nothing.csv", good(), "not there", "force", options={"units": {"force": "N"}}),
    # Samples
    Case("nan.csv", good(pressure_bar=put(PRESSURE, 4, "NaN")), "1 of 30 samples", "pressure", 6),
    Case(
        "blank_cell.csv",
        good(displacement_mm=put(DISPLACEMENT, 9, "")),
        "missing",
        "displacement",
        11,
    ),
    Case(
        "infinite.csv", good(pressure_bar=put(PRESSURE, 29, "-inf")), "not finite", "pressure", 31
    ),
    Case("overflow.csv", good(pressure_bar=put(PRESSURE, 2, "1e999")), "not finite", "pressure", 4),
    Case("blank_column.csv", good(pressure_bar=[""] * N), "holds text", "pressure", 2),
    Case("constant.csv", good(pressure_bar=[2.5] * N), "constant, at 2.5", "pressure"),
    # Time
    Case("no_instant.csv", good(time_s=put(TIME, 5, "")), "time is missing", "time", 7),
    Case("infinite_time.csv", good(time_s=put(TIME, 5, "inf")), "time is missing", "time", 7),
    Case("repeated.csv", good(time_s=put(TIME, 5, 0.4)), "0.4 is repeated", "time", 7),
    Case("frozen_clock.csv", good(time_s=[0.0] * N), "0 is repeated", "time", 3),
    Case("backwards.csv", good(time_s=put(TIME, 5, 0.05)), "back from 0.4 to 0.05", "time", 7),
    Case("clock_reset.csv", good(time_s=TIME[:20] + TIME[:10]), "goes back", "time", 22),
    Case("clock_text.csv", good(time_s=["noon"] * N), "'noon' is no time", "time", 2),
    Case("text_instant.csv", good(time_s=put(TIME, 7, "late")), "'late' is not", "time", 9),
    Case("gap.csv", gapped((12, 18), 60.0), "gap of 58.9 s", "time", 14),
    Case("gaps_only.csv", gapped((6,) * 5, 9.0), "no stretch", options={"gaps": "split"}),
    Case(
        "long_gap.csv", gapped((15, 15), 1e6), "too long", "time", options={"gaps": "interpolate"}
    ),
    Case("zero_rate.csv", good(), "impossible", options={"rate": 0}),
    Case("negative_rate.csv", good(), "impossible", options={"rate": -10}),
    Case("other_rate.csv", good(), "not the 50 asked", "time", options={"rate": 50}),
    Case("policy.csv", good(), "no way 'ignore'", options={"gaps": "ignore"}),
    # Parquet
    Case("truncated.parquet", PARQUET[: len(PARQUET) // 2], "damaged"),
    Case("garbage.parquet", b"PAR1" + GARBAGE, "damaged"),
    Case("text.parquet", good(), "damaged"),
    Case("no_rows.parquet", parquet(pressure_bar=np.zeros(0)), "no vectors"),
    Case(
        "null.parquet",
        parquet(pressure_bar=put(PRESSURE, 4, None), displacement_mm=DISPLACEMENT),
        "1 of 30 samples",
        "pressure",
        5,
    ),
    Case(
        "lists.parquet",
        parquet(pressure=[[1.0]] * N, displacement=DISPLACEMENT),
        "text",
        "pressure",
        1,
    ),
    # MATLAB
    Case("truncated.mat", MAT[: len(MAT) * 2 // 3], "damaged"),
    Case("garbage.mat", GARBAGE, "damaged"),
    Case("text.mat", good(), "damaged"),
    Case("scalars.mat", mat(pressure=2.0, displacement=7.0), "no vectors"),
    Case("strings.mat", mat(pressure="high"), "no vectors"),
    Case("huge.mat", MAT[:144] + b"\xff\xff\xff\x7f" * 4 + MAT[160:], "damaged"),
    Case(
        "nan.mat",
        mat(pressure=put(PRESSURE, 4, np.nan), displacement=DISPLACEMENT),
        "1 of 30",
        "pressure",
        5,
        UNITS,
    ),
    Case("no_units.mat", mat(pressure=np.multiply(PRESSURE, 200)), "no such", "displacement"),
    # HDF5
    Case("truncated.h5", HDF5[: len(HDF5) // 2], "damaged"),
    Case("signature_only.h5", HDF5[:8], "damaged"),
    Case("text.h5", good(), "damaged"),
    Case("empty.h5", hdf5(), "no vectors"),
    Case("images.hdf5", hdf5(pressure=np.zeros((9, 9))), "no vectors"),
    Case("huge.h5", hdf5(pressure_bar=(10**14,)), "declares 100000000000000 samples"),
    Case(
        "unequal.h5",
        hdf5(pressure_bar=PRESSURE, displacement_mm=DISPLACEMENT[:20]),
        "no such",
        "displacement",
    ),
    # TDMS
    Case("garbage.tdms", b"TDSm" + GARBAGE, "no channel in it"),
    Case("truncated.tdms", tdms()[:-5], "cut off"),
    Case("cut_head.tdms", tdms()[:60], "no channel in it"),
    Case("text.tdms", good(), "damaged"),
    Case("no_samples.tdms", tdms(n=0), "no channel in it has samples"),
    Case("two_clocks.tdms", tdms(increments=(0.1, 0.2)), "several time bases"),
    # Spreadsheets
    Case("truncated.xlsx", XLSX[: len(XLSX) // 2], "damaged"),
    Case("garbage.xlsx", b"PK\x03\x04" + GARBAGE, "damaged"),
    Case("text.xlsx", good(), "damaged"),
    Case("spreadsheet.csv", XLSX, "it is a spreadsheet or an archive"),
    Case("words.xlsx", xlsx(pressure=["high"] * N), "no sheet in it has numbers"),
    Case("no_column.xlsx", xlsx(pressure_bar=PRESSURE), "no such channel", "displacement"),
    Case(
        "blank.xlsx",
        xlsx(pressure_bar=put(PRESSURE, 4, None), displacement_mm=DISPLACEMENT),
        "1 of 30 samples",
        "pressure",
        6,
    ),
    Case(
        "backwards.xlsx",
        xlsx(time_s=put(TIME, 5, 0.05), pressure_bar=PRESSURE, displacement_mm=DISPLACEMENT),
        "back from 0.4 to 0.05",
        "time",
        7,
    ),
    # Bags
    Case("truncated.mcap", MCAP[:300], "damaged"),
    Case("garbage.mcap", b"\x89MCAP0\r\n" + GARBAGE, "damaged"),
    Case("text.mcap", good(), "damaged"),
    Case("mcap.bag", MCAP, "by its content it is MCAP"),
    Case("garbage.bag", b"#ROSBAG V2.0\n" + GARBAGE, "damaged"),
    Case("text.db3", good(), "damaged"),
    Case("garbage.db3", b"SQLite format 3\0" + GARBAGE, "damaged"),
    Case("no_topic.mcap", MCAP, "no such channel", "displacement"),
    # Descriptions of the folder
    Case(
        "no_described.csv",
        described("[channels.pressure]\ncolumn = 'A0'"),
        "no column 'A0'",
        "pressure",
    ),
]

if __name__ == "__main__":
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for case in CASES:
        print(case.write(folder), *case.arguments)
