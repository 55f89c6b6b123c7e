"""What the pages beyond the papers share: runs of controllers on rigs, tables and pictures."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from mckibben.blocks.base import Block
from mckibben.control import Controller, track
from mckibben.control.controller import Ahead, BlockController
from mckibben.control.uncompensated import slow_cycle, uncompensated
from mckibben.errors import ModelWarning
from mckibben.recording import Recording
from mckibben.report.printed import METADATA, STYLE
from mckibben.rigs import Rig
from mckibben.system.workers import Tell, all_of

PICTURES = Path(__file__).parent.parent / "pictures" / "papers"
RESOLUTION = 130
"""Dots per inch."""


class Trial(NamedTuple):
    """A controller, None for no compensation, on a rig with a load, and what it has to follow."""

    law: Block | Controller | None
    rig: Rig
    reference: Recording
    seed: int = 0


class BySection(Controller):
    """Compensators side by side, each of the muscles that it commands."""

    def __init__(self, *compensators: Block) -> None:
        self.parts = [BlockController(block) for block in compensators]

    def connect(self, offer: Any) -> None:
        for part in self.parts:
            names = {channel.name for channel in part.block.outputs}
            part.connect(replace(offer, driven=tuple(c for c in offer.driven if c.name in names)))

    def reset(self, sample_time: float) -> None:
        for part in self.parts:
            part.reset(sample_time)

    def step(self, reference: Any, measured: Any, scheduled: Any, ahead: Ahead) -> Any:
        return np.concatenate(
            [part.step(reference, measured, scheduled, ahead) for part in self.parts]
        )


def followed(_: None, trial: Trial, tell: Tell) -> dict[str, float]:
    """Return the RMSE of every output after the first third of a reference [mm]."""
    law, rig, reference, seed = trial
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        if law is None:
            law = uncompensated(rig, reference, slow_cycle(rig, reference, seed=seed), seed=seed)
        settle = (reference.duration or 0.0) / 3
        return dict(track(law, rig, reference, settle=settle, seed=seed).rmse)


def errors(trials: Mapping[Any, Trial], jobs: int | None = None) -> dict[Any, float]:
    """Return the worst output's RMSE of every trial [mm]."""
    found = all_of(followed, [*trials.values()], jobs)
    return {key: max(each.values()) for key, each in zip(trials, found, strict=True)}


def table(columns: Sequence[str], rows: Mapping[str, Sequence[float]]) -> list[str]:
    """Return the lines of a table of numbers, to three digits."""
    lines = [f"| {' | '.join(columns)} |", "|---" + "|---:" * (len(columns) - 1) + "|"]
    return [
        *lines,
        *(f"| {name} | {' | '.join(f'{x:.3g}' for x in row)} |" for name, row in rows.items()),
        "",
    ]


class Panel(NamedTuple):
    """Curves over one axis: by name, the values there."""

    x_label: str
    x: Sequence[float] | Sequence[str]
    curves: Mapping[str, Sequence[float]]
    logarithmic: bool = False


def picture(name: str, panels: Sequence[Panel], y_label: str) -> None:
    """Write a picture of errors, on a logarithmic scale."""
    with rc_context(dict(STYLE)):
        figure = Figure((3.4 * len(panels), 3.2), layout="constrained")
        for axis, panel in zip(np.ravel(figure.subplots(1, len(panels))), panels, strict=True):
            for (curve, y), mark in zip(panel.curves.items(), "os^Dv<>", strict=False):
                axis.plot(panel.x, y, marker=mark, ms=3, lw=1, label=curve)
            axis.set(xlabel=panel.x_label, ylabel=y_label, yscale="log")
            scaled = [axis.yaxis]
            if panel.logarithmic:
                axis.set_xscale("log")
                scaled += [axis.xaxis]
            for each in scaled:
                each.set_major_formatter("{x:g}")
                each.set_minor_formatter(NullFormatter())
            axis.grid(alpha=0.3)
        handles, labels = axis.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3)
        PICTURES.mkdir(parents=True, exist_ok=True)
        figure.savefig(PICTURES / name, dpi=RESOLUTION, metadata=dict(METADATA["png"]))
