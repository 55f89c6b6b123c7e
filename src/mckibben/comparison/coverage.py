"""Where training has been in the plane of all inputs together, and how models do elsewhere.

A network of local rules says something only where it was shown something. That every input of a test
is within the range of the training does not tell: muscles moved one at a time cover the edges of the
box that these ranges span, and nothing inside it. So a sample is called outside of the training where
the nearest sample of that is farther away than training runs are from each other.

Nothing here is fitted or chosen by: it explains errors on the test once they are known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.numerals import numeral
from mckibben.recording import Recording

Mask = NDArray[np.bool_]

QUANTILE = 0.99
"""Of the distances from every training sample to the nearest of another run: farther is outside."""

NEAREST, FARTHEST = 0.05, 0.25
"""Distances, as shares of a range, that are inside and outside whatever the runs: a repeated run is near
itself, and levels may be far apart."""

MOST_SAMPLES = 10_000
"""Of the training that are kept to measure distances to, evenly thinned."""

DRAWN = 4096
"""Points spread evenly over the box of ranges, to tell how much of it is covered."""

PIECES = 4
"""Parts that a single run counts as."""

STILL = 0.01
"""An input whose range is below this share of its largest value is held, and does not span the box."""

ALONG_A_LINE = 0.99
"""Share of a run's variance along one direction from which its inputs move in one pattern."""

COVERED = 0.5
"""Share of the box of ranges from which training is said to cover it."""

FEWEST = 20
"""Samples that an error is told of."""

LARGER = 1.5
"""Error outside over error inside, or on the data fitted, from which a model is not to be trusted."""


@dataclass(frozen=True)
class OffTraining:
    """How a model does where its training has been, and where it has not.

    Parameters
    ----------
    trained : str
        What the training was, in words.
    covered : float
        As of `Coverage`.
    share : float
        Of the test samples that are outside, 0 to 1.
    inside, outside : float or None
        RMSE on the test samples there, of several outputs the mean of theirs; None of fewer than
        `FEWEST`.
    fitted : float or None
        The same on the data fitted. A memory that came to a sample from elsewhere is wrong inside too,
        which this tells.
    unit : str
        Of the outputs.
    """

    trained: str
    covered: float
    share: float
    inside: float | None
    outside: float | None
    fitted: float | None = None
    unit: str = ""

    @property
    def ratio(self) -> float | None:
        """Error outside over error inside, or None where one of them is not known."""
        return self._times(self.inside)

    @property
    def ratio_to_fitted(self) -> float | None:
        """Error outside over that on the data fitted, or None where one of them is not known."""
        return self._times(self.fitted)

    def _times(self, other: float | None) -> float | None:
        return None if self.outside is None or not other else self.outside / other

    @property
    def trusted(self) -> bool | None:
        """Whether the model is to be trusted off its training; None where the test cannot tell.

        Where next to no test sample is outside, there is no such place if training covers the range.
        """
        if self.outside is None:
            return True if self.covered >= COVERED else None
        ratios = [ratio for ratio in (self.ratio, self.ratio_to_fitted) if ratio is not None]
        return max(ratios) < LARGER if ratios else None

    def __str__(self) -> str:
        """Return it as a sentence without its end.

        >>> str(OffTraining("8 runs", 0.9, 0.0, 1.1, None, "mm"))  # doctest: +ELLIPSIS
        'trained on 8 runs that cover 90 % of the joint range of its inputs; no test sample is...'
        """
        covered, share = numeral(100 * self.covered, 2), numeral(100 * self.share, 2)
        cover = "covers" if self.trained.startswith("1 ") else "cover"
        begin = (
            f"trained on {self.trained} that {cover} {covered} % of the joint range of its inputs; "
        )
        if self.outside is None:
            where = f"{share} % of the test samples are" if self.share else "no test sample is"
            end = (
                "trust it within that range as its test error says"
                if self.trusted
                else "nothing here tells what it does elsewhere: test it where all inputs move"
            )
            return f"{begin}{where} outside of them, so {end}"
        begin += f"on {share} % of the test samples it is outside of them, "
        begin += f"where it is off by {numeral(self.outside, 3)} {self.unit}".rstrip() + " RMSE"
        sides = (
            (self.ratio, "inside", self.inside),
            (self.ratio_to_fitted, "on the data fitted", self.fitted),
        )
        times = [
            f"{numeral(ratio, 2)} times its error {where} ({numeral(error, 3)})"
            for ratio, where, error in sides
            if ratio is not None
        ]
        if not times:
            return begin
        return f"{begin}, {' and '.join(times)}: " + (
            "it holds there too"
            if self.trusted
            else "do not trust it there beyond that, or train on recordings in which inputs move so "
            "together"
        )

    def to_dict(self) -> dict[str, Any]:
        """Return it for JSON."""
        return asdict(self) | {
            "ratio": self.ratio,
            "ratio_to_fitted": self.ratio_to_fitted,
            "trusted": self.trusted,
        }


@dataclass(frozen=True)
class Coverage:
    """What training covers of its inputs' joint range.

    Parameters
    ----------
    inputs : tuple of str
        Channels: what drives, then what schedules.
    n_runs : int
        Training recordings.
    n_patterns : int or None
        Ways in which their inputs move; None where some run moves them independently.
    covered : float
        Share of the box of the training's ranges that is within `radius` of a training sample, 0 to 1.
    radius : float
        Distance from the nearest training sample beyond which a sample is outside; of inputs scaled by
        their ranges.
    outside : tuple of bool arrays
        For every test recording, which samples are.
    """

    inputs: tuple[str, ...]
    n_runs: int
    n_patterns: int | None
    covered: float
    radius: float
    outside: tuple[Mask, ...] = field(repr=False, compare=False)

    @property
    def trained(self) -> str:
        """What the training was, in words."""
        n, what = (self.n_runs, "run") if self.n_patterns is None else (self.n_patterns, "pattern")
        return f"{n} {what}{'' if n == 1 else 's'}"

    def of(
        self,
        errors: Array,
        rows: Sequence[Mask],
        fitted: float | None = None,
        unit: str = "",
    ) -> OffTraining:
        """Return how a model does inside and outside.

        Parameters
        ----------
        errors : array, shape (n, k)
            At all scored samples of the test recordings, one after another.
        rows : sequence of bool arrays
            Which samples of these are scored.
        fitted : float, optional
            The model's error on the data fitted.
        unit : str
            Of the errors.
        """
        pairs = zip(self.outside, rows, strict=True)
        far = np.concatenate([own[kept] for own, kept in pairs])
        return OffTraining(
            trained=self.trained,
            covered=self.covered,
            share=float(far.mean()),
            inside=_rmse(errors[~far]),
            outside=_rmse(errors[far]),
            fitted=fitted,
            unit=unit,
        )


def coverage_of(
    train: Sequence[Recording], test: Sequence[Recording], inputs: Sequence[str]
) -> Coverage | None:
    """Return what training covers of the joint range of some inputs, and where tests are outside.

    Parameters
    ----------
    train, test : sequence of Recording
        Fitted to, and tested on.
    inputs : sequence of str
        Channels, each in every recording.

    Returns
    -------
    Coverage or None
        None of fewer than two inputs that move in the training, where ranges say it all.
    """
    from scipy.spatial import cKDTree

    known = [recording.matrix(inputs) for recording in train]
    asked = [recording.matrix(inputs) for recording in test]
    stacked = np.concatenate(known)
    low, span = stacked.min(axis=0), np.ptp(stacked, axis=0)
    moving = span > STILL * np.abs(stacked).max(axis=0)
    if moving.sum() < 2:
        return None
    every = np.concatenate([stacked, *asked])
    whole = np.ptp(every, axis=0)
    # what only the test moves is scaled by how far it does; what nothing moves says nothing
    used = moving | (whole > STILL * np.abs(every).max(axis=0))
    scale = np.where(moving, span, np.where(whole > 0, whole, 1.0))
    stride = -(-len(stacked) // MOST_SAMPLES)
    runs = [((own - low) / scale)[::stride, used] for own in known]
    others = runs if len(runs) > 1 else np.array_split(runs[0], PIECES)
    apart = [_distances_to_others(others, place) for place in range(len(others))]
    radius = float(np.clip(np.quantile(np.concatenate(apart), QUANTILE), NEAREST, FARTHEST))
    tree = cKDTree(np.concatenate(runs))

    def far(points: Array) -> Mask:
        return np.asarray(tree.query(points, distance_upper_bound=radius * (1 + 1e-9))[0] > radius)

    box = np.zeros((DRAWN, int(used.sum())))
    box[:, moving[used]] = _spread(DRAWN, int(moving.sum()))
    # what is held rests at its mean
    held = ~moving[used]
    box[:, held] = ((stacked.mean(axis=0) - low) / scale)[used][held]
    return Coverage(
        inputs=tuple(inputs),
        n_runs=len(train),
        n_patterns=_patterns([(own / scale)[:, moving] for own in known]),
        covered=float(1 - far(box).mean()),
        radius=radius,
        outside=tuple(far(((own - low) / scale)[:, used]) for own in asked),
    )


def _distances_to_others(runs: Sequence[Array], place: int) -> Array:
    """Return how far every sample of a run is from the nearest of another."""
    from scipy.spatial import cKDTree

    others = np.concatenate([run for k, run in enumerate(runs) if k != place])
    return np.asarray(cKDTree(others).query(runs[place])[0])


def _spread(n: int, dimensions: int) -> Array:
    """Return points spread evenly over the unit box, the same ones always."""
    from scipy.stats.qmc import Halton

    return np.asarray(Halton(dimensions, scramble=False).random(n))


def _patterns(runs: Sequence[Array]) -> int | None:
    """Return how many ways there are in which inputs move, each along a line; None where some do not."""
    found: set[tuple[float, ...]] = set()
    for run in runs:
        _, sizes, directions = np.linalg.svd(run - run.mean(axis=0), full_matrices=False)
        if not sizes[0] ** 2 >= ALONG_A_LINE * (sizes**2).sum():
            return None
        direction = directions[0] * np.sign(directions[0][np.abs(directions[0]).argmax()])
        found.add(tuple(np.round(direction, 1) + 0.0))
    return len(found)


def _rmse(errors: Array) -> float | None:
    if len(errors) < FEWEST:
        return None
    return float(np.sqrt(np.mean(errors**2, axis=0)).mean())
