"""Corners of kernels, on data so small that they are run uncompiled too (`tests.uncompiled`)."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from mckibben import ModelWarning
from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.coupled.coupled_memory import CoupledMemory, readout_width
from mckibben.blocks.coupled.fuzzy_network import FuzzyNetwork
from mckibben.blocks.coupled.load_estimate import LoadEstimate
from mckibben.blocks.coupled.recurrent_fuzzy_network import RecurrentFuzzyNetwork
from mckibben.blocks.dynamics.narx import NarxPolynomial
from mckibben.blocks.dynamics.state_network import StateNetwork
from mckibben.blocks.fields import vector
from mckibben.blocks.force.multistate_friction import deflected
from mckibben.blocks.hysteresis.differential import flow
from mckibben.blocks.hysteresis.oscillators import BoucWenOscillator
from mckibben.blocks.hysteresis.preisach import DEPTH, Preisach, everett, output_at, solved_everett
from mckibben.blocks.laws import wander
from mckibben.blocks.solving import eliminate, solve_near
from mckibben.estimators.coupled.mpi_narmax import remembered
from mckibben.registry import load, names
from mckibben.system.compiling import Deferred
from tests.blocks.balances import ALONE as HARDENING
from tests.golden.models import network
from tests.twins import STEP_ERROR, STEPPED, TWINS

pytestmark = pytest.mark.kernel

Array = NDArray[np.float64]


def plain(kernel: Any) -> Any:
    """Return what is compiled, as it was written."""
    assert isinstance(kernel, Deferred)
    return kernel.py_func


def path(lowest: list[float], highest: list[float], n_turns: int = 6) -> Array:
    rng = np.random.default_rng(0)
    return wander(np.array(lowest), np.array(highest), rng, 8, n_turns)


# -- solving ---------------------------------------------------------------------------------


def test_elimination_exchanges_rows_and_ends_on_singular_ones() -> None:
    matrix = np.array([[0.0, 2.0, 1.0], [1.0, -1.0, 0.0], [3.0, 0.0, 1.0]])
    solved = np.array([1.0, 2.0, 3.0])
    right = matrix @ solved
    eliminate(matrix.copy(), right)
    np.testing.assert_allclose(right, solved, atol=1e-14)
    right = np.array([1.0, 1.0])
    eliminate(np.zeros((2, 2)), right)
    assert not np.isnan(right).any()


@pytest.mark.parametrize(
    ("evaluate", "target", "ends", "expected", "clipped"),
    [
        (lambda u, _: u, 1.0, (0.0, 256.0), 1.0, False),
        (lambda u, _: u, 300.0, (0.0, 256.0), 256.0, True),
        (lambda u, _: u, -300.0, (0.0, 256.0), 0.0, True),
        (lambda u, _: u if u < 1.5 else np.inf, 1.2, (0.0, 256.0), 1.2, False),
        (lambda u, _: -1.0 if u < 1.3 else 1.0, 0.0, (0.0, 256.0), 1.3, False),
        (lambda u, _: -1.0 if u < 1.0003 else 1.0, 0.0, (1.0, 1.001), 1.0003, False),
    ],
    ids=["on a step", "above", "below", "infinite beyond", "jump", "between neighbours"],
)
def test_roots(evaluate: Any, target: float, ends: Any, expected: float, clipped: bool) -> None:
    u, out = plain(solve_near)(evaluate, target, ends[0], *ends, None)
    assert u == pytest.approx(expected, rel=1e-13)
    assert bool(out) == clipped


# -- several muscles ---------------------------------------------------------------------------


def test_a_network_of_sets_far_apart_is_solved_rule_by_rule() -> None:
    example = FuzzyNetwork.example()
    narrow = replace(example, widths=tuple((0.1,) * len(row) for row in example.widths))
    ones = np.ones(40)
    wave = 5.0 * np.sin(0.7 * np.arange(40))
    x = np.column_stack([29.0 + 0.4 * wave, 31.0 - 0.3 * wave, 0.1 * ones])
    given = narrow.inverse().simulate(np.column_stack([narrow.simulate(x), x[:, 2]]))
    np.testing.assert_allclose(given, x[:, :2], rtol=1e-12)


def test_a_network_gives_the_nearest_that_it_can() -> None:
    inverse = FuzzyNetwork.example().inverse()
    wanted = np.array([[10.0, 10.0, 1.0], [500.0, -300.0, 1.0], [10.0, 10.0, 1.0]])
    with pytest.warns(ModelWarning):
        given = inverse.simulate(wanted)
    (low, high) = np.array(FuzzyNetwork.example().limits).T
    assert ((given >= low) & (given <= high)).all()
    reached = inverse.inverse().simulate(np.column_stack([given, wanted[:, 2]]))
    np.testing.assert_allclose(reached[[0, 2]], wanted[[0, 2], :2], atol=1e-7)
    assert np.abs(reached[1] - wanted[1, :2]).max() > 100.0


ALONE = replace(
    HARDENING,
    springs=((0.0, 10.0),),
    elasticity=((0.0,),),
    areas=((60.0,),),
    relaxation=((),),
    damping=(0.0,),
    lines=(),
    lags=(),
)
"""A balance of one muscle under a load."""


@pytest.mark.filterwarnings("ignore:overflow", "ignore:invalid")
def test_muscles_that_no_place_holds_stay_and_go_on_when_one_does() -> None:
    """A muscle that pulls the more the shorter it is runs away, but for little pressure."""
    block = replace(ALONE, areas=((60.0, 300.0),))
    pressures = np.array([[0.0, 0.0], [0.5, 0.0], [6.0, 0.0], [1e9, 0.0], [0.5, 0.0], [0.4, 0.0]])
    with pytest.warns(ModelWarning, match=r"\b2\b"):
        moved = block.inverse().simulate(pressures)[:, 0]
    np.testing.assert_array_equal(moved[2:4], moved[1])
    kept = block.inverse().simulate(pressures[[0, 1, 4, 5]])[:, 0]
    assert np.isfinite(moved).all()
    np.testing.assert_allclose(moved[[0, 1, 4, 5]], kept, atol=0.2 * block.limits[-1])


def test_friction_beyond_the_area_still_finds_pressures_that_balance() -> None:
    """Steps of Newton's method that would leave the bracket are halved."""
    rubbing = {
        "friction": ((100.0, 80.0),),
        "limits": (0.5, 8.0),
        "walls": (0.1,),
        "friction_growth": 0.95,
        "highest_pressure": 9.5,
    }
    block = replace(ALONE, tare=True, **rubbing)  # type: ignore[arg-type]
    inputs = np.column_stack([[10.4, 3.4, 5.0, -1.9], np.zeros(4)])
    pressures = block.simulate(inputs)
    loads = LoadEstimate(block).simulate(np.column_stack([inputs[:, 0], pressures]))
    np.testing.assert_allclose(loads, 0.0, atol=1e-10)


SLACK = replace(
    Balance.example(),
    springs=((0.0, 10.0, -7.0, -3.0, 1.0, 0.4), (0.0, -7.0, 11.0, -3.0, 0.4, 1.2)),
    bladders=(8.0, 8.0),
    pushes=(3.0, 0.0),
)
"""Of which now one muscle is slack, now the other."""


@pytest.mark.parametrize("friction", [SLACK.friction, ((40.0, 30.0), (40.0, 30.0))])
def test_slack_muscles_push_as_hard_as_they_can(friction: tuple[tuple[float, ...], ...]) -> None:
    """Also where friction that breaks away throws Newton's steps far off."""
    block = replace(SLACK, friction=friction)
    pressures = np.column_stack(
        [[0.0, 3.0, 3.0, 0.2, 0.0, 4.0], [0.0, 0.0, 4.0, 4.0, 0.0, 0.1], np.ones(6), np.zeros(6)]
    )
    expected = TWINS["balance-inverse"](block.inverse(), pressures.tolist(), 0.1)
    moved = block.inverse().simulate(pressures, sample_time=0.1)
    np.testing.assert_allclose(moved, expected, atol=1e-8)
    inputs = np.column_stack([moved, pressures[:, 2:]])
    inputs[3, 0] -= 12.0
    with pytest.warns(ModelWarning):
        found = block.simulate(inputs, sample_time=0.1)
    expected = TWINS["balance"](block, inputs.tolist(), 0.1)
    np.testing.assert_allclose(found, expected, atol=1e-8)


def longer_pasts() -> RecurrentFuzzyNetwork:
    """Return a network of two past outputs, the input and two past ones, the load and two past ones."""
    return replace(
        RecurrentFuzzyNetwork.example(),
        centres=((20.0,),) * 5 + ((100.0,),) * 3,
        widths=((40.0,),) * 5 + ((150.0,),) * 3,
        feedbacks=((0.3,),) * 8,
        consequents=vector(0.1 * np.random.default_rng(1).uniform(-1, 1, 9)),
        output_lags=2,
        input_lags=2,
        scheduling_lags=2,
    )


VARIANTS: dict[str, tuple[Any, float, list[float]]] = {
    "products of three": (
        replace(
            CoupledMemory.example(),
            degree=3,
            crossed=True,
            readout=(vector(0.3 / (1.0 + np.arange(readout_width(2, 2, 1, 3, True)))),),
        ),
        0.01,
        [5.0, 5.0],
    ),
    "longer pasts": (longer_pasts(), longer_pasts().own_time, [40.0, 200.0]),
    "two past outputs": (
        replace(
            NarxPolynomial.example(),
            output_lags=2,
            terms=((), (0,), (1,), (2,), (4,), (0, 2)),
            weights=(0.01, 0.8, 0.1, 0.05, 0.04, 0.01),
        ),
        NarxPolynomial.example().sample_time,
        [5.0],
    ),
    **{
        f"{kind} {loops}, exponent {exponent}": (
            replace(load("blocks", kind).example(), exponent=exponent, **loops),
            0.01,
            [5.0],
        )
        for kind, loops in (
            ("bouc-wen", {"sigma": 0.5}),
            ("bouc-wen", {"sigma": 3.0}),
            ("generalized-bouc-wen", {}),
        )
        for exponent in (1, 2)
    },
    "held force, Bouc-Wen": (replace(BoucWenOscillator.example(), hold="zero"), 0.01, [5.0]),
    "held force, network": (replace(StateNetwork.example(), hold="zero"), 0.01, [5.0]),
    "network of several": (network(), 0.01, [5.0, 30.0]),
}


@pytest.mark.parametrize("variant", VARIANTS)
def test_variants_agree_with_their_twins(variant: str) -> None:
    block, step, highest = VARIANTS[variant]
    inputs = path([0.0] * len(highest), highest)
    found = block.simulate(inputs, sample_time=step).reshape(len(inputs), -1)
    expected = TWINS[block.kind](block, inputs.tolist(), step)
    tolerance = STEP_ERROR * np.ptp(expected) if block.kind in STEPPED else 1e-12
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=tolerance)


def test_memberships_are_those_of_each_time_after_the_other() -> None:
    rng = np.random.default_rng(0)
    x, centres, widths = rng.normal(size=(5, 2)), rng.normal(size=(2, 3)), rng.uniform(1, 2, (2, 3))
    feedbacks, found = rng.normal(size=(2, 3)), np.empty((5, 2, 3))
    remembered(x, centres, widths, feedbacks, found)
    last = np.zeros((2, 3))
    for sample, memberships in zip(x, found, strict=True):
        last = np.exp(-0.5 * ((sample[:, np.newaxis] - centres + feedbacks * last) / widths) ** 2)
        np.testing.assert_allclose(memberships, last, rtol=1e-13)


# -- one muscle --------------------------------------------------------------------------------


def test_flow_solves_its_equation_where_it_slows_down_unloading() -> None:
    """dv/dtau = 1 - psi |v|^2; models that run away so are refused, and never come here."""
    v, h = -1.1, 1e-6
    for tau in np.linspace(0.05, 1.2, 24):
        here, ahead = (plain(flow)(v, step, 0.4, 1.3, 2) for step in (tau, tau + h))
        psi = 0.4 if here < 0 else 1.3
        assert (ahead - here) / h == pytest.approx(1 - psi * here**2, abs=1e-5)


@pytest.mark.parametrize("v", [0.0, 0.01, 3.0])
def test_an_element_goes_on_from_where_it_was(v: float) -> None:
    """From far beyond its limit backwards, through relaxing and sticking to slipping."""
    k, sigma, limit = 2.0, 0.5, 1.0
    times = np.linspace(0.0, 4.0, 21)
    x = [plain(deflected)(-3.0, v, time, k, sigma, limit) for time in times]
    assert x[0] == pytest.approx(-3.0)
    step = times[1]
    for here, there in pairwise(x):
        assert plain(deflected)(here, v, step, k, sigma, limit) == pytest.approx(there, abs=1e-12)
    assert np.all(np.diff(x) >= 0)


def test_relays_at_a_corner_and_at_the_ends() -> None:
    block = Preisach.example()
    numbers = block.coefficients(None)
    n = int(numbers[0])
    levels, table = numbers[1 : 1 + n], numbers[1 + n : 1 + n + n * n]
    state = block.initial_state(np.array([levels[0]]))
    assert plain(output_at)(state[2], state, levels, table) == state[2 + DEPTH]
    for other, rising in ((levels[-1], True), (levels[0], False)):
        assert plain(solved_everett)(1.0, other, rising, levels, table) == other
    middle = levels[n // 2]
    for u in (middle + 0.3, levels[-1]):
        wanted = plain(everett)(u, middle, levels, table)
        assert plain(solved_everett)(wanted, middle, True, levels, table) == pytest.approx(u)
    wanted = plain(everett)(middle, levels[0] + 0.1, levels, table)
    assert plain(solved_everett)(wanted, middle, False, levels, table) == pytest.approx(
        levels[0] + 0.1
    )
    plateau = np.zeros_like(table)
    assert plain(solved_everett)(0.0, middle, True, levels, plateau) == levels[n // 2 + 1]


# -- air -------------------------------------------------------------------------------------


def test_air_holds_between_its_goals_and_goes_as_far_as_it_can() -> None:
    air = load("blocks", "air").example()
    reference = np.repeat([1.0, 5.0, 5.0, 0.0, 0.5], 12)
    with pytest.warns(ModelWarning):
        command = air.inverse().simulate(reference, sample_time=0.01)
    assert set(command[12:15]) == {air.input_limits[1]}
    assert set(command[36:39]) == {air.offsets[1]}  # below, no command vents faster
    pressure = air.simulate(command, sample_time=0.01)
    assert pressure[:14].tolist() == [pressure[0]] * 14  # held, then late
    expected = TWINS["air"](air, command[:, np.newaxis].tolist(), 0.01)
    np.testing.assert_allclose(pressure[:, np.newaxis], expected, atol=1e-12)


def test_sums_that_may_be_reordered_are_compiled_alike_whatever_was_compiled_before() -> None:
    every = [load("blocks", kind).example() for kind in names("blocks")]
    for kernel in {one for block in every for one in block.c_kernels}:
        if kernel.targetoptions.get("fastmath"):
            cells = [cell.cell_contents for cell in kernel.py_func.__closure__ or ()]
            named = map(kernel.py_func.__globals__.get, kernel.py_func.__code__.co_names)
            called = [one for one in (*cells, *named) if isinstance(one, Deferred)]
            assert all(one.targetoptions.get("inline") == "always" for one in called)
