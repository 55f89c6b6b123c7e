"""Files as rigs leave them are read rightly, or a remedy that was tried leads there in few steps."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mckibben
from mckibben.errors import DataError, DataWarning
from mckibben.options import merged
from mckibben.recording import Recording
from tests.files.odd import UNITS, Odd, odd

STEPS = 3
"""Remedies that may be needed, one after the other."""

TIMING = 0.05
"""Largest error, relative to the largest sample: rounded times and lost rows shift samples by one."""

PARTS = 20


class WrongError(AssertionError):
    """A wrong value, a wrong remedy, or a circle of remedies."""


def read(path: Path, options: Mapping[str, Any]) -> Recording:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)
        found = mckibben.read(path, **options)
    return max(found, key=len)


def is_true(options: Mapping[str, Any], file: Odd) -> bool:
    """Return whether options do not contradict what the person at the rig knows."""
    units, columns = file.facts["units"], file.facts["columns"]
    for channel, unit in options.get("units", {}).items():
        if channel in units and not np.isclose(
            UNITS[channel][units[channel]], UNITS[channel].get(unit, np.nan), rtol=1e-3
        ):
            return False
    for channel, column in options.get("columns", {}).items():
        header = columns.get(channel, file.facts["time"])
        if column not in (header, f"{header} (2)", f"column_{header}"):
            return False
    step = options.get("sample_time", file.sample_time)
    return bool(np.isclose(step, file.sample_time, rtol=1e-3)) and not options.get("raw")


def known(file: Odd, channel: str) -> dict[str, dict[str, str]]:
    """Return what the person at the rig states of a channel or a unit that no header names."""
    column = file.facts["columns"].get(channel, file.facts["time"])
    header = column if isinstance(column, str) else f"column_{column}"
    units = {} if channel == "time" else {"units": {channel: file.facts["units"][channel]}}
    return {"columns": {channel: header}, **units}


def followed(file: Odd) -> tuple[Recording | DataError, dict[str, Any]]:
    """Return what a file is read as if the remedies are followed, or the last refusal."""
    (path,) = file.paths
    options: dict[str, Any] = {}
    stated = 0
    for _ in range(STEPS + 2 + len(file.channels)):
        try:
            found = read(path, options)
        except DataError as error:
            if not error.options:
                return error, options
            right = [one for one in error.options if is_true(one, file)]
            wrong = [one for one in error.options if one not in right]
            if any(not one.keys() & {"units", "columns"} for one in wrong):  # others are questions
                raise WrongError(f"a remedy is wrong: {error}") from None
            if not right and "units" in error.options[0]:  # a question to the one at the rig
                units = {
                    c: file.facts["units"].get(c, u) for c, u in error.options[0]["units"].items()
                }
                right = [{**error.options[0], "units": units}]
            if not right:
                raise WrongError(f"no remedy is right: {error}") from None
            if stated >= STEPS:
                raise WrongError(f"after {stated} remedies: {error}") from None
            options, stated = merged(options, right[0]), stated + 1
            continue
        unsure = [channel for channel in file.channels if channel not in found]
        counted = "sample number" in file.about or file.facts["time"] is None
        if found.sample_time is None and not counted:
            unsure.append("time")
        stated_units = options.get("units", {})
        unsure += [
            c
            for c in found.meta.get("assumed_units", ())
            if c in set(file.channels) - set(stated_units)
        ]
        if not unsure:
            return found, options
        more = known(file, unsure[0])
        if merged(options, more) == options:
            raise WrongError(f"{unsure[0]} is left out")
        options = merged(options, more)
    raise WrongError("it goes in a circle")


def check(found: Recording, file: Odd) -> None:
    """Refuse samples that are not those of the file, at the right time from each other."""
    step = found.sample_time
    every = 1 if step is None else round(step / file.sample_time)
    if every < 1 or (step is not None and abs(step - every * file.sample_time) > 2e-3 * step):
        raise WrongError(f"the sample time is {step}, and not {file.sample_time}")
    channels = file.channels
    if step is None:  # nothing tells that rows were lost
        there = ~np.logical_and.reduce([np.isnan(x) for x in channels.values()])
        channels = {name: x[there] for name, x in channels.items()}
    n = len(found)
    rows = len(next(iter(channels.values())))
    best = np.inf
    for first in range(max(1, rows - every * (n - 1))):
        worst = 0.0
        for channel, truth in channels.items():
            there = truth[first : first + every * n : every]
            size = np.nanmax(np.abs(truth))
            off = np.abs(there - found[channel][: there.size]) / size
            worst = max(worst, float(np.nanmax(off, initial=0.0)))
        best = min(best, worst)
    if best > TIMING:
        raise WrongError(f"samples are wrong by {100 * best:.3g} %")


@pytest.mark.parametrize("part", range(PARTS))
def test_a_thousand_files_are_read_rightly_or_refused_with_what_helps(
    part: int, tmp_path: Path
) -> None:
    wrong, refused = [], 0
    for seed in range(part, 1000, PARTS):
        file = odd(seed, tmp_path)
        try:
            found, _ = followed(file)
            if isinstance(found, Recording):
                check(found, file)
            else:
                refused += 1
            if file.facts["plain"] and isinstance(found, DataError):
                raise WrongError(f"refused: {found}")
        except WrongError as error:
            wrong.append(f"{seed} ({file.about}): {error}")
    assert not wrong, "\n".join(wrong)
