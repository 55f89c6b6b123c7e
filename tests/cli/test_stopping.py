"""Ctrl-C sent to the real commands at random moments: what is finished is kept, and goes on."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mckibben import GPI, Recording, write
from mckibben.signals import irregular_triangle, triangle

STOPS = 2

PROMPT = 20.0
"""Within which a command stops [s]: that it does not hang."""

MODELS = "pi,maxwell-slip,mpi,p1,bouc-wen"


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("recordings")
    time_ = np.arange(0, 60, 0.05)
    paths = []
    for name, u in (
        ("train", triangle(time_, 4.0, [5.0, 4.2, 3.4, 2.6, 1.8, 1.0])),
        ("test", irregular_triangle(time_, 12, 5.0, seed=3)),
    ):
        y = GPI.example().simulate(u) + 0.02 * np.random.default_rng(0).standard_normal(u.size)
        paths.append(folder / f"{name}.csv")
        write(Recording({"pressure": u, "displacement": y}, 0.05), paths[-1])
    return paths[0], paths[1]


def begin(*words: str | Path) -> subprocess.Popen[str]:
    program = "from mckibben.cli.entry import run; run()"
    return subprocess.Popen(
        [sys.executable, "-c", program, *map(str, words)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # a shell's & ignores it
    )


def stopped(moment: float, *words: str | Path) -> tuple[int, str, float]:
    """Send Ctrl-C as a terminal does, to all processes of the command, after so many seconds."""
    process = begin(*words)
    time.sleep(moment)
    started = time.monotonic()
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGINT)
    said = process.communicate(timeout=60)[1]
    return process.returncode, said, time.monotonic() - started


def on_board(folder: Path) -> dict[str, dict[str, Any]]:
    """Return the rows of the leaderboard's models on disk, by model."""
    path = folder / "leaderboard.json"
    rows = json.loads(path.read_text())["rows"] if path.exists() else []
    return {row["model"]: row for row in rows if row["status"] != "baseline"}


def kept(folder: Path) -> dict[Path, int]:
    """Return the files of what is finished, and when each was written."""
    found = (folder / "unfinished").rglob("*.*")
    return {path: path.stat().st_mtime_ns for path in found if path.is_file()}


def check_stopped(code: int, said: str, took: float) -> None:
    assert code == 130, said
    assert "Traceback" not in said
    assert took < PROMPT


@pytest.mark.long
def test_a_stopped_comparison_keeps_what_is_finished_and_goes_on(
    recordings: tuple[Path, Path], tmp_path: Path
) -> None:
    train, test = recordings
    rng = np.random.default_rng(0)
    whole = time.monotonic()
    words = ("compare", train, "--test", test, "--models", MODELS, "--jobs", "2")
    process = begin(*words, "-o", tmp_path / "first")
    process.communicate()
    whole = time.monotonic() - whole
    assert process.returncode == 0
    for round_ in range(STOPS):
        folder = tmp_path / str(round_)
        code, said, took = stopped(float(rng.uniform(0.5, whole)), *words, "-o", folder)
        if code != 0:
            check_stopped(code, said, took)
            assert not list(folder.rglob("*.part"))
            announced = on_board(folder)
            names = {path.name.rsplit("-", 1)[0] for path in kept(folder)}
            assert set(announced) <= names
            process = begin(*words, "-o", folder)
            process.communicate()
            assert process.returncode == 0
            for model, row in announced.items():  # seconds are never the same twice
                assert on_board(folder)[model]["fit_seconds"] == row["fit_seconds"]
        assert set(on_board(folder)) == set(MODELS.split(","))
        assert json.loads((folder / "leaderboard.json").read_text())["pending"] == []
        assert not (folder / "unfinished").exists()
