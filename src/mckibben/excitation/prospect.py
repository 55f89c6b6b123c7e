"""What a plan is measured by: a criterion over likely models, and what is known before it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.equations import quantities
from mckibben.errors import DataError, ModelError
from mckibben.excitation.believed import Belief, telling
from mckibben.excitation.candidates import random_plan
from mckibben.excitation.information import Criterion, Known, Noise, Slopes, crossed
from mckibben.excitation.limits import Limits, at_rates, followed
from mckibben.excitation.unmodelled import Unmodelled

WORK = 5e4
"""Samples times parameters of one free run over a plan, by which its sample time is chosen."""

FINEST, COARSEST = 0.02, 0.1
"""Sample times of plans [s]."""

STRETCHES, SHORTEST, LONGEST = 25, 3.0, 10.0
"""How many stretches a plan has, and how long each is [s]."""

FEWEST = 3
"""Stretches without which there is nothing to choose."""

REFERENCE = 120.0
"""Random motion whose predictions are to be good [s]."""

UNSURE = 0.3
"""Error of predictions, over the range, that not knowing any parameter makes."""

WIDEST = 3.0
"""Largest error of a parameter that nothing is known of, over its value."""

MEMBERS, APART = 3, 0.3
"""Likely sets of parameters, and how far one is from the likeliest at most, of its value."""

NOISE, MEMORY, LEFT = 0.003, 0.2, 0.01
"""Where nothing is recorded: noise over the range, and over what time it is alike [s]. What a model
leaves at least, over the range."""

EXACT = 1e-5
"""Error over the range below which recordings are the model's own."""

EARLY, LARGER = 5, 2.0
"""Share of a recording that is its first part, one in so many, and how much larger errors are there
where it did not begin at rest."""

MOST_SAMPLES = 20_000
"""Of recordings, to know what they tell."""


@dataclass(frozen=True)
class Prospect:
    """What a plan is measured by.

    Parameters
    ----------
    criterion : Criterion
        What is to be made small.
    motion : Criterion
        The same for predictions, whatever the goal.
    known : Known
        Before the plan.
    limits : Limits
    step, length, n_stretches, n_last
        Sample time [s], samples of a stretch, stretches, and how many of them end it at rest.
    names, values, outputs
        Of the parameters, and of the outputs.
    """

    criterion: Criterion
    motion: Criterion
    known: Known
    limits: Limits
    step: float
    length: int
    n_stretches: int
    n_last: int
    names: tuple[str, ...]
    values: Array
    outputs: tuple[str, ...]

    def by_motion(self, known: Known) -> float:
        """Return the expected error of predictions, over the range of the output."""
        return float(np.sqrt(self.motion(known)))


def prospect_of(
    belief: Belief, limits: Limits, seconds: float, goal: str | None, seed: int
) -> Prospect:
    """Return what plans of so many seconds are measured by.

    Raises
    ------
    DataError
        On too short a time.
    ModelError
        On models that no plan can be made with, or a goal that names no parameter.
    """
    block, rng = belief.block, np.random.default_rng(seed + 1)
    places = telling(block)
    every = quantities(block)
    names = tuple(every[place].name for place in places)
    wanted = _wanted(names, goal)
    step = block.sample_time or min(
        max(belief.step, seconds * len(places) / WORK, FINEST), COARSEST
    )
    length = round(min(max(seconds / STRETCHES, SHORTEST), LONGEST) / step)
    n_stretches = int(seconds / (length * step) + 1e-9)
    ways = max(limit.span / limit.rate for limit in limits.values())
    n_last = int(np.ceil((ways + 2 * step) / (length * step)))
    if n_stretches - n_last < FEWEST:
        least = (FEWEST + n_last) * length * step
        raise DataError(
            f"{seconds:g} s are too short for a plan: what moves has to come back to rest, too",
            remedy=f"give --minutes {np.ceil(least / 6) / 10:g} or more",
        )
    low, high, rate, rest = at_rates(limits)
    driven = list(limits)
    columns = np.array([driven.index(channel.name) for channel in block.inputs])
    unmodelled = Unmodelled.of(low, high, rate, rng)
    reference = _reference(limits, length, step, rng)
    spans = _spans(block, reference, rest, columns, step)
    noise, recorded, pulls = _recorded(belief, places, limits, columns, unmodelled, spans)
    first = Criterion((Slopes(block, places, step),), unmodelled, noise, step, spans, columns)
    first = first.weighed_by(reference, first.start(rest))
    told = recorded + belief.known_before(places)
    precision = told + _wide(first.weights[0])
    blocks = _likely(block, places, precision, reference, rest, columns, step, spans, rng)
    members = tuple(Slopes(one, places, step) for one in blocks)
    motion = replace(first, members=members)
    motion = motion.weighed_by(reference, motion.start(rest))
    known = Known(tuple(told + _wide(weight) for weight in motion.weights), pulls)
    criterion = motion
    if wanted is not None:
        criterion = replace(motion, weights=[np.diag(wanted)] * len(members), shared=None)
    return Prospect(
        criterion,
        motion,
        known,
        limits,
        step,
        length,
        n_stretches,
        n_last,
        names,
        block.pack()[places],
        tuple(channel.name for channel in block.outputs),
    )


def _wanted(names: tuple[str, ...], goal: str | None) -> Array | None:
    """Return the shares of chosen parameters, or None where it is predictions that matter."""
    if goal is None:
        return None
    parts = [part.strip() for part in goal.split(",")]
    chosen = np.array([any(part and part in name for part in parts) for name in names])
    for part in parts:
        if not part or not any(part in name for name in names):
            raise ModelError(
                f"no parameter of the model has {part!r} in its name. Remedy: name some of "
                f"{', '.join(names)}"
            )
    return chosen / chosen.sum()


def _reference(limits: Limits, length: int, step: float, rng: np.random.Generator) -> list[Array]:
    """Return random motion of all that is driven, in stretches."""
    n = max(round(REFERENCE / (length * step)), 1)
    place, found = at_rates(limits)[3], []
    for stretch in random_plan(limits, n, length, step, rng):
        found.append(followed(stretch.targets, place, limits, step))
        place = found[-1][-1]
    return found


def _outputs(
    block: Block, reference: list[Array], rest: Array, columns: Array, step: float
) -> Array:
    """Return a model's outputs over motion from rest."""
    inputs = np.ascontiguousarray(np.vstack(reference)[:, columns])
    state = block.initial_state(np.ascontiguousarray(rest[columns]))
    outputs = np.empty((len(inputs), len(block.outputs)))
    block.bind(step, state, inputs, outputs)()
    return outputs


def _spans(block: Block, reference: list[Array], rest: Array, columns: Array, step: float) -> Array:
    """Return the ranges of a model's outputs.

    Raises
    ------
    ModelError
        Where it does not run free over this motion, or nothing moves.
    """
    outputs = _outputs(block, reference, rest, columns, step)
    spans = np.ptp(outputs, axis=0)
    if not (np.isfinite(spans).all() and (spans > 0).all()):
        raise ModelError(
            f"{block.kind!r} does not run free, or does not move, within these limits. Remedy: give "
            "limits in which it was identified, or another model."
        )
    return spans


def _recorded(
    belief: Belief,
    places: list[int],
    limits: Limits,
    columns: Array,
    unmodelled: Unmodelled,
    spans: Array,
) -> tuple[Noise, Array, Array]:
    """Return the noise of recordings, the precision that they give, and how they pull parameters."""
    p, k = len(places), unmodelled.phases.size
    precision, pulls = np.zeros((p, p)), np.zeros((spans.size, p, k))
    if not belief.recordings:
        return Noise(MEMORY * (NOISE * spans) ** 2, LEFT), precision, pulls
    block, rest = belief.block, at_rates(limits)[3]
    every_sample = sum(len(recording) for recording in belief.recordings)
    gathered, seen, errors, steps = [], [], [], []
    for recording in belief.recordings:
        every = 1 if block.sample_time else max(-(-every_sample // MOST_SAMPLES), 1)
        step = every * float(recording.sample_time or 1.0)
        commands = np.column_stack(
            [
                recording[name] if name in recording else np.full(len(recording), rest[i])
                for i, name in enumerate(limits)
            ]
        )[::every]
        inputs = np.ascontiguousarray(commands[:, columns])
        slopes = Slopes(block, places, step)
        base, by, _ = slopes.over(inputs, slopes.start(inputs[0]))
        measured = recording.matrix(channel.name for channel in block.outputs)[::every]
        features, _ = unmodelled.features(commands, unmodelled.start(commands[0]), step)
        error = measured - base
        begun = _begun(error)
        gathered.append(by[begun:])
        errors.append(error[begun:])
        steps.append(step)
        seen.append(features[begun:])
    density, left = np.empty(spans.size), 0.0
    for output, span in enumerate(spans.tolist()):
        own = [error[:, output] for error in errors]
        power = float(np.mean(np.concatenate(own) ** 2))
        alone = noise_of(own) ** 2 if power > (EXACT * span) ** 2 else power
        density[output] = max(alone * float(np.mean(steps)), (EXACT * span) ** 2)
        left += max(power * (1.0 - power / max(alone, power)), 0.0) / span**2 / spans.size
    for by, features, step in zip(gathered, seen, steps, strict=True):
        rows = (by * np.sqrt(step / density)[:, np.newaxis]).reshape(-1, p)
        precision += rows.T @ rows
        pulls += crossed(by, features, step * spans / density)
    # a model fitted to little leaves little of that, and more of what comes
    return Noise(density, max(float(np.sqrt(left)), LEFT)), precision, pulls


def _begun(errors: Array) -> int:
    """Return from which sample on errors are the model's, not of what came before the recording."""
    first = len(errors) // EARLY
    early, late = (np.mean(part**2, axis=0) for part in (errors[: first or None], errors[first:]))
    return first if (early > LARGER**2 * late).any() else 0


def _wide(weight: Array) -> Array:
    """Return the precision of parameters of which nothing is known."""
    deviation = UNSURE / np.sqrt(len(weight) * np.maximum(np.diag(weight), 1e-300))
    return np.diag(np.minimum(deviation, WIDEST) ** -2)


def _likely(
    block: Block,
    places: list[int],
    precision: Array,
    reference: list[Array],
    rest: Array,
    columns: Array,
    step: float,
    spans: Array,
    rng: np.random.Generator,
) -> list[Block]:
    """Return the block and others as likely, of those that run free to about the same range."""
    found, values = [block], block.pack()
    values_of, vectors = np.linalg.eigh(precision)
    while len(found) < MEMBERS:
        away = vectors @ (rng.standard_normal(len(places)) / np.sqrt(np.maximum(values_of, 1e-12)))
        away *= min(1.0, APART / np.abs(away).max())
        for _ in range(8):
            moved = values.copy()
            moved[places] *= 1 + away
            try:
                other = block.unpack(moved)
                range_of = np.ptp(_outputs(other, reference, rest, columns, step), axis=0)
            except ModelError:
                range_of = np.full(spans.size, np.nan)
            if ((range_of > 0.67 * spans) & (range_of < 1.5 * spans)).all():
                found.append(other)
                break
            away *= 0.5
        else:
            found.append(block)
    return found


def noise_of(errors: list[Array]) -> float:
    """Return the noise of runs' errors as if of independent samples: that of their sums.

    Errors that stay alike over many samples tell no more than as many fewer.
    """
    power = sum(float(e @ e) for e in errors)
    count = sum(e.size for e in errors)
    alike = 1.0
    longest = max(e.size for e in errors) // 2
    for lag in range(1, longest):
        shared = sum(float(e[lag:] @ e[:-lag]) for e in errors if e.size > lag) / power
        if shared <= 0.0:
            break
        alike += 2.0 * shared
    return float(np.sqrt(power / count * alike))
