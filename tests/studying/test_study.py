"""A study: what it compares, how its inverse does, and on which rig its loop is closed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mckibben import GPI, PI, DataError, PiecewiseLinear, Recording, study
from mckibben.blocks.base import Block
from mckibben.blocks.fields import Channel
from mckibben.diagnosis.check import Validation
from mckibben.files import read, write
from mckibben.rigs import load_rig
from mckibben.signals import triangle
from mckibben.studying.inverting import check_inverse
from mckibben.studying.loops import closed_loops, named, recorded_rig

TIME = np.arange(0, 24, 0.02)


def recorded(u: np.ndarray) -> Recording:
    noise = 0.02 * np.random.default_rng(0).standard_normal(u.size)
    return Recording({"pressure": u, "displacement": GPI.example().simulate(u) + noise}, 0.02)


@pytest.fixture(scope="module")
def train() -> Recording:
    return recorded(triangle(TIME, 4.0, [5.0, 4.2, 3.4, 2.6, 1.8, 1.0]))


def test_predictions_are_those_that_were_scored(train: Recording) -> None:
    found = study(train, models=["pi"], jobs=1)
    (row,) = found.leaderboard.rows
    error = found.predictions["pi"][-1][:, 0] - train["displacement"]
    tail = error[len(found.train[0]) :]
    assert row.test is not None
    assert row.test.rmse == pytest.approx(float(np.sqrt(np.mean(tail**2))), rel=1e-12)


def test_check_and_leaderboard_have_one_mean_to_beat(train: Recording) -> None:
    found = study(train, models=["pi"], jobs=1)
    assert isinstance(found.check, Validation)
    assert found.leaderboard.constant is not None
    (one,) = found.check.outputs
    assert one.rmse == pytest.approx(found.leaderboard.rows[0].test_error)
    assert one.mean_error == pytest.approx(found.leaderboard.constant.test_error)
    assert not one.useless


@pytest.mark.parametrize("block", [PI.example(), GPI.example()], ids=lambda b: b.kind)
def test_inverse_check_covers_the_reachable_range(block: Block, train: Recording) -> None:
    check = check_inverse("it", block, train)
    assert check.error <= 1e-12
    assert check.reachable is not None
    low, high = check.reachable
    assert np.ptp(check.reference) > 0.9 * (high - low)
    assert np.all((check.pressure >= 0) & (check.pressure <= 5))


def test_inverse_check_keeps_the_units_of_other_channels(train: Recording) -> None:
    block = replace(
        PiecewiseLinear.example(), input=Channel("stroke", "mm"), output=Channel("pull", "N")
    )
    samples = {"stroke": train["displacement"], "pull": train["pressure"]}
    recording = Recording(samples, 0.02, units={"stroke": "mm", "pull": "N"})
    check = check_inverse("it", block, recording)
    assert check.own
    assert check.error <= 1e-12


@pytest.mark.parametrize(("driven", "closed"), [("voltage", True), ("pressure", False)])
def test_no_loop_tells_a_regulator_pressures_as_volts(
    driven: str, closed: bool, train: Recording
) -> None:
    model = replace(GPI.example(), input=Channel(driven, "V" if closed else "bar"))
    row = SimpleNamespace(model="gpi", inverse=model.inverse())
    board: Any = SimpleNamespace(rows=[row], outputs=("displacement",))
    assert bool(closed_loops(board, "gpi", load_rig("rail"), [train], 0)) is closed


@pytest.mark.parametrize("loads", [(0.0, 100.0), (None,)])
def test_a_load_that_is_told_is_no_loop_of_the_muscles(
    train: Recording, loads: tuple[float | None, ...]
) -> None:
    swung = 50 + 50 * np.sin(TIME)

    def under(load: float | None) -> Recording:
        force = swung if load is None else np.full(TIME.size, load)
        lifted = train["displacement"] - 0.1 * force
        return train.with_channels(
            {"displacement": "mm", "force": "N"}, displacement=lifted, force=force
        )

    runs = [under(load) for load in loads]
    plain = study(train, models=["pi"], jobs=1).characterization
    found = study(runs, load="force", models=["pi"], jobs=1).characterization
    assert plain is not None
    if loads == (None,):  # where the load is never constant, nothing is measured
        assert found is None
    else:
        assert found is not None
        assert found.loop_width == pytest.approx(plain.loop_width, rel=0.1)


def test_a_loop_is_closed_on_the_rig_as_it_was_changed(tmp_path: Path) -> None:
    stock = load_rig("mas20-hanging")
    heavy = stock.changed({"payload": 7.0, "muscle.friction.extending": [0.3, 0.7, 1, 1, 1, 0.8]})
    given = Recording({"pressure": np.linspace(0, 3, 20)}, 0.05)
    write(heavy.run(given), tmp_path / "run.csv")
    (run,) = read(tmp_path / "run.csv")
    rebuilt = recorded_rig([run, heavy.changed({"start.pressure": 1.0}).run(given)])
    assert rebuilt == heavy.changed({})
    assert rebuilt is not None
    assert named(rebuilt) == "mas20-hanging (changed: muscle.friction.extending, payload)"
    plain = recorded_rig([stock.run(given)])
    assert plain is not None
    assert named(plain) == "mas20-hanging"
    assert recorded_rig([given, given]) is None


@pytest.mark.parametrize(
    ("meta", "match"),
    [
        ({"rig": "rail v2 (virtual)"}, "rail"),
        ({"rig": "rail v0 (virtual)", "rig_changes": {}}, "rail v0"),
        ({"rig": "rail v2 (virtual)", "rig_changes": {"crane": 1}}, "crane"),
        ({}, "rig"),
    ],
)
def test_no_loop_is_closed_on_a_rig_that_is_not_known(meta: dict[str, Any], match: str) -> None:
    given = Recording({"voltage": np.linspace(0, 3, 20)}, 0.05)
    other = load_rig("rail").run(given)
    with pytest.raises(DataError, match=match):
        recorded_rig([given.with_meta(**meta), other])


def test_no_compensation_leaves_the_loop_of_the_model() -> None:
    """Read off the rising branch of one stop, falling references are off by its height: 2 r w."""
    weight, threshold = 4.0, 0.4
    model = PI((0.0, threshold), (2.0, weight), 0.0, (0.0, 5.0))
    t = np.arange(500) * 0.05
    recording = Recording({"pressure": 2.5 - 2.5 * np.cos(t)}, 0.05)
    found = check_inverse(
        "pi", model, model.simulate(recording).with_channels(pressure=recording["pressure"])
    )
    assert found.reachable is not None
    assert found.uncompensated_error is not None
    height = 2 * threshold * weight / (found.reachable[1] - found.reachable[0])
    assert found.error < 1e-9
    assert found.uncompensated_error == pytest.approx(height, rel=0.02)
