"""What recordings cannot tell: nothing where they tell it all, and one thing where they lack one."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from mckibben import PI, DataError, Recording
from mckibben.excitation import untold
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
    force: float | Array = 50.0,
    *,
    slow: float = 1.0,
    seed: int = 0,
    noise: float = NOISE,
    step: float | None = STEP,
) -> Recording:
    """Return a recording of it, with noise."""
    load = np.zeros(u.size) + force
    rng = np.random.default_rng(seed)
    y = muscle(u, load, slow) + noise * 30 * rng.standard_normal(u.size)
    channels = {"pressure": u + NOISE * rng.standard_normal(u.size), "displacement": y}
    return Recording(channels | {"force": load}, step)


def pair(legs: Sequence[Leg], **settings: object) -> list[Recording]:
    """Return two runs of the same motion under two loads."""
    u = drive(legs)
    return [run(u, force, seed=seed, **settings) for seed, force in enumerate((50.0, 150.0))]  # type: ignore[arg-type]


def whats(recordings: Sequence[Recording], **settings: object) -> list[str]:
    """Return the names of what cannot be told."""
    return [gap.what for gap in untold(recordings, **settings)]  # type: ignore[arg-type]


def major_only() -> list[Recording]:
    ends = [(level, speed, 0.0) for speed in (0.2, 2.0, 2.0) for level in (4.0, 0.0)]
    return pair([*ends, (4.0, 1.0, 20.0), (0.0, 1.0, 20.0)])


def from_above_only() -> list[Recording]:
    peaks = [(level, 1.0, 0.0) for peak in (1.0, 1.8, 2.6, 3.2, 4.0) for level in (peak, 0.0)]
    slow = [(4.0, 0.1, 20.0), (0.0, 0.1, 20.0)]
    return pair([*peaks, *peaks, *slow])


def against_a_spring() -> list[Recording]:
    u = drive(COMPLETE)
    return [run(u, 20.0 + 4.0 * muscle(u), seed=seed) for seed in (0, 1)]


def coarse() -> list[Recording]:
    return [one.with_channels(displacement=np.round(one["displacement"])) for one in pair(COMPLETE)]


def clipped() -> list[Recording]:
    return [one.with_channels(pressure=np.minimum(one["pressure"], 3.7)) for one in pair(COMPLETE)]


BASE = np.concatenate([drive(COMPLETE), np.zeros(round(15 / STEP))])


def arm(u: Array, stiffness: float, seed: int = 0) -> Recording:
    """Return an arm of two muscles that pull at each other, the less the stiffer it is."""
    rng = np.random.default_rng(seed)
    moved = np.column_stack([muscle(one) for one in u.T])
    y = moved - 0.3 / (1 + stiffness) * moved[:, ::-1] + 0.02 * rng.standard_normal(u.shape)
    channels = {f"pressure_{k + 1}": one for k, one in enumerate(u.T)}
    channels |= {f"displacement_{k + 1}": one for k, one in enumerate(y.T)}
    held = {"pressure_extensor": stiffness, "force": 10 + 50 * stiffness}
    return Recording(channels | {name: np.full(len(u), x) for name, x in held.items()}, STEP)


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
    return [arm(u, level, seed) for seed, level in enumerate(stiffnesses)]


def arms_never_together() -> list[Recording]:
    rest = np.zeros_like(BASE)
    return arms(np.column_stack([np.concatenate([BASE, rest]), np.concatenate([rest, BASE])]))


def extensor_at_rest() -> list[Recording]:
    runs = arms(apart_and_together(), (1.0, 1.0))
    return [
        one.with_channels(force=np.full(len(one), level))
        for one, level in zip(runs, (10.0, 60.0), strict=True)
    ]


LACKING: list[tuple[Callable[[], list[Recording]], list[str]]] = [
    (lambda: pair(COMPLETE), []),
    (lambda: pair([(level, 0.25, 12.0) for level in TURNS] * 2), ["rate"]),
    (lambda: pair(CYCLES), ["creep"]),
    (lambda: pair(COMPLETE, slow=60.0), ["creep"]),
    (major_only, ["minor loops"]),
    (from_above_only, ["one-sided loops"]),
    (lambda: [run(drive(COMPLETE), seed=seed) for seed in (0, 1)], ["load"]),
    (against_a_spring, ["load"]),
    (lambda: pair(COMPLETE, step=None), ["time"]),
    (lambda: pair(COMPLETE, noise=0.06), ["noise"]),
    (coarse, ["resolution"]),
    (clipped, ["clipped"]),
    (lambda: [run(np.tile(BASE, 2), np.repeat([50.0, 150.0], BASE.size))], ["test"]),
    (lambda: arms(apart_and_together()), []),
    (lambda: arms(np.column_stack([BASE, 0.8 * BASE])), ["coupling"]),
    (arms_never_together, ["together"]),
    (lambda: arms(np.column_stack([BASE, 0.0 * BASE])), ["resting"]),
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


# -- what is called lacking scatters in fits, and what is not does not -----------------------------


@pytest.fixture(autouse=True, scope="module")
def one_thread() -> Iterator[None]:
    """Keep small matrices on one core."""
    with one_blas_thread():
        yield


# -- whatever is recorded --------------------------------------------------------------------------


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
        untold(given(run(drive(CYCLES))), *names)
