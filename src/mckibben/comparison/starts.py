"""Where on a test an error lies: at the start, whose past no model is told.

A recording that continues none begins with motion, and with memory, that came before it. An accurate
model may be off there more than in all the rest; the error is of the whole all the same.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.comparison.splits import Split
from mckibben.numerals import numeral

HALF = 0.5
"""Share of the squared error that counts as most of it."""

SHORT = 0.05
"""Share of the longest recording tested on up to which its start is short."""


@dataclass(frozen=True)
class Start:
    """That most of the error on the test lies within the start of its recordings.

    Parameters
    ----------
    samples : int
        From the start of every recording, in which half of the squared error lies.
    of : int
        Samples of the longest recording.
    seconds : float or None
        Their duration; None without time.
    """

    samples: int
    of: int
    seconds: float | None

    def to_dict(self) -> dict[str, Any]:
        """Return its numbers, and what they say."""
        return asdict(self) | {"said": str(self)}

    def __str__(self) -> str:
        """Say where the error lies."""
        lasting = "" if self.seconds is None else f" ({numeral(self.seconds, 2)} s)"
        return (
            f"half of its squared error on the test lies in the first {self.samples} of {self.of} "
            f"samples{lasting}, which depend on what came before the recording: no model is told that. "
            "The test error is of the whole"
        )


def start_of(errors: Array, split: Split) -> Start | None:
    """Return the start in which half of the squared error lies; None where it is not short.

    Parameters
    ----------
    errors : array, shape (n, k)
        Of all samples that are scored, of all outputs.
    split : Split
        Which samples these are.
    """
    counts = [int(rows.sum()) for rows in split.test_rows]
    squares = np.zeros(max(counts))
    parts = np.split((errors**2).sum(axis=1), np.cumsum(counts)[:-1])
    for part, rows in zip(parts, split.test_rows, strict=True):
        if not rows[0] and rows[1:].all():  # it continues none
            squares[: part.size] += part
    within = np.cumsum(squares) >= HALF * float(np.sum(errors**2))
    samples = int(np.argmax(within)) + 1
    if not within.any() or samples > SHORT * squares.size:
        return None
    step = split.test[0].sample_time
    return Start(samples, squares.size, None if step is None else samples * step)
