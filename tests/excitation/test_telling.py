"""What recordings cannot tell: nothing where they tell it all, and one thing where they lack one."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import least_squares

from mckibben import PI, DataError, Recording
from mckibben.blocks.dynamic.process_model import ProcessModel
from mckibben.excitation import untold
from mckibben.signals import triangle
from mckibben.system.threads import one_blas_thread
from tests.recordings import MEASURED

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


def test_what_moves_too_little_to_compute_with_counts_as_held() -> None:
    u = 1e-300 * drive([(level, 0.2, 0.0) for level in TURNS])  # at one speed, which is told
    tiny = Recording({"pressure": u, "displacement": 1e300 * u}, STEP)
    assert untold([tiny], ["pressure"], ["displacement"])


def test_of_recordings_that_tell_it_all_nothing_is_said() -> None:
    assert untold(pair(COMPLETE)) == ()


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


LACKING: dict[str, Callable[[], list[Recording]]] = {
    "rate": one_speed,
    "creep": no_holds,
    "minor loops": major_only,
    "one-sided loops": from_above_only,
    "load": one_load,
    "time": without_time,
    "noise": noisy,
    "resolution": coarse,
    "clipped": clipped,
    "start": begun_inside,
    "repeats": nothing_twice,
    "test": alone,
}


@pytest.mark.parametrize("what", LACKING)
def test_where_one_thing_is_lacking_it_alone_is_said(what: str) -> None:
    gaps = untold(LACKING[what]())
    assert [gap.what for gap in gaps] == [what]
    assert gaps[0].sentence.endswith(".")
    assert gaps[0].remedy.endswith(".")


@pytest.mark.parametrize(
    ("made", "what", "said"),
    [
        (creeping_on, "creep", "still moves"),
        (no_load, "load", "no load is recorded"),
        (one_load_known, "load", "a load is recorded in 1 of 2 recordings"),
        (against_a_spring, "load", "as a spring's would"),
    ],
)
def test_other_ways_to_lack_it(made: Callable[[], list[Recording]], what: str, said: str) -> None:
    (gap,) = untold(made())
    assert gap.what == what
    assert said in gap.sentence


def test_a_test_that_goes_further() -> None:
    far = run(drive([(5.0, 1.0, 0.0), (0.0, 1.0, 0.0)]))
    (gap,) = untold(pair(COMPLETE), tests=[far])
    assert gap.what == "range"
    assert "5 bar" in gap.sentence
    assert whats(pair(COMPLETE), tests=[run(drive([(3.9, 1.0, 0.0), (0.1, 1.0, 0.0)]))]) == []


def test_copies_tell_nothing_more() -> None:
    one = pair(COMPLETE)[0]
    assert untold([one, one]) == untold([one])


def test_a_muscle_that_is_held_is_judged_by_its_force() -> None:
    (one, other) = pair(COMPLETE)
    held = [
        Recording(
            {
                "pressure": r["pressure"],
                "displacement": np.full(len(r), d),
                "force": r["displacement"],
            },
            r.sample_time,
        )
        for r, d in ((one, 0.0), (other, 10.0))
    ]
    assert "steps of that size" not in " ".join(gap.sentence for gap in untold(held))
    assert "force" not in " ".join(gap.what for gap in untold(held))


def test_a_force_that_creeps_ends_no_hold() -> None:
    u = drive([(4.0, 1.0, 20.0), (1.0, 1.0, 20.0)])
    force = 100.0 * u + 40.0 * lag(u, 8.0)
    one = Recording({"pressure": u, "force": force}, STEP)
    creep = next(gap for gap in untold(one, "pressure", "force") if gap.what == "creep")
    assert creep.evidence["hold"] > 18.0
    assert creep.evidence["moved"] > 0.01


def test_a_model_without_parameters_that_tell_is_said() -> None:
    many = PI(tuple(np.linspace(0, 3, 200)), (0.01,) * 200)
    (gap,) = [gap for gap in untold(pair(COMPLETE), model=many) if gap.what == "parameters"]
    assert "cannot be said" in gap.sentence


def test_levels_recorded_once_each_hide_the_way_between() -> None:
    u = np.random.default_rng(3).uniform(0, 4, 300)
    gaps = {
        gap.what: gap
        for gap in untold([Recording({"pressure": u, "displacement": muscle(u)}, 4.0)])
    }
    assert "sampling" in gaps
    assert "noise" not in gaps


@pytest.mark.parametrize("still", ["pressure", "displacement"])
def test_what_does_not_move_tells_nothing(still: str) -> None:
    one = run(drive(COMPLETE))
    (first, *_) = untold([one.with_channels(**{still: np.ones(len(one))})])
    assert first.what == "still"


def test_an_input_that_never_turns_back() -> None:
    (first, *_) = untold([run(drive([(4.0, 0.2, 0.0)]))])
    assert (first.what, first.severity) == ("hysteresis", 0.95)


# -- several muscles ------------------------------------------------------------------------------

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


def test_an_arm_that_tells_it_all() -> None:
    assert untold(arms(apart_and_together())) == ()


def test_muscles_that_move_as_one() -> None:
    u = np.column_stack([BASE, 0.8 * BASE])
    assert whats(arms(u)) == ["coupling"]
    assert "as one" in untold(arms(u))[0].sentence


def test_muscles_that_never_move_together() -> None:
    rest = np.zeros_like(BASE)
    u = np.column_stack([np.concatenate([BASE, rest]), np.concatenate([rest, BASE])])
    assert whats(arms(u)) == ["together"]


def test_a_muscle_that_never_moves() -> None:
    assert whats(arms(np.column_stack([BASE, np.zeros_like(BASE)]))) == ["resting", "still"][:1]


def test_an_extensor_that_rests() -> None:
    u = apart_and_together()
    runs = [
        one.with_channels(force=np.full(len(one), level))
        for one, level in zip(arms(u, (1.0, 1.0)), (10.0, 60.0), strict=True)
    ]
    assert whats(runs) == ["stiffness"]


def stand(lengths: Sequence[Array], pressures: Sequence[Array]) -> list[Recording]:
    """Return forces on a test stand."""
    return [
        Recording(
            {
                "pressure": p,
                "length": length,
                "force": 100 * p + 5 * (length - 180) + 5 * lag(length, 0.5),
            },
            STEP,
        )
        for length, p in zip(lengths, pressures, strict=True)
    ]


def test_a_test_stand_whose_length_is_held() -> None:
    u = drive(COMPLETE)
    gaps = {gap.what for gap in untold(stand([np.full(u.size, x) for x in (180, 190)], [u, u]))}
    assert "isometric" in gaps
    both = {
        gap.what
        for gap in untold(stand([180 + 5 * u, np.full(u.size, 190.0)], [np.full(u.size, 3.0), u]))
    }
    assert "isometric or isobaric" in both
    assert "isometric" not in both


# -- that what is said is true --------------------------------------------------------------------


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


def told(u: Sequence[Array]) -> set[str]:
    """Return what runs of a muscle alone cannot tell."""
    return {gap.what for gap in untold([run(one, None) for one in u])}


ONE_SPEED = triangle(np.arange(0, 60, STEP), period=10.0, peaks=4.0)


def test_rate_dependence_that_is_untold_comes_out_anyhow_and_told_it_does_not() -> None:
    """A lag of 0.5 s of a twentieth of the gain, beside free hysteresis."""
    fast, slow = (triangle(np.arange(0, 6 * p, STEP), period=p, peaks=4.0) for p in (2.0, 20.0))
    for runs, lacking in (([ONE_SPEED], True), ([ONE_SPEED, fast, slow], False)):
        assert ("rate" in told(runs)) == lacking
        error = spread([hysteresis(u) for u in runs], [0.4 * lag(u, 0.5) for u in runs])
        assert error > 0.5 if lacking else error < 0.2


def test_creep_that_is_untold_comes_out_anyhow_and_told_it_does_not() -> None:
    """Creep over 200 s of a twentieth of the gain, beside free hysteresis and lags."""
    legs = [(level, 1.5, 40.0) for level in (1.2, 4.0, 2.8, 0.0)]
    for runs, lacking in (([ONE_SPEED], True), ([ONE_SPEED, drive(legs)], False)):
        assert ("creep" in told(runs)) == lacking
        beside = [np.column_stack([hysteresis(u), lag(u, 0.5), lag(u, 2.0)]) for u in runs]
        error = spread(beside, [0.4 * lag(u, 200.0) for u in runs])
        assert error > 0.5 if lacking else error < 0.2


def test_a_load_that_is_untold_comes_out_anyhow_and_told_it_does_not() -> None:
    u = drive(CYCLES)
    for forces, lacking in (((50.0, 50.0), True), ((50.0, 150.0), False)):
        runs = [run(u, force, seed=seed) for seed, force in enumerate(forces)]
        assert ("load" in whats(runs)) == lacking
        error = spread([hysteresis(u)] * 2, [0.05 * one["force"] for one in runs])
        assert error > 0.5 if lacking else error < 0.2


def test_coupling_that_is_untold_comes_out_anyhow_and_told_it_does_not() -> None:
    apart = apart_and_together()
    for u, lacking in ((np.column_stack([BASE, 0.8 * BASE]), True), (apart, False)):
        assert ("coupling" in whats(arms(u))) == lacking
        error = spread([hysteresis(u[:, 0])], [0.3 * u[:, 1]])
        assert error > 0.5 if lacking else error < 0.2


@pytest.fixture(autouse=True, scope="module")
def one_thread() -> Iterator[None]:
    """Keep small matrices on one core."""
    with one_blas_thread():
        yield


# -- parameters of a model ------------------------------------------------------------------------


PROCESS = ProcessModel(gain=8.0, time_constants=(60.0, 0.3), output_offset=2.0)


def processed(u: Array, seed: int) -> Recording:
    """Return what a process with a slow and a fast time constant gives, with noise."""
    y = PROCESS.simulate(u, sample_time=STEP)
    noise = 0.02 * np.random.default_rng(seed).standard_normal(u.size)
    return Recording({"pressure": u, "displacement": y + noise}, STEP)


def refitted(runs: Sequence[Recording]) -> Array:
    """Return the logarithms of slow and fast time constant that fit best, by another's search."""

    def residual(theta: Array) -> Array:
        gain, offset, *times = np.exp(theta)
        model = ProcessModel(gain=gain, time_constants=tuple(times), output_offset=offset)
        return np.concatenate([model.simulate(r)["displacement"] - r["displacement"] for r in runs])

    start = np.log([8.0, 2.0, 60.0, 0.3])
    found = least_squares(residual, start, bounds=(start - 3, start + 3), max_nfev=20)
    return np.asarray(found.x[2:])


def test_parameters_that_are_untold_come_out_anyhow_and_told_they_do_not() -> None:
    short = drive([(4.0, 4.0, 0.0), (1.0, 4.0, 0.0)] * 2)
    long = drive([(4.0, 4.0, 40.0), (1.0, 4.0, 40.0)])
    for runs, lacking in (([short], True), ([short, long], False)):
        gaps = untold([processed(u, 0) for u in runs], model=PROCESS)
        said = [gap.sentence for gap in gaps if gap.what == "parameters"]
        assert any("ime constants 1" in sentence for sentence in said) == lacking
        assert not any("ime constants 2" in sentence for sentence in said)
        found = np.array([refitted([processed(u, seed) for u in runs]) for seed in range(4)])
        slow, fast = np.std(found, axis=0)
        assert fast < 0.2
        assert slow > 0.4 if lacking else slow < 0.1


def test_a_model_that_the_recordings_do_not_fit_is_refused() -> None:
    with pytest.raises(DataError, match="pressure"):
        untold([run(ONE_SPEED).select(["force", "displacement"])], "force", "displacement", PROCESS)


# -- where it is shown ----------------------------------------------------------------------------


def test_gaps_come_most_important_first_and_as_json() -> None:
    gaps = untold([run(ONE_SPEED, None)])
    severities = [gap.severity for gap in gaps]
    assert severities == sorted(severities, reverse=True)
    assert json.loads(json.dumps([gap.to_dict() for gap in gaps]))[0]["what"] == gaps[0].what
    assert str(gaps[0]) == f"{gaps[0].sentence} {gaps[0].remedy}"


@settings(max_examples=25, deadline=None)
@given(
    speed=st.floats(0.05, 5.0),
    low=st.floats(0.0, 3.0),
    span=st.floats(0.5, 4.0),
    unit=st.sampled_from([1.0, 0.01]),
)
def test_what_is_said_of_speed_does_not_depend_on_scale(
    speed: float, low: float, span: float, unit: float
) -> None:
    t = np.arange(0, 8 * span / speed, span / speed / 200)
    u = low + triangle(t, period=2 * span / speed, peaks=span)
    one = Recording({"pressure": unit * u, "displacement": unit * muscle(u)}, float(t[1]))
    (gap,) = (gap for gap in untold([one]) if gap.what == "rate")
    assert gap.evidence["slow"] == pytest.approx(unit * speed, rel=0.05)
    assert gap.evidence["fast"] == pytest.approx(unit * speed, rel=0.05)


@settings(max_examples=60, deadline=None)
@given(data=st.data(), n=st.integers(10, 80), two=st.booleans(), timed=st.booleans())
def test_whatever_is_recorded_something_or_nothing_is_said(
    data: st.DataObject, n: int, two: bool, timed: bool
) -> None:
    values = st.lists(st.sampled_from([0.0, 0.5, 1.0, -2.0, 1e6]), min_size=n, max_size=n)
    names = ["pressure_1", "displacement_1"] + ["pressure_2", "displacement_2"] * two
    beside = data.draw(st.sampled_from([[], ["force"], ["pressure_extensor"]]))
    channels = {name: np.array(data.draw(values)) for name in (*names, *beside)}
    first = Recording(channels, 0.1)
    second = Recording(channels, 0.1 if timed else None)
    for gap in untold([first, second]):
        assert gap.sentence.endswith(".")
        assert 0 < gap.severity <= 1
        assert "nan" not in str(gap)


def test_recordings_that_cannot_be_judged_are_refused() -> None:
    one = run(ONE_SPEED, None)
    with pytest.raises(DataError, match="at least one"):
        untold([])
    with pytest.raises(DataError, match="voltage"):
        untold([one], "voltage")
    with pytest.raises(DataError, match="displacement"):
        untold([one, one.select(["pressure"])])


# -- measured muscles -----------------------------------------------------------------------------


def measured(name: str) -> list[Recording]:
    """Return a set of measured recordings."""
    from mckibben.measured.sets import sets_in

    if not (MEASURED / name).exists():
        pytest.skip("the measured recordings are not here")
    (found,) = sets_in(MEASURED / name)
    return found.recordings()


@pytest.mark.filterwarnings("ignore::mckibben.errors.DataWarning")
@pytest.mark.parametrize(
    ("name", "inputs", "outputs", "said", "not_said"),
    [
        ("festo_dmsp10_static", None, None, {"rate", "minor loops"}, {"repeats", "start", "noise"}),
        ("festo_dmsp10_levels", None, None, {"sampling"}, {"minor loops", "noise", "hysteresis"}),
        ("festo_isometric_20mm", None, None, {"isometric", "minor loops"}, {"repeats", "rate"}),
        ("cavatappi_loads", None, None, {"one-sided loops"}, {"load", "rate", "minor loops"}),
        ("sma_wing", None, None, {"one-sided loops", "load"}, {"minor loops", "clipped"}),
        (
            "soft_arm_three_muscles",
            ["input_1", "input_2", "input_3"],
            ["displacement_1", "displacement_2"],
            {"together"},
            {"coupling", "resting", "minor loops", "rate"},
        ),
        ("bouc_wen_benchmark", "force", "displacement", set(), {"hysteresis", "sampling", "rate"}),
    ],
)
def test_measured_recordings(
    name: str,
    inputs: list[str] | None,
    outputs: list[str] | None,
    said: set[str],
    not_said: set[str],
) -> None:
    found = set(whats(measured(name), inputs=inputs, outputs=outputs))
    assert said <= found
    assert not found & not_said
