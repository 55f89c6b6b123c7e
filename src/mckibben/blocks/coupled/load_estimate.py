"""Load estimates from displacements and pressures of muscles, by the force balance.

Where displacements and pressures are known, all in the equation of
`mckibben.blocks.coupled.balance_law` is known but the loads:

    C F = p A(y) - springs - elasticity - friction - relaxation - damping - inertia,

n equations of as many loads or fewer, solved by least squares with the pseudo-inverse of C. Pressures
must be measured, not those that a compensator asks for.

Solved for the pressure, at given displacements and desired loads, the same equation is the balance
itself: that is the compensator of a force.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Annotated, Any, Self

import numpy as np
from pydantic import BeforeValidator, InstanceOf
from pydantic.dataclasses import dataclass

from mckibben.arrays import Array
from mckibben.blocks.base import Block, Board
from mckibben.blocks.compose import Composition, PerChannel, Series
from mckibben.blocks.coupled import balance_terms as at
from mckibben.blocks.coupled.balance import Balance, Placed, balance_in
from mckibben.blocks.coupled.balance_law import AT_REST, FROM_REST, IN_TIME, update_state
from mckibben.blocks.coupled.balance_solving import start_at_rest, start_held, unbalanced
from mckibben.blocks.fields import STRICT, Channel
from mckibben.blocks.kernels import fill, kernel, step
from mckibben.blocks.memoryless import Affine
from mckibben.blocks.parameters import same_as
from mckibben.blocks.saving import nested
from mckibben.errors import ModelError


@step
def load_estimate_step(
    coefficients: Array, state: Array, scratch: Array, inputs: Array, outputs: Array
) -> None:
    """Compute the loads of a sample.

    Inputs: m displacements, n pressures, and the schedules. Coefficients: those of the balance, then
    the pseudo-inverse of its shares of loads, row by row. Scratch, with x, the scheduling inputs of the
    balance, at its end:

        coordinates q (m) | residual forces (m) and what they need | x: schedules | loads
    """
    c = coefficients
    n, m = int(c[at.N_MUSCLES]), int(c[at.N_COORDINATES])
    n_loads = int(c[at.N_LOADS])
    n_x = int(c[at.N_SCHEDULES]) + n_loads
    q, x = scratch[:m], scratch[scratch.size - n_x :]
    loads = x[n_x - n_loads :]
    for j in range(m):
        q[j] = inputs[j] + state[int(c[at.TARE]) + j]
    mode = FROM_REST if state[at.FRESH] != 0.0 else IN_TIME
    estimate(c, state, mode, q, inputs, loads, scratch)
    update_state(c, state, mode, q, inputs[m : m + n], x)
    fill(outputs, loads)


@kernel
def estimate(
    c: Array, state: Array, mode: int, q: Array, inputs: Array, loads: Array, scratch: Array
) -> None:
    """Fill the loads in equilibrium at given coordinates.

    ``loads`` is the end of the scheduling inputs x in the scratch: zeroed first, so that the residual
    forces are those without load, which the loads then balance.
    """
    n, m = int(c[at.N_MUSCLES]), int(c[at.N_COORDINATES])
    n_schedules, n_loads = int(c[at.N_SCHEDULES]), int(c[at.N_LOADS])
    x, residual = scratch[scratch.size - n_schedules - n_loads :], scratch[m : 2 * m]
    for i in range(n_schedules):
        x[i] = inputs[m + n + i]
    for i in range(n_loads):
        loads[i] = 0.0
    unbalanced(c, state, mode, q, x, inputs[m : m + n], scratch[m:])
    load_pseudoinverse = c[c.size - n_loads * m :]
    for i in range(n_loads):
        for j in range(m):
            loads[i] -= load_pseudoinverse[i * m + j] * residual[j]


@kernel
def load_estimate_start(
    coefficients: Array, state: Array, scratch: Array, inputs: Array, virgin: bool
) -> None:
    """Start as the balance does, under the frictionless loads of the first sample.

    The scratch is that of `load_estimate_step`; once the loads are known, its residual forces make room
    for the pressures p of the start (n), and what these need.
    """
    c = coefficients
    n, m = int(c[at.N_MUSCLES]), int(c[at.N_COORDINATES])
    n_schedules, n_loads = int(c[at.N_SCHEDULES]), int(c[at.N_LOADS])
    q, p, x = scratch[:m], scratch[m : m + n], scratch[scratch.size - n_schedules - n_loads :]
    loads = x[n_schedules:]
    state[:] = 0.0
    fill(q, inputs)
    estimate(c, state, AT_REST, q, inputs, loads, scratch)
    if c[at.HELD] != 0.0:
        start_held(c, state, x, q, p)
    else:
        for i in range(n_loads):
            loads[i] = loads[i] if c[at.TARED] == 0.0 else 0.0
        start_at_rest(c, state, x, q, p, scratch[m + n :])
    if virgin:
        for j in range(m):
            q[j] = inputs[j] + state[int(c[at.TARE]) + j]
        update_state(c, state, AT_REST, q, inputs[m : m + n], x)


@dataclass(frozen=True, config=STRICT)
class LoadEstimate(Block):
    """Load estimator: from displacements, pressures and scheduling inputs of muscles to their loads.

    Its memory begins where the balance's does: at rest without pressure, under the loads that the
    first sample implies without friction. A balance with a tare starts without load: loads present at
    the start then offset the estimate.

    Parameters
    ----------
    forward : Balance
        The muscles.
    """

    kind = "load-estimate"
    ports = ("forward.driven", "forward.given"), ("scheduled",), ("loads",)
    rate_dependent = same_as("forward.rate_dependent")
    complex_step = same_as("forward.complex_step")
    n_states = same_as("forward.n_states")
    kernel = load_estimate_step
    start_kernel = load_estimate_start
    parameters = ("forward",)
    typical = (Balance.example(),)
    _of_model = same_as("forward")
    formulas = (
        r"F = C^{+} \left(p A(y) - \text{springs}(x) - \text{elasticity} - \text{friction} - "
        r"\text{relaxation} - \text{damping} - \text{inertia}\right)",
    )

    forward: Annotated[InstanceOf[Balance], BeforeValidator(nested)]

    def __post_init__(self) -> None:
        loads = np.array(self.forward.loads)
        n, n_loads = loads.shape
        if n_loads == 0:
            raise ModelError(
                "this balance has no load to estimate",
                remedy="identify it under several forces: measured, or of two masses or more, each a "
                "constant of its recordings",
            )
        if any(channel.unit != "bar" for channel in self.forward.given):
            raise ModelError(
                "loads are estimated from pressures, and this balance has "
                f"{self.forward.given[0].name} in {self.forward.given[0].unit}",
                remedy="identify it from the pressure (`input=pressure`)",
            )
        if np.linalg.matrix_rank(loads) < n_loads:
            raise ModelError(
                f"{n_loads} load(s) pull at {n} muscle(s) in the shares "
                f"{self.forward.loads}, which do not distinguish them",
                remedy="identify a balance with fewer loads",
            )

    @property
    def loads(self) -> tuple[Channel, ...]:
        """The estimated loads."""
        return self.forward.scheduled[len(self.scheduled) :]

    @property
    def scheduled(self) -> tuple[Channel, ...]:
        """The scheduling inputs other than loads."""
        return self.forward.scheduled[: len(self.forward.scheduled) - self.forward.n_loads]

    @property
    def n_scratch(self) -> int:
        """Scratch of the balance, and the scheduling inputs."""
        return self.forward.n_scratch + len(self.forward.scheduled)

    def strictly_increasing(self) -> Iterator[tuple[str, tuple[float, ...]]]:
        return self.forward.strictly_increasing()

    def coefficients(self, sample_time: float | None) -> Array:
        """Return the balance's coefficients, and the pseudo-inverse of its shares of loads."""
        load_pseudoinverse = np.linalg.pinv(np.array(self.forward.loads))
        return np.concatenate([self.forward.coefficients(sample_time), load_pseudoinverse.ravel()])


@dataclass(frozen=True, config=STRICT)
class ForceCompensator(Composition):
    """Pressure for a desired force at a given length or displacement: a load estimate, solved for it.

    Parameters
    ----------
    forward : Block
        A load estimate of one muscle that starts held, alone or behind a series of blocks on its
        displacement and on its pressure.
    """

    kind = "force-compensator"
    inverts = True
    path_dependent = True
    parameters = ("forward",)

    forward: Annotated[InstanceOf[Block], BeforeValidator(nested)]

    forward_model = same_as("forward")

    def __post_init__(self) -> None:
        if self._estimate is None:
            raise ModelError(
                f"{self.forward.title!r} estimates no load from a displacement and a pressure",
                remedy="give a model that `balance-force` identified",
            )
        balance = self._estimate.forward
        if len(balance.given) != 1 or balance.n_loads != 1 or not balance.held:
            raise ModelError(
                "pressures are solved for of one muscle under one load that starts held",
                remedy="identify `balance-force`",
            )

    @classmethod
    def of(cls, model: Block) -> Self | None:
        """Return the compensator of a force model that starts held; None for other models."""
        estimate = _estimate_in(model)
        return cls(model) if estimate is not None and estimate.forward.held else None

    @property
    def _estimate(self) -> LoadEstimate | None:
        return _estimate_in(self.forward)

    @cached_property
    def parts(self) -> tuple[Block, ...]:  # type: ignore[override]
        """Blocks on the displacement, the balance, and the inverses of those on the pressure."""
        assert self._estimate is not None
        before = self.forward.parts[:-1] if isinstance(self.forward, Series) else ()
        stages = [stage.parts for stage in before if isinstance(stage, PerChannel)]
        on_displacement = [displacement for displacement, _ in stages]
        on_pressure = [pressure.inverse() for _, pressure in reversed(stages)]
        return (*on_displacement, self._estimate.forward, *on_pressure)

    @property
    def inputs(self) -> tuple[Channel, ...]:
        """The force, then the length or displacement, then what schedules."""
        return (*self.forward.outputs, self.forward.inputs[0], *self.forward.inputs[2:])

    @property
    def scheduling(self) -> tuple[str, ...]:
        """All inputs but the force."""
        return tuple(channel.name for channel in self.inputs[1:])

    @property
    def outputs(self) -> tuple[Channel, ...]:
        return (self.forward.inputs[1],)

    def wired(self, board: Board, taken: Sequence[Any]) -> list[Any]:
        force, displacement, *scheduled = taken
        return Series(self.parts).wired(board, [displacement, *scheduled, force])

    def joined(self, parts: Sequence[str]) -> str:
        return rf"p = {'['.join(reversed(parts))}[x{']' * len(parts)}"

    def reachable(self) -> tuple[Array, Array]:
        """Return the identified pressures."""
        first = [part.kind for part in self.parts].index(Balance.kind)
        return Series(self.parts[first:]).reachable()

    @classmethod
    def example(cls) -> Self:
        pressure, force = Channel("pressure", "bar"), Channel("force", "N")
        displacement = Channel("displacement", "mm")
        balance = Balance(
            springs=((0.0, 12.0),),
            elasticity=((6.0, 4.0),),
            areas=((160.0, -60.0, -10.0),),
            friction=((30.0, 8.0),),
            relaxation=((2.0,),),
            loads=((1.0,),),
            damping=(0.1,),
            walls=(0.3,),
            limits=(0.5, 2.0),
            friction_growth=0.95,
            highest_pressure=9.5,
            lags=(2.0,),
            hull=((-5.0, 40.0),),
            scale=40.0,
            degree=1,
            driven=(displacement,),
            scheduled=(force,),
            given=(pressure,),
            held=True,
        )
        shortening = Affine(-1.0, 200.0, Channel("length", "mm"), displacement)
        before = PerChannel((shortening, Affine(1.0, 0.0, pressure, pressure)))
        return cls(Series((before, LoadEstimate(balance))))


def _estimate_in(model: Block) -> LoadEstimate | None:
    """Return the load estimate that a model is, or ends with; None if there is none."""
    last = model.parts[-1] if isinstance(model, Series) else model
    return last if isinstance(last, LoadEstimate) else None


def load_of(model: Block) -> Block:
    """Return the load estimator of a model, allowing for offsets of its channels.

    Raises
    ------
    ModelError
        If the model has no load, or its coordinates are not measured one by one.
    """
    if isinstance(model, LoadEstimate):
        raise ModelError("this is already a load estimator", remedy="simulate it")
    if isinstance(model, Balance):
        return LoadEstimate(model)
    placed = balance_in(model)
    if placed is None or not placed.solved or len(placed.behind) > 1:
        raise ModelError(
            f"{model.title!r} does not estimate loads from displacements and pressures",
            remedy="identify 'balance', on recordings with a measured force",
        )
    stages = _stages(placed)
    estimate = LoadEstimate(placed.balance)
    return Series((*stages, estimate)) if stages else estimate


def _stages(placed: Placed) -> list[PerChannel]:
    """Return the blocks on displacements and pressures that lead to those of the balance, in stages.

    Each stage has a block for every displacement, then one for every pressure. Example: a model from
    pressure to length, of a regulator's lag, an offset, the balance solved for displacements, and a
    conversion of these to length, gives two stages: length to displacement beside the lag, and the
    displacement unchanged beside the offset.
    """
    balance = placed.balance
    on_pressures = [_of_each(block) for block in placed.before]
    on_displacements = [_of_each(block.inverse()) for block in placed.behind]
    n_stages = max(len(on_pressures), len(on_displacements))
    on_pressures += [_unchanged(balance.given)] * (n_stages - len(on_pressures))
    on_displacements += [_unchanged(balance.driven)] * (n_stages - len(on_displacements))
    return [
        PerChannel((*displacements, *pressures))
        for displacements, pressures in zip(on_displacements, on_pressures, strict=True)
    ]


def _unchanged(channels: Sequence[Channel]) -> tuple[Block, ...]:
    """Return blocks that pass channels on as they are."""
    return tuple(Affine(1.0, 0.0, channel, channel) for channel in channels)


def _of_each(block: Block) -> tuple[Block, ...]:
    """Return the block of every channel."""
    return block.parts if isinstance(block, PerChannel) else (block,)
