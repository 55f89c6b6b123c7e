"""Remedies are options that were tried; what the user states is not questioned."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mckibben
from mckibben.errors import DataError
from mckibben.files.request import Request
from tests.files.made import Cells, one, put, refused, several

N = 200
T = np.arange(N) / 50
P = 1.5 - 1.5 * np.cos(T)
Y = 8 * P

Options = dict[str, Any]

PLAIN = "t_s,p_bar,displacement_mm"
BRIDGED = {"gaps": "interpolate"}

QUESTIONS: dict[str, tuple[str, tuple[Cells, ...], Options]] = {
    "no unit": ("t_s,pressure,displacement_mm", (T, 100 * P, Y), {"units": {"pressure": "kPa"}}),
    "an unknown unit": ("t_s,p [qux],displacement_mm", (T, P, Y), {"units": {"pressure": "bar"}}),
    "a mass": ("t_s,p_bar,force [kg]", (T, P, Y), {"units": {"force": "kgf"}}),
    "whole seconds": ("t,p_bar,displacement_mm", (np.arange(N), P, Y), {"units": {"time": "s"}}),
    "milliseconds": ("t,p_bar,displacement_mm", (20 * np.arange(N), P, Y), {"units": {"time": "ms"}}),
    "a lost sample": (PLAIN, (T, P, [*Y[:9], "", *Y[10:]]), BRIDGED),
    "a lost row": (PLAIN, (np.delete(T, range(50, 60)), P[10:], Y[10:]), BRIDGED),
    "a word": (PLAIN, (T, P, [*Y[:5], "ERR", *Y[6:]]), BRIDGED),
    "rounded times": (PLAIN, (np.floor(T / 0.1) / 10, P, Y), {"sample_time": 0.02}),
    "two of one": ("t_s,p_bar,P [bar],x", (T, P, 2 * P, Y), {"columns": {"pressure": "p_bar"}}),
    "a misspelt column": ("t_s,p_bar,extension", (T, P, Y), {"columns": {"length": "extension"}}),
}  # fmt: skip


@pytest.mark.parametrize("case", QUESTIONS)
def test_a_remedy_is_given_as_options_which_work(case: str, tmp_path: Path) -> None:
    header, columns, answer = QUESTIONS[case]
    path = put(tmp_path / "run.csv", header, *columns)
    given = {"columns": {"length": "extensoin"}} if case == "a misspelt column" else {}
    error = refused(path, **given)
    assert answer in error.options
    for options in error.options:
        several(path, **{**given, **options})


def test_the_likely_unit_comes_first(tmp_path: Path) -> None:
    for step, unit in ((1, "s"), (20, "ms")):
        path = put(tmp_path / "run.csv", "t,p_bar,x_mm", step * np.arange(N), P, Y)
        assert refused(path).options[0] == {"units": {"time": unit}}


def test_a_unit_that_the_file_states_comes_before_those_it_may_be(tmp_path: Path) -> None:
    path = put(tmp_path / "run.csv", "t_s,p [psi],x_mm", T, 600 * P, Y)
    assert refused(path).options[0] == {"units": {"pressure": "psi"}}


def test_an_option_that_does_not_help_is_not_offered(tmp_path: Path) -> None:
    at_ends = [["", *Y[1:]][k] if k % 3 else "" for k in range(N)]  # no stretch is long enough
    path = put(tmp_path / "run.csv", "t_s,p_bar,displacement_mm", T, P, at_ends)
    error = refused(path)
    assert {"gaps": "split"} not in error.options
    assert {"gaps": "interpolate"} in error.options


def test_a_second_question_with_one_answer_is_answered_at_once(tmp_path: Path) -> None:
    path = put(tmp_path / "run.csv", "t_s,p_bar,force [kg]", np.floor(T / 0.1) / 10, P, Y)
    (options,) = refused(path).options
    assert options == {"units": {"force": "kgf"}, "sample_time": 0.02}
    assert one(path, **options)["force"] == pytest.approx(9.80665 * Y)


def test_a_unit_is_that_of_all_channels_that_are_numbered_alike(tmp_path: Path) -> None:
    path = put(
        tmp_path / "a.csv", "t_ms,p1,p2,p3,p4,displacement_mm", 20 * T * 50, *[100 * P] * 4, Y
    )
    (first, *_) = refused(path).options
    assert first == {"units": {f"pressure_{k}": "kPa" for k in (1, 2, 3, 4)}}
    found = one(path, **first)
    assert all(found[f"pressure_{k}"].max() == pytest.approx(P.max(), rel=1e-3) for k in (1, 4))


def test_an_option_without_a_value_takes_back_what_was_stated() -> None:
    request = Request(units={"contraction": "mm"}, rate=50.0)
    more = {"units": {"contraction": None, "displacement": "mm"}, "rate": None}
    assert request.changed(more) == Request(units={"displacement": "mm"})


def test_millimetres_stated_of_a_contraction_are_offered_as_a_displacement(tmp_path: Path) -> None:
    path = put(tmp_path / "run.csv", "t_s,p_bar,contraction", T, P, Y)
    (options,) = refused(path, units={"contraction": "mm"}).options
    assert options["units"] == {"displacement": "mm", "contraction": None}
    assert options["columns"] == {"displacement": "contraction"}


STATED: dict[str, tuple[str, Cells, Options, Cells]] = {
    "kilovolts of a dielectric elastomer": ("u", 2 * P, {"units": {"voltage": "kV"}}, 2000 * P),
    "30 kV, more than is usual": ("u", 10 * P, {"units": {"voltage": "kV"}}, 10_000 * P),
    "three bar below the atmosphere": ("p", -P, {"units": {"pressure": "bar"}}, -P),
    "hundred bar": ("p", 35 * P, {"units": {"pressure": "bar"}}, 35 * P),
    "a gain": ("p", P, {"calibration": {"pressure": (1e3, 0.0)}}, 1e3 * P),
    "a gain of what the file has": ("p_kPa", P, {"calibration": {"pressure": (2, 0)}}, P / 50),
    "bar under a header in millimetres": ("p_mm", P, {"units": {"pressure": "bar"}}, P),
}  # fmt: skip


@pytest.mark.parametrize("case", STATED)
def test_what_the_user_states_wins(case: str, tmp_path: Path) -> None:
    header, samples, options, right = STATED[case]
    path = put(tmp_path / "run.csv", f"t_s,{header},displacement_mm", T, samples, Y)
    found = one(path, **options)
    assert found["voltage" if "voltage" in found else "pressure"] == pytest.approx(right)


def test_statements_that_contradict_are_refused(tmp_path: Path) -> None:
    path = put(tmp_path / "run.csv", "t_s,p_bar,displacement_mm", T, P, Y)
    for options in (
        {"units": {"pressure": "kPa"}, "calibration": {"pressure": ("p", 1.0, 0.0, "bar")}},
        {"rate": 50.0, "sample_time": 0.01},
    ):
        with pytest.raises(DataError):
            mckibben.read(path, **options)
    assert refused(path, rate=10.0).options == ({"rate": None},)
