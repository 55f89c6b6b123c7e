"""What runs of a balance of forces remember at their first sample, where that is not rest.

A run that is cut from a motion begins with friction that some travel has loaded, and with relaxation
under way. Before its first sample the muscles are taken to be where its pressures and loads hold them
without either, with all stops of a muscle at one share of what they hold, between -1 and 1, and with
what its lags are behind: one number and one a lag, found with the others. More are not told apart.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.core.block import Block
from mckibben.blocks.core.running import run_many
from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.coupled.balance_law import AT_REST, keep, settle
from mckibben.blocks.coupled.load_estimate import parts_of
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.coupled.balance_loads import under
from mckibben.estimators.coupled.balance_search import Search
from mckibben.estimators.coupled.balance_structure import Structure

EARLY, LARGER = 5, 2.0
"""A run's first part, and how much larger errors are there where it did not begin as thought."""


def with_starts(search: Search, values: Array) -> Search | None:
    """Return the search for the starts of runs, too, if errors are largest there; else None."""
    if search.structure.tare:
        return None
    early, late = [], []
    for run in search.runs:
        errors = search.missed(values, run, whole=True)[0]
        place = len(errors) // EARLY
        early.append(np.mean(errors[:place] ** 2))
        late.append(np.mean(errors[place:] ** 2))
    if not np.mean(early) > LARGER**2 * np.mean(late):
        return None
    n_starts = 1 + max(run.place for run in search.runs)
    found = Search(search.data, replace(search.structure, n_starts=n_starts), search.ridge)
    found.span = search.span
    return found


def simulate_started(
    block: Block, data: TrainingData, structure: Structure, of_runs: Array
) -> Array:
    """Return free-running outputs where samples count, every run under its own load, from its own start.

    Parameters
    ----------
    block : Block
        Of the structure.
    data : TrainingData
    structure : Structure
    of_runs : array
        What was found of recordings and runs alone: values behind the lags.
    """
    outputs = []
    for run in data.runs:
        model = under(block, structure.table_of_loads(of_runs, 1 + run.recording)[-1])
        balance, acting, _ = parts_of(model)
        state = model.initial_state(run.inputs[0])
        if structure.n_starts:
            first = run.inputs[:1].copy()
            if acting is not None:
                first[:, : structure.n] = run_many([acting], first[:, : structure.n])[0]
            values = structure.values(balance, of_runs)
            begin_at(
                balance,
                state,
                first[0],
                structure.begun(values, run.place, first[0, : structure.n])[0],
            )
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
