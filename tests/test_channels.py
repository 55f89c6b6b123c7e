"""What drives and what is moved: of names as people give them, and of nothing but units."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mckibben import Recording, characterize, registry, workflow
from mckibben.channels import Channels, by_name, channels_of, varies
from mckibben.comparison.planning import plan_of
from mckibben.diagnosis.data_gaps import excitation
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.core.estimator import Estimator

T = np.linspace(0.0, 9.0, 50)
PAIR = ("pressure",), ("displacement",)


def run(*channels: str, held: tuple[str, ...] = (), **units: str) -> Recording:
    samples = {
        name: np.full(50, 3.0) if name in held else np.sin(T + k) for k, name in enumerate(channels)
    }
    return Recording(samples, 0.1, units=units)


@pytest.mark.parametrize(
    ("channels", "inputs", "outputs"),
    [
        ("pressure displacement", "pressure", "displacement"),
        ("level voltage pressure displacement", "pressure", "displacement"),
        ("u1 u2 u3 y1 y2", "u1 u2 u3", "y1 y2"),
        (
            "pressure_1 pressure_2 displacement_1 displacement_2 force",
            "pressure_1 pressure_2",
            "displacement_1 displacement_2",
        ),
        ("branch input output", "input", "output"),
        ("length pressure force", "pressure", "length"),
        ("pressure force", "pressure", "force"),
        ("reference_displacement pressure displacement", "pressure", "displacement"),
        ("pressure_1 pressure_2 pressure_3 x y", "pressure_1 pressure_2 pressure_3", "x y"),
        ("pressure_1 pressure_2 x y angle", "pressure_1 pressure_2", "x y"),
        ("u1 u2 x_1 y_1 x_2 y_2", "u1 u2", "x_1 y_1 x_2 y_2"),
        ("pressure x y", "pressure", "x y"),
        ("u y", "u", "y"),
        ("u10 u2 u1 y", "u1 u2 u10", "y"),
        ("pressure_1 pressure_2 displacement angle", "pressure_1 pressure_2", "displacement"),
        ("pressure displacement angle", "pressure", "displacement"),
        ("pressure_1 pressure_2 angle_1 angle_2 x", "pressure_1 pressure_2", "angle_1 angle_2"),
        ("pressure_1 pressure_2 displacement length", "pressure_1 pressure_2", "displacement"),
        ("pressure_left pressure_right angle", "pressure_left pressure_right", "angle"),
        ("pressure pressure_left displacement", "pressure", "displacement"),
        ("pressure pressure_2 angle angle_2", "pressure pressure_2", "angle angle_2"),
        ("pressure pressure_1 pressure_2 angle", "pressure_1 pressure_2", "angle"),
        ("p_a p_b displacement_x displacement_y", "p_a p_b", "displacement_x displacement_y"),
    ],
)
def test_by_name(channels: str, inputs: str, outputs: str) -> None:
    names = channels.split()
    assert by_name([run(*names)]) == (tuple(inputs.split()), tuple(outputs.split()))


def test_by_unit() -> None:
    found = run("tip", "left", "right", left="bar", right="bar", tip="mm")
    assert by_name([found]) == (("left", "right"), ("tip",))
    assert by_name([run("cuff", "hand")]) == ((), ())


def test_of_several_muscles_the_most_of_one_unit_is_moved() -> None:
    names = ["pressure_1", "pressure_2", "displacement", "elbow", "shoulder", "reference_angle"]
    found = run(*names, displacement="mm", elbow="rad", shoulder="rad", reference_angle="rad")
    assert by_name([found]) == (("pressure_1", "pressure_2"), ("elbow", "shoulder"))


@pytest.mark.parametrize(
    ("inputs", "outputs", "own"),
    [
        ("u", "y", "u"),
        ("u1 u2 u3", "y1 y2", "u1 u2"),
        ("p_2 p_1", "d_1 d_2", "p_1 p_2"),
        ("left right", "tip elbow", "left right"),
        ("u", "y1 y2", "u u"),
    ],
)
def test_every_output_has_an_input_of_its_own(inputs: str, outputs: str, own: str) -> None:
    pairs = Channels(tuple(inputs.split()), tuple(outputs.split())).pairs
    assert pairs == tuple(zip(own.split(), outputs.split(), strict=True))


@pytest.mark.parametrize(
    ("drive", "held", "pull"),
    [
        ("voltage", "length", "force"),
        ("pressure", "contraction", "force"),
        ("pressure", "angle", "torque"),
    ],
)
def test_what_is_held_at_levels_schedules_whatever_its_name(
    drive: str, held: str, pull: str
) -> None:
    names = (drive, held, pull)
    noise = 0.001 * np.sin(40 * T)
    runs = [
        run(*names).with_channels(**{held: level + noise}) for level in (10.0, 11.0, 12.0, 13.0)
    ]
    assert channels_of(runs) == Channels((drive,), (pull,), (held,), held=(held,))


def test_numbered_commands_drive_together() -> None:
    names = ["command_pressure_1", "command_pressure_2", "angle"]
    assert by_name([run(*names)]) == (tuple(names[:2]), ("angle",))


def test_what_is_held_at_one_value_is_no_output() -> None:
    names = ("pressure", "displacement", "force")
    held = [run(*names, held=("displacement",)) for _ in range(2)]
    force, moved = Channels(("pressure",), ("force",)), (("pressure",), ("displacement",))
    assert channels_of(held) == channels_of(held, "pressure") == force
    assert sides([*held, run(*names)]) == moved
    assert sides([run(*names, held=("displacement", "force"))]) == moved
    pulled = [run(*names, held=("pressure",))]
    assert sides(pulled) == (("displacement",), ("force",))


def sides(*given: Any) -> tuple[tuple[str, ...], tuple[str, ...]]:
    found = channels_of(*given)
    return found.inputs, found.outputs


def test_of_one_muscle_loads_are_offered_and_of_several_they_schedule() -> None:
    loaded = ("pressure", "displacement", "force", "temperature", "rest")
    one = channels_of([run(*loaded, held=("rest",))])
    assert one == Channels(*PAIR, (), ("force",), ("temperature",))
    assert one.single
    assert channels_of([run(*loaded)], scheduling=()).unused == ("force", "temperature", "rest")
    assert channels_of([run(*loaded)], scheduling="temperature").scheduling == ("temperature",)
    given = channels_of([run(*loaded)], ["pressure", "force"])
    assert (given.inputs, given.scheduling) == (("pressure",), ("force",))
    two = channels_of([run("pressure_1", "pressure_2", "angle", "pressure_extensor", "torque")])
    assert two.scheduling == ("pressure_extensor", "torque")


@pytest.mark.parametrize(
    ("names", "inputs", "outputs", "over"),
    [
        ("pressure length force", None, None, "length"),
        ("pressure length force", None, "force", "length"),
        ("pressure length force", "length", None, "length"),
        ("pressure length force", ["pressure", "length"], ["force"], "length"),
        ("pressure displacement force", None, "force", "displacement"),
        ("pressure displacement length force", None, "force", "length"),
    ],
)
def test_force_is_of_length_and_models_take_the_pressure(
    names: str, inputs: str | list[str] | None, outputs: str | list[str] | None, over: str
) -> None:
    found = channels_of([run(*names.split())], inputs, outputs)
    assert (found.inputs, found.outputs, found.offered) == ((over,), ("force",), ("pressure",))


@pytest.mark.parametrize("place", ["length", "displacement"])
@pytest.mark.parametrize("inputs", [None, "pressure", ("pressure",)])
@pytest.mark.parametrize("outputs", [None, "force"])
def test_what_is_held_in_every_recording_schedules_and_pressure_drives(
    place: str, inputs: str | tuple[str, ...] | None, outputs: str | None
) -> None:
    rng = np.random.default_rng(0)
    runs = []
    for level in (10.0, 14.0, 20.0):
        one = run("pressure", place, "force")
        runs.append(one.with_channels(**{place: level + 0.01 * rng.standard_normal(len(one))}))
    assert channels_of(runs, inputs, outputs) == Channels(
        ("pressure",), ("force",), (place,), held=(place,)
    )
    law = Channels((place,), ("force",), (), ("pressure",))
    at_levels = replace(law, held=(place,))
    assert channels_of(runs, place, "force") == at_levels
    moving = [run("pressure", place, "force")]
    assert channels_of(moving, None, "force") == law


def test_force_is_not_modelled_unasked_where_anything_else_is() -> None:
    told = ["pressure", "length", "force"]
    assert channels_of([run(*told)], "pressure", "force", None).inputs == ("pressure",)
    assert channels_of([run(*told)], None, "length", None).outputs == ("length",)
    for other in ("displacement", "angle", "position"):
        assert channels_of([run(*told, other)], None, None, None).outputs != ("force",)


def test_at_one_length_force_is_of_pressure() -> None:
    held = run("pressure", "length", "force", held=("length",))
    for outputs in (None, "force"):
        assert channels_of([held], None, outputs, None) == Channels(("pressure",), ("force",))
    assert not varies([np.r_[4.0, np.full(200, 3.0)]])


# -- every operation understands the same names ----------------------------------------------------

NAMINGS = (
    "pressure displacement",
    "voltage displacement",
    "pressure length",
    "pressure contraction",
    "u y",
    "cuff:bar tip:mm",
    "pressure voltage displacement",
    "pressure displacement force",
    "pressure angle torque",
    "pressure length force",
    "voltage length force",
    "pressure_1 pressure_2 displacement_1 displacement_2",
    "pressure pressure_2 displacement displacement_2",
    "pressure_left pressure_right angle",
    "pressure_flexor pressure_extensor angle",
    "pressure_1 pressure_2 x y",
    "u1 u2 y1 y2",
    "left:bar right:bar tip:mm",
    "command_pressure_1 command_pressure_2 angle",
    "pressure_1 pressure_2 displacement_1 displacement_2 pressure_extensor force",
)


def irregular(naming: str) -> list[Recording]:
    """Return three runs in which all channels move independently."""
    names, units = zip(*(word.partition(":")[::2] for word in naming.split()), strict=True)
    rng, time = np.random.default_rng(0), np.arange(400) * 0.05
    found = []
    for _ in range(3):
        waves = (
            rng.uniform(0.5, 1.5, (2, len(names), 1)) * time
            + rng.uniform(0, 6, len(names))[:, None]
        )
        samples = 2.0 + np.sin(waves[0]) + 0.3 * np.sin(3.1 * waves[1])
        given = {name: unit for name, unit in zip(names, units, strict=True) if unit}
        found.append(Recording(dict(zip(names, samples, strict=True)), 0.05, units=given))
    return found


class Resolved(Exception):  # noqa: N818
    """Ends a fit when its data are known."""


@pytest.mark.parametrize("naming", NAMINGS)
def test_every_operation_finds_the_same_channels(
    naming: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs = irregular(naming)
    plan = plan_of(runs)
    found = plan.data.channels
    assert {*naming.replace(":bar", "").replace(":mm", "").split()} == {
        *found.inputs, *found.outputs, *found.further, *found.unused
    }  # fmt: skip
    fitted: list[TrainingData] = []

    def begin(estimator: Estimator, given: list[Recording], **_: Any) -> None:
        fitted.append(estimator.data(given))
        raise Resolved

    monkeypatch.setattr(Estimator, "fit", begin)
    for name in plan.items:
        kind = registry.load("estimators", name)
        with pytest.raises(Resolved):
            workflow.fit(name, runs)
        for data in (fitted.pop(), kind(**kind.channel_settings(found)).data(runs)):
            given = [channel.name for channel in (*data.inputs, *data.scheduled)]
            assert tuple(channel.name for channel in data.outputs) == found.outputs
            assert {*found.inputs, *found.scheduling} <= {*given} <= {*found.inputs_in(runs)}
    known = excitation(runs)
    assert known.outputs == found.outputs
    assert {*known.driven, *known.loads} == {*found.inputs_in(runs)}
    if found.single and not found.offered:
        loop = characterize(runs)
        assert (loop.input, loop.output) == found.pair


def test_a_fit_lists_what_it_does_not_use() -> None:
    runs = irregular("pressure voltage displacement force")
    noted = workflow.fit("pi", runs, settings={"n_operators": 2}).notes
    assert "voltage" in noted[-1]
    assert "force" in noted[-1]
