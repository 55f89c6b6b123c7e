"""Closed loops on a virtual rig: uncompensated, with every inverse, PID, and both."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from mckibben.comparison.leaderboard import Leaderboard
from mckibben.control import UNCOMPENSATED, Tracked, before, control_law, track, tune_pid
from mckibben.errors import DataError, MckibbenError
from mckibben.recording import Recording, sample_time_of
from mckibben.rigs.rig import Rig, changes, recorded_on

LONGEST = 200.0
"""Longest motion that is tracked [s]."""

SMOOTHED = 0.5
"""Half width of the window that smooths a measured motion before it is tracked [s]."""


def recorded_rig(recordings: Sequence[Recording]) -> Rig | None:
    """Return the virtual rig of recordings, in its recorded configuration; None if they name none.

    Raises
    ------
    DataError
        If it cannot be rebuilt, or there are several.
    """
    rigs = [recorded_on(recording) for recording in recordings]
    # where commands rest is no matter of the rig: a loop begins at its reference
    kinds = [None if rig is None else rig.changed({"start": {}}) for rig in rigs]
    if any(kind != kinds[0] for kind in kinds):
        raise DataError(
            "the recordings are not all of one virtual rig", remedy="name the rig to close it on"
        )
    return rigs[0]


def named(rig: Rig) -> str:
    """Return the name of a rig, and its changes from the published one."""
    changed = ", ".join(changes(rig) or ())
    return f"{rig.name} (changed: {changed})" if changed else rig.name


def closed_loops(
    board: Leaderboard, chosen: str, rig: Rig, tests: Sequence[Recording], seed: int
) -> dict[str, Tracked]:
    """Return tracking results of a measured motion, uncompensated and with every controller.

    That is every inverse, PID, and both together.

    Nothing is chosen by it. An inverse that fails is left out; its model is in the leaderboard.
    There are none where inverses give pressures, and the rig takes volts.

    Parameters
    ----------
    chosen : str
        Model whose inverse is combined with PID.
    rig : Rig
        To close them on.
    tests : sequence of Recording
        Of which the one that moves most in its stillest output is followed.

    Raises
    ------
    DataError
        If that has no time.
    """
    inverses = {row.model: row.inverse for row in board.rows if row.inverse is not None}
    if not {channel.name for channel in inverses[chosen].outputs} <= set(rig.inputs):
        return {}
    wanted = {channel.name for inverse in inverses.values() for channel in inverse.inputs}
    held = [name for name in rig.inputs if name in wanted]
    reference = _followed(tests, board.outputs, held)
    step = sample_time_of(reference, "be tracked")
    scheduled = {name: float(reference[name][0]) for name in held}
    asked = inverses[chosen].inputs
    pid = tune_pid(rig, sample_time=step, scheduled=scheduled, references=asked, seed=seed)
    laws = [(f"{model} inverse", "feedforward", model) for model in inverses]
    laws += [("PID", "pid", chosen), (f"{chosen} inverse + PID", "feedforward-pid", chosen)]
    found: dict[str, Tracked] = {}
    without = before(inverses[chosen], rig, reference, approach=5.0, seed=seed).tracked
    if without is not None:
        found[UNCOMPENSATED] = without
    for name, law, model in laws:
        with suppress(MckibbenError):
            controller = control_law(law, inverses[model], lambda: pid)
            found[name] = track(controller, rig, reference, approach=5.0, seed=seed)
    return found


def _followed(tests: Sequence[Recording], outputs: Sequence[str], held: Sequence[str]) -> Recording:
    """Return a smoothed measured motion, with scheduling inputs at their means."""
    model = max(tests, key=lambda run: min(float(np.ptp(run[name])) for name in outputs))
    step = sample_time_of(model, "be tracked")
    n = min(len(model), round(LONGEST / step))
    width = max(round(SMOOTHED / step), 1)
    window = np.ones(width) / width
    smooth = {
        name: np.convolve(np.pad(model[name][:n], width, mode="edge"), window, "same")[
            width : width + n
        ]
        for name in outputs
    }
    return Recording(smooth | {name: np.full(n, float(model[name].mean())) for name in held}, step)
