"""Regressors of NARX models, from measured data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.estimators.core.data import Run, TrainingData
from mckibben.estimators.hysteresis.pi import play_operators


@dataclass(frozen=True)
class Lags:
    """What a NARX model looks at, and the scales of its input and output."""

    output_lags: int
    input_lags: int
    delay: int
    thresholds: tuple[float, ...]
    input_scale: tuple[float, float]
    output_scale: tuple[float, float]

    @classmethod
    def of(
        cls, data: TrainingData, output_lags: int, input_lags: int, delay: int, operators: int
    ) -> Lags:
        """Return the lags with scales that bring the data to -1 to 1."""
        (ul, uh), (yl, yh) = data.input_range, data.output_range
        radii = np.arange(1, operators + 1) / (operators + 1)
        return cls(
            output_lags,
            input_lags,
            delay,
            tuple(radii.tolist()),
            (0.5 * (ul + uh), 0.5 * (uh - ul)),
            (0.5 * (yl + yh), 0.5 * (yh - yl)),
        )

    @property
    def size(self) -> int:
        """Number of regressors."""
        return self.output_lags + self.input_lags + len(self.thresholds)

    @property
    def first(self) -> int:
        """The first sample whose regressors are all measured."""
        return max(self.output_lags, self.delay + self.input_lags - 1)

    def scaled(self, run: Run) -> tuple[Array, Array]:
        """Return input and output of a run, scaled."""
        x = (run.u - self.input_scale[0]) / self.input_scale[1]
        y = (run.y - self.output_scale[0]) / self.output_scale[1]
        return x, y

    def table(self, run: Run, rule: str) -> tuple[Array, Array]:
        """Return regressors and next outputs of a run, where all samples involved count."""
        x, y = self.scaled(run)
        rows = np.arange(self.first, x.size)
        columns = [y[rows - 1 - k] for k in range(self.output_lags)]
        columns += [x[rows - self.delay - k] for k in range(self.input_lags)]
        if self.thresholds:
            columns += list(play_operators(x, np.array(self.thresholds), rule)[rows].T)
        whole = run.counts[rows].copy()
        for k in range(self.output_lags):
            whole &= run.counts[rows - 1 - k]
        return np.column_stack(columns)[whole], y[rows][whole]

    def fields(self, data: TrainingData) -> dict[str, Any]:
        """Return the fields of the block that belong to the lags."""
        return {
            "output_lags": self.output_lags,
            "input_lags": self.input_lags,
            "delay": self.delay,
            "thresholds": self.thresholds,
            "input_scale": self.input_scale,
            "output_scale": self.output_scale,
            "sample_time": data.sample_time,
        }
