"""A type checker finds wrong calls of every operation, and nothing in right ones."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from mckibben.workflow import OPERATIONS

HEAD = """
import mckibben
from mckibben.options import ReadOptions
path: str = "run.csv"
"""

ARGUMENTS = {
    "fit": '"pi", path',
    "check": '"model.json", path',
    "calibrate": '"model.json", path',
    "simulate": '"model.json", path',
    "invert": '"model.json"',
    "track": '"model.json", path',
    "learn": '"model.json", path',
    "export": '"model.json", "out"',
    "reproduce": '"field-models"',
    "plan": "",
}
"""What an operation is called with; others with a path."""

RIGHT = {
    "fit": 'input="pressure", output=["displacement"], settings={"n_operators": 5}, rate=50.0',
    "characterize": 'input="pressure", scheduling=["force"]',
    "compare": 'models="pi,gpi", jobs=1, between=(1.0, 2.0)',
    "study": 'models=("pi",), title="A title", units={"pressure": "kPa"}',
    "check": 'resample=0.1, reading=ReadOptions(rate=50.0), out="out", force=True',
    "calibrate": 'exchangeable="run", fitted=path',
    "simulate": 'initial="virgin", interval=0.9',
    "invert": 'wanted="input", adaptive=True, time=3.0, learned=[path]',
    "track": 'plant="model.json", controller="pid", slew=1.0, limits={"pressure": (0.0, 6.0)}',
    "learn": "ahead=2, best=True",
    "review": 'compensator="model.json", refit=False',
    "plan": "minutes=1.0, seed=3",
    "plot": "kind=None, width=2",
    "info": 'input="pressure"',
    "data_gaps": 'output="displacement", tests=path',
    "export": 'target="fmu", library=False, inverse=True',
    "reproduce": "quick=True, seed=1, jobs=2",
}

WRONG = {
    "fit": 'settings=["n_operators"]',
    "characterize": "scheduling=3",
    "compare": "jobs=1.5",
    "study": "title=7",
    "check": 'resample="often"',
    "calibrate": 'exchangeable="runs"',
    "simulate": 'interval="0.9"',
    "invert": 'wanted="pressure"',
    "track": 'slew="fast"',
    "learn": 'ahead="2"',
    "review": 'refit="no"',
    "plan": 'minutes="three"',
    "plot": "width=3",
    "info": "input=3",
    "data_gaps": "output=3",
    "export": 'target="cpp"',
    "reproduce": 'quick="yes"',
}
"""Values of another type, each of an option of the operation's own."""


def call(name: str, options: str) -> str:
    inside = ", ".join(filter(None, (ARGUMENTS.get(name, "path"), options)))
    return f"mckibben.{name}({inside})"


@pytest.mark.long
def test_wrong_calls_are_found_and_right_ones_are_not(tmp_path: Path) -> None:
    assert set(OPERATIONS) <= set(RIGHT)
    assert RIGHT.keys() == WRONG.keys()
    right = [call(name, options) for name, options in RIGHT.items()]
    wrong = [call(name, options) for name, options in WRONG.items()]
    wrong += [call(name, "no_such_option=1") for name in WRONG]
    wrong += [call(name, 'between="1:2"') for name in WRONG if name != "export"]
    wrong += [
        "mckibben.fit(path)",
        "mckibben.invert(3)",
        "mckibben.load(3)",
        "mckibben.reads(path)",
    ]
    lines = [*HEAD.splitlines(), *right, *wrong]
    file = tmp_path / "calls.py"
    file.write_text("\n".join(lines) + "\n")
    command = [sys.executable, "-m", "mypy", "--strict", "--no-error-summary", file.name]
    ran = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    found = {int(one) for one in re.findall(r"calls\.py:(\d+): error", ran.stdout)}
    of_text = dict(enumerate(lines, start=1))
    first_wrong = len(lines) - len(wrong) + 1
    assert [of_text[k] for k in sorted(found) if k < first_wrong] == [], ran.stdout
    assert [of_text[k] for k in range(first_wrong, len(lines) + 1) if k not in found] == []
