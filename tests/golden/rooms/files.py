"""Files as laboratories write them: what `mckibben.read` makes of each, and what it refuses."""

from __future__ import annotations

import json
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import mckibben
from mckibben.errors import DataError, MckibbenError
from tests.golden.case import Case, Leaf, Tree
from tests.golden.commands import call

FILES = Path(__file__).parents[1] / "files"

Options = Mapping[str, Any]

WHOLE: dict[str, tuple[str, Options]] = {
    "columns-by-name": ("raw.csv", {
        "columns": {"time": "stamp", "pressure": "A0", "displacement": "a1"},
        "units": {"time": "ms", "pressure": "psi", "displacement": "cm"}}),
    "calibration": ("raw.csv", {
        "columns": {"time": "stamp", "pressure": "A0", "displacement": "A1"},
        "units": {"time": "ms", "pressure": "MPa", "displacement": "mm"},
        "calibration": {"pressure": (0.25, -0.125), "displacement": (-1, 10)}}),
    "columns-none-such": ("raw.csv", {"columns": {"pressure": "A7"}}),
    "column-by-number": ("no-header.csv", {
        "columns": {"time": "column_1", "pressure": "column_2", "displacement": "column_3"}}),
    "units-go-first": ("plain.csv", {"units": {"pressure": "psi", "time": "min"}}),
    "units-kpa": ("kpa-without-unit.csv", {"units": {"pressure": "kPa"}}),
    "units-of-none": ("plain.csv", {"units": {"force": "N"}}),
    "rate": ("no-time.csv", {"rate": 250.0}),
    "rate-denied": ("plain.csv", {"rate": 100.0}),
    "rate-agrees": ("plain.csv", {"rate": 50.0}),
    "rate-for-dates": ("dates-ambiguous.csv", {"rate": 50.0}),
    "days-said": ("spreadsheet-days.csv", {"units": {"time": "day"}}),
    "constants": ("plain.csv", {"constants": {"force": (200, "g"), "length": (30, "cm")}}),
    "constants-first": ("held-force.csv", {"constants": {"force": (1, "kN")}}),
    "held-asked-for": ("held-pressure.csv", {"channels": ["pressure", "displacement"]}),
    "held-force-asked-for": ("held-force.csv", {"channels": ["pressure", "force"]}),
    "short-allowed": ("too-short.csv", {"informative": False}),
    "gap-split": ("gap.csv", {"gaps": "split"}),
    "gap-bridged": ("gap.csv", {"gaps": "interpolate"}),
    "two-gaps-split": ("two-gaps.csv", {"gaps": "split"}),
    "two-gaps-bridged": ("two-gaps.csv", {"gaps": "interpolate"}),
    "holes-split": ("holes.csv", {"gaps": "split"}),
    "holes-bridged": ("holes.csv", {"gaps": "interpolate"}),
    "holes-left-out": ("holes.csv", {"channels": ["pressure"]}),
    "holes-at-ends-bridged": ("holes-at-ends.csv", {"gaps": "interpolate"}),
    "channel-missing": ("plain.csv", {"channels": ["pressure", "force"]}),
    "counter-as-time": ("counter.csv", {"columns": {"time": "sample"}, "units": {"time": "ms"}}),
    "counter-rate": ("counter.csv", {"rate": 50.0}),
    "matrix-named": ("matrix.mat", {"columns": {
        "time": "data[1]", "pressure": "data[2]", "displacement": "data[3]"}}),
    "hdf5-matrix-named": ("matrix.hdf5", {
        "columns": {"pressure": "log[1]", "displacement": "log[2]", "force": "log[3]"}}),
    "bag-named": ("ros1.bag", {"columns": {
        "pressure": "/rig/pressure/data", "angle": "/joint_states/position/elbow"}}),
    "bag-at-rate": ("ros1.bag", {"rate": 250.0, "columns": {
        "pressure": "/rig/pressure/data", "angle": "/joint_states/position/elbow"}}),
    "mcap-named": ("ros2-mcap", {"columns": {
        "pressure": "/state/pressure_kPa", "angle": "/joint_states/position/shoulder"}}),
    "clocks-at-rate": ("clocks", {"rate": 200.0}),
    "toml-and-options": ("described", {
        "units": {"pressure": "bar"}, "calibration": {"displacement": (1, 0)}}),
    "no-such-file": ("nowhere.csv", {}),
    "ending-unknown": ("nothing/readme.md", {}),
}  # fmt: skip
"""Case -> the input and options of `mckibben.read`; every other input is read as it is."""

ALONE = (
    *("plain.csv", "semicolon-comma.csv", "latin-1.csv", "utf-16.csv", "bom-crlf.csv"),
    *("unit-row.tsv", "blanks.txt", "pipes.dat", "sep-line.csv", "comments.csv"),
    *("header-in-comment.txt", "no-header.csv", "quoted.csv", "empty-last-column.csv"),
    *("thousands.csv", "three-digits.csv", "mixed-digits.csv", "ragged.csv", "no-number.csv"),
    *("text-column.csv", "empty.csv", "too-short.csv", "scientific.csv"),
    *(
        "dates-iso.csv",
        "dates-zone.csv",
        "dates-german.csv",
        "dates-dots.csv",
        "dates-month-name.csv",
    ),
    *("dates-us-am-pm.csv", "dates-ambiguous.csv", "time-of-day.csv", "epoch-ms.csv"),
    *("epoch-ns.csv", "time-ms.csv", "time-us.csv", "time-min.csv", "spreadsheet-days.csv"),
    *("counter.csv", "no-time.csv", "jitter.csv", "rounded-times.csv", "gap.csv", "two-gaps.csv"),
    *("repeated-time.csv", "time-back.csv", "time-missing.csv", "holes.csv", "holes-at-ends.csv"),
    *("units-si.csv", "units-us.csv", "units-other.csv", "antagonists.csv"),
    *("log.csv", "no-units.csv", "u-y.csv", "raw.csv", "unknown-unit.csv"),
    *("wrong-dimension.csv", "two-of-one.csv", "kpa-without-unit.csv", "held-pressure.csv"),
    *("held-force.csv", "sentinel.csv", "glitch.csv"),
    *("own.csv", "own-changed.csv", "own-without-time.csv"),
    *("v4.mat", "v5.mat", "v73.mat", "single.mat", "struct.mat", "matrix.mat", "wide-matrix.mat"),
    *("two-rates.mat", "lengths.mat", "groups.h5", "matrix.hdf5", "elsewhere.h5"),
    *("dates.parquet", "nulls.parquet", "titles.xlsx", "dates.xlsx", "first-sheet.xlsx"),
    *("sheets/book.xlsx", "waveform.tdms", "groups.tdms", "starts.tdms"),
    *("ros1.bag", "ros2-mcap", "ros2-db3"),
    *("ros2-mcap/ros2-mcap.mcap", "ros2-db3/ros2-db3.db3"),
    *("described", "described-wrongly", "no-unit-for-gain", "runs", "clocks"),
    *("joined", "nothing"),
)
"""Inputs that are read without options."""


_BOARD = ("input", "output", "unit", "n_train", "n_test", "chosen")


def caught(action: Callable[[], Any]) -> tuple[Any, MckibbenError | None, dict[str, int]]:
    """Return what an action returns or refuses, and how many warnings of each class it issues.

    Those of other libraries depend on what was imported before.
    """
    found: Any = None
    refused: MckibbenError | None = None
    with warnings.catch_warnings(record=True) as issued:
        warnings.simplefilter("always")
        try:
            found = action()
        except MckibbenError as error:
            refused = error
    classes = [each.category for each in issued if each.category.__module__.startswith("mckibben")]
    return found, refused, dict(Counter(each.__name__ for each in classes))


def refusal(error: MckibbenError) -> dict[str, Tree]:
    """Return what a program can take from an error."""
    told: dict[str, Tree] = {"class": type(error).__name__}
    if isinstance(error, DataError):
        file = None if error.file is None else error.file.name
        told |= {"file": file, "channel": error.channel, "row": error.row}
    return told


def meta(recording: mckibben.Recording) -> dict[str, Tree]:
    """Return ``meta`` without folders and sentences."""
    known = dict(recording.meta)
    known["notes"] = len(known.get("notes", ()))
    if "file" in known:
        known["file"] = Path(known["file"]).name
    if "converted_units" in known:
        known["converted_units"] = sorted(said.split()[0] for said in known["converted_units"])
    return known


def as_tree(recording: mckibben.Recording) -> dict[str, Tree]:
    """Return all of a recording."""
    return {
        "channels": dict(recording.channels),
        "order": list(recording.channels),
        "units": dict(recording.units),
        "sample_time": recording.sample_time,
        "start_time": recording.start_time,
        "name": recording.name,
        "meta": meta(recording),
    }


def read(place: str, options: Options, folder: Path) -> Tree:
    """Read an input; the folder is not needed."""
    found, refused, issued = caught(lambda: mckibben.read(FILES / place, **options))
    if refused is not None:
        return {"refused": refusal(refused)}
    return {"recordings": [as_tree(each) for each in found], "warnings": issued}


def round_trip(folder: Path) -> Tree:
    """Read, write and read again: the same recording, and the same bytes each time."""
    (before,) = mckibben.read(FILES / "own.csv")
    path = folder / "again.csv"
    mckibben.write(before, path)
    (after,) = mckibben.read(path)
    tree: dict[str, Leaf] = {"equal": after == before}
    lines = path.read_text().splitlines()
    return tree | {"lines": len(lines), "header": lines[0], "first": lines[1], "last": lines[-1]}


def split(folder: Path) -> Tree:
    """Fit and test one model on each of the tasks that ``channels.toml`` names, in their order."""
    command = ("measured", FILES / "split", "-o", folder / "out", "--jobs", 1, "--json")
    result = call(*command)
    tasks = json.loads(result.out)
    boards = [{key: one.get(key) for key in _BOARD} | _rows(one) for one in tasks.values()]
    return {"code": result.code, "tasks": boards}


def _rows(task: Mapping[str, Any]) -> dict[str, Tree]:
    return {
        row["model"]: {part: row[part]["rmse"] for part in ("train", "test")}
        | {"validation": row["validation_rmse"], "rank": row["test"]["rank"]}
        for row in task.get("rows", ())
    }


def cases() -> Iterator[Case]:
    """Yield the cases."""
    for place in ALONE:
        name = place.partition(".")[0].replace("/", "-")
        if sum(other.partition(".")[0] == name for other in ALONE) > 1:
            name = place.replace(".", "-")
        yield _case(name, place, {})
    for name, (place, options) in WHOLE.items():
        yield _case(name, place, options)
    said = "mckibben.write(recording, 'again.csv')"
    yield Case("files/round-trip-csv", said, round_trip)
    yield Case("files/split", "mckibben measured split --jobs 1 --json", split, {"*": 5e-3})


def _case(name: str, place: str, options: Options) -> Case:
    said = "".join(f", {key}={value!r}" for key, value in options.items())
    return Case(f"files/{name}", f"mckibben.read({place!r}{said})", partial(read, place, options))
