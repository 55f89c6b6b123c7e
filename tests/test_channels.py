"""What drives and what is moved: of names as people give them, and of nothing but units."""

from __future__ import annotations

import numpy as np
import pytest

from mckibben import Recording
from mckibben.channels import Channels, channels_of, recognised, varies

T = np.linspace(0.0, 9.0, 50)


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
        ("cuff hand", "cuff", "hand"),
        ("pressure_1 pressure_2 pressure_3 x y", "pressure_1 pressure_2 pressure_3", "x y"),
        ("pressure_1 pressure_2 x y angle", "pressure_1 pressure_2", "x y"),
        ("u1 u2 x_1 y_1 x_2 y_2", "u1 u2", "x_1 y_1 x_2 y_2"),
        ("pressure x y", "pressure", "x y"),
        ("u y", "u", "y"),
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
    assert recognised([run(*names)], names) == (tuple(inputs.split()), tuple(outputs.split()))


def test_by_unit() -> None:
    found = run("left", "right", "tip", left="bar", right="bar", tip="mm")
    assert recognised([found], ["tip", "left", "right"]) == (("left", "right"), ("tip",))


def test_of_several_muscles_the_most_of_one_unit_is_moved() -> None:
    names = ["pressure_1", "pressure_2", "displacement", "elbow", "shoulder", "reference_angle"]
    found = run(*names, displacement="mm", elbow="rad", shoulder="rad", reference_angle="rad")
    assert recognised([found], names) == (("pressure_1", "pressure_2"), ("elbow", "shoulder"))


def test_at_a_length_held_the_force_is_modelled() -> None:
    names = ["pressure", "displacement", "force"]
    held = [run(*names, held=("displacement",)) for _ in range(2)]
    assert recognised(held, names) == (("displacement",), ("force",))
    assert recognised([*held, run(*names)], names) == (("pressure",), ("displacement",))


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
    pairs = Channels(tuple(inputs.split()), tuple(outputs.split())).pairs()
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
    assert channels_of(runs) == Channels((drive,), (pull,), (held,))


def test_numbered_commands_drive_together() -> None:
    names = ["command_pressure_1", "command_pressure_2", "angle"]
    assert recognised([run(*names)], names) == (tuple(names[:2]), ("angle",))


def test_a_comparison_of_held_lengths_is_of_force() -> None:
    names = ("pressure", "displacement", "force")
    held = [run(*names, held=("displacement",)) for _ in range(2)]
    found = Channels(("pressure",), ("displacement",))
    assert channels_of(held) == Channels(("displacement",), ("force",))
    assert channels_of(held, "pressure") == found
    assert channels_of([*held, run(*names)]) == found
    assert channels_of([run(*names, held=("displacement", "force"))]) == found


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
def test_force_is_of_length_and_models_find_the_pressure(
    names: str, inputs: str | list[str] | None, outputs: str | list[str] | None, over: str
) -> None:
    found = channels_of([run(*names.split())], inputs, outputs, None)
    assert found == Channels((over,), ("force",))


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
    assert channels_of(runs, inputs, outputs) == Channels(("pressure",), ("force",), (place,))
    assert channels_of(runs, place, "force") == Channels((place,), ("force",))
    moving = [run("pressure", place, "force")]
    assert channels_of(moving, None, "force") == Channels((place,), ("force",))


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
