"""The kernels of a compensator that looks ahead, made for those of a model and its inverse.

Coefficients are [n, horizon, limits, the model's states, the inverse's, the model's coefficients, the
inverse's], nudges (n), lowest pressures (n), limits, and the coefficients of both. The state is [the
model's, references to come (horizon by n), last pressures (n), whether there are some, plans made].
"""

from __future__ import annotations

from functools import cache
from typing import Any

from mckibben.arrays import Array
from mckibben.blocks.base import Block, Start
from mckibben.blocks.kernels import Step, in_scratch, kernel, step
from mckibben.blocks.predictive.memory import Resume
from mckibben.blocks.predictive.plan import plan, plan_scratch
from mckibben.blocks.predictive.plan_one import one_scratch, plan_one
from mckibben.blocks.predictive.supply import allowed

HEAD = 7
"""Coefficients before the nudges."""

PASSES = 2
"""Times that a plan is made, each along what the model makes of the one before."""

STILL = 0.1
"""By the nudge: what moves less counts as going on as before."""


def horizon_scratch(model: Block, undo: Block, length: int, rows: int) -> int:
    """Return how many numbers a step computes in, of a horizon and so many limits."""
    n = len(undo.outputs)
    planned = one_scratch(length) if n == 1 else plan_scratch(length, n, rows)
    own = 3 * model.n_states + undo.n_states + len(undo.inputs) + 4 * n + rows * (n + 2)
    return own + length * n * (4 + n) + max(planned, model.n_scratch, undo.n_scratch)


@kernel
def plan_for_one(
    n: int,
    rows: Array,
    before: Array,
    slopes: Array,
    nominal: Array,
    errors: Array,
    p: Array,
    scratch: Array,
) -> int:
    """Plan for one muscle, as `plan` does for several."""
    plan_one(rows, before, slopes, nominal, errors, p, scratch)
    return n


@kernel
def kept_to(n: int, rows: Array, before: Array, p: Array) -> bool:
    """Clip pressures of a horizon to all limits, in turn; return whether they kept to them."""
    there = allowed(rows, before, p[:n])
    for t in range(1, p.size // n):
        one = allowed(rows, p[(t - 1) * n : t * n], p[t * n : (t + 1) * n])
        there = there and one
    return there


def _in_room(function: Any) -> Any:
    """Return a kernel that is given scratch, whether it takes some or not."""
    if in_scratch(function):
        return function

    @kernel
    def without_scratch(
        coefficients: Array, state: Array, scratch: Array, inputs: Array, outputs: Array
    ) -> None:
        """Run what needs no scratch."""
        function(coefficients, state, inputs, outputs)

    return without_scratch


def _start_in_room(function: Any) -> Any:
    """Return a start that is given scratch, whether it takes some or not."""
    if in_scratch(function):
        return function

    @kernel
    def start_without_scratch(
        coefficients: Array, state: Array, scratch: Array, inputs: Array, virgin: bool
    ) -> None:
        """Start what needs no scratch."""
        function(coefficients, state, inputs, virgin)

    return start_without_scratch


@cache
def kernels_of(
    model_step: Step, undo_step: Step, undo_start: Start, resume: Resume, *, one: bool
) -> tuple[Step, Start]:
    """Return the step and the start of a compensator that looks ahead.

    Parameters
    ----------
    model_step, undo_step, undo_start : callable
        Kernels of the model and of its inverse.
    resume : callable
        Fills the inverse's state from the model's.
    one : bool
        Whether of one muscle.
    """
    answers, undoes, begins = _in_room(model_step), _in_room(undo_step), _start_in_room(undo_start)
    planner: Any = plan_for_one if one else plan

    @kernel
    def linearise(
        n: int,
        model: Array,
        nudges: Array,
        memory: Array,
        before: Array,
        wished: Array,
        nominal: Array,
        given: Array,
        errors: Array,
        slopes: Array,
        states: Array,
        vectors: Array,
        room: Array,
    ) -> None:
        """Find the errors along pressures, and the model's slopes where the motion goes on."""
        size = memory.size
        trial, kept, after = states[:size], states[size : 2 * size], states[2 * size : 3 * size]
        way, answer, change = vectors[:n], vectors[n : 2 * n], vectors[2 * n : 3 * n]
        way[:] = 1.0
        kept[:] = memory
        for t in range(nominal.size // n):
            for k in range(n):
                p = nominal[t * n + k]
                moved = p - (before[k] if t == 0 else nominal[(t - 1) * n + k])
                if abs(moved) > STILL * nudges[k]:
                    way[k] = 1.0 if moved > 0.0 else -1.0
                given[k] = p
            trial[:] = kept
            answers(model, trial, room, given, answer)
            after[:] = trial
            for k in range(n):
                given[k] = nominal[t * n + k] + way[k] * nudges[k]
                trial[:] = kept
                answers(model, trial, room, given, change)
                for i in range(n):
                    slopes[(t * n + i) * n + k] = (change[i] - answer[i]) / (way[k] * nudges[k])
                given[k] = nominal[t * n + k]
            for k in range(n):
                errors[t * n + k] = wished[t * n + k] - answer[k]
            kept[:] = after

    @step
    def predictive_step(
        coefficients: Array, state: Array, scratch: Array, inputs: Array, outputs: Array
    ) -> None:
        """Give the first pressures of a horizon within all limits, and take that step."""
        c = coefficients
        n, count, width = int(c[0]), int(c[1]) * int(c[0]), int(c[0]) + 2
        size, n_undoing = int(c[3]), int(c[4])
        nudges, lowest, numbers = c[HEAD : HEAD + n], c[HEAD + n : HEAD + 2 * n], c[HEAD + 2 * n :]
        rows, own = numbers[: int(c[2]) * width], numbers[int(c[2]) * width :]
        model, undo = own[: int(c[5])], own[int(c[5]) : int(c[5]) + int(c[6])]
        memory, wished, last = state[:size], state[size : size + count], state[size + count :]
        before = last[:n]
        states, undoing = scratch[: 3 * size], scratch[3 * size : 3 * size + n_undoing]
        given = scratch[3 * size + n_undoing : 3 * size + n_undoing + inputs.size]
        rest = scratch[3 * size + n_undoing + inputs.size :]
        vectors, ranges, tables = (
            rest[: 4 * n],
            rest[4 * n : 4 * n + rows.size],
            rest[4 * n + rows.size :],
        )
        inverted, nominal = tables[:count], tables[count : 2 * count]
        following, errors = tables[2 * count : 3 * count], tables[3 * count : 4 * count]
        slopes, room = tables[4 * count : (4 + n) * count], tables[(4 + n) * count :]
        first = last[n] == 0.0
        for i in range(count - n):
            wished[i] = inputs[i % n] if first else wished[i + n]
        wished[count - n :] = inputs[:n]
        resume(model, memory, undoing)
        given[:] = inputs
        for t in range(int(c[1])):
            given[:n] = wished[t * n : (t + 1) * n]
            undoes(undo, undoing, room, given, inverted[t * n : (t + 1) * n])
        if first:  # whatever the rate
            before[:] = inverted[:n]
            m = 0
            for i in range(int(c[2])):
                if rows[i * width] == 0.0:
                    ranges[m * width : (m + 1) * width] = rows[i * width : (i + 1) * width]
                    m += 1
            _ = allowed(ranges[: m * width], lowest, before)
            last[n] = 1.0
        following[:] = inverted
        if not kept_to(n, rows, before, following):
            nominal[:] = inverted
            for _ in range(PASSES):
                linearise(
                    n,
                    model,
                    nudges,
                    memory,
                    before,
                    wished,
                    nominal,
                    given,
                    errors,
                    slopes,
                    states,
                    vectors,
                    room,
                )
                _ = planner(n, rows, before, slopes, nominal, errors, following, room)
                _ = kept_to(n, rows, before, following)
                nominal[:] = following
            last[n + 1] += 1.0
        before[:] = following[:n]
        given[:n] = before
        answers(model, memory, room, given, vectors[:n])
        outputs[:] = before

    @kernel
    def predictive_start(
        coefficients: Array, state: Array, scratch: Array, inputs: Array, virgin: bool
    ) -> None:
        """Start as the inverse does: as if its first reference had been there all along."""
        c = coefficients
        numbers = c[HEAD + 2 * int(c[0]) + int(c[2]) * (int(c[0]) + 2) + int(c[5]) :]
        undoing = scratch[: int(c[4])]
        begins(numbers, undoing, scratch[int(c[4]) :], inputs, virgin)
        state[:] = 0.0
        state[: int(c[3])] = undoing[: int(c[3])]

    return predictive_step, predictive_start
