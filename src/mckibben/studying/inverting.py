"""Compensators: the inverse of a model, tested once when it is made, and what is to be expected of it.

A compensator follows a motion as well as its model predicts the muscle, so what is expected of it is the
model's free-run error on the test. That the model follows behind its own inverse is required: it says
only that the inverse is right.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations_with_replacement
from math import comb
from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block, Stream
from mckibben.blocks.fields import drives
from mckibben.blocks.force.feedforward import compensator
from mckibben.blocks.runs import run_of
from mckibben.comparison.leaderboard import Leaderboard, Row, acceptable
from mckibben.errors import MckibbenError, ModelError, ModelWarning
from mckibben.metrics import useful
from mckibben.numerics.blocks import squared_errors, sums_of_others
from mckibben.numerics.least_squares import solve_products
from mckibben.recording import COMMAND, Recording
from mckibben.splits import Split
from mckibben.studying.recorded_inputs import RecordedInputs
from mckibben.system.atomic import Numbers

FOLLOWED = 1e-9
"""Largest error of a model behind its inverse, relative to the range of the motion."""

AFTERWARDS = 0.05
"""The same after a sample that the inverse clips, and says so: its memory is then off by that."""

PACES = (1.0, 10.0)
"""Times for which the input takes to run through its range, over the fastest recorded."""

MOST_OUTSIDE = 0.05
"""Largest share of the test's motion in which commands leave the inputs that were recorded."""


@dataclass(frozen=True)
class InverseCheck:
    """A random motion of a model, and of the model behind its inverse.

    Parameters
    ----------
    model : str
        Short name of the model inverted.
    inverse : Block
        The compensator.
    reference, pressure, output : array, shape (n, k)
        What the model does under random inputs; what the inverse gives for that; and what the model does
        then. With a dead time, outputs are later than the references by it.
    time : array, shape (n,)
    timed : bool
        Whether this is in seconds, and not sample numbers.
    error : float
        Largest difference between reference and output, relative to the reference's range, before the
        first sample that the inverse clips.
    error_afterwards : float
        The same over the whole motion.
    """

    model: str
    inverse: Block
    reference: Array
    pressure: Array
    output: Array
    time: Array
    timed: bool
    error: float
    error_afterwards: float


@dataclass(frozen=True)
class Compensation(Numbers):
    """A compensator, and what is to be expected of it.

    Parameters
    ----------
    model : str
        Whose inverse it is.
    inverse : Block
        From desired outputs to inputs.
    unit : str
        Of the errors.
    following_error : float
        Predicted RMSE with which a muscle follows: the model's free-run error on the test.
    following_interval : (float, float) or None
        95 % interval of that.
    static_error : float
        Error of a static map on the same test; see `static_error`.
    check : InverseCheck
        Of the inverse on its own model.
    commands : tuple of str
        Recorded commands that are not the model's inputs: what lies between them and these, such as the
        lag of a regulator, is not in the error.
    """

    model: str
    inverse: Block = field(repr=False)
    unit: str
    following_error: float
    following_interval: tuple[float, float] | None
    static_error: float = field(repr=False)
    check: InverseCheck = field(repr=False)
    commands: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return whose it is, and its errors."""
        errors = {"static_map_error": self.static_error, "inverse_error": self.check.error}
        return super().to_dict() | errors


def compensation(
    board: Leaderboard, split: Split, seed: int = 0
) -> tuple[Compensation | None, Mapping[str, str]]:
    """Return the compensator of the first model of a leaderboard that has a good one.

    Also the models before it in the order of the choice, and why they have no compensator. Without a
    recommended model there is none: a compensator is as good as its model. The split is that of the
    leaderboard.
    """
    if board.best is None:
        return None, {}
    passed_over: dict[str, str] = {}
    judged = board.best.skill_least is not None
    plain = static_error(split, (*board.inputs, *board.loads), board.outputs)
    for row in board.rows:
        unvalidated = judged and row.skill_least is None  # the test must not decide
        if row.block is None or unvalidated or not acceptable(row, board.constant):
            continue
        try:
            return _of_row(row, row.block, board, split, plain, seed), passed_over
        except MckibbenError as error:
            passed_over[row.model] = str(error)
    return None, passed_over


def _of_row(
    row: Row, block: Block, board: Leaderboard, split: Split, plain: float, seed: int
) -> Compensation:
    """Return the compensator of a row; raise a `ModelError` where it has no good one."""
    inverse = compensator(block)
    if not drives(inverse.outputs[0]):
        raise ModelError("its inverse gives no input of a muscle", remedy="invert another model")
    if not np.isfinite(inverse.reachable()).all():
        raise ModelError(
            "it does not know the inputs that it was identified for, so its commands have no limits",
            remedy="invert another model",
        )
    if not useful(row.test_error, plain):
        raise ModelError(
            f"its error on the test, {row.test_error:.3g} {board.unit}, is not clearly below that of a "
            f"static map, {plain:.3g}",
            remedy="record more, or use the static map",
        )
    space = RecordedInputs.of(split.train, [channel.name for channel in block.inputs])
    check = check_inverse(block, space, model=row.model, seed=seed)
    _refuse_unrecorded(check.inverse, split)
    return Compensation(
        row.model,
        check.inverse,
        board.unit,
        row.test_error,
        row.rmse_interval,
        plain,
        check,
        tuple(
            c for c in split.train[0].channels if c.startswith(COMMAND) and c not in board.inputs
        ),
    )


def check_inverse(
    block: Block, space: RecordedInputs, *, model: str | None = None, seed: int = 0
) -> InverseCheck:
    """Return the compensator of a model, tested on a random motion within a space, slow and fast.

    Its name is by default the block's kind.

    Raises
    ------
    ModelError
        If the model has no inverse, or does not follow behind it.
    """
    inverse, name = compensator(block), block.kind if model is None else model
    checks = [_check(name, block, inverse, space, pace, seed) for pace in PACES]
    for check in checks:
        if not (check.error <= FOLLOWED and check.error_afterwards <= AFTERWARDS):
            raise ModelError(
                f"its inverse misses a motion of the model by {check.error_afterwards:.1e} of the range",
                remedy="invert another model",
            )
    return checks[0]


def build_compensator(block: Block, sample_time: float | None = None) -> Block:
    """Return the compensator of a model, tested within its identified inputs where it knows them.

    It is tested at a sample time [s], by default the model's own, or 20 ms.

    Raises
    ------
    ModelError
        As `check_inverse`.
    """
    space = None if block.inverts else RecordedInputs.known(block, sample_time)
    return compensator(block) if space is None else check_inverse(block, space).inverse


def _check(
    name: str, block: Block, inverse: Block, space: RecordedInputs, pace: float, seed: int
) -> InverseCheck:
    random_motion = space.motion(pace, seed)
    outputs = [channel.name for channel in block.outputs]
    input_names = [channel.name for channel in inverse.outputs]
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore", ModelWarning)
        desired = block.simulate(random_motion)
        references = desired.select([channel.name for channel in inverse.inputs])
        commands, clipped_at = inverse.simulate(references), _first_clipped(inverse, references)
        commanded = random_motion.with_channels(**{name: commands[name] for name in input_names})
        output = block.simulate(commanded).matrix(outputs)
    reference = desired.matrix(outputs)
    step, dead = space.sample_time, block.dead_time + inverse.dead_time
    lag = 0 if step is None else round(dead / step)
    span = np.maximum(np.ptp(reference, axis=0), np.finfo(float).tiny)
    missed = np.abs(output[lag:] - reference[: len(reference) - lag]) / span
    return InverseCheck(
        model=name,
        inverse=inverse,
        reference=reference,
        pressure=commands.matrix(input_names),
        output=output,
        time=random_motion.time,
        timed=space.sample_time is not None,
        error=float(missed[: max(clipped_at - lag, 0)].max(initial=0.0)),
        error_afterwards=float(missed.max()),
    )


def _first_clipped(inverse: Block, references: Recording) -> int:
    """Return the first sample of a motion at which a compensator clips; all if it never does."""
    if not inverse.n_clipped(inverse.final_state(references)):
        return len(references)
    stream = inverse.stream(references.sample_time, initial=inverse.start_on(references).tolist())
    for sample, row in enumerate(references.matrix([channel.name for channel in inverse.inputs])):
        stream.step(row)
        if stream.status & Stream.CLIPPED:
            return sample
    return len(references)


def _refuse_unrecorded(inverse: Block, split: Split) -> None:
    """Raise a `ModelError` if commands for the test's motion are no inputs as those of training."""
    needed = [channel.name for channel in inverse.inputs]
    names = [channel.name for channel in inverse.outputs]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        commands = [
            inverse.simulate(recording.with_derived(needed).select(needed)).matrix(names)
            for recording in split.test
        ]
    share = RecordedInputs.of(split.train, names).outside(np.concatenate(commands))
    if share > MOST_OUTSIDE:
        raise ModelError(
            f"its commands for the test's motion leave the recorded combinations of "
            f"{', '.join(names)} in {100 * share:.0f} % of the samples",
            remedy="record these too, or invert another model",
        )


LARGEST_DEGREE, MOST_TERMS = 5, 60
"""Of the polynomial."""

RIDGE = 1e-9
"""Of the least squares, relative to each term's own effect."""

FEWEST_PARTS = 3
"""Of the data, each left out in turn to choose the degree: recordings, or pieces of them if fewer."""

Map = Callable[[Array], Array]
"""From values, (m, n), to others, (m, k)."""


def static_error(split: Split, inputs: Sequence[str], outputs: Sequence[str]) -> float:
    """Return the error on the test of a static map of the inputs, mean RMSE over outputs."""
    recordings = [run.with_derived((*inputs, *outputs)) for run in (*split.train, *split.test)]
    names = [name for name in inputs if all(name in run for run in recordings)]
    train = [run_of(run, names, outputs) for run in split.train]
    pairs = zip(split.test, split.test_rows, strict=True)
    test = [run_of(run, names, outputs, counts=rows) for run, rows in pairs]
    train_inputs = [run.driven[run.counts] for run in train]
    predict = static_map(train_inputs, [run.outputs[run.counts] for run in train])
    errors = np.concatenate([(predict(run.driven) - run.outputs)[run.counts] for run in test])
    return float(np.sqrt((errors**2).mean(axis=0)).mean())


def static_map(inputs: Sequence[Array], outputs: Sequence[Array]) -> Map:
    """Return a polynomial fitted to recordings by least squares.

    Its degree is that of the smallest error on recordings left out in turn; of one or two recordings,
    on thirds of each: few lengths or loads determine no high degree.

    Parameters
    ----------
    inputs, outputs : sequence of array, shapes (m, n) and (m, k)
        Of every recording. Values beyond these count as the nearest one.
    """
    if len(inputs) < FEWEST_PARTS:
        inputs, outputs = (
            [part for table in tables for part in np.array_split(table, FEWEST_PARTS)]
            for tables in (inputs, outputs)
        )
    n = inputs[0].shape[1]
    all_inputs = np.concatenate(inputs)
    low, high = all_inputs.min(axis=0), all_inputs.max(axis=0)
    degrees = [d for d in range(1, LARGEST_DEGREE + 1) if d == 1 or comb(n + d, d) <= MOST_TERMS]
    best_map, least = _constant(outputs), np.inf
    for degree in degrees:
        terms = _polynomial(low, high, degree)
        tables = [np.hstack([terms(part), y]) for part, y in zip(inputs, outputs, strict=True)]
        width = tables[0].shape[1] - outputs[0].shape[1]
        products = np.array([table.T @ table for table in tables])
        others = sums_of_others(products, np.arange(len(tables)))
        error = float(squared_errors(products, solve_products(others, width, RIDGE)).sum())
        if error < least:
            least = error
            weights = solve_products(products.sum(axis=0, keepdims=True), width, RIDGE)[0]
            best_map = _weighted(terms, weights)
    return best_map


def _weighted(terms: Map, weights: Array) -> Map:
    return lambda values: terms(values) @ weights


def _constant(outputs: Sequence[Array]) -> Map:
    mean = np.concatenate(outputs).mean(axis=0)
    return lambda values: np.tile(mean, (len(values), 1))


def _polynomial(low: Array, high: Array, degree: int) -> Map:
    """Return the function to the terms of a polynomial; values beyond the ends count as these."""
    factors = [
        list(places)
        for order in range(degree + 1)
        for places in combinations_with_replacement(range(low.size), order)
    ]

    def terms(values: Array) -> Array:
        scaled = (np.clip(values, low, high) - low) / np.where(high > low, high - low, 1.0) * 2 - 1
        return np.column_stack([scaled[:, places].prod(axis=1) for places in factors])

    return terms
