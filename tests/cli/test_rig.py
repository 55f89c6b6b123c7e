"""mckibben rig: list, show, run, record, new."""

from __future__ import annotations

import json
from pathlib import Path

from mckibben.rigs import load_rig
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
