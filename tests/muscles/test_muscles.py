"""The library of identified muscles, and what it says of others."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mckibben import DataError, muscles
from mckibben.blocks.fields import rows
from mckibben.blocks.laws import wander
from mckibben.muscles import Sheet
from mckibben.muscles.library import FOLDER, described, load
from mckibben.muscles.prior import prior_of
from mckibben.muscles.traits import PLACES, traits
from mckibben.rigs import rig_names
from tests.refusals import refused

NAMES = [muscle.name for muscle in muscles.list()]
RAIL = load("rail")
OTHER = Sheet(
    diameter_mm=40.0,
    rest_length_mm=500.0,
    braid_angle_deg=RAIL.sheet.braid_angle_deg,
    max_pressure_bar=4.0,
    max_contraction=RAIL.sheet.max_contraction,
)
"""The rail's muscle, made larger."""


@pytest.mark.parametrize("name", NAMES)
def test_files_are_what_they_describe(name: str) -> None:
    text = (FOLDER / f"{name}.toml").read_text(encoding="utf-8")
    assert described(load(name)) == text
    assert muscles.show(name) == text


def test_virtual_muscles_are_those_of_the_rigs_and_marked() -> None:
    assert {muscle.name for muscle in muscles.list() if muscle.virtual} <= set(rig_names())


def test_traits_do_not_know_size() -> None:
    balance = replace(RAIL.balance, asymmetry=0.8, obstacles=((1.0, 30.0, 5.0, -1.0, 2.0, 4.0),))
    larger = muscles.scaled(balance, RAIL.sheet, OTHER)
    np.testing.assert_allclose(
        traits(larger, OTHER), traits(RAIL.balance, RAIL.sheet), rtol=0, atol=1e-9
    )
    again = muscles.scaled(larger, OTHER, RAIL.sheet)
    np.testing.assert_allclose(again.pack(), balance.pack(), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_a_muscle_of_another_size_moves_alike(name: str) -> None:
    """Displacements go with the stroke, forces with area and pressure, pressures with the highest."""
    muscle = load(name)
    balance = replace(muscle.balance, walls=(0.05,))
    larger = muscles.scaled(balance, muscle.sheet, OTHER)
    length = OTHER.stroke / muscle.sheet.stroke
    pressure = OTHER.max_pressure_bar / muscle.sheet.max_pressure_bar
    force = pressure * OTHER.area / muscle.sheet.area
    low, high = np.array([(0.1, 0.7), *((0.0, 0.3),) * balance.n_loads]).T
    shares = wander(low, high, np.random.default_rng(0), 8, 10)
    motion = shares * [muscle.sheet.stroke, *(muscle.sheet.force,) * balance.n_loads]
    sizes = [length, *(force,) * balance.n_loads]
    expected = pressure * balance.simulate(motion, sample_time=0.05)
    found = larger.simulate(sizes * motion, sample_time=0.05)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)


def test_braid_follows_from_the_largest_force_as_from_the_angle() -> None:
    by_angle = Sheet(diameter_mm=20.0, rest_length_mm=200.0, braid_angle_deg=25.0)
    by_force = Sheet(diameter_mm=20.0, rest_length_mm=200.0, max_force_N=by_angle.force)
    np.testing.assert_allclose(by_force.braid, by_angle.braid, rtol=1e-12)


def test_a_muscle_of_the_library_is_likely_itself_and_others_less_sure() -> None:
    known, told = prior_of("rail"), np.isfinite(RAIL.traits)
    far = prior_of("rail", without=("rail", "mas20-hanging", "dmsp20-150", "dmsp20-300"))
    away = np.abs(known.mean - RAIL.traits)[told], np.abs(far.mean - RAIL.traits)[told]
    assert np.median(away[0]) < 0.3 * np.median(away[1])
    assert all(known.levels[name] <= far.levels[name] for name in ("friction", "relaxation"))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("diameter_mm = 20.0\nrest_length_mm = 200.0", "max_force_N"),
        ("diameter_mm = 20.0\nbraid_angle_deg = 25.0", "rest_length_mm"),
        ("diameter_mm = 20.0\nrest_length_mm = 200.0\nbraid_angle_deg = 60.0", "braid_angle_deg"),
        ("diameter_mm = 20.0\nrest_length_mm = 200.0\nmax_force_N = 1e5", "max_force_N"),
        ("diameter_mm = 20.0\nrest_length_mm = 200.0\nbraid_angle_deg = 25.0\nx = 1", "x"),
        ("diameter_mm = ", "TOML"),
        (
            'diameter_mm = 20.0\nrest_length_mm = 200.0\nbraid_angle_deg = 25.0\nlike = "x"',
            "'x'",
        ),
        ('format = "mckibben-muscle"\nversion = 2', "sheet.toml"),
        ('format = "mckibben-muscle"\nversion = 1', "title"),
    ],
)
def test_bad_sheets_are_refused_by_what_is_wrong(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "sheet.toml"
    path.write_text(text, encoding="utf-8")
    with refused(DataError, names=said):
        prior_of(path)


def test_muscles_are_loaded_from_files_too(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    title = 'a "b" \\ \n\x1b\x7f ü'
    path.write_text(described(replace(RAIL, title=title)), encoding="utf-8")
    assert (load(path).balance, load(path).title) == (RAIL.balance, title)
    assert np.array_equal(prior_of(path).mean, prior_of("rail").mean, equal_nan=True)
    with refused(DataError, names="'nobody'"):
        load("nobody")


def test_a_muscle_of_ones_own_is_asked_as_those_of_the_library(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    own = replace(RAIL.balance, areas=rows((0.5 * np.array(RAIL.balance.areas)).tolist()))
    path.write_text(described(replace(RAIL, balance=own)), encoding="utf-8")
    area = PLACES["area"]
    asked, not_asked = prior_of(path).mean[area], prior_of(path, without=["own"]).mean[area]
    assert asked - load(path).traits[area] == pytest.approx(0.0, abs=0.5)
    assert not_asked - asked > 0.2
    path.write_text(path.read_text().replace("areas = [[", "areas = [[1"))
    assert load(path).balance != own  # as it is now, not as it was


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("offset = [", "set_off = [", "offset"),
        ("wall = [", "wall = [0.1, ", "wall"),
        ("damping = [0", "damping = [-0", "damping"),
        ("loads = [[1.0]]", "loads = [[0.0]]", "balance"),
        ("areas = [[", "areas = [[-", "balance.areas"),
        ('title = "', 'title = 1 # "', "title"),
        ("version = 1", "version = 1\na = " + "[" * 10_000, "TOML"),
        ("version = 1", "version = 1" + "0" * 5_000, "TOML"),
    ],
)
def test_bad_muscles_are_refused_by_what_is_wrong(
    tmp_path: Path, old: str, new: str, said: str
) -> None:
    text = described(RAIL)
    assert old in text
    (tmp_path / "bad.toml").write_text(text.replace(old, new, 1), encoding="utf-8")
    with refused(DataError, file=tmp_path / "bad.toml", names=said) as caught:
        prior_of(tmp_path / "bad.toml")
    assert str(caught.value).count("Remedy") == 1
