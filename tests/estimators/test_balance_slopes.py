"""Slopes of a balance by hand against complex step through the same law: every term, in every mode."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import count
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from mckibben.blocks.complex_step import STEP, twin
from mckibben.blocks.coupled import balance_law as law
from mckibben.blocks.coupled import balance_solving as solving
from mckibben.blocks.coupled import balance_terms as at
from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.coupled.balance_terms import LINEAR
from mckibben.blocks.fields import rows
from mckibben.blocks.laws import wander
from mckibben.estimators.coupled.balance_slopes import run
from tests.blocks.balances import channels

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

TIME, SAMPLES = 0.1, 60
EXACT = 1e-10
"""Between samples [s]; of every run; relative to the largest slope of a column."""

BOTH = replace(
    Balance.example(),
    springs=((-3.0, 14.0, -4.0, -3.0, 1.0, 0.4), (2.0, -4.0, 15.0, -3.0, 0.4, 1.2)),
    bladders=(8.0, 7.0),
    pushes=(),
)
"""Two muscles with an extensor and a load; stops, lags, damping, lines and walls; never slack."""

SINGLE = replace(
    BOTH,
    springs=((2.0, 16.0, -1.0, 0.4, 0.3, 0.1, 0.1, 0.02, -2.0, 0.6, 0.2, 0.1, 0.05, 0.03),),
    **{
        name: getattr(BOTH, name)[:1]
        for name in ("elasticity", "areas", "friction", "relaxation", "damping", "lines", "walls")
    },
    loads=((1.0, 0.5),),
    hull=((-20.0, 50.0),),
    bladders=(8.0,),
    degree=3,
    friction_slopes=(0.02, 0.01),
    driven=channels("displacement", "mm", 1),
    scheduled=(*channels("extensor", "bar", 2), *channels("force", "N", 2)),
    given=channels("pressure", "bar", 1),
)
"""A muscle with two schedules of third degree and two loads."""

THREE = replace(
    BOTH,
    elasticity=((6.0, 4.0), (3.0, 8.0), (2.0, 5.0)),
    areas=((60.0, -25.0, -6.0), (66.0, -20.0, -8.0), (55.0, -15.0, -7.0)),
    friction=((3.0, 1.5), (2.5, 2.0), (1.0, 2.2)),
    relaxation=((1.0, 0.6), (0.8, 0.5), (0.4, 0.3)),
    damping=(0.1, 0.05, 0.08),
    lines=(0.06, 0.0, 0.05),
    walls=(0.05, 0.1, 0.02),
    bladders=(8.0, 7.0, 6.0),
    hull=((-20.0, 50.0),) * 3,
    directions=((1.0, 0.1), (-0.4, 0.9), (-0.5, -0.8)),
    given=channels("pressure", "bar", 3),
)
"""Three muscles about two coordinates."""

TIGHT: dict[str, Any] = {"hull": ((-2.0, 4.0), (-2.0, 5.0))}
OBSTACLES = rows([[1.0, 2.0, 3.0, 0.5, -1.0, -1.0, 2.0, 0.1], [1.0, 3.0, 2.0, 0.1, 1.0, 5.0, 9, 0]])

CASES: dict[str, Balance] = {
    "all at once": BOTH,
    "without time": replace(
        BOTH, relaxation=((), ()), lags=(), damping=(0.0, 0.0), lines=(), loads=((1.0,), (0.3,))
    ),
    "lines beyond what is known": replace(BOTH, lines=(0.6, 0.4), **TIGHT),
    "area at its least": replace(
        BOTH,
        springs=((-140.0, *BOTH.springs[0][1:]), BOTH.springs[1]),
        areas=((30.0, -250.0), (66.0, -300.0)),
        lines=(0.6, 0.4),
    ),
    "slack": replace(BOTH, pushes=(3.0, 0.0), bladders=(12.0, 9.0), lines=(0.6, 0.4)),
    "slack with much friction": replace(
        BOTH,
        springs=((0.0, 10.0, -7.0, -3.0, 1.0, 0.4), (0.0, -7.0, 11.0, -3.0, 0.4, 1.2)),
        friction=((40.0, 30.0), (40.0, 30.0)),
        pushes=(3.0, 0.0),
    ),
    "mass": replace(BOTH, mass=(0.01, 0.02)),
    "friction by way and schedule": replace(BOTH, asymmetry=0.4, friction_slopes=(0.03,)),
    "friction proportional to pressure": replace(BOTH, friction_growth=1.0, asymmetry=1.7),
    "constant friction": replace(BOTH, friction_growth=0.0, limits=(1.0, 4.0)),
    "friction that never breaks away": replace(BOTH, limits=(500.0, 800.0)),
    "obstacles": replace(BOTH, obstacles=OBSTACLES),
    "tare": replace(BOTH, tare=True, **TIGHT),
    "settled": replace(BOTH, settled=True),
    "held at the start": replace(BOTH, held=True),
    "one muscle, two schedules": SINGLE,
    "one muscle, all kinds": replace(
        SINGLE, asymmetry=0.6, tare=True, obstacles=((1.0, 3.0, 2.0, 0.1, 0.2),), mass=(0.01,)
    ),
    "more muscles than coordinates": THREE,
    "slack muscles about coordinates": replace(THREE, pushes=(4.0, 1.0, 2.0), tare=True),
    "driven muscles with mass": replace(
        THREE, mass=(0.01, 0.02, 0.01), drive=((1.0, 0.5, 0.1), (1.0, 0.2, 0.5), (1.0, -0.2, 0.3))
    ),
}


def driving(block: Balance) -> tuple[Array, Array, Array, Array]:
    """Return pressures, coordinates, what schedules and loads, and how pressures move with a front."""
    rng = np.random.default_rng(3)

    def path(low: float, high: float, width: int) -> Array:
        whole = wander(np.full(width, low), np.full(width, high), rng, 8, 12)[:SAMPLES]
        return np.asarray(whole + 1e-3 * rng.uniform(size=whole.shape))

    p = path(0.0, 4.0, len(block.given))
    p[20:22], p[40], p[41] = -0.2, 0.1, 4.1  # less than none, as sensors have it, and a step
    q, x = path(-4.0, 9.0, len(block.driven)), path(0.0, 2.0, len(block.scheduled))
    return p, q, x, rng.normal(size=(*p.shape, 2))


def columns(block: Balance, c: Array) -> Iterator[tuple[int, Array]]:
    """Yield every column of slopes that a parameter moves, and how coefficients move with it."""
    places, column = block.places.at, count(c.size - int(block.places.at["springs"].min()))
    first, met = int(places["springs"].min()), places["obstacles"].reshape(-1, block.sizes.obstacle)

    def unit(*moved: int) -> Array:
        moves = np.zeros(c.size)
        moves[list(moved)] = 1.0
        return moves

    names = {*LINEAR["coordinate"], *LINEAR["muscle"]} - {"obstacles"}
    linear = [*(places[name] for name in names), met[:, at.STIFFNESS :]]
    for place in sorted(np.concatenate([each.ravel() for each in linear]).tolist()):
        yield place - first, unit(place)
    yield next(column), unit(at.GROWTH)
    for place in places["friction_slopes"].ravel().tolist():
        yield next(column), unit(place)
    yield next(column), c[at.RATIO] * unit(at.RATIO)
    changes = (places[name].ravel().tolist() for name in ("decays", "gains"))
    own = zip(block.lags, *changes, strict=True)
    for lag, of_decay, of_gain in own:
        decay = np.exp(-TIME / lag)
        moves = decay * TIME / lag * unit(of_decay) + (c[of_gain] - decay) * unit(of_gain)
        yield next(column), moves
    yield next(column), unit(*places["walls"].ravel().tolist())
    for place in (*places["pushes"].ravel(), *met[:, at.PLACE]):
        yield next(column), unit(place)


def stepped(c: Complex, p: Complex, q: Array, x: Array, *, held: bool) -> Complex:
    """Return what `run` finds, by the kernels of the law for complex numbers."""
    m = int(c[at.N_COORDINATES].real)
    state = np.zeros(int(c[at.TARE].real) + m + 2, np.complex128)
    x, work = x.astype(np.complex128), np.zeros(int(c[at.WORK].real), np.complex128)
    here, none, tare = (np.zeros(size, np.complex128) for size in (m, p.shape[1], m))
    found = np.zeros((len(p), m), np.complex128)
    for t in range(-1, len(p)):
        way = law.AT_REST if t < 0 else law.FROM_REST if t == 0 else law.IN_TIME
        now = max(t, 0)
        pushed = p[now] if t >= 0 or (held and c[at.HELD] == 0.0) else none
        if held:
            here = q[now].astype(np.complex128)
            twin(solving.unbalanced)(c, state, way, here, x[now], pushed, work)
            found[now] = work[:m]
        else:
            twin(solving.solve_equilibrium)(c, state, way, here, x[now], pushed, work)
            found[now] = here
        twin(law.update_state)(c, state, way, here, pushed, x[now])
        if not held and c[at.TARED] != 0.0:
            tare = here.copy() if t < 0 else tare
            found[now] -= tare
    return found


@pytest.mark.parametrize("held", [False, True], ids=["free", "held"])
@pytest.mark.parametrize("case", CASES)
def test_slopes_are_those_of_complex_step(case: str, *, held: bool) -> None:
    block = CASES[case]
    c, (p, q, x, dp) = block.coefficients(TIME), driving(block)
    found, slopes = run(c, p, q, x, dp, held=held)
    still = np.zeros(c.size)
    every = [(column, moves, np.zeros(p.shape)) for column, moves in columns(block, c)]
    last = slopes.shape[2] - dp.shape[2]
    every += [(last + f, still, dp[:, :, f]) for f in range(dp.shape[2])]
    moved = set[int]()
    for column, of_c, of_p in every:
        expected = stepped(c + 1j * STEP * of_c, p + 1j * STEP * of_p, q, x, held=held)
        np.testing.assert_allclose(found, expected.real, rtol=0, atol=1e-11 * np.ptp(found))
        slope = expected.imag / STEP
        missed = np.abs(slopes[:, :, column] - slope)
        assert missed.max() <= EXACT * np.abs(slope).max(), column
        moved.add(column)
    others = [column for column in range(slopes.shape[2]) if column not in moved]
    assert not slopes[:, :, others].any()


@pytest.mark.kernel
@pytest.mark.parametrize("case", CASES)
def test_free_runs_are_those_of_the_block_with_slopes_and_without(case: str) -> None:
    block = CASES[case]
    c, (p, q, x, dp) = block.coefficients(TIME), driving(block)
    found, _ = run(c, p, q, x, dp, held=False)
    free = block.inverse().simulate(np.column_stack([p, x]), sample_time=TIME)
    np.testing.assert_allclose(found, free, rtol=0, atol=1e-12 * np.ptp(free))
    alone, none = run(c, p, q, x, held=False, sloped=False)
    np.testing.assert_array_equal(alone, found)
    assert none.shape == (*found.shape, 0)


@pytest.mark.kernel
@pytest.mark.parametrize("case", ["all at once", "settled", "one muscle, two schedules"])
def test_forces_that_a_held_balance_lacks_are_linear_in_its_coefficients(case: str) -> None:
    """But for what walls and lines do to them."""
    block = replace(CASES[case], walls=(0.0,) * len(CASES[case].given), lines=())
    c, (p, q, x, _) = block.coefficients(TIME), driving(block)
    lacking, slopes = run(c, p, q, x, held=True)
    first = int(law.coordinate_at(c, 0))
    linear = [column for column, _ in columns(block, c) if column < c.size - first]
    sums = slopes[:, :, linear] @ c[first + np.array(linear)]
    np.testing.assert_allclose(sums, lacking, rtol=0, atol=1e-12 * np.ptp(lacking))
