"""Files that are, or were, read wrongly: each case holds the right answer.

The right answers were worked out from the numbers that the inputs were made of, never by the package.
What is right is a part of what there is to see: samples, units and step, or which channel is
refused; words and numbers of notes are open.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import mckibben
from mckibben.errors import DataError
from tests.golden.case import Case, Tree
from tests.golden.rooms.files import FILES, Options, caught

WRONG: Mapping[str, tuple[str, Options]] = {
    "kpa-called-bar": ("wrong/kpa-called-bar.csv", {}),
    "bar-called-mpa": ("wrong/bar-called-mpa.csv", {}),
    "psi-called-bar": ("wrong/psi-called-bar.csv", {}),
    "ms-of-a-column": ("wrong/ms.csv", {"columns": {"time": "stamp"}}),
    "ms-of-a-matrix": ("wrong/ms.mat", {
        "columns": {"time": "data[1]", "pressure": "data[2]", "displacement": "data[3]"}}),
    "titles": ("wrong/titles.csv", {}),
    "titles-of-two-cells": ("wrong/titles.xlsx", {}),
    "shift-jis": ("wrong/shift-jis.csv", {}),
    "japanese-utf-8": ("wrong/japanese.csv", {}),
    "bara": ("wrong/bara.csv", {}),
    "psia": ("wrong/psia.csv", {}),
    "unit-row-denies-header": ("wrong/unit-row.csv", {}),
    "units-in-cells": ("wrong/units-in-cells.csv", {}),
    "hexadecimal": ("wrong/hexadecimal.csv", {}),
    "minus-sign": ("wrong/minus-sign.csv", {}),
    "zeros-for-missing": ("wrong/zeros.csv", {}),
    "wrap-of-16-bits": ("wrong/wrap.csv", {}),
    "wrap-of-signed-16-bits": ("wrong/wrap-signed.csv", {}),
    "sentinels-in-a-row": ("wrong/sentinels.csv", {}),
    "sentinel-in-few-samples": ("wrong/sentinel-few.csv", {}),
    "all-missing": ("wrong/all-missing.csv", {}),
    "tables-beside-recording": ("wrong/case-01.mat", {}),
    "tables-beside-recording-named": ("wrong/case-01.mat", {
        "columns": {"angle": "thf", "force": "M1"}, "rate": 1000.0}),
    "struct-array": ("wrong/case-03.mat", {}),
    "struct-a-signal": ("wrong/case-03b.mat", {}),
    "servos": ("wrong/case-09.csv", {
        "columns": {"time": "timestamp", "reference": "target pos (1)", "position": "pos (1)"},
        "units": {"time": "s"}}),
    **{f"piezo-{i}": (f"wrong/case-11-{i}.csv", {}) for i in range(1, 9)},
}  # fmt: skip
"""Case -> the input and options of `mckibben.read`."""

ONLY = {"servos": ("reference", "position")}
"""Case -> the channels of which the right answer is known; all by default."""


def seen(place: str, options: Options, only: tuple[str, ...], folder: Path) -> Tree:
    """Read an input, and return what the right answer says something of."""
    found, refused, issued = caught(lambda: mckibben.read(FILES / place, **options))
    if refused is not None:
        return refusal(refused)
    return {"recordings": [_told(each, only, issued) for each in found]}


def refusal(error: Exception) -> Tree:
    """Return which channel is refused; the row may be any of those that show it."""
    told = {"class": type(error).__name__}
    if isinstance(error, DataError):
        told["channel"] = str(error.channel)
    return {"refused": told}


def _told(recording: mckibben.Recording, only: tuple[str, ...], issued: Mapping[str, int]) -> Tree:
    names = only or tuple(recording.channels)
    told: dict[str, Any] = {
        "channels": {name: recording.channels.get(name) for name in names},
        "units": {name: recording.units.get(name) for name in names},
        "sample_time": recording.sample_time,
    }
    reference = recording.meta.get("pressure_reference", {})
    if "absolute" in reference.values():
        told |= {"reference": dict(reference), "warned": issued.get("DataWarning", 0) > 0}
    return told


def cases() -> Iterator[Case]:
    """Yield the cases; right answers are worked out in another way, hence not equal to the bit."""
    for name, (place, options) in WRONG.items():
        said = "".join(f", {key}={value!r}" for key, value in options.items())
        call = f"mckibben.read({place!r}{said})"
        run = partial(seen, place, options, ONLY.get(name, ()))
        yield Case(f"files/right-{name}", call, run, {"*": 1e-12})
