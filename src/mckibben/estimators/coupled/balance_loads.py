"""Loads of recordings: which way they pull, and constant ones that nobody measured, which are found.

A weight shifts a muscle's constant force. Where no force was recorded, the first recording's weight is
the model's, and every other recording's is told relative to it, if that makes the model much better;
where some recordings have a force, the others' constants are found as such. Loads that were measured
and seem to push are refused.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.blocks.compose import Series
from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.coupled.balance import balance_in
from mckibben.blocks.fields import rows
from mckibben.errors import DataError
from mckibben.estimators.core.data import TrainingData
from mckibben.estimators.coupled.balance_checks import held
from mckibben.estimators.coupled.balance_search import Search
from mckibben.estimators.coupled.base import LOADS
from mckibben.estimators.optimisers.tracker import Tracker
from mckibben.recording import Recording

LOADS_HELP = 0.1
"""By how much loads of their own have to help, for them to be believed."""

TOLD = 6
"""Most recordings whose loads are told one by one."""

WORSE = 3.0
"""Times its error of the others from which a recording seems to have hung under a load that varied."""

TURNED_STEPS = 2
"""Steps after which loads that were turned round are compared with those that were given."""

SLACK = 0.02
"""Load of a held muscle, relative to its largest, that is none."""

BADLY = 0.03
"""Error, relative to the range, from which all recordings may have."""


def with_loads(
    recordings: Sequence[Recording], scheduling: Sequence[str]
) -> tuple[list[Recording], list[tuple[str, ...]]]:
    """Return recordings that all have the loads that any has, and for each which it had not.

    These are what they are in others on average.
    """
    filled, lacking = [], []
    means = {}
    for name in scheduling:
        found = [recording for recording in recordings if name in recording]
        if found and all(recording.units[name] in LOADS for recording in found):
            means[name] = float(np.mean(np.concatenate([recording[name] for recording in found])))
    for recording in recordings:
        without = tuple(name for name in means if name not in recording)
        levels = {name: np.full(len(recording), means[name]) for name in without}
        filled.append(recording.with_channels(dict.fromkeys(without, LOADS[0]), **levels))
        lacking.append(without)
    return filled, lacking


def without_held(data: TrainingData) -> tuple[TrainingData, list[str]]:
    """Return data without runs in which nothing moves and no force was measured, and what is said."""
    loaded = any(channel.unit in LOADS for channel in data.scheduled)
    tells = [(loaded and not run.unmeasured) or not held(data, run) for run in data.runs]
    names = dict.fromkeys(run.name for run, told in zip(data.runs, tells, strict=True) if not told)
    if not names or not any(tells):
        return data, []
    runs = tuple(run for run, told in zip(data.runs, tells, strict=True) if told)
    return replace(data, runs=runs), [
        f"in {name} nothing moves and no force was measured: it tells nothing, and is left out. "
        "Remedy: record the force"
        for name in names
    ]


def without_load(data: TrainingData, *, every: bool) -> tuple[int, ...]:
    """Return the recordings without a load that others have; or every one but the first with it."""
    lacking = {run.recording for run in data.runs if run.unmeasured}
    found = dict.fromkeys(run.recording for run in data.runs)
    reference = next((one for one in found if one not in lacking), None)
    return tuple(one for one in found if one in lacking or (every and one != reference))


def with_own_loads(search: Search, values: Array, data: TrainingData) -> Search | None:
    """Return the search for loads of recordings' own, too, if a step says that they help.

    None with a load that was measured, or displacements that count from rest under whatever load.
    """
    structure, own = search.structure, without_load(data, every=True)
    if structure.loaded or structure.unmeasured or structure.tare or not own:
        return None
    found = search.having(unmeasured=own)
    loads = np.zeros(structure.n * len(own))
    return found if _gain(found, np.append(values, loads)) > LOADS_HELP else None


def _gain(search: Search, values: Array) -> float:
    """Return by how much loads, found last, would lessen the errors, were these straight."""
    errors, slopes = search.errors(values)
    usable = np.isfinite(slopes).all(axis=1)
    columns = slopes[usable] @ search.structure.free(moving=True)
    columns /= np.maximum(np.sqrt((columns**2).sum(axis=0)), 1e-300)
    left = []
    for count in (slopes.shape[1] - search.structure.own.first, 0):
        others = columns[:, : columns.shape[1] - count]
        found = np.linalg.lstsq(others, errors[usable], rcond=1e-6)[0]
        left.append(float(np.linalg.norm(errors[usable] - others @ found)))
    return 1.0 - left[1] / left[0]


def under(model: Block, loads: Sequence[float]) -> Block:
    """Return a model all of whose muscles bear a constant load more [in the unit of its forces]."""
    if not any(loads):
        return model
    placed = balance_in(model)
    assert placed is not None
    springs = np.array(placed.balance.springs)
    springs[:, 0] += loads
    changed = replace(placed.balance, springs=rows(springs)).inverse()
    parts = (*placed.before, changed, *placed.behind)
    return Series(parts) if len(parts) > 1 else changed


def loads_told(data: TrainingData, loads: Array, balance: Balance, *, newtons: bool) -> list[str]:
    """Return what is said of loads that were found, shape (recordings, n)."""
    runs = {run.recording: run for run in data.runs}
    own = {place: run for place, run in runs.items() if loads[place].any()}
    if not own:
        return []
    measured = [place for place, c in enumerate(data.scheduled) if c.unit in LOADS]
    shares = np.array(balance.loads)
    listed = []
    for place, run in own.items():
        level = shares @ run.scheduled[0, measured] if run.unmeasured else 0.0
        values = " and ".join(f"{load:.3g}" for load in loads[place] + level)
        listed.append(f"{values} in {run.name}")
    if len(listed) > TOLD:
        listed = [*listed[:TOLD], f"and {len(listed) - TOLD} more"]
    unit = LOADS[0] if newtons else f"{balance.given[0].unit} on the area at rest"
    said = f"loads that were not measured, taken as constant [{unit}]: {', '.join(listed)}"
    if measured:
        return [f"{said}. Remedy: record the force of all"]
    first = next(run.name for place, run in runs.items() if place not in own)
    return [
        f"{said} more than in {first}, under whose load the model is. Remedy: record the force, or give "
        "first what the model shall be under"
    ]


def varying(search: Search, values: Array) -> list[str]:
    """Return what tells of loads that varied unmeasured: recordings that are followed badly."""
    missed = [search.missed(values, place, sloped=False)[0] for place in range(len(search.runs))]
    sizes = np.array([np.sqrt(np.mean(errors**2)) for errors in missed])
    notes = []
    for place, run in enumerate(search.runs):
        rest = np.delete(sizes, place)
        if rest.size and sizes[place] > WORSE * np.median(rest):
            notes.append(
                f"{run.name} is followed {sizes[place] / np.median(rest):.2g} times worse than others, "
                "as if something varied that was not measured. Remedy: record the force, or leave it out"
            )
    badly = float(np.sqrt(np.mean(sizes**2)))
    if badly > BADLY and not notes and not search.structure.loaded:
        notes.append(
            f"recordings are followed to {100 * badly:.2g} % of their range only; a load that varied, "
            "among others, would do that. Remedy: record the force if it may vary"
        )
    return notes


def held_told(search: Search, values: Array) -> list[str]:
    """Return how well forces of muscles that were held are followed, which no displacement tells."""
    places = [place for place, still in enumerate(search.still) if still]
    if not places:
        return []
    unit = LOADS[0] if search.structure.in_newtons else search.structure.given[0].unit
    lacking = [search.followed(values, place, held=True, sloped=False)[0] for place in places]
    loads = np.concatenate([search.runs[place].scheduled[:, -1] for place in places])
    pushes = loads.min() < SLACK * loads.max()
    slack = "; where they would have to push they are slack, and their force is zero" * bool(pushes)
    error = float(np.sqrt(np.mean(np.concatenate(lacking) ** 2)))
    return [
        f"of muscles held in place ({len(places)} recordings) forces are followed to "
        f"{error:.3g} {unit} RMSE, which displacements do not tell{slack}"
    ]


def check_loads(search: Search, values: Array, tracker: Tracker) -> None:
    """Refuse loads that seem to push where they should pull; note one that tells nothing.

    Raises
    ------
    DataError
        Naming the recording, or that it is all of them.
    """
    if _told(search, values):
        return
    channel = search.structure.loaded[0].name
    suspects = [tuple(range(len(search.runs))), *((place,) for place in range(len(search.runs)))]
    costs = []
    for suspect in suspects:
        other = _turned(search, suspect)
        found = other.begun(float(values[search.structure.grip]))
        tried = Tracker()
        if _told(other, found):
            other.descend(found, TURNED_STEPS, tried)
        costs.append(tried.best_cost)
    best = int(np.argmin(costs))
    given = Tracker()
    search.descend(values, TURNED_STEPS, given)
    if costs[best] < min(given.best_cost, search.cost(values)):
        names = [search.runs[place].name for place in suspects[best]]
        raise DataError(
            "the more it pulls, the shorter the muscle, as if its sign were wrong",
            file=names[0] if len(set(names)) == 1 else f"all {len(names)} recordings",
            channel=channel,
            remedy="give forces that pull the muscle longer as positive",
        )
    tracker.notes.append(
        f"{channel} hardly tells area from springs: all forces may be wrong by a factor. Remedy: "
        "record under loads that change while the pressure does not"
    )


def _told(search: Search, values: Array) -> bool:
    """Tell whether the linear stage found that a load pulls, and how much."""
    structure = search.structure
    area = float(values[structure.places("areas", 0)[0]])
    return not structure.in_newtons or area * structure.least_pull < 0.99


def _turned(search: Search, places: Sequence[int]) -> Search:
    """Return the same search with the loads of some runs turned round."""
    runs = list(search.runs)
    for place in places:
        scheduled = runs[place].scheduled.copy()
        scheduled[:, -1] *= -1.0
        runs[place] = replace(runs[place], scheduled=scheduled)
    return search.having(replace(search.data, runs=tuple(runs)))
