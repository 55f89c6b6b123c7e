"""Parameters of a model that recordings leave open, seen from how its output moves with them."""

from __future__ import annotations

import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.equations import quantities
from mckibben.blocks.running import run_many
from mckibben.errors import MckibbenError
from mckibben.estimators.core.checking import training_data
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.core.uncertainty import (
    LARGEST,
    relative_sizes,
    sensitivities,
    simulate_all,
)
from mckibben.excitation.gap import Gap, value
from mckibben.excitation.runs import Proposal, Reach, proposals
from mckibben.excitation.seen import Seen
from mckibben.recording import Recording

LOOSE = 0.5
"""Standard error, relative to a parameter's size, from which it is not known."""

TIMES = (1, 3, 10)
"""How often a run may be recorded for the sake of a parameter."""

FEW = 3
"""Numbers of a vector up to which each means something; of longer ones, such as the coefficients of a
polynomial, the best known combination is judged."""

LONGEST = 1200.0
"""How long that may take in all [s]."""

KNOWN_BEFORE = 0.01
"""Precision with which any parameter is known beforehand: to within a hundred times its size."""

MOST = 20_000
"""Samples on which outputs are compared."""

MANY = 150
"""Parameters above which a model is a network, or a table."""

ROUNDING = 1e-6
"""Error of a model, as a share of what it should give, below which it has none."""

TOLD = 4
"""Groups of parameters that are spoken of at most."""

ALIKE = 0.9
"""Share of what a parameter moves that another's moves alike, from which both are told only together."""


def parameters(
    recordings: Sequence[Recording],
    model: Block,
    facts: Seen | None = None,
) -> list[Gap]:
    """Return which parameters of a model recordings leave open, each with the run that would tell it.

    What no run tells is in the model's nature, such as two offsets of which only the sum matters, and is
    left out; so are models of very many parameters, which mean nothing each.

    Parameters
    ----------
    recordings : sequence of Recording
    model : Block
        Its error on the recordings counts as noise, correlated as it is.
    facts : Seen, optional
        Of the recordings, for usual speeds.

    Raises
    ------
    DataError
        If a recording lacks a channel of the model.
    """
    driven = [one.name for one in model.inputs if one.name not in model.scheduling]
    outputs = [one.name for one in model.outputs]
    data = training_data(
        recordings, driven, outputs, scheduling=tuple(model.scheduling), one_rate=False
    )
    data = _shortened(data, model)
    theta = model.pack()
    # what is exactly 0 ended at its bound, and what is exactly 1 is a norm
    free = np.flatnonzero((theta != 0) & (theta != 1)).tolist()
    if not 0 < len(free) <= MANY:
        return [_unknown(f"it has {len(free)} that are free, which say nothing one by one")]
    sizes = relative_sizes(theta)
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            target, base = data.target, simulate_all([model], data)[0]
            slopes = sensitivities(model, free, sizes[free], lambda many: simulate_all(many, data))
            known = np.isfinite(slopes).all(axis=0) & (np.abs(slopes).max(axis=0) < LARGEST)
            free = [place for place, good in zip(free, known, strict=True) if good]
            slopes = slopes[:, known]
            variance = _variance(target, target - base, len(free))
            told = slopes.T @ slopes / variance
            runs = _runs(model, data, facts)
            more = [
                (run, _information(model, free, sizes, run) * _weight(run, data) / variance)
                for run in runs
            ]
    except MckibbenError as error:
        return [_unknown(str(error).rstrip("."))]
    if not free:
        return [_unknown("its output does not move with them, or is not finite")]
    groups = _groups(model, free)
    meanings = _meanings(model, groups, free)
    gaps = [gap for name in groups if (gap := _gap(name, groups, told, more, meanings))]
    return sorted(gaps, key=lambda gap: -gap.severity)[:TOLD]


def _unknown(why: str) -> Gap:
    """Return that nothing is known of a model's parameters."""
    return Gap(
        "parameters",
        f"Which parameters of the model these recordings tell cannot be said: {why}.",
        "Check the model on a run that it was not fitted to (mckibben check).",
        "how sure each parameter is",
        0.05,
    )


def standard_error(told: Array, places: Sequence[int]) -> float:
    """Return that of the best known combination of some parameters, all others unknown, in their sizes.

    Parameters
    ----------
    told : array, shape (k, k)
        Information about all parameters in units of their sizes.
    places : sequence of int
    """
    information = told + KNOWN_BEFORE**2 * np.eye(len(told))
    others = [place for place in range(len(told)) if place not in places]
    own = information[np.ix_(places, places)]
    if others:
        across = information[np.ix_(others, places)]
        own = own - across.T @ np.linalg.solve(information[np.ix_(others, others)], across)
    return float(1 / np.sqrt(max(np.linalg.eigvalsh(own)[-1], 1e-300)))


def _gap(
    name: str,
    groups: Mapping[str, list[int]],
    told: Array,
    more: Sequence[tuple[Proposal, Array]],
    meanings: Mapping[str, str],
) -> Gap | None:
    places = groups[name]
    error = standard_error(told, places)
    if error <= LOOSE:
        return None
    enough = [
        (times * _seconds(run), times, run.words, after)
        for run, extra in more
        for times in TIMES
        if times * _seconds(run) <= LONGEST
        and (after := standard_error(told + times * extra, places)) <= LOOSE
    ]
    if not enough:
        return None
    _, times, words, after = min(enough)
    meaning = meanings[name]
    partner = _partner(told, name, groups)
    size = "more than ten times its size" if error > 10 else f"{value(100 * error)} % of its size"
    sentence = (
        f"Of the model fitted, {meaning} cannot be told: its standard error is {size}."
        if partner is None
        else f"Of the model fitted, {meaning} and {meanings[partner]} can be told "
        f"only together: the standard error of the former is {size}."
    )
    return Gap(
        "parameters",
        sentence,
        f"{words}{'' if times == 1 else f', {times} times'}, which would bring it to about "
        f"{value(100 * after)} %.",
        f"“{name}”, and what it is used for away from these recordings",
        0.3 + 0.15 * min(2.0, np.log10(error / LOOSE)),
        {"standard_error": error, "after": after},
        (),
    )


def _seconds(run: Proposal) -> float:
    """Return how long a run takes [s]; 0 without time."""
    return len(run.inputs) * (run.sample_time or 0.0)


def _partner(told: Array, own_name: str, groups: Mapping[str, list[int]]) -> str | None:
    """Return the other group of parameters that moves the output alike, if one does."""
    found, places = (0.0, ""), groups[own_name]
    own = told[np.ix_(places, places)]
    if np.trace(own) == 0:
        return None
    for name, others in groups.items():
        if name != own_name:
            across = told[np.ix_(others, places)]
            ridge = 1e-9 * np.trace(told) * np.eye(len(others))
            same = across.T @ np.linalg.solve(told[np.ix_(others, others)] + ridge, across)
            found = max(found, (float(np.trace(same) / np.trace(own)), name))
    return found[1] if found[0] > ALIKE else None


def _groups(model: Block, free: Sequence[int]) -> dict[str, list[int]]:
    """Return what is judged as a whole: name -> places among the free parameters."""
    names = [quantity.name for quantity in quantities(model)]
    fields: dict[str, list[int]] = {}
    for place, index in enumerate(free):
        fields.setdefault(re.sub(r"( \d+)+$", "", names[index]), []).append(place)
    groups: dict[str, list[int]] = {}
    for field, places in fields.items():
        if len(places) > FEW:
            groups[field] = places
        else:
            for place in places:
                name = names[free[place]]
                groups[f"{name} ({free[place] + 1})" if name in groups else name] = [place]
    return groups


def _meanings(model: Block, groups: Mapping[str, list[int]], free: Sequence[int]) -> dict[str, str]:
    """Return what every group is, in words, its name first."""
    every = quantities(model)
    told = {name: every[free[places[0]]].meaning for name, places in groups.items()}
    return {
        name: f"“{name}” ({meaning[0].lower()}{meaning[1:]})" if meaning else f"“{name}”"
        for name, meaning in told.items()
    }


def _variance(target: Array, residual: Array, n_free: int) -> float:
    """Return what one sample's noise would be if it alone were as uncertain as the residual is.

    Residuals that hang together tell less: as many times as an autoregression of their first lag says.
    None is taken to be smaller than rounding.
    """
    power = float(residual @ residual) / max(residual.size - n_free, 1)
    if power <= ROUNDING**2 * float(np.var(target)):
        return ROUNDING**2 * float(np.var(target))
    lag = float(residual[1:] @ residual[:-1] / (residual @ residual))
    return power * min((1 + lag) / max(1 - lag, 1e-9), residual.size / 10) if lag > 0 else power


def _shortened(data: TrainingData, model: Block) -> TrainingData:
    """Return fewer samples: every so manieth, or the first of a model bound to its sample time."""
    total = sum(len(run.inputs) for run in data.runs)
    every = -(-total // MOST)
    if every == 1:
        return data
    if model.sample_time is None:
        return replace(data, runs=tuple(run.thinned(every) for run in data.runs))
    return replace(
        data, runs=tuple(run.cut(0, max(10, run.u.shape[0] // every)) for run in data.runs)
    )


def _runs(model: Block, data: TrainingData, facts: Seen | None) -> list[Proposal]:
    def reach(name: str, unit: str, values: Array) -> Reach:
        speed = None
        if facts is not None and name in facts.branches:
            slow = [branch.slow for branch in facts.branches[name] if branch.slow]
            speed = float(np.median(slow)) if slow else None
        return Reach(name, unit, float(values.min()), float(values.max()), speed)

    given = np.concatenate([run.inputs for run in data.runs])
    reaches = [
        reach(channel.name, channel.unit, column)
        for channel, column in zip(model.inputs, given.T, strict=True)
    ]
    driven = [one for one in reaches if one.name not in model.scheduling and one.high > one.low]
    if len(driven) + len(model.scheduling) != len(reaches):
        return []
    beside = [one for one in reaches if one.name in model.scheduling]
    return list(proposals(driven, beside, model.sample_time))


def _weight(run: Proposal, data: TrainingData) -> float:
    """Return how many samples a sample of a run stands for, by time, of those compared."""
    steps = [own.sample_time for own in data.runs if own.sample_time is not None]
    return run.sample_time / float(np.mean(steps)) if steps and run.sample_time else 1.0


def _information(model: Block, free: Sequence[int], sizes: Array, run: Proposal) -> Array:
    """Return what a run tells of parameters, for a noise of 1."""
    slopes = sensitivities(
        model,
        free,
        sizes[list(free)],
        lambda many: run_many(many, run.inputs, sample_time=run.sample_time).reshape(len(many), -1),
    )
    slopes = np.where(np.isfinite(slopes), slopes, 0.0)
    return np.asarray(slopes.T @ slopes)
