"""Rigs as files: round trips, and everything that may be wrong with them."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from mckibben import DataError
from mckibben.rigs import describe, load_rig, save_rig
from mckibben.system.ordinary import DESCRIPTION
from tests.refusals import refused

GOOD = describe(load_rig("mas20-hanging"))


WRONG: dict[str, tuple[object, ...]] = {
    "muscle.braid_angle": (90.0, 5.0, 60.0),
    "muscle.length": (0.0, -200.0, "long"),
    "muscle.c10": (-1.0, float("nan"), float("inf")),
    "muscle.wall": (15.0, 0.0),
    "muscle.friction.stiffness": ((-1.0,) * 6, (1.0,)),
    "muscle.friction.contracting": ((float("nan"),) * 6,),
    "muscle.creep.time": ((0.0, 1.0),),
    "air.valve_time": (0.0,),
    "air.polytropic": (2.0,),
    "payload": (-1.0, "heavy"),
    "sample_time": (0.0, None),
    "integration_step": (0.1,),
    "start.pressure": (7.0, float("nan")),
    "start.voltage": (1.0,),
    "range.pressure.low": (6.0,),
    "sensor": ({}, {"smell": {}}),
    "range": ({}, {"pressure": {}}),
    "version": (0, 1.5),
    "name": ("Mas 20", ""),
    # of which there are none
    "mass": (1.0,),
    "muscle.colour": (1.0,),
    "muscle.length.unit": (1.0,),
    "a.b.c": (1.0,),
}


@pytest.mark.parametrize("path", WRONG)
def test_impossible_and_unknown_parameters_are_refused_by_name(path: str) -> None:
    for value in WRONG[path]:
        with pytest.raises(DataError, match=path.split(".")[0]):
            load_rig("mas20-hanging").changed({path: value})


@pytest.mark.parametrize(
    ("text", "named"),
    [
        (b"", "format"),
        (b"time,pressure\n0,1\n", "TOML"),
        (b"a = " + b"[" * 5000, "TOML"),
        (b"\xff\xfe\x00" * 50, "text"),
        (b"#" * (DESCRIPTION + 1), "bytes"),
        (GOOD[: len(GOOD) // 2], "missing|TOML"),
        (GOOD.replace("format_version = 1", "format_version = 9"), "9"),
        (GOOD.replace('setup = "moving-end"', 'setup = "rocket"'), "rocket"),
        (GOOD.replace("wall =", "wal ="), "'muscle.wal'|'muscle.wall'"),
        (GOOD + "\n[engine]\npower = 3\n", "engine"),
        (GOOD.replace("length = 200.0", "length = nan"), "muscle.length"),
        (GOOD.replace("length = 200.0", 'length = "200 mm"'), "muscle.length"),
    ],
)
def test_a_wrong_file_is_refused_by_name(text: str | bytes, named: str, tmp_path: Path) -> None:
    file = tmp_path / "rig.toml"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    with refused(DataError, file=file) as told:
        load_rig(file)
    assert re.search(named, told.value.problem)


def test_names_of_no_rig_are_refused(tmp_path: Path) -> None:
    for wrong in ("mas30", tmp_path / "missing.toml"):
        with refused(DataError, names=wrong):
            load_rig(wrong)
    with refused(DataError, file=tmp_path / "rail.json"):
        save_rig(load_rig("rail"), tmp_path / "rail.json")
