"""A study: what it compares, how its inverse does, and on which rig its loop is closed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mckibben import GPI, DataError, Recording, study
from mckibben.blocks.fields import Channel
from mckibben.control import UNCOMPENSATED
from mckibben.diagnosis.check import Validation
from mckibben.files import read, write
from mckibben.rigs import load_rig
from mckibben.signals import triangle
from mckibben.studying.study import closed_loops, recorded_rig, rig_title
from tests.blocks.balances import CROWDED
from tests.refusals import refused

TIME = np.arange(0, 24, 0.02)

OF_MUSCLES = ("elasticity", "areas", "friction", "relaxation", "damping", "lines", "walls", "given")
"""Fields of a balance with a part for every muscle."""


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


@pytest.mark.parametrize(("driven", "closed"), [("voltage", True), ("pressure", False)])
def test_no_loop_tells_a_regulator_pressures_as_volts(
    driven: str, closed: bool, train: Recording
) -> None:
    model = replace(GPI.example(), input=Channel(driven, "V" if closed else "bar"))
    row = SimpleNamespace(model="gpi", inverse=model.inverse())
    board: Any = SimpleNamespace(rows=[row], outputs=("displacement",))
    assert bool(closed_loops(board, "gpi", load_rig("rail"), [train], 0)) is closed


def test_a_loop_is_closed_with_more_pressures_than_motions() -> None:
    """No PID is tuned there: a pressure has no motion of its own."""
    joint = replace(
        CROWDED,
        springs=((0.0, 5.0),),
        loads=((1.0,),),
        scale=1.0,
        limits=(0.05, 0.2),
        hull=((-0.8, 0.8),) * 2,
        driven=(Channel("angle", "rad"),),
        scheduled=(Channel("torque", "N*m"),),
        directions=((1.0,), (-1.0,)),
        pressure_range=(0.0, 6.0),
        **{name: getattr(CROWDED, name)[:2] for name in OF_MUSCLES},
    )
    row = SimpleNamespace(model="balance", inverse=joint)
    board: Any = SimpleNamespace(rows=[row], outputs=("angle",))
    test = Recording({"angle": 0.2 * np.sin(TIME), "torque": np.zeros(TIME.size)}, 0.02)
    loops = closed_loops(board, "balance", load_rig("antagonistic-joint"), [test], 0)
    assert {*loops} == {UNCOMPENSATED, "balance inverse"}


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
    assert rig_title(rebuilt) == "mas20-hanging (changed: muscle.friction.extending, payload)"
    plain = recorded_rig([stock.run(given)])
    assert plain is not None
    assert rig_title(plain) == "mas20-hanging"
    assert recorded_rig([given, given]) is None


@pytest.mark.parametrize(
    ("meta", "fields"),
    [
        ({"rig": "rail v2 (virtual)"}, {"names": "rail"}),
        ({"rig": "rail v0 (virtual)", "rig_changes": {}}, {"names": "v0"}),
        ({"rig": "rail v2 (virtual)", "rig_changes": {"crane": 1}}, {"parameter": "crane"}),
        ({}, {"names": "rig"}),
    ],
)
def test_no_loop_is_closed_on_a_rig_that_is_not_known(
    meta: dict[str, Any], fields: dict[str, Any]
) -> None:
    given = Recording({"voltage": np.linspace(0, 3, 20)}, 0.05)
    other = load_rig("rail").run(given)
    with refused(DataError, **fields):
        recorded_rig([given.with_meta(**meta), other])
