"""Files as laboratories write them, of which the right answer was worked out in another way."""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import mckibben
from mckibben.errors import DataError, MckibbenError
from tests.golden.case import Case, Tree

FILES = Path(__file__).parents[1] / "files"

Options = Mapping[str, Any]

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


def cases() -> Iterator[Case]:
    """Yield the cases; right answers are worked out in another way, hence not equal to the bit."""
    for name, (place, options) in WRONG.items():
        said = "".join(f", {key}={value!r}" for key, value in options.items())
        call = f"mckibben.read({place!r}{said})"
        run = partial(seen, place, options, ONLY.get(name, ()))
        yield Case(f"files/right-{name}", call, run, {"*": 1e-12})
