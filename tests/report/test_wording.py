"""Numbers as they are written, and the commands that repeat a study."""

from __future__ import annotations

import shlex
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mckibben.report.commands import Typed, commands
from mckibben.report.wording import duration, number, percent
from tests.report.studies_by_hand import measured, models, study


@given(st.floats(-1e300, 1e300), st.integers(1, 6))
def test_numbers_keep_their_digits(value: float, digits: int) -> None:
    read = float(number(value, digits).replace("−", "-"))
    assert read == pytest.approx(value, rel=0.5000001 * 10 ** (1 - digits), abs=5e-324)


def test_what_is_not_a_number_is_a_dash_and_shares_are_percentages() -> None:
    assert {number(value) for value in (None, float("nan"), float("inf"))} == {"–"}
    assert (percent(0.5), percent(1.0, 3), percent(None)) == ("50 %", "100 %", "–")


@pytest.mark.parametrize(("step", "numbers"), [(0.01, "1.00 100"), (4.0, "400 4.00"), (None, "")])
def test_durations_are_given_with_and_without_time(step: float | None, numbers: str) -> None:
    words = duration(measured(101, sample_time=step)).split()
    found = [word for word in words if word.replace(".", "").isdigit()]
    assert found == ["101", *numbers.split()]


def test_commands_are_quoted_and_name_every_file_once() -> None:
    whole = measured(200, file="my data/run 1.csv")
    other = measured(200, seed=1, file="$(rm).csv", name="other")
    (again, *_) = (line for _, line in commands(study((whole.slice(0, 150),), (whole,))))
    words = shlex.split(again)
    assert words[:3] == ["mckibben", "study", "my data/run 1.csv"]
    assert words.count("my data/run 1.csv") == 1
    again, fit, *_ = (line for _, line in commands(study((whole,), (other,))))
    words = shlex.split(again)
    assert words[words.index("--test") + 1] == "$(rm).csv"
    assert words[words.index("--models") + 1] == "eupi,gpi,mpi,pi,rdpi"
    assert shlex.split(fit)[:4] == ["mckibben", "fit", "gpi", "my data/run 1.csv"]


def test_a_study_is_repeated_as_it_was_typed_and_what_is_to_come_is_asked_for() -> None:
    typed = ["study", "a b.csv", "--column", "pressure=P (1)", "--zero", "displacement"]
    again, fit, *_ = (line for _, line in commands(study(), Typed(typed, typed[2:4])))
    assert shlex.split(again) == ["mckibben", *typed]
    assert "pressure=P (1)" in shlex.split(fit)
    found = study(inverse=False, blocks=models())
    assert not any("inverse.json" in line for _, line in commands(found))
    unfinished = replace(found, leaderboard=replace(found.leaderboard, pending=("cpi",)))
    assert "cpi" in commands(unfinished)[0][1]
