"""A static map from inputs to outputs: what every model with memory has to beat."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations_with_replacement
from math import comb

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.runs import run_of
from mckibben.numerics.blocks import squared_errors, sums_of_others
from mckibben.numerics.least_squares import solve_products
from mckibben.splits import Split

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
    every = [one.with_derived((*inputs, *outputs)) for one in (*split.train, *split.test)]
    known = [name for name in inputs if all(name in one for one in every)]
    train = [run_of(one, known, outputs) for one in split.train]
    pairs = zip(split.test, split.test_rows, strict=True)
    test = [run_of(one, known, outputs, counts=rows) for one, rows in pairs]
    given = [run.driven[run.counts] for run in train]
    found = static_map(given, [run.outputs[run.counts] for run in train])
    errors = np.concatenate([(found(run.driven) - run.outputs)[run.counts] for run in test])
    return float(np.sqrt((errors**2).mean(axis=0)).mean())


def static_map(given: Sequence[Array], wanted: Sequence[Array]) -> Map:
    """Return a polynomial fitted to recordings by least squares.

    Its degree is that of the smallest error on recordings left out in turn; of one or two recordings,
    on thirds of each: few lengths or loads determine no high degree.

    Parameters
    ----------
    given, wanted : sequence of array, shapes (m, n) and (m, k)
        Of every recording. Values beyond these count as the nearest one.
    """
    if len(given) < FEWEST_PARTS:
        given, wanted = (
            [part for one in tables for part in np.array_split(one, FEWEST_PARTS)]
            for tables in (given, wanted)
        )
    n = given[0].shape[1]
    every = np.concatenate(given)
    low, high = every.min(axis=0), every.max(axis=0)
    possible = [d for d in range(1, LARGEST_DEGREE + 1) if d == 1 or comb(n + d, d) <= MOST_TERMS]
    chosen, least = _constant(wanted), np.inf
    for degree in possible:
        terms = _polynomial(low, high, degree)
        tables = [np.hstack([terms(part), y]) for part, y in zip(given, wanted, strict=True)]
        width = tables[0].shape[1] - wanted[0].shape[1]
        products = np.array([table.T @ table for table in tables])
        others = sums_of_others(products, np.arange(len(tables)))
        missed = float(squared_errors(products, solve_products(others, width, RIDGE)).sum())
        if missed < least:
            least = missed
            whole = solve_products(products.sum(axis=0, keepdims=True), width, RIDGE)[0]
            chosen = _weighted(terms, whole)
    return chosen


def _weighted(terms: Map, weights: Array) -> Map:
    return lambda values: terms(values) @ weights


def _constant(wanted: Sequence[Array]) -> Map:
    mean = np.concatenate(wanted).mean(axis=0)
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
