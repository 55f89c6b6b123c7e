"""mckibben rig: list, show, run, record, new."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mckibben import read
from mckibben.rigs import load_rig, rig_names
from mckibben.studying.rig_runs import at_first_commands, commands
from tests.cli.conftest import Cli
from tests.refusals import mentions


def test_what_show_prints_is_a_rig(cli: Cli, tmp_path: Path) -> None:
    shown = cli("rig", "show", "soft-arm")
    mine = tmp_path / "mine.toml"
    mine.write_text(shown.out.replace("disc_mass = 0.8", "disc_mass = 1.5"), encoding="utf-8")
    assert load_rig(mine) == load_rig("soft-arm").changed({"disc_mass": 1.5})
    assert json.loads(cli("rig", "show", str(mine), "--json").out)["disc_mass"] == 1.5


def test_run_takes_commands_from_a_recording_and_reports_saturation(
    cli: Cli, tmp_path: Path
) -> None:
    given, out = tmp_path / "given.csv", tmp_path / "run.csv"
    rows = "\n".join(f"{0.01 * i:.2f},{0.05 * i:.2f},0" for i in range(200))
    given.write_text(f"time,pressure,displacement\n{rows}\n", encoding="utf-8")
    result = cli("rig", "run", "mas20-hanging", "--inputs", given, "-o", out, "--json")
    assert result.code == 0, result.err
    assert json.loads(result.out)["saturated"] == {"pressure": 79}
    assert mentions(result.err, (79, 200))


@pytest.mark.parametrize("name", rig_names())
def test_a_signal_covers_by_default_the_range_of_the_channel_that_it_drives(name: str) -> None:
    rig = load_rig(name)
    for channel in rig.inputs:
        limits = rig.limits(channel)
        for signal in ("triangle:period=2", "random-wave:max-frequency=1", "binary-steps"):
            samples = commands(rig, [f"{channel}={signal}"], 8.0, 50.0, 0)[channel]
            assert samples.min() == pytest.approx(limits.low)
            assert samples.max() == pytest.approx(limits.high)


@pytest.mark.parametrize(
    ("flags", "changes", "rate", "seed", "ideal"),
    [
        ((), {}, None, 0, False),
        (("--seed", 3), {}, None, 3, False),
        (("--ideal",), {}, None, 0, True),
        (("--rate", 50), {}, 50.0, 0, False),
        (("--set", "payload=12", "--seed", 4), {"payload": 12.0}, None, 4, False),
    ],
)
def test_run_writes_what_the_rig_returns(
    cli: Cli,
    tmp_path: Path,
    flags: tuple[Any, ...],
    changes: dict[str, float],
    rate: float | None,
    seed: int,
    ideal: bool,
) -> None:
    out, signal = tmp_path / "run.csv", "random-wave:max-frequency=1"
    driven = "--signal", signal, "--duration", 2
    result = cli("rig", "run", "mas20-hanging", *driven, "-o", out, *flags)
    assert result.code == 0, result.err
    rig = load_rig("mas20-hanging").changed(changes)
    given = commands(rig, [signal], 2.0, rate, seed)
    expected = at_first_commands(rig, given).run(given, seed, ideal=ideal)
    (found,) = read(out)
    assert found.channels.keys() == expected.channels.keys()
    for name, samples in expected.channels.items():
        assert np.array_equal(found[name], samples), name


def test_record_writes_runs_and_what_each_is_for(cli: Cli, tmp_path: Path) -> None:
    result = cli("rig", "record", "field-models", "--out", tmp_path / "set")
    assert result.code == 0, result.err
    said = json.loads((tmp_path / "set" / "protocol.json").read_text())
    assert [(run["file"], run["role"]) for run in said["runs"]] == [
        ("decaying-triangle.csv", "train"),
        ("irregular-triangle.csv", "test"),
    ]
    first = tmp_path / "set" / "decaying-triangle.csv"
    stamp = first.stat().st_mtime_ns
    (tmp_path / "set" / "irregular-triangle.csv").unlink()
    again = cli("rig", "record", "field-models", "--out", tmp_path / "set", "--json")
    assert json.loads(again.out)["recorded"] == ["irregular-triangle"]
    assert first.stat().st_mtime_ns == stamp
    other = cli("rig", "record", "field-models", "--out", tmp_path / "set", "--seed", 2)
    assert other.code == 2
    assert "protocol.json" in other.err
    assert first.stat().st_mtime_ns == stamp
