"""The contract of a block as laws, to which the author of a new one can put it."""

from __future__ import annotations

import json
from collections.abc import Callable

import numpy as np

from mckibben.blocks import saving
from mckibben.blocks.base import Block
from mckibben.blocks.laws.inverse_laws import EXACT, inverts
from mckibben.blocks.laws.trial import Trial
from mckibben.errors import DataError, ModelError
from mckibben.recording import Recording, standard_unit


def check_block(block: Block, *, sample_time: float = 0.01, seed: int = 0) -> None:
    """Put a block to the laws that every block must obey.

    Sizes agree with what is declared; simulating is repeatable and leaves its arguments alone; a
    stream, `Block.simulate_many` and a saved copy agree with `Block.simulate` to the last bit; a
    recording gives what an array gives; bad input is refused by name; a rate-independent block sees
    neither the sample time nor the pace of its input; and the inverse, where there is one, is exact
    through minor loops, from a carried-over state, and again after references it could not reach.

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
    trial = Trial.of(block, sample_time, seed)
    for law in LAWS:
        law(trial)


def _sizes_agree(trial: Trial) -> None:
    block = trial.block
    packed = block.pack()
    state = block.initial_state(trial.inputs[0])
    trial.demand(
        packed.shape == (block.n_parameters,), "pack gives n_parameters numbers in one vector"
    )
    trial.demand(state.shape == (block.n_states,), "initial_state gives n_states numbers")
    trial.demand(block.unpack(packed) == block, "unpack(pack()) equals the block")
    trial.refused(ModelError, "", block.unpack, np.append(packed, 0.0))
    if block.n_states:
        trial.refused(ModelError, "", trial.run, trial.inputs, [*state.tolist(), 0.0])
    for channel in (*block.inputs, *block.outputs):
        unit = standard_unit(channel.name)
        trial.demand(unit in (None, channel.unit), f"{channel.name!r} is in {unit!r} everywhere")


def _simulates(trial: Trial) -> None:
    given = trial.inputs.copy()
    state = trial.block.initial_state(given[0]).tolist()
    kept = list(state)
    outputs = trial.run(given, state)
    shape = (len(given), len(trial.block.outputs))
    trial.demand(trial.outputs.shape == shape, "simulate gives one column to every output")
    trial.demand(bool(np.isfinite(trial.outputs).all()), "outputs are finite")
    trial.demand(np.array_equal(given, trial.inputs), "simulate leaves its inputs alone")
    trial.demand(state == kept, "simulate leaves the state it is given alone")
    trial.demand(
        np.array_equal(outputs, trial.outputs),
        "simulating again, from the state that initial_state gives, gives the same to the last bit",
    )


def _streams(trial: Trial) -> None:
    stream = trial.block.stream(trial.sample_time)
    for attempt in ("", " after reset"):
        stepped = np.array([stream.step(row).copy() for row in trial.inputs])
        equal = np.array_equal(stepped, trial.outputs)
        trial.demand(equal, f"a stream equals simulate to the last bit{attempt}")
        stream.reset()
    half = len(trial.inputs) // 2
    for row in trial.inputs[:half]:
        stream.step(row)
    carried = stream.state.tolist()
    resumed = trial.run(trial.inputs[half:], carried)
    trial.demand(
        np.array_equal(resumed, trial.outputs[half:]),
        "simulating on from a stream's state equals simulating in one go to the last bit",
    )
    stream = trial.block.stream(trial.sample_time, initial=carried)
    stepped = np.array([stream.step(row).copy() for row in trial.inputs[half:]])
    trial.demand(np.array_equal(stepped, resumed), "a stream starts from an explicit state")


def _simulates_many(trial: Trial) -> None:
    block = trial.block
    sets = np.array([scale * block.pack() for scale in (1.0, 1.001, 0.999)])
    many = block.simulate_many(sets, trial.inputs, sample_time=trial.sample_time)
    one_by_one = [
        block.unpack(row).simulate(trial.inputs, sample_time=trial.sample_time) for row in sets
    ]
    trial.demand(
        np.array_equal(many.reshape(len(sets), *trial.outputs.shape), one_by_one),
        "simulate_many equals simulate of every parameter set to the last bit",
    )


def _saves(trial: Trial) -> None:
    content = json.loads(json.dumps(trial.block.to_dict(), allow_nan=False))
    copy = saving.from_dict(content)
    trial.demand(copy == trial.block, "a saved and loaded copy equals the block")
    trial.demand(copy.to_dict() == trial.block.to_dict(), "a copy saves as the block does")
    outputs = copy.simulate(trial.inputs, sample_time=trial.sample_time)
    trial.demand(np.array_equal(outputs, trial.outputs), "a copy gives the same to the last bit")
    trial.refused(ModelError, "surplus", saving.from_dict, {**content, "surplus": 1})


def _takes_recordings(trial: Trial) -> None:
    block = trial.block
    units = {channel.name: channel.unit for channel in block.inputs}
    columns = dict(zip(units, trial.inputs.T, strict=True))
    recording = Recording(columns, trial.sample_time, units)
    modelled = block.simulate(recording)
    for index, channel in enumerate(block.outputs):
        equal = np.array_equal(modelled[channel.name], trial.outputs[:, index])
        trial.demand(equal, "a recording gives the outputs that an array gives")
        trial.demand(modelled.units[channel.name] == channel.unit, "outputs carry their units")
    for name in columns:
        others = {**columns, "unrelated": columns[name]}
        del others[name]
        trial.refused(DataError, name, block.simulate, Recording(others, trial.sample_time))
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
        trial.refused(ModelError, "sample time", block.simulate, trial.inputs)
        return
    for sample_time in (None, 7.0):
        outputs = block.simulate(trial.inputs, sample_time=sample_time)
        same = np.array_equal(outputs, trial.outputs)
        trial.demand(same, "a rate-independent block gives the same at any sample time")
    for moving in range(trial.inputs.shape[1]):
        path = np.tile(trial.inputs[0], (len(trial.inputs), 1))
        path[:, moving] = trial.inputs[:, moving]
        outputs = trial.run(path)
        repeats = trial.rng.integers(1, 4, len(path))
        slow = trial.run(np.repeat(path, repeats, axis=0))[np.cumsum(repeats) - 1]
        steps = np.sign(np.diff(path[:, moving]))
        turns = np.flatnonzero(np.diff(steps)) + 1
        kept = np.array([0, *turns, len(path) - 1])
        fast = trial.run(path[kept])
        law = "holding the input of a rate-independent block changes nothing"
        trial.agree(slow, outputs, EXACT, law)
        if block.path_dependent:
            continue
        law = "only the turning points of its input matter to a rate-independent block"
        trial.agree(fast, outputs[kept], EXACT, law)


LAWS: tuple[Callable[[Trial], None], ...] = (
    _sizes_agree,
    _simulates,
    _streams,
    _simulates_many,
    _saves,
    _takes_recordings,
    _refuses_bad_arrays,
    _knows_its_time,
    inverts,
)
"""Each raises a `ContractError` where it is broken."""
