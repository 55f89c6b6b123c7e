"""Paper C's use of its model: pressure that keeps a wished-for force while the muscle is moved.

Source: "A Multistate Friction Model for the Compensation of the Asymmetric Hysteresis in the Mechanical
Response of Pneumatic Artificial Muscles", Section 4. The paper proposes the feedforward and tries none;
motion and wished-for forces are ours.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from mckibben.blocks.force.feedforward import ForceFeedforward
from mckibben.blocks.force.laws import ForceLaw
from mckibben.blocks.force.multistate_friction import MultistateFriction
from mckibben.control import track
from mckibben.papers.multistate_friction.protocol import IDENTIFIED_AT, LONGEST, SAMPLE_TIME
from mckibben.papers.reproduction import Cell, Figure, Table, thinned
from mckibben.recording import Recording
from mckibben.rigs import load_rig
from mckibben.signals.excitations import irregular_triangle

RIG = "mas10-test-stand"
ALONE = "static law alone"
SPRING, HELD, SWUNG = "static law at 4 bar", "150 N", "150 N ± 50 N"
"""Forces wished for: by length, as if there were no hysteresis; held; a sine in time."""

STROKE = 12.0
"""Of the imposed motion [mm]."""

SWINGING = 7.0
"""Period of the sine [s]."""

APPROACH = 10.0
"""From rest to the first force [s]."""


def references(law: ForceLaw, duration: float) -> dict[str, Recording]:
    """Return wished-for forces [N] while the length goes through irregular loops [mm]."""
    time = np.arange(round(duration / SAMPLE_TIME) + 1) * SAMPLE_TIME
    turns = 2 * round(duration / 20.0) + 1
    length = LONGEST - irregular_triangle(time, turns, STROKE, seed=7)
    per_bar, rest = law.terms(length)
    forces = {
        SPRING: IDENTIFIED_AT * per_bar + rest,
        HELD: np.full(time.size, 150.0),
        SWUNG: 150.0 + 50.0 * np.sin(2 * np.pi * time / SWINGING),
    }
    return {
        name: Recording({"force": force, "length": length}, SAMPLE_TIME)
        for name, force in forces.items()
    }


def feedforward_on_the_stand(
    law: ForceLaw,
    frictions: Mapping[str, MultistateFriction],
    *,
    quick: bool,
    seed: int,
    tell: Callable[[float, str], None],
) -> tuple[Table, Figure, dict[str, float]]:
    """Track forces on the test stand without feedback of force.

    Parameters
    ----------
    law : ForceLaw
        Static force.
    frictions : mapping of str to MultistateFriction
        Fitted from rest on, by name.
    quick : bool
        Whether one force and a short motion will do.
    seed : int
        Of the sensors' noise.
    tell : callable
        Told the share done, and what is next.

    Returns
    -------
    Table, Figure, dict
        The errors; force by time; and the RMSE of every way with the first force [N].
    """
    wished = references(law, 40.0 if quick else 80.0)
    wished = {SPRING: wished[SPRING]} if quick else wished
    ways = {ALONE: ForceFeedforward(law)} | {
        name: ForceFeedforward(law, replace(friction, output=law.outputs[0], initial="virgin"))
        for name, friction in frictions.items()
    }
    rig, first = load_rig(RIG), wished[SPRING]
    rows: list[tuple[Cell, ...]] = []
    errors: dict[str, float] = {}
    curves = {"wished for": _curve(first)}
    for place, (wish, reference) in enumerate(wished.items()):
        for name, way in ways.items():
            tell(place / len(wished), f"feedforward of {wish}")
            found = track(way, rig, reference, approach=APPROACH, seed=seed)
            rows.append(
                (wish, name, found.rmse["force"], found.largest["force"], float(found.clipped))
            )
            if reference is first:
                errors[name] = found.rmse["force"]
                run = found.recording.slice(len(found.recording) - len(first), len(found.recording))
                curves[name] = _curve(run)
    table = Table(
        "Force on the test stand, by feedforward alone (proposed in its Section 4)",
        ("force wished for", "compensated by", "RMSE [N]", "largest [N]", "steps at a limit"),
        tuple(rows),
        "Pressure = the closed-form solution of f_st(l, p) + f_h(l) = force at the commanded length, "
        f"which goes through irregular loops of {STROKE:.0f} mm; the force is not fed back. Friction is "
        "that of 4 bar, whatever the pressure. By hand: mckibben rig record multistate-friction "
        "--out runs; mckibben fit multistate runs/isometric-*.csv runs/isobaric-4bar.csv --input length "
        "--output force -o law.json; mckibben invert law.json -o ahead.json; mckibben track ahead.json "
        f"--rig {RIG} --reference wished.csv, which holds force and length.",
    )
    figure = Figure(
        "Force on the test stand, by feedforward alone", "length [mm]", "force [N]", curves
    )
    return table, figure, errors


def _curve(run: Recording) -> tuple[np.ndarray, np.ndarray]:
    return thinned(run["length"], 1500), thinned(run["force"], 1500)
