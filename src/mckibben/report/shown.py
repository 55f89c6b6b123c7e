"""Which recordings of a study are shown, each once, with what the models make of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mckibben.recording import Recording

if TYPE_CHECKING:
    from mckibben.comparison.results import Study

Array = NDArray[np.float64]

MOST_RECORDINGS = 6
"""Recordings with figures of their own; the others are named."""


@dataclass(frozen=True, eq=False)
class Shown:
    """One recording and the models' free-running outputs on it.

    Parameters
    ----------
    recording : Recording
        Measured.
    outputs : mapping of str to array, shape (n,)
        Model name to its output, the chosen model first.
    role : str
        What the recording was used for, in words.
    test_from : int or None
        First sample of the part held out for the test, where one recording serves for both.
    """

    recording: Recording
    outputs: Mapping[str, Array]
    role: str
    test_from: int | None = None


def shown(study: Study) -> tuple[Shown, ...]:
    """Return all recordings of a study, those tested on first.

    Where the last part of a recording is held out, the study holds its first part once more to fit;
    that is not repeated here.
    """
    ranked = [row.model for row in study.leaderboard.rows if row.model in study.predictions]
    n_train = len(study.train)
    parts = [_part_of(study, recording) for recording in study.test]
    found = []
    for index, (recording, part) in enumerate(zip(study.test, parts, strict=True)):
        role = "test" if part is None else "first part to fit, rest to test"
        start = None if part is None else len(study.train[part])
        outputs = {model: study.predictions[model][n_train + index] for model in ranked}
        found.append(Shown(recording, outputs, role, start))
    for index, recording in enumerate(study.train):
        if index not in parts:
            outputs = {model: study.predictions[model][index] for model in ranked}
            found.append(Shown(recording, outputs, "fit"))
    return tuple(found)


def drawn(found: Sequence[Shown]) -> tuple[Shown, ...]:
    """Return those with figures of their own: recordings tested on first, then the longest."""
    by_weight = sorted(found, key=lambda one: (one.role == "fit", -len(one.recording)))
    return tuple(by_weight[:MOST_RECORDINGS])


def _part_of(study: Study, whole: Recording) -> int | None:
    """Return which training recording is the first part of a test recording, or None."""
    for index, part in enumerate(study.train):
        n = len(part)
        if (
            n < len(whole)
            and part.name == whole.name
            and part.start_time == whole.start_time
            and all(
                np.array_equal(part[name], whole[name][:n]) for name in (study.input, study.output)
            )
        ):
            return index
    return None
