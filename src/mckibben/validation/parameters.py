"""Parameters of a fitted model, and how sure each is, where residuals remember too."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.equations import quantities
from mckibben.errors import ModelError
from mckibben.estimators.core.uncertainty import (
    DIFFERENCE,
    LARGEST,
    autoregressions,
    relative_sizes,
    sandwich,
    vanishing,
)
from mckibben.recording import Recording
from mckibben.system.threads import cores

LEVEL = 0.95
"""Of intervals."""

MOST, MOST_OPERATIONS = 3_000_000, 200_000_000
"""Samples simulated for sensitivities, of all parameters together, and operations of models that are
solved; of longer recordings the beginnings are taken, as if the rest told as much."""

SOLVED = 10
"""Operations of a step, for every parameter, above which a model is solved rather than computed."""

UNFELT = 1e-6
"""Share of the most felt parameter's sensitivity below which one is not felt."""


@dataclass(frozen=True)
class Parameter:
    """One number of a model.

    Parameters
    ----------
    name, symbol : str
        For people, and in LaTeX.
    value : float
    unit : str
        Empty for none.
    meaning : str
        In words.
    standard_error : float or None
        In its unit; None where `said` tells why.
    interval : (float, float) or None
        In which it lies by 95 %.
    said : str
        Why it has no standard error; empty where it has.
    """

    name: str
    symbol: str
    value: float
    unit: str
    meaning: str
    standard_error: float | None
    interval: tuple[float, float] | None
    said: str = ""


@dataclass(frozen=True, eq=False)
class Sureness:
    """What recordings tell of a model's parameters together.

    Parameters
    ----------
    covariance : array, shape (n_parameters, n_parameters)
        NaN for those not told.
    said : tuple of str
        For every parameter, why it is not told; empty where it is.
    condition : float
        Of the sensitivities, each parameter scaled by its size.
    n_effective : float
        Independent samples that are worth as much as all these, for the mean of an output.
    terms : tuple of int
        Of every output, of the autoregression of its residuals.
    """

    covariance: Array
    said: tuple[str, ...]
    condition: float
    n_effective: float
    terms: tuple[int, ...]

    @property
    def half_width(self) -> float:
        """Half an interval, in standard errors."""
        from scipy.stats import t

        known = int(np.isfinite(np.diag(self.covariance)).sum())
        return float(t.ppf(0.5 + LEVEL / 2, max(self.n_effective - known, 1.0)))


def residuals(block: Block, recordings: Sequence[Recording]) -> list[Array]:
    """Return what a model's free run leaves of every recording, measured less modelled, (n, m) each."""
    names = [channel.name for channel in block.outputs]
    return [r.matrix(names) - block.simulate(r).matrix(names) for r in recordings]


def parameters(block: Block, sure: Sureness) -> tuple[Parameter, ...]:
    """Return every number of ``block.pack()``, in its order, with what it is and how sure it is.

    What is rounding beside the others, as a weight of 1e-17, is shown as 0.
    """
    found = []
    deviations = np.sqrt(np.diag(sure.covariance))
    values = block.pack()
    shown = np.where(vanishing(values), 0.0, values).tolist()
    for what, value, own, said in zip(
        quantities(block), shown, deviations.tolist(), sure.said, strict=True
    ):
        half = own * sure.half_width
        told = not said
        found.append(
            Parameter(
                what.name,
                what.symbol,
                value,
                what.unit,
                what.meaning,
                own if told else None,
                (value - half, value + half) if told else None,
                said,
            )
        )
    return tuple(found)


def sureness(block: Block, recordings: Sequence[Recording], left: Sequence[Array]) -> Sureness:
    """Return what recordings tell of a model's parameters.

    Parameters
    ----------
    left : sequence of array, shape (n, m)
        What `residuals` gives.
    """
    n_parameters = block.n_parameters
    covariance = np.full((n_parameters, n_parameters), np.nan)
    said = fixed(block)
    values = block.pack()
    sizes = relative_sizes(values)
    total = sum(map(len, left))
    steps = max(total * n_parameters, 1)
    share = min(1.0, MOST / steps, MOST_OPERATIONS / (steps * _operations(block, recordings[0])))
    kept = [r.slice(0, max(round(share * len(r)), min(len(r), 50))) for r in recordings]
    left = [e[: len(r)] for e, r in zip(left, kept, strict=True)]
    share = sum(map(len, left)) / total
    models = autoregressions(left)
    worth = min(model.effective_sample_size(sum(map(len, left))) for model in models) / share
    places = [place for place in range(n_parameters) if not said[place]]
    columns: list[list[Array]] = []
    given = [channel.name for channel in block.outputs]
    base = [block.simulate(r).matrix(given) for r in kept]  # anew: a start may be fitted
    with ThreadPoolExecutor(cores()) as pool:
        moved = list(pool.map(lambda place: _sensitivity(block, kept, base, place), places))
    for place, column in zip(places, moved, strict=True):
        if column is None:
            said[place] = "cannot be moved on its own without breaking the model"
        else:
            columns.append(column)
    places = [place for place in places if not said[place]]
    terms = tuple(model.coefficients.size for model in models)
    if not columns or not all(np.isfinite(e).all() for e in left):
        said = [reason or "the model's output is not finite" for reason in said]
        return Sureness(covariance, tuple(said), np.inf, worth, terms)
    moves = [np.stack([column[run] for column in columns], axis=2) for run in range(len(left))]
    if worth < 1 + len(places):
        short = (
            f"{len(places)} parameters cannot be told from about {worth:.0f} independent samples"
        )
        said = [reason or short for reason in said]
        return Sureness(covariance, tuple(said), np.inf, worth, terms)
    condition, found, told = sandwich(moves, left, models)
    felt = [max(float(np.abs(slopes).max()) for slopes in column) for column in columns]
    for place, known, own_felt in zip(places, told.tolist(), felt, strict=True):
        if not known:
            apart = own_felt > UNFELT * max(felt)
            alone = "only together with others" if apart else "it moves nothing in them"
            said[place] = f"not determined by these recordings: {alone}"
    found = share * found[np.ix_(told, told)]  # as if the rest told as much
    known_places = np.array(places)[told]
    covariance[np.ix_(known_places, known_places)] = found * np.multiply.outer(
        sizes[known_places], sizes[known_places]
    )
    return Sureness(covariance, tuple(said), condition, worth, terms)


def fixed(block: Block) -> list[str]:
    """Return for every parameter why no fit finds it: chosen, or at a bound; empty where one does."""
    values, found = block.pack(), []
    for name, value, none in zip(block.parameter_names, values, vanishing(values), strict=True):
        if name.endswith("input offset"):
            found.append("chosen: the point about which the model is linear")
        elif none:
            found.append("0: at a bound, or left out")
        elif value == 1:
            found.append("exactly 1: chosen, as what others are relative to")
        else:
            found.append("")
    return found


def _operations(block: Block, recording: Recording) -> float:
    """Return what a step costs, where solving it costs far more than a pass over the numbers; else 1."""
    parts: Sequence[Block] = getattr(block, "parts", ())
    if parts:
        return sum(_operations(part, recording) for part in parts)
    try:
        usual = block.cost(recording.sample_time).usual
    except ModelError:
        return 1.0
    return float(usual) if usual > SOLVED * block.n_parameters else 1.0


def _sensitivity(
    block: Block, recordings: Sequence[Recording], base: Sequence[Array], place: int
) -> list[Array] | None:
    """Return how every run's outputs move with a parameter, in units of its size; None if it cannot.

    Parameters
    ----------
    base : sequence of array, shape (n, m)
        Outputs where it does not move.
    """
    values = block.pack()
    size = relative_sizes(values)[place]
    names = [channel.name for channel in block.outputs]
    for step in (DIFFERENCE, -DIFFERENCE):
        moved = values.copy()
        moved[place] += step * size
        try:
            with np.errstate(all="ignore"):
                other = block.unpack(moved)
                runs = [other.simulate(r).matrix(names) for r in recordings]
        except ModelError:  # the other way may be open
            continue
        slopes = [(run - at) / step for run, at in zip(runs, base, strict=True)]
        if all(np.abs(slope).max() < LARGEST for slope in slopes):
            return slopes
    return None
