"""Rows of the table of targets, and what all sections share: fits that are kept, and errors."""

from __future__ import annotations

import statistics
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mckibben import Recording
from mckibben.blocks.core.block import Block
from mckibben.registry import load

Array = NDArray[np.float64]

BALANCE = "balance"


@dataclass(frozen=True)
class Row:
    """A target.

    Parameters
    ----------
    section, what, unit : str
    target : float
        Highest figure that is good enough, NaN where there is none.
    figures : mapping of str to sequence of float
        By model, a figure a seed or run; the balance's are named `BALANCE`.
    note : str
    least : float
        Lowest figure that is good enough.
    """

    section: str
    what: str
    unit: str
    target: float
    figures: Mapping[str, Sequence[float]]
    note: str = ""
    least: float = -np.inf

    @property
    def met(self) -> bool | None:
        """Whether the balance's median keeps to the target; None where there is none."""
        values = self.figures.get(BALANCE, ())
        if not len(values) or np.isnan(self.target):
            return None
        return bool(self.least <= statistics.median(values) <= self.target)

    @property
    def wanted(self) -> str:
        """The target in words."""
        if np.isnan(self.target):
            return ""
        if self.least > -np.inf:
            return f"{self.least:g} to {self.target:g}"
        return f"{self.target:g}"


@dataclass
class Fits:
    """Models fitted, each once."""

    found: dict[tuple[object, ...], Block] = field(default_factory=dict)

    def __call__(self, key: object, name: str, train: Sequence[Recording], **how: object) -> Block:
        """Return a model fitted to runs that the key stands for."""
        place = (key, name, repr(sorted(how.items())))
        if place not in self.found:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                self.found[place] = load("estimators", name)(**how).fit(list(train)).model_
        return self.found[place]


def rms(values: Array) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def free_run(block: Block, recording: Recording, *names: str) -> Array:
    """Return what a model gives over a recording, free-running, warnings left out."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return block.simulate(recording).matrix(names)


def missed(block: Block, recording: Recording, *names: str) -> float:
    """Return the RMSE of a free run over outputs."""
    return rms(free_run(block, recording, *names) - recording.matrix(names))


def decimated(recording: Recording, every: int) -> Recording:
    """Return every so many-th sample, noise and all."""
    channels = {name: recording[name][::every] for name in recording.channels}
    step = (recording.sample_time or 1.0) * every
    return Recording(channels, step, recording.units, meta=recording.meta)


def shown(values: Sequence[float]) -> str:
    """Return the median, and the range where there are several."""
    middle = statistics.median(values)
    if len(values) == 1:
        return f"{middle:.3g}"
    return f"{middle:.3g} ({min(values):.3g} to {max(values):.3g})"


def table(rows: Iterable[Row]) -> str:
    """Return rows as a table in Markdown."""
    lines = [
        "| section | what | unit | baselines | balance | target | met |",
        "|---|---|---|---|---:|---:|---|",
    ]
    notes: list[str] = []
    for row in rows:
        others = "; ".join(
            f"{name} {shown(values)}" for name, values in row.figures.items() if name != BALANCE
        )
        mark = ""
        if row.note:
            if row.note not in notes:
                notes.append(row.note)
            mark = f" [{1 + notes.index(row.note)}]"
        own = shown(row.figures[BALANCE]) if row.figures.get(BALANCE) else "-"
        met = {None: "", True: "yes", False: "NO"}[row.met]
        cells = [row.section, row.what + mark, row.unit, others, own, row.wanted, met]
        lines.append(f"| {' | '.join(cells)} |")
    lines += ["", *(f"[{place}] {note}" for place, note in enumerate(notes, start=1))]
    return "\n".join(lines)
