"""Figures of several muscles, and of what loads them: every input against every output."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mckibben.arrays import Array
from mckibben.comparison.channels import Channels, any_moves, moved_by
from mckibben.diagnosis.conditions import FOLLOWS
from mckibben.recording import Recording
from mckibben.report.drawing import (
    N_AGES,
    N_COLOURS,
    POINTS,
    Curve,
    Drawing,
    Panel,
    along,
    axis_label,
    left_out,
)
from mckibben.statistics import dependence

SMALL = 500
"""Points of a small picture."""

MOST = 6
"""Inputs, and outputs, that are pictured."""


@dataclass(frozen=True, eq=False)
class Coupling:
    """How far every input moves every output, by one straight line through all inputs.

    Parameters
    ----------
    inputs, outputs : tuple of str
        Channels.
    effects : array, shape (outputs, inputs)
        What an input over its whole measured range does to an output, in the output's unit; NaN where
        inputs move together, so that nobody can tell whose effect it is.
    units : tuple of str
        Of the outputs.
    explained : tuple of float
        Share of each output's variance that the line explains: the rest is bent, or remembers.
    """

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    effects: Array
    units: tuple[str, ...]
    explained: tuple[float, ...]

    def own(self, output: str, recordings: Sequence[Recording] = ()) -> str:
        """Return the input that is an output's own: of as many its pair, else what moves it most.

        Where recordings are given, it is one that moves in them, if any does.
        """
        place = self.outputs.index(output)
        moving = [k for k, name in enumerate(self.inputs) if any_moves(recordings, (name,))]
        moving = moving or list(range(len(self.inputs)))
        pair = self.inputs.index(Channels(self.inputs, self.outputs).pairs()[place][0])
        effects = np.abs(self.effects[place, moving])
        if pair in moving and (self.paired or not np.isfinite(effects).all()):
            return self.inputs[pair]
        return self.inputs[moving[int(np.argmax(np.nan_to_num(effects)))]]

    def pairs(self, recordings: Sequence[Recording]) -> tuple[tuple[str, str], ...]:
        """Return what every output of recordings is drawn over, and the output.

        That is the input that is its own; where all are held, what else drives and moves.
        """
        shared = [n for n in recordings[0].channels if all(n in each for each in recordings)]
        others = [name for name in shared if name not in self.outputs]
        return tuple(
            (moved_by(recordings, self.own(output, recordings), others), output)
            for output in self.outputs
        )

    @property
    def paired(self) -> bool:
        """Whether there are as many inputs as outputs."""
        return len(self.inputs) == len(self.outputs)


def coupling(
    recordings: Sequence[Recording], inputs: Sequence[str], outputs: Sequence[str]
) -> Coupling:
    """Return how far inputs move outputs over all recordings, each of which may rest elsewhere.

    Parameters
    ----------
    recordings : sequence of Recording
        At least one.
    inputs, outputs : sequence of str
        Channels that all of them have.
    """
    u = np.concatenate([r.matrix(inputs) - r.matrix(inputs).mean(axis=0) for r in recordings])
    y = np.concatenate([r.matrix(outputs) - r.matrix(outputs).mean(axis=0) for r in recordings])
    size = np.linalg.norm(u, axis=0)
    scaled = u / np.where(size > 0, size, 1.0)
    gains = np.linalg.lstsq(scaled, y, rcond=1e-6)[0]
    highest = np.max([r.matrix(inputs).max(axis=0) for r in recordings], axis=0)
    ranges = highest - np.min([r.matrix(inputs).min(axis=0) for r in recordings], axis=0)
    effects = (gains / np.where(size > 0, size, 1.0)[:, np.newaxis] * ranges[:, np.newaxis]).T
    if (dependence(u) > FOLLOWS).any():
        effects = np.full_like(effects, np.nan)
    total = np.sum(y**2, axis=0)
    left = np.sum((y - scaled @ gains) ** 2, axis=0)
    explained = 1 - left / np.where(total > 0, total, 1.0)
    units = tuple(recordings[0].units[name] for name in outputs)
    return Coupling(tuple(inputs), tuple(outputs), effects, units, tuple(explained.tolist()))


def fullest(recordings: Sequence[Recording], inputs: Sequence[str]) -> Recording:
    """Return the recording whose least moved input moves the most; of equals the first."""

    def least(recording: Recording) -> float:
        return float(min(np.ptp(recording[name]) / whole[name] for name in inputs))

    spans = {name: np.concatenate([r[name] for r in recordings]) for name in inputs}
    whole = {name: max(float(np.ptp(x)), np.finfo(float).tiny) for name, x in spans.items()}
    return max(recordings, key=least)


def matrix(recording: Recording, found: Coupling, points: int = SMALL) -> Drawing:
    """Draw every output (rows) over every input (columns), small; own pairs are in colour."""
    panels = []
    for output in found.outputs[:MOST]:
        for name in found.inputs[:MOST]:
            x, y = along(recording[name], recording[output], points)[1:]
            colour = "series-1" if found.own(output, [recording]) == name else "input"
            panels.append(
                Panel(
                    axis_label(name, recording.units[name]),
                    axis_label(output, recording.units[output]),
                    (Curve(x, y, "", colour, "fine"),),
                )
            )
    note = left_out([*found.inputs[MOST:], *found.outputs[MOST:]])
    return Drawing(tuple(panels), columns=min(len(found.inputs), MOST), note=note)


def loop_by(
    recordings: Sequence[Recording],
    input_name: str,
    output_name: str,
    by: str,
    points: int = POINTS,
) -> Drawing:
    """Draw output over input, coloured by a third channel, a load or a stiffness, from low to high."""
    paths = [along(r[input_name], r[output_name], points) for r in recordings]
    x, y = (np.concatenate([path[k] for path in paths]) for k in (1, 2))
    level = np.concatenate(
        [r[by][path[0].astype(int)] for r, path in zip(recordings, paths, strict=True)]
    )
    edges = levels(np.concatenate([r[by] for r in recordings]))
    recording = recordings[0]
    unit = f" {recording.units[by]}" if recording.units[by] else ""
    which = np.clip(np.searchsorted(edges, level, side="right") - 1, 0, len(edges) - 2)
    curves = []
    for place in range(len(edges) - 1):
        chosen = which == place
        if chosen.any():
            ends = dict.fromkeys(f"{end:.3g}" for end in (level[chosen].min(), level[chosen].max()))
            name = f"{by} {' to '.join(ends)}{unit}"
            colour = f"age-{place + 1}"
            curves.append(Curve(x[chosen], y[chosen], name, colour, "specks"))
    x_label = axis_label(input_name, recording.units[input_name])
    y_label = axis_label(output_name, recording.units[output_name])
    return Drawing((Panel(x_label, y_label, tuple(curves)),))


def levels(values: Array) -> Array:
    """Return the edges of at most `N_AGES` equal steps from lowest to highest."""
    low, high = float(values.min()), float(values.max())
    if high <= low:
        return np.array([low, low])
    return np.linspace(low, high, N_AGES + 1)


def third_channels(recording: Recording, used: Sequence[str]) -> list[str]:
    """Return the channels that a loop can be coloured by: those that move and are not used already."""
    free = [name for name in recording.channels if name not in used]
    return [name for name in free if np.ptp(recording[name]) > 0][:N_COLOURS]
