"""What runs of a balance of forces remember at their first sample, where that is not rest.

A run that is cut from a motion begins with friction that some travel has loaded, and with relaxation
under way. Before its first sample the muscles are taken to be where its pressures and loads hold them
without either, with all stops of a muscle at one share of what they hold, between -1 and 1, and with
what its lags are behind: one number and one a lag, found with the others. More are not told apart.
"""

from __future__ import annotations

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.coupled.balance import balance_in
from mckibben.blocks.coupled.balance_law import keep, settle
from mckibben.blocks.coupled.balance_terms import AT_REST
from mckibben.blocks.running import run_many
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.coupled.balance_loads import under
from mckibben.estimators.coupled.balance_search import Search
from mckibben.estimators.coupled.balance_structure import Structure

EARLY, LARGER = 5, 2.0
"""A run's first part, and how much larger errors are there where it did not begin as thought."""


def with_starts(search: Search, values: Array, data: TrainingData) -> Search | None:
    """Return the search for the starts of runs, too, if errors are largest there; else None.

    So they are where runs were taken to begin settled, and did not. Where none begins at rest, starts
    would take up what the model lacks.
    """
    if search.structure.tare or not any(search.resting):
        return None
    early, late = [], []
    for place in range(len(search.runs)):
        errors = search.missed(values, place, sloped=False, whole=True)[0]
        _, before, after = opening(errors)
        early.append(np.mean(before))
        late.append(np.mean(after))
    if not np.mean(early) > LARGER**2 * np.mean(late):
        return None
    return search.having(settled=False, n_starts=1 + max(run.place for run in data.runs))


def opening(errors: Array) -> tuple[int, Array, Array]:
    """Return how many samples a run's first part has, and the mean squares of errors there and after."""
    first = len(errors) // EARLY
    early, late = (np.mean(part**2, axis=0) for part in (errors[: first or None], errors[first:]))
    return first, early, late


def simulate_started(
    block: Block, data: TrainingData, structure: Structure, values: Array
) -> Array:
    """Return free-running outputs where samples count, every run under its own load, from its own start.

    Parameters
    ----------
    block : Block
        Of the structure.
    data : TrainingData
    structure : Structure
    values : array
        All that was found, of which only what recordings and runs have of their own is looked at.
    """
    outputs = []
    for run in data.runs:
        model = under(block, values[structure.own.load(run.recording)].tolist())
        state = model.initial_state(run.inputs[0])
        if structure.n_starts:
            placed, n = balance_in(model), structure.n
            assert placed is not None
            first = run.inputs[0].copy()
            for part in placed.before:
                first[:n] = run_many([part], first[np.newaxis, :n])[0][0]
            known = values.copy()
            known[structure.grip] = placed.balance.grip
            begun, _ = structure.own.begun(known, run.place, structure.grip, first[:n])
            begin_at(placed.balance, state, first, begun)
        found = run_many([model], run.inputs, sample_time=run.sample_time, initial=tuple(state))
        outputs.append(found[0][run.counts].ravel())
    return np.concatenate(outputs)


def begin_at(balance: Balance, state: Array, first: Array, begun: Array) -> None:
    """Bring a state at rest to where the first pressures hold the muscles, with what was begun."""
    n = len(balance.driven)
    c, scratch = balance.coefficients(1.0), np.zeros(balance.n_scratch)
    y, p = state[:n].copy(), np.ascontiguousarray(first[:n])
    settle(c, state, AT_REST, y, first[n:], p, scratch)
    keep(c, state, AT_REST, y, p)
    state[2 * n : 2 * n + begun.size] = begun
