"""Derivatives of free runs by parameters, for every block, exact to rounding.

What a block does is laid out as kernels in order, as for an export. Their coefficients depend smoothly
on the parameters, by arithmetic of a few numbers: central differences of eighth order give that to
1e-11 or better. From coefficients to outputs, starts and memories included, kernels are differentiated
by complex step; see `mckibben.blocks.complex_step`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields
from functools import partial
from itertools import pairwise, starmap
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.blocks.base import VIRGIN, Block
from mckibben.blocks.complex_step import STEP, twin
from mckibben.blocks.compose import Layout
from mckibben.blocks.fields import Initial
from mckibben.blocks.kernels import in_scratch
from mckibben.blocks.parameters import Parametrised
from mckibben.errors import ModelError
from mckibben.system.threads import cores

Complex = NDArray[np.complex128]

CHANGES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
"""Relative steps of a parameter in the central difference of its coefficients."""

AGREEING = 1e-11
"""Relative difference of derivatives of coefficients that is rounding."""

WEIGHTS = (4 / 5, -1 / 5, 4 / 105, -1 / 280)
"""Weights of the eighth-order central difference, nearest points first."""


def _laid_out(block: Block) -> Layout:
    """Return the layout of a block, if all its blocks have derivatives."""
    layout = Layout(block, from_rest=True)
    for _, each in layout.calls():
        if not each.c_kernels:
            raise ModelError(
                f"{each.title!r} has no derivatives: it is not one kernel with a start kernel",
                remedy="declare a start_kernel with its kernel, or compose it of such blocks",
            )
    return layout


def _moved(value: Any, numbers: Iterator[float]) -> Any:
    """Return the value of a field with other numbers, which may be slightly out of bounds."""
    if type(value) is float:
        return next(numbers)
    if type(value) is tuple:
        return tuple(_moved(item, numbers) for item in value)
    if not isinstance(value, Parametrised):
        return value
    if type(value).unpack is not Parametrised.unpack:
        return value.unpack([next(numbers) for _ in range(value.n_parameters)])
    other = object.__new__(type(value))
    known: Any = value
    vars(other).update({each.name: getattr(known, each.name) for each in fields(known)})
    vars(other).update({name: _moved(getattr(known, name), numbers) for name in value.parameters})
    return other


class Tangents:
    """Free runs of a block with derivatives by its parameters, segment by segment.

    Parameters
    ----------
    block : Block
    sample_time : float or None
        [s].
    places : sequence of int, optional
        Of k parameters in `pack`; all by default.
    """

    def __init__(
        self, block: Block, sample_time: float | None, places: Sequence[int] | None = None
    ) -> None:
        self.block = block
        values = block.pack()
        self._layout = _laid_out(block)
        self._sample_time = sample_time
        own = [each.coefficients(sample_time) for _, each in self._layout.calls()]
        places = range(values.size) if places is None else places
        self.n_places = len(places)
        self._numbers: list[list[Complex]] = []
        for place in places:
            slopes = _coefficient_slopes(block, values, place, sample_time)
            self._numbers.append([_complex(*pair) for pair in zip(own, slopes, strict=True)])
        if not places:
            self._numbers.append([_complex(numbers, np.zeros(numbers.size)) for numbers in own])
        blocks = [each for _, each in self._layout.calls()]
        ends = np.cumsum([0, *(each.n_states for each in blocks)]).tolist()
        self._states = list(starmap(slice, pairwise(ends)))
        self._scratch = [np.zeros(each.n_scratch, np.complex128) for each in blocks]

    def start(self, first: Array, initial: Initial | None = None) -> Complex:
        """Return the initial states for a first input, with derivatives, shape (k or 1, n_states).

        Parameters are those of `Block.initial_state`.
        """
        rule = initial if initial is None or isinstance(initial, str) else None
        given = (
            None if initial is rule else self.block.initial_state(first, initial, self._sample_time)
        )
        states = np.zeros((len(self._numbers), self.block.n_states), np.complex128)
        for numbers, state in zip(self._numbers, states, strict=True):
            if given is not None:
                state[:] = given
            else:
                self._started(numbers, state, first, rule)
        return states

    def _started(
        self, numbers: list[Complex], state: Complex, first: Array, rule: str | None
    ) -> None:
        """Start blocks from their first input samples."""

        def begin(index: int, inputs: Complex) -> Complex:
            call, block = calls[index]
            own, start = state[self._states[index]], rule or block.start
            if call.state is not None:
                own[:] = call.state
            elif not isinstance(start, str):
                own[:] = block.initial_state(inputs[0].real, start, self._sample_time)
            elif own.size:
                kernel = block.c_kernels[1]
                room = [self._scratch[index]] if in_scratch(kernel) else []
                twin(kernel)(numbers[index], own, *room, inputs[0], VIRGIN[start])
            return own.copy()

        calls = list(self._layout.calls())

        self._follow(numbers, begin, first[np.newaxis])

    def over(self, inputs: Array, states: Complex) -> tuple[Array, Array]:
        """Return outputs (n, m) and their derivatives (n, m, k) over a segment; states continue.

        Parameters
        ----------
        inputs : array, shape (n, n_inputs)
        states : array, shape (k or 1, n_states)
            As `start` gives them; changed.
        """
        slopes = np.empty((len(inputs), len(self.block.outputs), self.n_places))
        for row, (numbers, state) in enumerate(zip(self._numbers, states, strict=True)):
            found = self._follow(numbers, partial(self._resumed, state), inputs)
            if self.n_places:
                np.divide(found.imag, STEP, out=slopes[:, :, row])
        return found.real.copy(), slopes

    def _resumed(self, state: Complex, index: int, taken: Complex) -> Complex:
        del taken
        return state[self._states[index]]

    def _follow(
        self, numbers: list[Complex], memory: Callable[[int, Complex], Complex], inputs: Array
    ) -> Complex:
        """Run all blocks over inputs, each from its state, ``memory(number, its inputs)``."""
        signals = np.zeros((len(inputs), self._layout.n_signals), np.complex128)
        signals[:, : inputs.shape[1]] = inputs
        index = 0
        for step in self._layout.steps:
            taken = np.ascontiguousarray(signals[:, step.taken])
            if step.block is None:
                signals[:, step.given] = taken.sum(axis=1, keepdims=True)
                continue
            found = np.empty((len(inputs), len(step.given)), np.complex128)
            kernel: Any = step.block.c_kernels[0]
            room = [self._scratch[index]] if in_scratch(kernel) else []
            twin(kernel.batch)(numbers[index], memory(index, taken), *room, taken, found)
            signals[:, step.given] = found
            index += 1
        return signals[:, self._layout.given]


def _complex(real: Array, slopes: Array) -> Complex:
    found = np.empty(real.shape, np.complex128)
    found.real, found.imag = real, STEP * slopes
    return found


def _coefficient_slopes(
    block: Block, values: Array, place: int, sample_time: float | None
) -> list[Array]:
    """Return the derivatives of the coefficients of all kernels by a parameter.

    Of ever shorter differences, those that agree best: a gain may have a pole nearby.
    """

    def moved(change: float) -> list[Array]:
        other = values.copy()
        other[place] += change
        calls = _laid_out(_moved(block, iter(other.tolist()))).calls()
        return [each.coefficients(sample_time) for _, each in calls]

    tried: list[Array] = []
    ends = np.cumsum([numbers.size for numbers in moved(0.0)])
    found, nearest = np.zeros(ends[-1]), np.full(ends[-1], np.inf)
    for share in CHANGES:
        change = share * (abs(values[place]) or 1.0)
        slopes = np.zeros(found.size)
        for times, weight in enumerate(WEIGHTS, 1):
            above, below = (np.concatenate(moved(way * change)) for way in (times, -times))
            moves = above != below  # infinite ones do not
            slopes[moves] += weight * (above[moves] - below[moves]) / change
        if tried:
            gap = np.abs(slopes - tried[-1])
            found = np.where(gap < nearest, tried[-1], found)
            nearest = np.minimum(gap, nearest)
            if (nearest <= AGREEING * np.abs(found)).all():
                break
        tried.append(slopes)
    return np.split(found, ends[:-1])


def jacobian(
    block: Block,
    inputs: Array,
    sample_time: float | None = None,
    initial: Initial | None = None,
    places: Sequence[int] | None = None,
) -> Array:
    """Return the derivatives of a free run by the parameters, shape (n, n_outputs, k).

    Parameters
    ----------
    block : Block
        Any block that is one kernel, or is composed of such.
    inputs : array, shape (n, n_inputs)
    sample_time : float, optional
        Time between samples [s]; needed by blocks that depend on rate.
    initial : {"first_sample", "virgin"} or sequence of float, optional
        Memory before the first sample; its derivatives count too, unless it is given itself. Default is
        the block's own.
    places : sequence of int, optional
        Of the k parameters, in `pack`; all by default.
    """
    places = range(block.n_parameters) if places is None else places
    workers = max(min(cores(), len(places)), 1)

    def run(share: Sequence[int]) -> Array:
        tangents = Tangents(block, sample_time, share)
        return tangents.over(inputs, tangents.start(inputs[0], initial))[1]

    with ThreadPoolExecutor(workers) as pool:
        shares = [places[first::workers] for first in range(workers)]
        found = np.empty((len(inputs), len(block.outputs), len(places)))
        for first, own in enumerate(pool.map(run, shares)):
            found[:, :, first::workers] = own
    return found
