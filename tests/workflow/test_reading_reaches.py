"""Every option of reading is applied or refused, whatever the data are, by every operation."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mckibben import MckibbenError, Recording, read
from mckibben.keywords import ReadKeywords
from mckibben.options import ReadOptions
from tests.golden.commands import call as command
from tests.workflow.calls import CALLS, COMMANDS, Use, outcome, prepare, typed

TIME = np.arange(60) * 0.02
COLUMNS = {
    "time [s]": TIME,
    "pressure [bar]": 2.0 + np.sin(8 * TIME),
    "displacement [mm]": 7.0 + 3.0 * np.cos(5 * TIME),
    "other [bar]": 3.0 + np.sin(9 * TIME) ** 2,
    "force [N]": 40.0 + np.cos(3 * TIME),
}

VALUES: dict[str, Use] = {
    "columns": Use({"pressure": "other"}),
    "units": Use({"pressure": "kPa"}),
    "constants": Use({"temperature": (21.0, "degC")}),
    "calibration": Use({"displacement": (-1.0, 2.0)}),
    "rate": Use(25.0),
    "sample_time": Use(0.04),
    "gaps": Use("interpolate"),
    "raw": Use(True),
    "rest_length": Use(150.0),
    "header": Use(2),
    "skip": Use(3),
    "encoding": Use("cp037"),
    "sheet": Use("Data"),
    "join": Use(True),
    "between": Use((0.2, 0.8)),
    "resample": Use(0.04),
    "zero": Use(("displacement",)),
}
"""Option -> a value that changes the recordings, or that is refused."""


def columns(option: str) -> dict[str, np.ndarray]:
    """Return columns on which an option has an effect: without times, with a gap, or with codes."""
    found = {name: values.copy() for name, values in COLUMNS.items()}
    if option in ("rate", "sample_time"):
        del found["time [s]"]
    if option == "gaps":
        found["displacement [mm]"][30:32] = np.nan
    if option == "raw":
        found["displacement [mm]"][30:32] = -9999.0
    return found


def as_file(found: dict[str, np.ndarray], folder: Path) -> Any:
    rows = np.column_stack([*found.values()])
    lines = [",".join("" if np.isnan(x) else repr(float(x)) for x in row) for row in rows]
    path = folder / "data.csv"
    path.write_text("\n".join([",".join(found), *lines]) + "\n")
    return path


def as_frame(found: dict[str, np.ndarray], folder: Path) -> Any:
    import pandas as pd

    return pd.DataFrame(found)


def as_arrays(found: dict[str, np.ndarray], folder: Path) -> Any:
    return found


def as_recording(found: dict[str, np.ndarray], folder: Path) -> Any:
    channels = {name.partition(" ")[0]: values for name, values in found.items()}
    step = 0.02 if channels.pop("time", None) is not None else None
    return Recording(channels, step, {"other": "bar"})


def numbers(data: Any, **given: Any) -> Any:
    """Return everything about recordings but notes; or the refusal."""
    try:
        found = read(data, **given)
    except MckibbenError as error:
        return error
    return [
        (one.sample_time, one.start_time, dict(one.units), one.meta.get("rest_length"),
         {name: values.tolist() for name, values in one.channels.items()})
        for one in found
    ]  # fmt: skip


def test_every_option_of_reading_has_a_value() -> None:
    assert {one.name for one in fields(ReadOptions)} == VALUES.keys()
    assert set(ReadKeywords.__annotations__) == VALUES.keys()


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("made", [as_file, as_frame, as_arrays, as_recording])
@pytest.mark.parametrize("option", VALUES)
def test_it_is_applied_or_refused(
    option: str, made: Callable[[dict[str, np.ndarray], Path], Any], tmp_path: Path
) -> None:
    try:
        data = made(columns(option), tmp_path)
    except MckibbenError:
        pytest.skip("there is no such recording")
    without, found = numbers(data), numbers(data, **{option: VALUES[option].value})
    if isinstance(found, MckibbenError):
        assert option in str(found) or made is as_file, found
    as_it_is = option == "raw" and made is as_recording  # which is read as measured anyway
    as_it_is |= option == "join"  # of one recording
    assert (repr(found) != repr(without)) is not as_it_is


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_numbers_are_the_same_wherever_they_are(tmp_path: Path) -> None:
    for option in ("columns", "units", "constants", "calibration", "rest_length", "between",
                   "resample", "zero", "rate", "sample_time"):  # fmt: skip
        given = {option: VALUES[option].value}
        places = [made(columns(option), tmp_path) for made in (as_file, as_frame, as_arrays)]
        first, *others = (numbers(place, **given) for place in places)
        assert all(repr(one) == repr(first) for one in others), option


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    place = tmp_path_factory.mktemp("reading")
    prepare(place)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(place)
        yield place


OF_OPERATIONS: dict[str, Any] = {"between": (0.5, 3.5), "resample": 0.04, "units": {"angle": "kPa"}}
READERS = [name for name in CALLS if not name.startswith("export") and name not in
           ("invert", "reproduce", "plan", "track")]  # fmt: skip


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("name", READERS)
def test_every_operation_that_reads_applies_it(folder: Path, name: str) -> None:
    call = CALLS[name]
    spy = {"study": "mckibben.studying.study:plan_of"}.get(name, "")
    for option in ("between", "resample"):
        use = Use(OF_OPERATIONS[option], spy=spy)
        without, found = outcome(call, use), outcome(call, use, {option: use.value})
        assert repr(found) != repr(without), option
    wrong = outcome(call, None, {"units": {"displacement": "kPa"}})
    assert isinstance(wrong, MckibbenError), wrong
    if name in COMMANDS:
        use = Use({"displacement": "kPa"})
        result = command(*typed(name, use, {"units": use.value}), "--json")
        assert result.code == 2, result
