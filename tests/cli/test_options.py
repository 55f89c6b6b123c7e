"""Values that no option can have, for every option of every command; names that terminals obey."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import click
import pytest

import mckibben
from mckibben.cli.parameters import named_models
from tests.cli.calls import CALLS, commands, files
from tests.cli.conftest import Cli
from tests.golden.commands import answered

WHOLE = ["-1", "99999999999999999999", "-99999999999999999999", "1e3", "nan", ""]
NUMBERS = ["nan", "inf", "-inf", "1e999", "-1", "1e300", ""]
WORDS = ["", " "]
SETTINGS = [
    "=",
    "a=",
    "=b",
    "n_operators=1e999",
    "n_operators=nan",
    "n_operators=99999999999999999999",
]

HARMLESS = {
    ("study", "--samples", "99999999999999999999"),
    ("compare", "--samples", "99999999999999999999"),
    *(
        ("invert", name, value)
        for name in ("--rate", "--rest-length", "--resample")
        for value in NUMBERS
    ),
    *(("invert", name, value) for name in ("--header", "--skip") for value in WHOLE[:3]),
    *(("invert", "--encoding", value) for value in WORDS),
    ("track", "--slew", "1e300"),
    ("export c", "--sample-time", "1e300"),
    ("export fmu", "--sample-time", "1e300"),
    ("export ros2", "--sample-time", "1e300"),
}
"""Strange, and no error."""

OTHERS = {("app", "--port")}
"""Of the workbench, which has tests of its own."""


def options() -> Iterator[tuple[str, str, tuple[str, ...], str]]:
    """Yield every option that takes a value: its command, name, spellings and type."""
    for path, command in commands():
        for option in command.params:
            if isinstance(option, click.Option) and not option.is_flag:
                yield path, option.opts[-1], tuple(option.opts), option.type.name


def hostile(name: str, kind: str) -> list[str]:
    if name == "--set":
        return SETTINGS
    return {"integer": WHOLE, "float": NUMBERS}.get(kind, WORDS)


CASES = [
    (command, name, spellings, value)
    for command, name, spellings, kind in options()
    for value in hostile(name, kind)
    if (command, name, value) not in HARMLESS and (command, name) not in OTHERS
]


def test_every_command_is_attacked() -> None:
    assert {command for command, *_ in options()} <= set(CALLS)
    assert len(CASES) > 300


@pytest.mark.long
@pytest.mark.parametrize("command", CALLS)
def test_what_no_option_can_be_is_refused_in_words(
    cli: Cli, command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    files(tmp_path)
    before = sorted(tmp_path.iterdir())
    for name, spellings, value in [case[1:] for case in CASES if case[0] == command]:
        words = list(CALLS[command].words)
        for spelling in spellings:  # instead of what works
            if spelling in words:
                place = words.index(spelling)
                del words[place : place + 2]
        result = cli(*command.split(), *words, name, value)
        case = (command, name, value, result.err)
        assert result.code == 2, case
        assert result.err.strip(), case
        assert "Traceback" not in result.err, case
    assert not [path for path in tmp_path.iterdir() if path not in before and path.is_file()]


ESCAPE = "\x1b]0;owned\x07\x1b[2J\x9b31m\u202e"


def test_names_do_not_reach_the_terminal_raw(
    cli: Cli, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    hostile = f"run{ESCAPE}.csv"
    Path(hostile).write_text("pressure,displacement\n1,2\n2,4\n3,x\n")
    Path(f"{ESCAPE}.json").write_text(f'{{"format": "{ESCAPE.encode("unicode_escape").decode()}"}}')
    header = f"pres{ESCAPE}[bar]"
    Path("header.csv").write_text(
        f"time,{header},y\n" + "".join(f"{k},{k},{k}\n" for k in range(9))
    )
    Path("run.csv").write_text("time,pressure,displacement\n0,1,2\n1,2,4\n2,3,6\n")
    calls = [
        ["info", hostile],
        ["info", f"{ESCAPE}.json"],
        ["info", "header.csv"],
        ["info", "header.csv", "--json"],
        ["characterize", "header.csv", "--input", ESCAPE],
        ["fit", ESCAPE, "run.csv", "-o", "out.json"],
        ["plot", "run.csv", "-o", f"{ESCAPE}.png"],
        ["info", "run.csv", ESCAPE],
        [ESCAPE],
        ["info", f"--{ESCAPE}"],
        ["rig", "show", ESCAPE],
        ["rig", "run", "rail", "--signal", ESCAPE, "-o", "out.csv"],
    ]
    for words in calls:
        result = cli(*words)
        said = result.out + result.err
        assert said.strip(), words
        assert result.code != 1, words
        assert "MCKIBBEN_DEBUG" not in said, words
        assert not set(ESCAPE) & set(said) - set("]0;owned[2J31m"), (words, said)


def test_raw_volts_are_calibrated(cli: Cli, tmp_path: Path) -> None:
    rows = "".join(f"{k / 50},{1 + k % 9},{k % 7}\n" for k in range(40))
    path = tmp_path / "raw.csv"
    path.write_text("t_s,A0,x_mm\n" + rows)
    found = answered("info", path, "--calibrate", "pressure=A0:2.5:-0.5:psi")
    pressure = found["recordings"][0]["channels"]["pressure"]
    assert (pressure["unit"], pressure["max"]) == ("bar", pytest.approx(22.0 * 0.0689475729))
    for option in (
        "--calibrate=pressure=A0:2.5",
        "--calibrate=A0:1:2:bar",
    ):
        path.write_text("t_s,A0,x_mm\n" + 9 * rows)
        assert cli("info", path, option).code == 2


def test_the_package_runs_as_a_module() -> None:
    command = [sys.executable, "-m", "mckibben", "--version"]
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stdout.strip()) == (0, mckibben.__version__)


def test_models_that_are_named_are_not_replaced_by_the_quick_choice() -> None:
    assert named_models(("pi", "gpi"), quick=True) == ("pi", "gpi")
    assert named_models("all", quick=True) == "quick"
    assert named_models("all", quick=False) == "all"
