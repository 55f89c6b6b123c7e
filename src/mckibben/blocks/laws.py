"""Contract tests of blocks, for authors of new ones.

Every law is tried on random inputs that wander with minor loops and holds.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.blocks import saving
from mckibben.blocks.base import Block
from mckibben.blocks.compose import Composition
from mckibben.blocks.fields import Initial
from mckibben.blocks.inverse import Inverse, Invertible
from mckibben.errors import ContractError, DataError, ModelError, ModelWarning
from mckibben.recording import Recording, standard_unit
from mckibben.registry import load, names

DEFAULT_LIMITS = (0.0, 5.0)
"""Test inputs of a block without an input range."""

MARGIN = 0.02
"""Share of a range excluded at both ends, so that rounding does not decide what is reachable."""

EXACT = 1e-9
"""Largest error of an inverse, relative to the range of the output."""


def check_block(block: Block, *, sample_time: float = 0.01, seed: int = 0) -> None:
    """Test a block against all laws of blocks.

    Sizes agree with what is declared; simulating is repeatable and leaves its arguments alone; a
    stream, `Block.simulate_many`, a saved copy and the parts of a composition, run one after another,
    agree with `Block.simulate` to the last bit; a recording gives what an array gives; bad input is
    refused by name; a rate-independent block sees neither the sample time nor the pace of its input; and
    the inverse, where there is one, is exact through minor loops, from a carried-over state, and again
    after references it could not reach.

    Parameters
    ----------
    block : Block
        What to check; its class must be registered, since saved models are.
    sample_time : float, default 0.01
        Time between samples [s], positive.
    seed : int, default 0
        Of the random inputs.

    Raises
    ------
    ContractError
        Naming the first law that is broken.

    Examples
    --------
    >>> import mckibben
    >>> mckibben.check_block(mckibben.PI.example())
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)  # random inputs may be beyond reach
        trial = Trial.of(block, sample_time, seed)
        for law in LAWS:
            law(trial)


def examples() -> dict[str, Block]:
    """Return the examples of all registered blocks and their inverses, by title."""
    blocks: list[Block] = [load("blocks", kind).example() for kind in names("blocks")]
    blocks += [block.inverse() for block in blocks if isinstance(block, Invertible)]
    by_title = {block.title: block for block in blocks}
    return {title: by_title[title] for title in sorted(by_title)}


# -- trials ----------------------------------------------------------------------------------


@dataclass
class Trial:
    """A block, test inputs, shape (n, n_inputs), and its outputs.

    Turning points of inputs are ``pace`` samples from each other, on average.
    """

    block: Block
    sample_time: float
    inputs: Array
    rng: np.random.Generator
    pace: int

    def __post_init__(self) -> None:
        self.outputs = self.run(self.inputs)
        # where outputs hardly move, rounding of their size is all there is to see
        least = 1e-4 * np.abs(self.outputs).max(axis=0) + np.finfo(float).tiny
        with np.errstate(invalid="ignore"):  # outputs that are not finite break a law
            self.span = np.maximum(np.ptp(self.outputs, axis=0), least)
        self.n_driven = self.block.n_driven

    @classmethod
    def of(cls, block: Block, sample_time: float, seed: int, n_turns: int = 24) -> Trial:
        """Return a trial on random inputs, slower for rate-dependent blocks."""
        rng = np.random.default_rng(seed)
        pace = 200 if block.rate_dependent else 12
        inputs = wander(*trial_limits(block), rng, pace, n_turns)
        return cls(block, sample_time, inputs, rng, pace)

    def run(
        self, inputs: Array, initial: Initial | None = None, block: Block | None = None
    ) -> Array:
        """Simulate the block, or another, over other inputs, shape (n, n_inputs)."""
        return (block or self.block).simulate(inputs, initial=initial, sample_time=self.sample_time)

    def demand(self, holds: bool, law: str) -> None:
        """Raise a `ContractError` that names the law, unless it is fulfilled."""
        if not holds:
            raise ContractError(
                f"{self.block.kind!r} breaks the contract of blocks: {law}",
                remedy="correct the block; docs/templates/README.md has a table of where to look",
            )

    def same(self, outputs: Array, references: Array, law: str) -> None:
        """Require outputs that are equal to the last bit."""
        self.demand(np.array_equal(outputs, references), f"{law} to the last bit")

    def agree(self, outputs: Array, references: Array, tolerance: float, law: str) -> None:
        """Require outputs close to references, relative to the range of the block's outputs."""
        error = np.abs(outputs - references)
        holds = bool((error <= tolerance * self.span).all())
        self.demand(holds, f"{law} (the error is {error.max():.3g})")

    def refused(
        self, kind: type[Exception], about: str, attempt: Callable[..., object], *given: object
    ) -> None:
        """Require an attempt to raise an error of a kind whose text names its cause."""
        try:
            attempt(*given)
        except kind as error:
            named = about in str(error) and bool(getattr(error, "remedy", ""))
            self.demand(named, f"{str(error)!r} names {about!r} and ends with a remedy")
        else:
            self.demand(False, f"bad input raises a {kind.__name__} ({about})")


def trial_limits(block: Block) -> tuple[Array, Array]:
    """Return the lowest and highest test value of every input, each of shape (n_inputs,)."""
    lowest, highest = (np.full(len(block.inputs), end) for end in DEFAULT_LIMITS)
    driven = slice(0, block.n_driven)
    if hasattr(block, "input_range"):
        low, high = (np.array([end]) for end in block.input_limits)
    else:
        try:
            low, high = block.inverse().reachable()
        except ModelError:
            return lowest, highest
    with np.errstate(over="ignore", invalid="ignore"):
        is_finite = np.isfinite(high - low)
    lowest[driven] = np.where(is_finite, low, lowest[driven])
    highest[driven] = np.where(is_finite, high, highest[driven])
    return narrowed(lowest, highest)


def identified_limits(block: Block) -> tuple[Array, Array]:
    """Return the ends of every input's identified range, without margins, else its test values."""
    with np.errstate(invalid="ignore"):
        ends = narrowed(*block.known_inputs.T)
    lowest, highest = np.where(np.isfinite(ends).all(axis=0), ends, trial_limits(block))
    return lowest, highest


def narrowed(lowest: Array, highest: Array) -> tuple[Array, Array]:
    """Return a range without its margins."""
    margin = MARGIN * (highest - lowest)
    return lowest + margin, highest - margin


def wander(
    lowest: Array, highest: Array, rng: np.random.Generator, pace: int, n_turns: int = 24
) -> Array:
    """Return a path between random turning points in a range, shape (n, n_channels), with holds."""
    turns = rng.uniform(lowest, highest, (n_turns, lowest.size))
    return through(turns, rng.integers(pace // 2, pace * 3 // 2 + 1, n_turns - 1))


def through(turns: Array, samples: NDArray[np.int64]) -> Array:
    """Return straight lines through turning points, with a hold at each."""
    corners = np.concatenate([[0], np.cumsum(samples + 1)])
    places = np.sort(np.concatenate([corners, corners[1:-1] + 1]))
    values = np.insert(turns, np.arange(1, len(turns) - 1), turns[1:-1], axis=0)
    grid = np.arange(places[-1] + 1)
    return np.column_stack([np.interp(grid, places, column) for column in values.T])


# -- laws ------------------------------------------------------------------------------------


def _sizes_agree(trial: Trial) -> None:
    block, packed = trial.block, trial.block.pack()
    state = block.initial_state(trial.inputs[0], sample_time=trial.sample_time)
    sized = packed.shape == (block.n_parameters,)
    trial.demand(sized, "pack returns n_parameters numbers in one vector")
    trial.demand(state.shape == (block.n_states,), "initial_state returns n_states numbers")
    trial.demand(block.unpack(packed) == block, "unpack(pack()) equals the block")
    trial.refused(ModelError, "", block.unpack, np.append(packed, 0.0))
    if block.n_states:
        trial.refused(ModelError, "", trial.run, trial.inputs, [*state.tolist(), 0.0])
    for channel in (*block.inputs, *block.outputs):
        unit = standard_unit(channel.name)
        trial.demand(unit in (None, channel.unit), f"{channel.name!r} is in {unit!r} everywhere")


def _simulates(trial: Trial) -> None:
    inputs = trial.inputs.copy()
    state = trial.block.initial_state(inputs[0], sample_time=trial.sample_time).tolist()
    kept = list(state)
    outputs = trial.run(inputs, state)
    shape = (len(inputs), len(trial.block.outputs))
    trial.demand(trial.outputs.shape == shape, "simulate returns one column per output")
    trial.demand(bool(np.isfinite(trial.outputs).all()), "outputs are finite")
    trial.demand(np.array_equal(inputs, trial.inputs), "simulate does not change its inputs")
    trial.demand(state == kept, "simulate does not change its initial state")
    law = "simulating again, from the state of initial_state, returns the same"
    trial.same(outputs, trial.outputs, law)


def _streams(trial: Trial) -> None:
    stream, half = trial.block.stream(trial.sample_time), len(trial.inputs) // 2
    for attempt in ("", " after reset"):
        stepped = np.array([stream.step(row).copy() for row in trial.inputs])
        trial.same(stepped, trial.outputs, f"a stream{attempt} equals simulate")
        stream.reset()
    for row in trial.inputs[:half]:
        stream.step(row)
    carried = stream.state.tolist()
    resumed = trial.run(trial.inputs[half:], carried)
    law = "simulating on from a stream's state equals simulating in one go"
    trial.same(resumed, trial.outputs[half:], law)
    stream = trial.block.stream(trial.sample_time, initial=carried)
    stepped = np.array([stream.step(row).copy() for row in trial.inputs[half:]])
    trial.same(stepped, resumed, "a stream from an explicit state equals simulate from there")


def _simulates_many(trial: Trial) -> None:
    block = trial.block
    sets = np.array([scale * block.pack() for scale in (1.0, 1.001, 0.999)])
    many = block.simulate_many(sets, trial.inputs, sample_time=trial.sample_time)
    alone = np.array([trial.run(trial.inputs, block=block.unpack(row)) for row in sets])
    law = "simulate_many equals simulate of every parameter set"
    trial.same(many.reshape(len(sets), *trial.outputs.shape), alone, law)


def _equals_its_parts(trial: Trial) -> None:
    if not isinstance(trial.block, Composition):
        return
    wiring = trial.block.wiring
    starts: tuple[Initial | None, ...] = (None, "first_sample", "virgin")
    for initial in starts:
        signals = [*trial.inputs.T]
        for call in wiring.steps:
            taken = [signals[k] for k in call.taken]
            if call.block is None:
                signals.append(sum(taken, np.zeros(len(trial.inputs))))
                continue
            start = call.state.tolist() if initial is None and call.state is not None else initial
            signals += [*trial.run(np.column_stack(taken), start, call.block).T]
        by_parts = np.column_stack([signals[k] for k in wiring.given])
        law = "a composition equals its parts, run one after another"
        trial.same(trial.run(trial.inputs, initial), by_parts, law)


def _saves(trial: Trial) -> None:
    content = json.loads(json.dumps(trial.block.to_dict(), allow_nan=False))
    copy = saving.from_dict(content)
    trial.demand(copy == trial.block, "a saved and loaded copy equals the block")
    trial.demand(copy.to_dict() == trial.block.to_dict(), "a copy saves as the block does")
    trial.same(trial.run(trial.inputs, block=copy), trial.outputs, "a copy simulates the same")
    trial.refused(ModelError, "surplus", saving.from_dict, {**content, "surplus": 1})
    for name in content:
        less = {key: value for key, value in content.items() if key != name}
        trial.refused(ModelError, name, saving.from_dict, less)


def _takes_recordings(trial: Trial) -> None:
    block = trial.block
    units = {channel.name: channel.unit for channel in block.inputs}
    columns = dict(zip(units, trial.inputs.T, strict=True))
    modelled = block.simulate(Recording(columns, trial.sample_time, units))
    for index, channel in enumerate(block.outputs):
        law = "a recording and an array have the same outputs"
        trial.same(modelled[channel.name], trial.outputs[:, index], law)
        trial.demand(modelled.units[channel.name] == channel.unit, "outputs have their units")
    half = len(trial.inputs) // 2
    first = {name: samples[:half] for name, samples in columns.items()}
    state = block.final_state(Recording(first, trial.sample_time, units))
    law = "simulating on from final_state equals simulating in one go"
    trial.same(trial.run(trial.inputs[half:], state), trial.outputs[half:], law)
    trial.demand(len(repr(block)) <= 240 and "\n" not in repr(block), "repr takes three lines")
    for name in columns:
        columns_ = {**columns, "unrelated": columns[name]}
        del columns_[name]
        trial.refused(DataError, name, block.simulate, Recording(columns_, trial.sample_time))
        if standard_unit(name) is None:
            wrong = Recording(columns, trial.sample_time, {**units, name: "furlong"})
            trial.refused(DataError, name, block.simulate, wrong)


def _refuses_bad_arrays(trial: Trial) -> None:
    needed = len(trial.block.inputs) - trial.block.n_missable
    for column, channel in enumerate(trial.block.inputs[:needed]):
        for bad in (np.nan, np.inf):
            inputs = trial.inputs.copy()
            inputs[3, column] = bad
            trial.refused(DataError, channel.name, trial.run, inputs)
    wide = np.column_stack([trial.inputs, trial.inputs[:, 0]])
    trial.refused(DataError, "shape", trial.run, wide)
    trial.refused(DataError, "shape", trial.run, trial.inputs[:0])


def _knows_its_time(trial: Trial) -> None:
    block = trial.block
    if block.rate_dependent:
        trial.refused(ModelError, "sample_time", block.simulate, trial.inputs)
        return
    for sample_time in (None, 7.0):
        outputs = block.simulate(trial.inputs, sample_time=sample_time)
        law = "a rate-independent block returns the same at any sample time"
        trial.same(outputs, trial.outputs, law)
    for moving in range(trial.inputs.shape[1]):
        path = np.tile(trial.inputs[0], (len(trial.inputs), 1))
        path[:, moving] = trial.inputs[:, moving]
        outputs = trial.run(path)
        repeats = trial.rng.integers(1, 4, len(path))
        slow = trial.run(np.repeat(path, repeats, axis=0))[np.cumsum(repeats) - 1]
        law = "holding the input of a rate-independent block changes nothing"
        trial.agree(slow, outputs, EXACT, law)
        turns = np.flatnonzero(np.diff(np.sign(np.diff(path[:, moving])))) + 1
        kept = np.array([0, *turns, len(path) - 1])
        fast = trial.run(path[kept])
        if not block.path_dependent:
            law = "only the turning points of its input matter to a rate-independent block"
            trial.agree(fast, outputs[kept], EXACT, law)


def _inverts(trial: Trial) -> None:
    """Require an exact inverse, or an error that ends with a remedy."""
    block = trial.block
    try:
        inverse = block.inverse()
    except ModelError as error:
        trial.demand(bool(error.remedy), "an error of inverse() ends with a remedy")
        return
    swapped = (*block.outputs, *block.inputs[trial.n_driven :])
    driven = block.inputs[: trial.n_driven]
    trial.demand(inverse.inputs == swapped, "an inverse takes the outputs, then scheduling inputs")
    trial.demand(inverse.outputs == driven, "an inverse returns the driven inputs")
    again = trial.run(trial.inputs, block=inverse.inverse())
    trial.agree(again, trial.outputs, 1e-12, "the inverse of the inverse is the block")
    _tracks(trial, inverse, trial.outputs)
    low, high = block.reachable()
    trial.demand(bool((low < high).all()), "the lowest output of reachable is below the highest")
    if np.isfinite([*low, *high]).all() and not block.inverts:
        _tracks(trial, inverse, wander(*narrowed(low, high), trial.rng, trial.pace))
        _recovers(trial, inverse, low, high)


def _tracks(trial: Trial, inverse: Block, references: Array) -> None:
    """Require exact tracking from the first sample, and from states carried over at half-time.

    What a dead time makes late is compared with what was due then.
    """
    n = min(len(references), len(trial.inputs))
    references, scheduling = references[:n], trial.inputs[:n, trial.n_driven :]
    references_ = np.column_stack([references, scheduling])
    given = np.column_stack([trial.run(references_, block=inverse), scheduling])
    late = _late(trial, inverse)
    due = references[: n - late]
    law = "forward of inverse returns the reference, after the dead time, to 1e-9 of the output's range"
    trial.agree(trial.run(given)[late:], due, EXACT, law)
    half = n // 2
    forward_state = _state_after(trial.block, given[:half], trial.sample_time)
    starts = [_state_after(inverse, references_[:half], trial.sample_time)]
    limited = isinstance(inverse, Inverse) and hasattr(trial.block, "input_range")
    starts += [forward_state] if limited else []
    for start in starts:
        resumed = trial.run(references_[half:], start, inverse)
        outputs = trial.run(np.column_stack([resumed, scheduling[half:]]), forward_state)
        trial.agree(outputs[late:], due[half:], EXACT, f"from a carried-over state, {law}")


def _recovers(trial: Trial, inverse: Block, low: Array, high: Array) -> None:
    """Require that references out of reach are clipped with a warning, without later effects."""
    middle, span = (low + high) / 2, high - low
    turns = trial.rng.uniform(low, high, (19, low.size))
    turns[6], turns[12] = high + span / 2, low - span / 2
    references = through(turns, np.full(len(turns) - 1, trial.pace))
    scheduling = np.tile(trial.inputs[0, trial.n_driven :], (len(references), 1))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        inputs = trial.run(np.column_stack([references, scheduling]), block=inverse)
    warned = any(issubclass(warning.category, ModelWarning) for warning in caught)
    trial.demand(warned, "an inverse warns of references out of reach with a ModelWarning")
    outputs = trial.run(np.column_stack([inputs, scheduling]))[_late(trial, inverse) :]
    references = references[: len(outputs)]
    inside = (np.abs(references - middle) <= (0.5 - MARGIN) * span).all(axis=1)
    law = "after a reference out of reach, the inverse is exact again"
    trial.agree(outputs[inside], references[inside], EXACT, law)


def _late(trial: Trial, inverse: Block) -> int:
    """Return the delay of outputs after references in samples."""
    return round((trial.block.dead_time + inverse.dead_time) / trial.sample_time)


def _state_after(block: Block, inputs: Array, sample_time: float) -> list[float]:
    return [*map(float, block.run(inputs, sample_time, None)[1])]


LAWS: tuple[Callable[[Trial], None], ...] = (
    _sizes_agree,
    _simulates,
    _streams,
    _simulates_many,
    _equals_its_parts,
    _saves,
    _takes_recordings,
    _refuses_bad_arrays,
    _knows_its_time,
    _inverts,
)
"""Contract checks; each raises a `ContractError` on violation."""
