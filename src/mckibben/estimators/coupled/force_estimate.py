"""Force on a muscle from its measured pressure and displacement: a load cell without a load cell.

A balance of forces is asked for its load: what the displacement and its past, and the pressure, leave
for it. The interval comes from runs that the estimate was not fitted to, each left out in
turn (Vovk and others' conformal prediction, run by run), and so holds for loads like those recorded.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mckibben.blocks.base import Block
from mckibben.blocks.coupled.load_estimate import load_of
from mckibben.errors import DataError
from mckibben.estimators.coupled.balance import BalanceEstimator
from mckibben.recording import Recording


@dataclass(frozen=True)
class ForceEstimate:
    """What estimates a force.

    Parameters
    ----------
    block : Block
        From displacement and pressure to force.
    half_width : float
        Of the interval [N].
    level : float
        Share of samples of left-out runs that the interval held.
    """

    block: Block
    half_width: float
    level: float

    def estimate(self, recording: Recording) -> Recording:
        """Return ``force_model`` with ``force_low`` and ``force_high`` over a recording [N]."""
        found = self.block.simulate(recording)["force"]
        names = ("force_model", "force_low", "force_high")
        values = (found, found - self.half_width, found + self.half_width)
        return recording.with_channels(
            dict.fromkeys(names, "N"), **dict(zip(names, values, strict=True))
        )


def fit_force_estimate(
    recordings: Sequence[Recording],
    *,
    pressure: str = "pressure",
    displacement: str = "displacement",
    level: float = 0.95,
) -> ForceEstimate:
    """Return an estimate of force learned from recordings of pressure, displacement and force.

    Parameters
    ----------
    recordings : sequence of Recording
        At least three runs, of different loads.
    pressure, displacement : str
        Channels.
    level : float
        Share of samples that the interval should hold, between 0.5 and 1.

    Raises
    ------
    DataError
        On fewer than three runs, or a level out of range.
    """
    if len(recordings) < 3:
        raise DataError(
            f"{len(recordings)} run(s) are too few to tell how good an estimate of force is",
            remedy="give at least three, under different loads",
        )
    if not 0.5 <= level < 1:
        raise DataError(f"level is {level}", remedy="give a share between 0.5 and 1")

    def fitted(runs: Sequence[Recording]) -> Block:
        estimator = BalanceEstimator(
            input=(pressure,), output=(displacement,), scheduling=("force",)
        )
        return load_of(estimator.fit(runs).fitted)

    missed = []
    for place, left_out in enumerate(recordings):
        others = [run for number, run in enumerate(recordings) if number != place]
        missed.append(np.abs(fitted(others).simulate(left_out)["force"] - left_out["force"]))
    half = float(np.quantile(np.concatenate(missed), level))
    return ForceEstimate(fitted(recordings), half, level)
