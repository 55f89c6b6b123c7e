"""What a balance of forces says of muscles: only what its own response shows, and recordings determine.

Every number is found again without each fifth of the recordings; one that then differs by more than a
factor of two, or half of itself, is not determined, and not said.
"""

from __future__ import annotations

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.coupled.balance_response import AMPLITUDE, Response, response_of
from mckibben.errors import ModelError
from mckibben.estimators.coupled.balance_bench import starts_elsewhere
from mckibben.estimators.coupled.balance_search import Search
from mckibben.numerals import numeral

POOR = 0.1
"""Error relative to the range from which a model is said not to explain the recordings."""

WORSE = 3.0
"""Times its error of the others from which a recording seems to have been under something else."""

DETERMINED, CREEP = 0.5, 0.25
"""Standard error, relative to a number, up to which it is said; of creep, which friction resembles."""


def sentences(search: Search, z: Array, balance: Balance) -> list[str]:
    """Return what is said of a fit."""
    structure, problem = search.structure, search.problem
    low, high = min(float(problem.data.lowest.min()), 0.0), float(problem.data.highest.max())
    others = search.without_folds(z)
    found = [*_of_runs(search, z), *_of_loads(search, z, others, balance)]

    def all_of(numbers: object) -> tuple[Array, Array] | None:
        """Return numbers of the fit, and their standard errors by what is left out."""
        assert callable(numbers)
        try:
            every = np.array([numbers(one) for one in (z, *others)], dtype=np.float64)
        except (ModelError, ArithmeticError):
            return None
        count = len(every) - 1
        if count < 2 or not np.isfinite(every).all():
            return None
        return every[0], np.sqrt(
            (count - 1) * ((every[1:] - every[1:].mean(axis=0)) ** 2).mean(axis=0)
        )

    def response(one: Array) -> Response:
        block = structure.block(structure.expanded(one[: len(structure.terms)]), final=True)
        share = balance.areas[0][0] / block.areas[0][0]
        return _scaled(response_of(block, low, high), share)

    unit, per, n = balance.driven[0].unit, balance.given[0].unit, structure.n
    newtons = balance.areas[0][0] != 1.0
    at = f"at {numeral(0.5 * (low + high), 3)} {per}"
    reach = f"{numeral(AMPLITUDE * (high - low), 3)} {per}"
    loops = all_of(lambda one: np.concatenate([response(one).width, response(one).stiffness]))
    for k, channel in enumerate(balance.given if loops is not None else ()):
        assert loops is not None
        said = _with_error(loops[0][k], loops[1][k], unit)
        found += [f"{channel.name}: a slow loop of ± {reach} {at} is {said} wide"] if said else []
    for j, channel in enumerate(balance.driven if loops is not None and newtons else ()):
        assert loops is not None
        said = _with_error(loops[0][n + j], loops[1][n + j], f"N/{unit}")
        found += (
            [f"{channel.name}: stiffness {at}, relaxed, without friction: {said}"] if said else []
        )
    creep = all_of(lambda one: response(one).creep) if balance.lags else None
    for k, channel in enumerate(balance.given if creep is not None else ()):
        assert creep is not None
        said = _with_error(100.0 * creep[0][k], 100.0 * creep[1][k], "%", CREEP)
        found += (
            [f"{channel.name}: of a step {at} {said} comes after the first second"] if said else []
        )
    return found


def _scaled(response: Response, share: float) -> Response:
    return Response(
        response.position,
        share * response.stiffness,
        response.width,
        share * response.friction,
        response.creep,
    )


def _with_error(value: float, error: float, unit: str, most: float = DETERMINED) -> str:
    """Return a number with its standard error and unit; empty where it is not determined."""
    if not 0.0 < error <= most * abs(value):
        return ""
    return f"{numeral(value, 3)} ± {numeral(error, 2)} {unit}".rstrip()


def _of_runs(search: Search, z: Array) -> list[str]:
    """Return what is said of recordings that are followed badly, or begin elsewhere."""
    problem, structure = search.problem, search.structure
    parts = problem.errors(structure, z)[0][: len(problem.runs)]
    sizes = np.array([float(np.sqrt(np.mean(part**2))) for part in parts])
    found = [
        f"{run.name} is followed {size / np.median(np.delete(sizes, place)):.2g} times worse than others, "
        "as if something varied that was not measured. Remedy: record it, or leave this one out"
        for place, (run, size) in enumerate(zip(problem.runs, sizes.tolist(), strict=True))
        if len(sizes) > 1 and size > WORSE * np.median(np.delete(sizes, place))
    ]
    whole = float(np.sqrt(np.mean(sizes**2)))
    if whole > POOR:
        found.append(
            f"this model misses {100 * whole:.2g} % of what moves: it does not explain these recordings. "
            "Remedy: check channels, units, signs and zeros, recording by recording"
        )
    found += [
        f"{name} does not begin at rest: its first part does not count. Remedy: begin recordings "
        "without pressure"
        for name in starts_elsewhere(problem.data)
    ]
    return found


def _of_loads(search: Search, z: Array, others: list[Array], balance: Balance) -> list[str]:
    """Return what is said of loads: those that were found, and those that seem to push."""
    found: list[str] = []
    for j, channel in enumerate(balance.scheduled[balance.n_schedules :]):
        share = np.array(balance.loads)[:, j]
        if (share < 0.0).all():
            found.append(
                f"{channel.name} acts as if it helped the muscles: the more it is, the further they move "
                "at equal pressures. If it pulls against them, its sign is wrong. Remedy: give loads that "
                "pull muscles longer as positive"
            )
    listed = {}
    for run in search.problem.runs:
        place = search.problem.loads_at(search.structure, run)
        values, among = z[place], np.array([one[place] for one in others])
        if values.size and (np.abs(values) > 2.0 * np.sqrt(len(among)) * among.std(axis=0)).any():
            share = balance.areas[0][0]
            listed[run.recording] = (
                f"{' and '.join(numeral(float(share * v), 3) for v in values)} in {run.name}"
            )
    if listed:
        unit = "N" if balance.areas[0][0] != 1.0 else f"{balance.given[0].unit} on the area at rest"
        found.append(
            f"constant loads that were not measured [{unit}], beyond those of the others: "
            f"{', '.join(listed.values())}. Remedy: record the force of all"
        )
    return found
