"""The band of a model that was compared: found on the cross-validation's errors, tried on the test."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mckibben.arrays import Array
from mckibben.bands.finding import find_band
from mckibben.bands.held import Held
from mckibben.bands.scale import SHAPES
from mckibben.blocks.bands import Band, Banded
from mckibben.blocks.base import Block
from mckibben.errors import DataError
from mckibben.numerals import numeral

if TYPE_CHECKING:
    from mckibben.comparison.fitting import Data


UNLIKE = 0.1
"""By which a band holds less than it should where the test is not like what was held out."""


@dataclass(frozen=True)
class TestedBand:
    """How a band from the training side does on the test.

    Parameters
    ----------
    level : float
        What it is to hold: 0.9, or the most that so few units allow.
    unit : {"run", "block"}
        What counts as exchangeable.
    units : int
        How many of them the cross-validation had.
    unit_of_width : str
        Unit of the outputs.
    coverage, width, constant_coverage, constant_width : mapping of str to float
        By output: the share of samples inside, and the mean width; and those of a band that is the same
        everywhere, found likewise.
    """

    __test__ = False  # it is no test

    level: float
    unit: str
    units: int
    unit_of_width: str
    coverage: Mapping[str, float]
    width: Mapping[str, float]
    constant_coverage: Mapping[str, float]
    constant_width: Mapping[str, float]

    def __str__(self) -> str:
        """Return it as a sentence without its end."""
        each = [
            f"{name} {numeral(100 * self.coverage[name], 3)} % ({numeral(width, 2)} "
            f"{self.unit_of_width} wide on average, one that is the same everywhere "
            f"{numeral(self.constant_width[name], 2)})"
            for name, width in self.width.items()
        ]
        short = min(self.coverage.values()) < self.level - UNLIKE
        return (
            f"of the test's samples, its band for {numeral(100 * self.level, 3)} %, from {self.units} "
            f"{self.unit}s of the cross-validation, holds {', '.join(each)}"
            + (
                "; do not rely on it: what was held out in training is not like the test. Remedy: "
                "calibrate it on runs like those to come"
                if short
                else ""
            )
        )

    def to_dict(self) -> dict[str, Any]:
        """Return it for JSON, and in words."""
        return asdict(self) | {"said": str(self)}


def tested_band(
    block: Block, held: Sequence[Held], outputs: Sequence[Array], data: Data
) -> tuple[Banded, TestedBand] | None:
    """Return a model with its band, and how that does on the test; None where that cannot be told.

    Parameters
    ----------
    held : sequence of Held
        What models fitted without a part of the training side gave there.
    outputs : sequence of array, shape (n, k)
        Free-running, on every training recording, then every test recording.
    """
    names = data.channels.outputs
    if not held or tuple(channel.name for channel in block.outputs) != tuple(names):
        return None
    if any(run.inputs.shape[1] != len(block.inputs) for run in held):
        return None  # without a load that it is told, the others missed what it does not
    try:
        found, constant = find_band(block, held), find_band(block, held, shapes=SHAPES[:1])
    except DataError:
        return None
    coverage, width = _tried(found.band, outputs, data)
    other, wide = _tried(constant.band, outputs, data)
    by_name = [dict(zip(names, each, strict=True)) for each in (coverage, width, other, wide)]
    band, unit = found.band, block.outputs[0].unit
    tested = TestedBand(found.level, band.unit, band.units, unit, *by_name)
    return Banded(block, found.band), tested


def _tried(band: Band, outputs: Sequence[Array], data: Data) -> tuple[list[float], list[float]]:
    """Return the share of scored samples inside, and the mean width, of every output."""
    split, names = data.split, data.channels.outputs
    inside, width = [], []
    modelled = outputs[len(split.train) :]
    for recording, found, kept in zip(split.test, modelled, split.test_rows, strict=True):
        driving = recording.matrix(channel.name for channel in band.driving)
        given = np.hstack([driving, found])
        ends = band.simulate(given, sample_time=recording.sample_time).reshape(len(given), -1, 3)
        lower, upper = ends[kept, :, 1], ends[kept, :, 2]
        measured = recording.matrix(names)[kept]
        inside.append((lower <= measured) & (measured <= upper))
        width.append(upper - lower)
    return (
        np.concatenate(inside).mean(axis=0).tolist(),
        np.concatenate(width).mean(axis=0).tolist(),
    )
