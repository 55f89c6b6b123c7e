"""Derivatives of free runs by parameters: exact to rounding where kernels allow it, else differences.

What a block does is laid out as kernels in order, as for an export. Their coefficients depend smoothly
on the parameters, by arithmetic of a few numbers: central differences of eighth order give that to
1e-11 or better. From coefficients to outputs, starts and memories included, kernels are differentiated
by complex step; see `mckibben.blocks.complex_step`. A block of which some part is no kernel, or has one
too large for that, is differentiated by differences of free runs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import fields
from itertools import pairwise, starmap
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mckibben.arrays import Array
from mckibben.blocks.base import VIRGIN, Block
from mckibben.blocks.complex_step import STEP, twin
from mckibben.blocks.compose import Layout
from mckibben.blocks.fields import Initial
from mckibben.blocks.kernels import in_scratch
from mckibben.blocks.parameters import Parametrised
from mckibben.errors import ModelError
from mckibben.numerics.descent import differences
from mckibben.system.threads import cores

Complex = NDArray[np.complex128]

Begun = Initial | Callable[[Block], Array] | None
"""Memory before the first sample, as of `Block.initial_state`, or a state as a function of the block."""

DIFFERENCE = 1e-6
"""Step of differences of free runs, relative to the size of a parameter."""

CHANGES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
"""Relative steps of a parameter in the central difference of its coefficients."""

AGREEING = 1e-11
"""Relative difference of derivatives of coefficients that is rounding."""

WEIGHTS = (4 / 5, -1 / 5, 4 / 105, -1 / 280)
"""Weights of the eighth-order central difference, nearest points first."""


def relative_sizes(parameters: Array) -> Array:
    """Return the scales of parameters, with a lower bound."""
    return np.maximum(np.abs(parameters), 1e-3 * np.abs(parameters).max(initial=1e-3))


def _laid_out(block: Block) -> Layout:
    """Return the layout of a block, if all its blocks have kernels to differentiate."""
    layout = Layout(block, from_rest=True)
    for _, each in layout.calls():
        if not each.c_kernels:
            raise ModelError(
                f"{each.title!r} has no derivatives: it is not one kernel with a start kernel",
                remedy="declare a start_kernel with its kernel, or compose it of such blocks",
            )
    return layout


def differentiable(block: Block) -> bool:
    """Return whether all parts of a block have derivatives by complex step."""
    with suppress(ModelError):
        return all(each.complex_step for _, each in _laid_out(block).calls())
    return False


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
    number: Any = value
    vars(other).update({each.name: getattr(number, each.name) for each in fields(number)})
    vars(other).update({name: _moved(getattr(number, name), numbers) for name in value.parameters})
    return other


class Tangents:
    """Free runs of a block by complex step, with derivatives by its parameters.

    Parameters
    ----------
    block : Block
        Of kernels.
    sample_time : float or None
        [s].
    initial : optional
        As of `derivatives`.
    places : sequence of int, optional
        Of k parameters in `pack`; all by default.
    """

    def __init__(
        self,
        block: Block,
        sample_time: float | None,
        initial: Begun = None,
        places: Sequence[int] | None = None,
    ) -> None:
        self._block, self._sample_time, self._initial = block, sample_time, initial
        self._layout, values = _laid_out(block), block.pack()
        self._calls = list(self._layout.calls())
        own = self._numbers_of(block)
        places = range(values.size) if places is None else places
        self._n_places, none = len(places), [np.zeros(numbers.size) for numbers in own]
        self._numbers = [
            [_complex(*pair) for pair in zip(own, slopes, strict=True)]
            for slopes in ([self._slopes_of(values, place, own) for place in places] or [none])
        ]
        ends = np.cumsum([0, *(each.n_states for _, each in self._calls)]).tolist()
        self._states = list(starmap(slice, pairwise(ends)))
        self._scratch = [np.zeros(each.n_scratch, np.complex128) for _, each in self._calls]

    def _numbers_of(self, block: Block) -> list[Array]:
        """Return the coefficients of all kernels, then the state, if that is a function."""
        numbers = [each.coefficients(self._sample_time) for _, each in _laid_out(block).calls()]
        return [*numbers, self._initial(block)] if callable(self._initial) else numbers

    def _slopes_of(self, values: Array, place: int, own: list[Array]) -> list[Array]:
        """Return the derivatives of those numbers by a parameter.

        Of ever shorter differences, those that agree best: a gain may have a pole nearby, and beyond
        that no number.
        """

        def moved(change: float) -> Array:
            other = values.copy()
            other[place] += change
            return np.concatenate(self._numbers_of(_moved(self._block, iter(other.tolist()))))

        trials: list[Array] = []
        ends = np.cumsum([numbers.size for numbers in own])
        found, nearest = np.zeros(ends[-1]), np.full(ends[-1], np.inf)
        for share in CHANGES:
            change = share * (abs(values[place]) or 1.0)
            slopes = np.zeros(found.size)
            try:
                for times, weight in enumerate(WEIGHTS, 1):
                    above, below = (moved(way * change) for way in (times, -times))
                    moves = above != below  # infinite ones do not
                    slopes[moves] += weight * (above[moves] - below[moves]) / change
            except ModelError:
                continue
            if trials:
                gap = np.abs(slopes - trials[-1])
                found = np.where(gap < nearest, trials[-1], found)
                nearest = np.minimum(gap, nearest)
                if (nearest <= AGREEING * np.abs(found)).all():
                    break
            trials.append(slopes)
        return np.split(found, ends[:-1])

    def over(self, inputs: Array) -> tuple[Array, Array]:
        """Return outputs, shape (n, m), and their derivatives, shape (n, m, k), over inputs."""
        outputs = np.empty((len(inputs), len(self._block.outputs)))
        slopes = np.empty((*outputs.shape, self._n_places))
        for row, numbers in enumerate(self._numbers):
            states = self._start(numbers, inputs[:1])

            def resume(index: int, _: Complex, states: list[Complex] = states) -> Complex:
                return states[index]

            found = self._follow(numbers, inputs, resume)
            outputs[:] = found.real
            if self._n_places:
                np.divide(found.imag, STEP, out=slopes[:, :, row])
        return outputs, slopes

    def _start(self, numbers: list[Complex], first: Array) -> list[Complex]:
        """Return the states of all blocks before a first input, each started from its own."""
        initial, states, whole = self._initial, list[Complex](), None
        if callable(initial):
            whole = numbers[-1]
        elif initial is not None and not isinstance(initial, str):
            real_state = self._block.initial_state(first[0], initial, self._sample_time)
            whole = np.asarray(real_state, dtype=np.complex128)
        if whole is not None:
            return [whole[part].copy() for part in self._states]

        def begin(index: int, inputs: Complex) -> Complex:
            call, block = self._calls[index]
            state = np.zeros(block.n_states, np.complex128)
            start = initial if isinstance(initial, str) else block.start
            if call.state is not None:
                state[:] = call.state
            elif not isinstance(start, str):
                state[:] = block.initial_state(inputs[0].real, start, self._sample_time)
            elif state.size:
                kernel = block.c_kernels[1]
                room = [self._scratch[index]] if in_scratch(kernel) else []
                twin(kernel)(numbers[index], state, *room, inputs[0], VIRGIN[start])
            states.append(state.copy())
            return state

        self._follow(numbers, first, begin)
        return states

    def _follow(
        self, numbers: list[Complex], inputs: Array, memory: Callable[[int, Complex], Complex]
    ) -> Complex:
        """Run all blocks over inputs, each from its state, ``memory(number, its inputs)``."""
        signals = np.zeros((len(inputs), self._layout.n_signals), np.complex128)
        signals[:, : inputs.shape[1]] = inputs
        index = 0
        for step in self._layout.steps:
            inputs_of_step = np.ascontiguousarray(signals[:, step.taken])
            if step.block is None:
                signals[:, step.given] = inputs_of_step.sum(axis=1, keepdims=True)
                continue
            outputs_of_step = np.empty((len(inputs), len(step.given)), np.complex128)
            kernel: Any = step.block.c_kernels[0]
            room = [self._scratch[index]] if in_scratch(kernel) else []
            twin(kernel.batch)(
                numbers[index],
                memory(index, inputs_of_step),
                *room,
                inputs_of_step,
                outputs_of_step,
            )
            signals[:, step.given] = outputs_of_step
            index += 1
        return signals[:, self._layout.given]


def _complex(real: Array, slopes: Array) -> Complex:
    table = np.empty(real.shape, np.complex128)
    table.real, table.imag = real, STEP * slopes
    return table


def by_moving(
    block: Block, run: Callable[[Block], Array], places: Sequence[int] | None = None
) -> Array:
    """Return the differences of a block's runs, (n, m), by k of its parameters, shape (n, m, k)."""
    values = block.pack()
    steps = DIFFERENCE * relative_sizes(values)
    return differences(lambda shifted: run(block.unpack(shifted)), values, steps, places)


def derivatives(
    block: Block,
    inputs: ArrayLike,
    sample_time: float | None = None,
    initial: Begun = None,
    places: Sequence[int] | None = None,
) -> Array:
    """Return the derivatives of a free run by the parameters, shape (n, n_outputs, k).

    Exact to rounding of any block that is one kernel, or is composed of such; at kinks, they are those
    of the branch taken. Of others (see `Block.complex_step`) they are differences.

    Parameters
    ----------
    block : Block
    inputs : array_like, shape (n, n_inputs), or (n,) for one input
    sample_time : float, optional
        Time between samples [s]; needed by blocks that depend on rate.
    initial : {"first_sample", "virgin"}, sequence of float, or callable, optional
        Memory before the first sample; its derivatives count too, unless it is given itself. A callable
        returns the state of a block, shape (n_states,). Default is the block's own.
    places : sequence of int, optional
        Of the k parameters, in `pack`; all by default.
    """
    table = np.asarray(inputs, dtype=np.float64).reshape(-1, len(block.inputs))
    places = range(block.n_parameters) if places is None else places
    workers, exact = max(min(cores(), len(places)), 1), differentiable(block)

    def outputs_of(other: Block) -> Array:
        start = initial(other).tolist() if callable(initial) else initial
        return other.run(table, sample_time, start)[0]

    def run(share: Sequence[int]) -> Array:
        if exact:
            return Tangents(block, sample_time, initial, share).over(table)[1]
        return by_moving(block, outputs_of, share)

    with ThreadPoolExecutor(workers) as pool:
        shares = [places[first::workers] for first in range(workers)]
        result = np.empty((len(table), len(block.outputs), len(places)))
        for first, own in enumerate(pool.map(run, shares)):
            result[:, :, first::workers] = own
    return result
