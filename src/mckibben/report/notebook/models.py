"""How models and compensators are shown."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.free_run import run_free
from mckibben.control.identified import known_ranges
from mckibben.errors import MckibbenError, ModelError
from mckibben.numerals import numeral
from mckibben.recording import Recording
from mckibben.report import model_subjects, subjects
from mckibben.report.drawing import Drawing
from mckibben.report.notebook.card import Card
from mckibben.report.notebook.face import Draw, Face, table_of
from mckibben.report.notebook.recordings import pair_of
from mckibben.signals import decaying_triangle

MOST_PARAMETERS = 8
"""That a card lists; of more it gives the first."""

PERIOD, CYCLES, SAMPLES = 10.0, 3, 500
"""Of the falling triangle that a model's loop is drawn with: seconds, cycles, and samples a cycle."""


class BlockFace(Face):
    """A model or a compensator."""

    def __init__(self, block: Block) -> None:
        self.block = block

    def card(self) -> Card:
        """Return what goes in and out, how far it is known, and its parameters."""
        block = self.block
        names = block.parameter_names
        values = block.pack()
        ranges = known_ranges(block)
        rows = table_of(
            {
                "in": _listed((c.name, c.unit) for c in block.inputs),
                "out": _listed((c.name, c.unit) for c in block.outputs),
                "input range": "; ".join(
                    f"{name} {numeral(low)} to {numeral(high)}"
                    for name, (low, high) in ranges.items()
                    if name in [channel.name for channel in block.inputs]
                ),
                "states": str(block.n_states),
                "parameters": str(block.n_parameters),
                "rate": _rate(block),
                "inverse": _inverse(block),
            }
        )
        rows += [
            (name, numeral(float(value), 4))
            for name, value in zip(names[:MOST_PARAMETERS], values, strict=False)
        ]
        left = len(names) - MOST_PARAMETERS
        notes = [f"and {left} more parameters: .pack() has all"] if left > 0 else []
        kind = "Compensator" if block.undoing else "Model"
        return Card(f"{kind} {block.title}", rows=rows, notes=notes)

    def drawings(self, choices: Mapping[str, Any]) -> Mapping[str, Draw]:
        """Return its own loop and weights, or what a recording says of it."""
        if "recording" in choices:
            return against({self.block.title: self.block})
        return {"loop": self.loop, "weights": self.weights}

    def weights(self) -> Drawing:
        """Draw weights over thresholds."""
        return model_subjects.weights({self.block.title: self.block})

    def loop(
        self,
        input: str | None = None,  # noqa: A002
        output: str | None = None,
        high: float | None = None,
    ) -> Drawing:
        """Draw its answer to a falling triangle of one input, from rest, the others held in the middle.

        Parameters
        ----------
        input, output : str, optional
            Channels; default the first.
        high : float, optional
            Highest input; default what the model was identified on.
        """
        block = self.block
        names = [channel.name for channel in block.inputs]
        driven, given = input or names[0], output or block.outputs[0].name
        ranges = known_ranges(block)
        if driven not in ranges and high is None:
            raise ModelError(
                f"the model does not say on which range of {driven} it was identified",
                remedy="give high=, or a measured recording=",
            )
        low, top = ranges.get(driven, (0.0, 0.0))
        step = block.sample_time or PERIOD / SAMPLES
        t = step * np.arange(round(CYCLES * PERIOD / step) + 1)
        wave = decaying_triangle(t, period=PERIOD, high=top if high is None else high, low=low)
        channels = {name: np.full(t.size, np.mean(ranges.get(name, (0.0, 0.0)))) for name in names}
        channels[driven] = wave
        units = {channel.name: channel.unit for channel in block.inputs}
        run = block.simulate(Recording(channels, step, units, meta={"name": block.title}))
        return subjects.loop([run], driven, given)


def against(blocks: Mapping[str, Block]) -> Mapping[str, Draw]:
    """Return what draws models, running free, against a recording."""

    def runs(recording: Recording, output: str) -> dict[str, Array]:
        return {name: run_free(block, recording, output) for name, block in blocks.items()}

    first = next(iter(blocks.values()))

    def channels(recording: Recording, given: str | None, wanted: str | None) -> tuple[str, str]:
        outputs = [channel.name for channel in first.outputs]
        wanted = wanted or outputs[0]
        own = [channel.name for channel in first.inputs]
        place = outputs.index(wanted) if wanted in outputs else 0
        several = len(outputs) <= len(own) and len(outputs) > 1
        pair = pair_of(recording)
        usual = own[place] if several else (pair[0] if pair and pair[0] in own else own[0])
        return given or usual, wanted

    def loops(
        recording: Recording,
        input: str | None = None,  # noqa: A002
        output: str | None = None,
    ) -> Drawing:
        given, wanted = channels(recording, input, output)
        return subjects.fit_loops(recording, given, wanted, runs(recording, wanted))

    def fit(
        recording: Recording,
        input: str | None = None,  # noqa: A002
        output: str | None = None,
    ) -> Drawing:
        _, wanted = channels(recording, input, output)
        return subjects.fit_over_time(recording, wanted, runs(recording, wanted))

    def residuals(
        recording: Recording,
        input: str | None = None,  # noqa: A002
        output: str | None = None,
    ) -> Drawing:
        given, wanted = channels(recording, input, output)
        return subjects.residuals(recording, given, wanted, runs(recording, wanted))

    return {"loops": loops, "fit": fit, "residuals": residuals}


def _listed(channels: Iterable[tuple[str, str]]) -> str:
    return ", ".join(f"{name} [{unit}]" if unit else name for name, unit in channels)


def _rate(block: Block) -> str:
    if block.sample_time is not None:
        return f"a sample every {numeral(block.sample_time)} s"
    return "matters" if block.rate_dependent else "does not matter"


def _inverse(block: Block) -> str:
    if block.undoing:
        return ""
    try:
        return block.inverse().title
    except MckibbenError:
        return "none"
