"""What recordings cannot tell: nothing where they tell it all, and one thing where they lack one."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from mckibben import PI, DataError, Recording
from mckibben.excitation import untold
from mckibben.signals import triangle
from mckibben.system.threads import one_blas_thread

Array = NDArray[np.float64]

STEP = 0.05
NOISE = 0.002

Leg = tuple[float, float, float]
"""Level [bar], speed on the way there [bar/s], and hold there [s]."""

TURNS = (4.0, 0.5, 3.4, 1.0, 3.0, 1.4, 2.6, 1.8, 4.0, 0.0)
CYCLES: list[Leg] = [
    *((level, 0.2, 0.0) for level in (4.0, 0.0)),
    *((level, 2.0, 0.0) for level in TURNS),
    *((level, 2.0, 0.0) for level in TURNS),
]
HOLDS: list[Leg] = [(level, 1.0, 20.0) for level in (1.2, 4.0, 2.8, 0.0)]
COMPLETE = [*CYCLES, *HOLDS]


def drive(legs: Sequence[Leg], step: float = STEP) -> Array:
    """Return an input that goes from level to level and rests there."""
    times, levels = [0.0], [0.0]
    for level, speed, hold in legs:
        times.append(times[-1] + abs(level - levels[-1]) / speed)
        levels.append(level)
        if hold:
            times.append(times[-1] + hold)
            levels.append(level)
    return np.interp(np.arange(0.0, times[-1], step), times, levels)


def lag(u: Array, seconds: float, step: float = STEP) -> Array:
    """Return a first-order lag that begins at rest."""
    y = np.empty_like(u)
    y[0] = u[0]
    keep = np.exp(-step / seconds)
    for i in range(1, u.size):
        y[i] = keep * y[i - 1] + (1 - keep) * u[i]
    return y


def muscle(u: Array, force: float | Array = 0.0, slow: float = 1.0) -> Array:
    """Return the displacement of a muscle that remembers, lags and gives way."""
    remembered = PI(thresholds=(0.0, 0.15, 0.4), weights=(5.0, 2.0, 1.0)).simulate(u)
    return remembered + (0.4 if slow < 10 else 3.0) * lag(u, slow) - 0.05 * force


def run(
    u: Array,
    force: float | Array | None = 50.0,
    *,
    slow: float = 1.0,
    seed: int = 0,
    noise: float = NOISE,
    step: float | None = STEP,
) -> Recording:
    """Return a recording of it, with noise."""
    load = np.zeros(u.size) + (0.0 if force is None else force)
    rng = np.random.default_rng(seed)
    y = muscle(u, load, slow) + noise * 30 * rng.standard_normal(u.size)
    channels = {"pressure": u + NOISE * rng.standard_normal(u.size), "displacement": y}
    return Recording(channels if force is None else channels | {"force": load}, step)


def pair(legs: Sequence[Leg], **settings: object) -> list[Recording]:
    """Return two runs of the same motion under two loads."""
    u = drive(legs)
    return [run(u, force, seed=seed, **settings) for seed, force in enumerate((50.0, 150.0))]  # type: ignore[arg-type]


def whats(recordings: Sequence[Recording], **settings: object) -> list[str]:
    """Return the names of what cannot be told."""
    return [gap.what for gap in untold(recordings, **settings)]  # type: ignore[arg-type]


def one_speed() -> list[Recording]:
    return pair([(level, 0.25, 12.0) for level in TURNS] * 2)


def no_holds() -> list[Recording]:
    return pair(CYCLES)


def creeping_on() -> list[Recording]:
    return pair(COMPLETE, slow=60.0)


def major_only() -> list[Recording]:
    ends = [(level, speed, 0.0) for speed in (0.2, 2.0, 2.0) for level in (4.0, 0.0)]
    return pair([*ends, (4.0, 1.0, 20.0), (0.0, 1.0, 20.0)])


def from_above_only() -> list[Recording]:
    peaks = [(level, 1.0, 0.0) for peak in (1.0, 1.8, 2.6, 3.2, 4.0) for level in (peak, 0.0)]
    slow = [(4.0, 0.1, 20.0), (0.0, 0.1, 20.0)]
    return pair([*peaks, *peaks, *slow])


def one_load() -> list[Recording]:
    return [run(drive(COMPLETE), seed=seed) for seed in (0, 1)]


def no_load() -> list[Recording]:
    return [run(drive(COMPLETE), None, seed=seed) for seed in (0, 1)]


def one_load_known() -> list[Recording]:
    u = drive(COMPLETE)
    return [run(u, load, seed=seed) for seed, load in enumerate((None, np.full(len(u), 20.0)))]


def against_a_spring() -> list[Recording]:
    u = drive(COMPLETE)
    return [run(u, 20.0 + 4.0 * muscle(u), seed=seed) for seed in (0, 1)]


def without_time() -> list[Recording]:
    return pair(COMPLETE, step=None)


def noisy() -> list[Recording]:
    return pair(COMPLETE, noise=0.06)


def coarse() -> list[Recording]:
    return [one.with_channels(displacement=np.round(one["displacement"])) for one in pair(COMPLETE)]


def clipped() -> list[Recording]:
    return [one.with_channels(pressure=np.minimum(one["pressure"], 3.7)) for one in pair(COMPLETE)]


def begun_inside() -> list[Recording]:
    inside = [
        (level, speed, 0.0) for speed in (0.2, 2.0, 2.0) for level in (1.0, 3.0, 1.4, 2.6, 2.0)
    ]
    legs = [*inside, *inside, *HOLDS]
    return [
        part.slice(int(np.argmax(part["pressure"] > 0.9)), len(part))
        for part in pair([(0.5, 1.0, 0.0), *legs])
    ]


def nothing_twice() -> list[Recording]:
    rng = np.random.default_rng(0)
    legs = [
        (float(x), float(s), 0.0)
        for x, s in zip(rng.uniform(0, 4, 24), np.geomspace(0.1, 3, 24), strict=True)
    ]
    u = drive([(4.0, 0.3, 0.0), *legs, (0.0, 0.7, 25.0), (2.0, 0.9, 25.0)])
    return [run(u[: u.size // 2], 50.0), run(u[u.size // 2 :], 150.0)]


def alone() -> list[Recording]:
    u = drive(COMPLETE)
    return [run(np.concatenate([u, u]), np.repeat([50.0, 150.0], u.size))]


BASE = np.concatenate([drive(COMPLETE), np.zeros(round(15 / STEP))])


def arm(u: Array, stiffness: float, seed: int = 0) -> Recording:
    """Return an arm of two muscles that pull at each other, the less the stiffer it is."""
    rng = np.random.default_rng(seed)
    moved = np.column_stack([muscle(one) for one in u.T])
    y = moved - 0.3 / (1 + stiffness) * moved[:, ::-1] + 0.02 * rng.standard_normal(u.shape)
    channels = {f"pressure_{k + 1}": one for k, one in enumerate(u.T)}
    channels |= {f"displacement_{k + 1}": one for k, one in enumerate(y.T)}
    load = np.linspace(0, 50, len(u)) ** (1 + stiffness)
    return Recording(
        channels | {"pressure_extensor": np.full(len(u), stiffness), "force": load}, STEP
    )


def held_load(one: Recording) -> Recording:
    """Return the same under a load that is held in a run, and differs between runs."""
    return one.with_channels(force=np.full(len(one), 10 + 50 * one["pressure_extensor"][0]))


def apart_and_together() -> Array:
    rest = np.zeros_like(BASE)
    rng = np.random.default_rng(1)
    legs = [[(float(x), 1.5, 0.0) for x in rng.uniform(0, 4, 60)] for _ in range(2)]
    wild = [drive(own) for own in legs]
    n = min(map(len, wild))
    columns = [
        np.concatenate([BASE, rest, wild[0][:n]]),
        np.concatenate([rest, BASE, wild[1][:n]]),
    ]
    return np.column_stack(columns)


def arms(u: Array, stiffnesses: Sequence[float] = (0.0, 1.0)) -> list[Recording]:
    return [held_load(arm(u, level, seed)) for seed, level in enumerate(stiffnesses)]


def arms_as_one() -> list[Recording]:
    return arms(np.column_stack([BASE, 0.8 * BASE]))


def arms_never_together() -> list[Recording]:
    rest = np.zeros_like(BASE)
    return arms(np.column_stack([np.concatenate([BASE, rest]), np.concatenate([rest, BASE])]))


def arms_of_which_one_rests() -> list[Recording]:
    return arms(np.column_stack([BASE, np.zeros_like(BASE)]))


def extensor_at_rest() -> list[Recording]:
    runs = arms(apart_and_together(), (1.0, 1.0))
    return [
        one.with_channels(force=np.full(len(one), level))
        for one, level in zip(runs, (10.0, 60.0), strict=True)
    ]


LACKING: list[tuple[Callable[[], list[Recording]], list[str]]] = [
    (lambda: pair(COMPLETE), []),
    (one_speed, ["rate"]),
    (no_holds, ["creep"]),
    (creeping_on, ["creep"]),
    (major_only, ["minor loops"]),
    (from_above_only, ["one-sided loops"]),
    (one_load, ["load"]),
    (no_load, ["load"]),
    (one_load_known, ["load"]),
    (against_a_spring, ["load"]),
    (without_time, ["time"]),
    (noisy, ["noise"]),
    (coarse, ["resolution"]),
    (clipped, ["clipped"]),
    (begun_inside, ["start"]),
    (nothing_twice, ["repeats"]),
    (alone, ["test"]),
    (lambda: arms(apart_and_together()), []),
    (arms_as_one, ["coupling"]),
    (arms_never_together, ["together"]),
    (arms_of_which_one_rests, ["resting"]),
    (extensor_at_rest, ["stiffness"]),
]


@pytest.mark.parametrize(("made", "what"), LACKING)
def test_what_is_lacking_is_told_and_nothing_else(
    made: Callable[[], list[Recording]], what: list[str]
) -> None:
    assert whats(made()) == what


@pytest.mark.parametrize(
    ("made", "first"),
    [
        (lambda one: one.with_channels(pressure=np.ones(len(one))), "still"),
        (lambda one: one.with_channels(displacement=np.ones(len(one))), "still"),
        (lambda _: run(drive([(4.0, 0.2, 0.0)])), "hysteresis"),
    ],
)
def test_what_stands_in_the_way_of_all_else_comes_first(
    made: Callable[[Recording], Recording], first: str
) -> None:
    gaps = untold([made(run(drive(COMPLETE)))])
    severities = [gap.severity for gap in gaps]
    assert gaps[0].what == first
    assert severities == sorted(severities, reverse=True)
    assert json.loads(json.dumps([gap.to_dict() for gap in gaps]))[0]["what"] == first


def test_a_test_that_goes_further() -> None:
    far, near = (
        run(drive([(top, 1.0, 0.0), (end, 1.0, 0.0)])) for top, end in ((5, 0), (3.9, 0.1))
    )
    assert whats(pair(COMPLETE), tests=[far]) == ["range"]
    assert whats(pair(COMPLETE), tests=[near]) == []


def test_copies_tell_nothing_more() -> None:
    one = pair(COMPLETE)[0]
    assert untold([one, one]) == untold([one])


def test_a_muscle_that_is_held_is_judged_by_its_force() -> None:
    held = [
        Recording(
            {
                "pressure": r["pressure"],
                "displacement": np.full(len(r), level),
                "force": r["displacement"],
            },
            r.sample_time,
        )
        for r, level in zip(pair(COMPLETE), (0.0, 10.0), strict=True)
    ]
    assert {"force", "resolution", "still"}.isdisjoint(whats(held))


# -- what is called lacking scatters in fits, and what is not does not -----------------------------


def hysteresis(u: Array) -> Array:
    """Return columns that any hysteresis without rate is a sum of, closely, with offset and drift."""
    shapes = [u / 4, (u / 4) ** 2, np.sqrt(np.abs(u / 4)), (u / 4) ** 3]
    columns = [
        PI(thresholds=(float(r),), weights=(1.0,)).simulate(shape)
        for shape in shapes
        for r in np.linspace(0, 0.5, 12)
    ]
    t = np.arange(u.size) / u.size
    return np.column_stack([*columns, np.ones(u.size), t])


def spread(columns: Sequence[Array], effect: Sequence[Array], seeds: int = 20) -> float:
    """Return how far apart fits of an effect's size come, relative to it, over realisations of noise.

    ``columns`` are what else is fitted, run by run, and ``effect`` what it is, for a size of 1.
    """
    design, wanted = np.vstack(columns), np.concatenate(effect)
    norms = np.linalg.norm(design, axis=0)
    left, sizes, _ = np.linalg.svd(design[:, norms > 0] / norms[norms > 0], full_matrices=False)
    known = left[:, sizes > 1e-7 * sizes[0]]
    alone = wanted - known @ (known.T @ wanted)
    rng = np.random.default_rng(0)
    measured = wanted + 30 * NOISE * rng.standard_normal((seeds, wanted.size))
    return float(np.std(measured @ alone / max(alone @ alone, 1e-300)))


ONE_SPEED = triangle(np.arange(0, 60, STEP), period=10.0, peaks=4.0)

Truth = tuple[list[Recording], list[Array], list[Array]]
"""Runs, what else is fitted to each, and the effect of which they tell or not."""


def of_rate(lacking: bool) -> Truth:
    """A lag of 0.5 s of a twentieth of the gain, beside free hysteresis."""
    fast, slow = (triangle(np.arange(0, 6 * p, STEP), period=p, peaks=4.0) for p in (2.0, 20.0))
    runs = [ONE_SPEED] if lacking else [ONE_SPEED, fast, slow]
    return (
        [run(u, None) for u in runs],
        [hysteresis(u) for u in runs],
        [0.4 * lag(u, 0.5) for u in runs],
    )


def of_creep(lacking: bool) -> Truth:
    """Creep over 200 s of a twentieth of the gain, beside free hysteresis and lags."""
    held = drive([(level, 1.5, 40.0) for level in (1.2, 4.0, 2.8, 0.0)])
    runs = [ONE_SPEED] if lacking else [ONE_SPEED, held]
    beside = [np.column_stack([hysteresis(u), lag(u, 0.5), lag(u, 2.0)]) for u in runs]
    return [run(u, None) for u in runs], beside, [0.4 * lag(u, 200.0) for u in runs]


def of_load(lacking: bool) -> Truth:
    u = drive(CYCLES)
    runs = [run(u, f, seed=k) for k, f in enumerate((50.0, 50.0 if lacking else 150.0))]
    return runs, [hysteresis(u)] * 2, [0.05 * one["force"] for one in runs]


def of_coupling(lacking: bool) -> Truth:
    u = np.column_stack([BASE, 0.8 * BASE]) if lacking else apart_and_together()
    return arms(u), [hysteresis(u[:, 0])], [0.3 * u[:, 1]]


@pytest.mark.parametrize("lacking", [True, False])
@pytest.mark.parametrize(
    ("what", "truth"),
    [("rate", of_rate), ("creep", of_creep), ("load", of_load), ("coupling", of_coupling)],
)
def test_what_is_lacking_comes_out_anyhow_and_what_is_not_does_not(
    what: str, truth: Callable[[bool], Truth], lacking: bool
) -> None:
    runs, beside, effect = truth(lacking)
    assert (what in whats(runs)) == lacking
    error = spread(beside, effect)
    assert error > 0.5 if lacking else error < 0.2


@pytest.fixture(autouse=True, scope="module")
def one_thread() -> Iterator[None]:
    """Keep small matrices on one core."""
    with one_blas_thread():
        yield


# -- whatever is recorded --------------------------------------------------------------------------


@settings(max_examples=40, deadline=None)
@given(data=st.data(), n=st.integers(10, 80), two=st.booleans(), timed=st.booleans())
def test_whatever_is_recorded_something_or_nothing_is_said(
    data: st.DataObject, n: int, two: bool, timed: bool
) -> None:
    values = st.lists(st.sampled_from([0.0, 0.5, 1.0, -2.0, 1e6, 1e-300]), min_size=n, max_size=n)
    names = ["pressure_1", "displacement_1"] + ["pressure_2", "displacement_2"] * two
    beside = data.draw(st.sampled_from([[], ["force"], ["pressure_extensor"]]))
    channels = {name: np.array(data.draw(values)) for name in (*names, *beside)}
    for gap in untold([Recording(channels, 0.1), Recording(channels, 0.1 if timed else None)]):
        assert 0 < gap.severity <= 1
        assert "nan" not in str(gap)


@pytest.mark.parametrize(
    ("given", "names", "said"),
    [
        (lambda one: [], [], "at least one"),
        (lambda one: [one], ["voltage"], "voltage"),
        (lambda one: [one, one.select(["pressure"])], [], "displacement"),
    ],
)
def test_recordings_that_cannot_be_judged_are_refused(
    given: Callable[[Recording], list[Recording]], names: list[Any], said: str
) -> None:
    with pytest.raises(DataError, match=said):
        untold(given(run(ONE_SPEED)), *names)
