"""The families of drawn plants; each function is deterministic in its seed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mckibben import Recording
from mckibben.arrays import Array
from tests.plants.sampled import motions, physics
from tests.plants.sampled.benches import Bench
from tests.plants.sampled.draws import FRICTIONS, LAWS, RATES, Plant, Truth, power_law, rounded
from tests.plants.sampled.held import HeldMuscle
from tests.plants.sampled.physics import Resistance, Slope

KINDS = ("wall", "dead zone", "asymmetry", "mass", "slack")
RIGS = ("spring", "load", "joint", "spring", "load")
MOTIONS = ("nested", "turning", "stairs", "sines")


def clean(seed: int, noise_seed: int | None = None) -> Plant:
    """Plants without wall, dead zone, asymmetric friction, mass that is seen, or slack.

    A ``noise_seed`` draws other noise of all sensors.
    """
    rng, rig = np.random.default_rng([64, 1, seed]), RIGS[seed % 5]
    bench = Bench(
        rng,
        rig,
        LAWS[(seed + seed // 4) % 4],
        FRICTIONS[(5 * seed + 2 * (seed // 5)) % 8],
        RATES[(seed + seed // 5) % 4],
        payload=bool(seed % 2) if rig == "joint" else None,
        limit_rate=seed % 7 == 6,
        sensors=_sensors(noise_seed),
    )
    train, tests, _ = _runs(bench)
    return Plant(f"clean {seed}", train, tests, rounded(bench.truth))


def with_one(kind: str, seed: int, noise_seed: int | None = None) -> Plant:
    """Plants as of `clean`, with exactly one phenomenon of `KINDS`."""
    place, variant = KINDS.index(kind), seed % 4
    rng = np.random.default_rng([64, 2, place, seed])
    rig = ("spring", "load", "joint", "spring")[variant]
    friction = ("maxwell_slip", "coulomb", "dahl", "bouc_wen")[(seed + place) % 4]
    rate = RATES[(seed + 2 * place) % 4]
    if kind == "slack":
        rig = "spring" if rig == "load" else rig
        rate = "sls" if rate == "dashpot" else rate
    if kind == "mass":
        friction = ("maxwell_slip", "bouc_wen", "dahl", "maxwell_slip")[variant]
        rate = "none"
    bench = Bench(
        rng, rig, LAWS[(seed + place) % 4], friction, rate, kind, seed, sensors=_sensors(noise_seed)
    )
    names, seconds = MOTIONS, 36.0
    if kind == "wall":
        stiffer, share = ((12, 40), (8, 20), (10, 30), (3, 6)), rng.uniform(0.22, 0.35)
        times = [rng.uniform(*ends) for ends in stiffer]
        bench.put_wall((1, 1, -1, -1)[variant], share, times[variant])
    if kind == "mass":
        bench.pace = max(bench.pace, 8 / bench.natural)
        names, seconds = ("nested", "steps", "chirp", "sines"), 16.0
    train, tests, moved = _runs(bench, names, seconds)
    truth = bench.truth
    if kind == "wall":
        truth["share_of_training_in_contact"] = bench.in_contact(moved)
    if kind == "slack":
        truth["share_of_training_slack"] = _share_slack(bench, train, moved)
    if kind == "dead zone":
        channel = "pressure_2" if bench.joint else "pressure"
        pressures = np.concatenate([run[channel] for run in train])
        below = float(np.mean(pressures < truth["threshold_bar"]))
        truth["share_of_training_below_threshold"] = below
    if kind == "asymmetry":
        own = truth["friction"]
        truth |= {"friction_up_N": own["force_up_N"], "friction_down_N": own["force_down_N"]}
        truth["friction_ratio_down_to_up"] = own["ratio_down_to_up"]
    return Plant(f"{kind} {seed}", train, tests, rounded(truth))


def known_parameters(seed: int, noise: bool = True, noise_seed: int | None = None) -> Plant:
    """Plants of few parameters, all of them told.

    0.1 p (a0 + a1 x + a2 x²) = K x + F0 + Fc sgn(v) + c v + q, with q' = k1 v - q/tau. Pressure does not
    lag; noise is white. Without a load cell, only tau and ratios to K can be found.
    """
    rng = np.random.default_rng([64, 3, seed])
    dt, top = 0.01, rng.uniform(3, 6)
    rest = rng.uniform(120, 300)
    a0 = rng.uniform(400, 2500)
    end = rng.uniform(0.24, 0.34) * rest  # contraction where the area is zero
    bow = rng.uniform(0.0, 0.45) if seed % 4 else 0.0
    a1, a2 = -a0 / end * (1 + bow), a0 / end**2 * bow
    law = physics.polynomial_area(a0, a1, a2)
    stroke = rng.uniform(0.35, 0.6) * end
    preload = rng.uniform(0.0, 0.06) * a0 * physics.BAR * top
    spring = (law(top, stroke)[0] - preload) / stroke
    total = spring - law(0.5 * top, 0.5 * stroke)[1]
    terms = (
        ["coulomb"],
        ["coulomb", "damping"],
        ["coulomb", "relaxation"],
        ["coulomb", "damping", "relaxation"],
        ["damping", "relaxation"],
    )[seed % 5]
    coulomb = rng.uniform(0.025, 0.08) * total * stroke if "coulomb" in terms else 0.0
    damping = rng.uniform(0.04, 0.2) * total if "damping" in terms else 0.0
    k1 = tau = 0.0
    if "relaxation" in terms:
        k1 = rng.uniform(0.15, 0.45) * total
        tau = float(np.exp(rng.uniform(np.log(0.5), np.log(5))))
    low = preload / (physics.BAR * a0) * 1.0  # the spring never goes slack

    def drive(x: float, ps: Sequence[float], load: float) -> Slope:
        f, k = law(ps[0], x)
        return f - spring * x - preload, k - spring

    prony = [(k1, tau)] if k1 else []
    resistance = Resistance(coulomb=(coulomb, coulomb), dashpot=damping, prony=prony)
    rig = physics.Rig(drive, resistance, substep=0.0025 if damping or k1 else 0.01)
    with_force = seed % 2 == 1
    s_x, s_p = rng.uniform(0.005, 0.05), rng.uniform(0.001, 0.005)
    s_f = rng.uniform(0.002, 0.01) * spring * stroke
    if not noise:
        s_x = s_p = s_f = 0.0
    pace = rng.uniform(1.5, 4)

    sensors = _sensors(noise_seed)

    def run(name: str, p: Array) -> Recording:
        x, _ = physics.simulate(rig, p, None, dt)
        noises = rng.standard_normal((3 if with_force else 2, p.size))  # motions stay the same
        if sensors is not None:
            noises = sensors.standard_normal(noises.shape)
        channels = {"pressure": p + s_p * noises[0], "displacement": x + s_x * noises[1]}
        if with_force:
            channels["force"] = spring * x + preload + s_f * noises[2]
        meta = {"name": name, "rest_length": round(rest, 3)}
        return Recording(channels, sample_time=dt, meta=meta)

    train = [
        run("train nested", motions.nested(rng, 30, dt, low, top, 2 * pace)),
        run("train stairs", motions.stairs(rng, 30, dt, low, top, 1.5 * pace)),
        run("train turning", motions.turning(rng, 30, dt, low, top, pace)),
    ]
    tests = {
        "other": [run("other sines", motions.sines(rng, 25, dt, low, top, 0.6 / pace))],
        "faster": [run("faster turning", motions.turning(rng, 15, dt, low, top, pace / 3))],
    }
    values = {
        "spring_N_per_mm": spring,
        "preload_N": preload,
        "area_mm2": a0,
        "area_mm2_per_mm": a1,
        "area_mm2_per_mm2": a2,
        "coulomb_N": coulomb,
        "damping_N_s_per_mm": damping,
        "relaxing_stiffness_N_per_mm": k1,
        "relaxation_s": tau,
    }
    own = ("spring_N_per_mm", "relaxation_s")
    truth: Truth = values | {
        "terms": terms,
        "ratios_to_spring": {k: v / spring for k, v in values.items() if k not in own},
        "identifiable": "all"
        if with_force
        else "relaxation_s and ratios_to_spring only, unless spring_N_per_mm is given",
        "force_channel": "load cell between muscle and spring: K x + F0" if with_force else "none",
        "noise_std": {
            "displacement_mm": s_x,
            "pressure_bar": s_p,
            "force_N": s_f if with_force else 0.0,
        },
        "pressures_bar": [low, top],
        "equation": "0.1 p (a0 + a1 x + a2 x^2) = K x + F0 + Fc sgn(v) + c v + q, "
        "q' = k1 v - q / tau",
    }
    return Plant(f"known parameters {seed}", train, tests, rounded(truth, 8))


def torque_joint(seed: int) -> Plant:
    """Joints with friction and a payload torque that varies between and within runs.

    Odd seeds: the torque of gravity.
    """
    kinds = ("maxwell_slip", "dahl", "lugre", "coulomb", "pressure_scaled", "bouc_wen")
    bench = Bench(
        np.random.default_rng([64, 4, seed]),
        "joint",
        LAWS[seed % 4],
        kinds[seed % 6],
        RATES[(seed + 1) % 4],
        payload=True,
        gravity=seed % 2 == 1,
        dt=0.02,
        filling=0.05 if seed % 3 else 0.0,
    )
    of = (
        "gravity's: payload moment * cos(angle)"
        if bench.gravity
        else "of a motor, whatever the angle"
    )
    bench.truth["torque"] = f"on the joint, positive turns to larger angles; {of}"
    bench.truth["loads_of_training_N_m"] = [bench.lightest, bench.heaviest]

    def run(
        title: str, name: str, how: float | None, seconds: float = 32.0, faster: float = 1.0
    ) -> Recording:
        pattern = bench.pattern(name, seconds, faster)
        return bench.run(title, pattern, bench.load(seconds, how))

    loads = (0.0, 1.0, None, 0.5, None)
    train = [run(f"train {n}", n, how) for n, how in zip((*MOTIONS, "turning"), loads, strict=True)]
    t = motions.clock(32.0, 0.02)
    held, swing = np.full(t.size, 0.3 * bench.high), bench.load(32.0, None)
    bias = bench.bias * (1 + 0.12 * np.sin(2 * np.pi * t / 17))
    tests = {
        "other": [run("other turning", "turning", 0.75)],
        "faster": [run("faster turning", "turning", None, 16.0, 3.0)],
    }
    heavier = bench.pattern("sines", 32.0), bench.load(32.0, 1.0, 1.3)
    tests["heavier"] = [bench.run("heavier sines", *heavier)]
    tests["load changes"] = [bench.run("load changes at held pressures", held, swing)]
    tests["slower"] = [run("slower turning", "turning", None, 45.0, 0.35)]
    both = 0.8 * bench.pattern("sines", 32.0), bench.load(32.0, 0.6)
    tests["co-contraction"] = [bench.run("co-contraction changes", *both, bias=bias)]
    return Plant(f"torque joint {seed}", train, tests, rounded(bench.truth))


def isometric(seed: int, length_noise: float = 0.0) -> Plant:
    """Muscles held at six lengths while pressure sweeps; tested at other sweeps and lengths.

    ``length_noise`` is that of the recorded length [mm].
    """
    rng = np.random.default_rng([64, 5, seed])
    muscle = HeldMuscle(rng, seed, length_noise)
    off = rng.uniform(-0.03, 0.03, 7) * [0, 1, 1, 1, 1, 1, 0]
    xs = muscle.span * (np.linspace(0, 1, 7) + off)
    out = int(rng.integers(2, 5))
    kept, left = np.delete(xs, out), xs[out]

    def runs(
        name: str, kind: str, seconds: float, places: Sequence[float] | Array, faster: float = 1.0
    ) -> list[Recording]:
        return [
            muscle.held(f"{name} {muscle.at(x)}", muscle.sweep(kind, seconds, x, faster), x)
            for x in places
        ]

    train = runs("train", "nested", 36.0, kept)
    tests = {
        "other sweeps": runs("other", "turning", 30.0, kept[::2])
        + runs("stairs", "stairs", 30.0, kept[1::2]),
        "faster sweeps": runs("faster", "turning", 15.0, kept[1::3], 3.0),
        "length left out": runs("left out", "nested", 36.0, [left])
        + runs("left out", "turning", 36.0, [left]),
    }
    muscle.truth["lengths_mm"] = [muscle.rest - x for x in kept]
    muscle.truth["left_out_mm"] = muscle.rest - left
    muscle.truth["least_tension_N"] = muscle.least_tension
    name = f"isometric {seed} noise {length_noise}"
    return Plant(name, train, tests, rounded(muscle.truth))


def mixed(seed: int) -> Plant:
    """Held lengths and free motions of one muscle in one set."""
    rng = np.random.default_rng([64, 6, seed])
    muscle = HeldMuscle(rng, seed)
    muscle.noise["length_mm"] = float(rng.choice([0.0, 0.01, 0.03]))
    span, dt, top = muscle.span, muscle.dt, muscle.top
    low = top * 0.3  # carries the load
    heaviest = 0.5 * muscle.law(low, 0.0)[0]

    def held(name: str, kind: str, x: float) -> Recording:
        return muscle.held(f"{name} {muscle.at(x)}", muscle.sweep(kind, 30.0, x), x)

    def free(name: str, kind: str, seconds: float, share: float, faster: float = 1.0) -> Recording:
        load = np.full(round(seconds / dt), share * heaviest)
        return muscle.free(name, muscle.pattern(kind, seconds, low, faster), load)

    train = [held("train held", "nested", x) for x in span * np.array([0.0, 0.3, 0.6, 0.9])]
    for kind, share in (("nested", 0.3), ("turning", 1.0), ("stairs", 0.6)):
        train.append(free(f"train free {share:.1f}", kind, 36.0, share))
    pattern = muscle.pattern("turning", 36.0, low)
    varying = motions.slow_levels(rng, 36.0, dt, 0.3 * heaviest, heaviest, 7.0)
    train.append(muscle.free("train free, load varies", pattern, varying))
    t = motions.clock(40.0, dt)
    moved = span * (0.35 - 0.25 * np.cos(2 * np.pi * t / 20.0))
    spring = muscle.law(top, 0.6 * span)[0] / (0.6 * span)
    tests = {
        "other held": [held("held", "turning", span * 0.45)],
        "other free": [free("free", "sines", 30.0, 0.8)],
        "faster free": [free("free, faster", "turning", 18.0, 0.5, 3.0)],
        "heavier free": [free("free, 1.3 x", "turning", 30.0, 1.3)],
    }
    sweep = muscle.sweep("sines", 40.0, span * 0.6)
    tests["length moved"] = [muscle.held("length moved at changing pressure", sweep, moved)]
    pattern = motions.turning(rng, 30.0, dt, 0.1 * top, top, 3.5)
    tests["spring"] = [muscle.sprung("against a spring", pattern, spring)]
    muscle.truth |= {
        "held_lengths_mm": [muscle.rest - x for x in span * np.array([0.0, 0.3, 0.6, 0.9])],
        "loads_of_training_N": [0.3 * heaviest, heaviest],
        "spring_of_test_N_per_mm": spring,
        "least_tension_held_N": muscle.least_tension,
    }
    return Plant(f"mixed {seed}", train, tests, rounded(muscle.truth))


def drifting(seed: int) -> Plant:
    """Even seeds: hours of power-law creep. Odd seeds: an offset for each recording."""
    rng = np.random.default_rng([64, 7, seed])
    return (_shifting if seed % 2 else _creeping)(rng, seed)


def _shifting(rng: np.random.Generator, seed: int) -> Plant:
    rig, friction = ("spring", "load")[seed // 2 % 2], FRICTIONS[(1 + seed // 2) % 8]
    rate = ("none", "sls")[seed // 4 % 2]
    bench = Bench(rng, rig, LAWS[seed // 2 % 4], friction, rate, dt=0.02)
    size = rng.uniform(0.02, 0.08) * bench.travel
    offsets: dict[str, float] = {}

    def run(
        name: str, motion: str, how: float | None, seconds: float = 30.0, faster: float = 1.0
    ) -> Recording:
        offsets[name] = float(size * rng.standard_normal())
        pattern = bench.pattern(motion, seconds, faster)
        return bench.run(name, pattern, bench.load(seconds, how), offset=offsets[name])

    loads = (0.0, 1.0, None, 0.5, 0.3, 0.8)
    each = zip((*MOTIONS, "turning", "nested"), loads, strict=True)
    train = [run(f"train {i} {m}", m, how) for i, (m, how) in enumerate(each)]
    others = enumerate(("turning", "sines", "stairs"))
    tests = {
        "other": [run(f"other {i}", m, 0.7) for i, m in others],
        "faster": [run("faster", "turning", 0.5, 18.0, 3.0)],
    }
    bench.truth["drift"] = "offset of displacement for each recording"
    bench.truth |= {"offset_std_mm": size, "offsets_mm": offsets}
    return Plant(f"drifting {seed}", train, tests, rounded(bench.truth))


def _creeping(rng: np.random.Generator, seed: int) -> Plant:
    dt = float(rng.choice([1.0, 2.0]))
    friction = ("maxwell_slip", "dahl", "bouc_wen")[seed // 2 % 3]
    bench = Bench(rng, "spring", LAWS[seed // 2 % 4], friction, "none", dt=dt, filling=0.0)
    n, total = rng.uniform(0.06, 0.2), rng.uniform(0.5, 1.2) * bench.stiffness
    elements = power_law(n, total, 2.0, 2e5, 8)
    bench.rig.resistance.prony, bench.rig.substep = elements, dt
    ends = bench.low, bench.high

    def run(name: str, p: Array) -> Recording:
        return bench.run(name, p, None)

    def step(peak: float, level: float, seconds: float) -> Array:
        rise = np.linspace(bench.low, peak, round(60 / dt))
        return np.append(rise, np.full(round(seconds / dt), level))

    hold = float(rng.uniform(300, 900))
    train = [
        run("train 3 h of levels", motions.stairs(rng, 10800, dt, *ends, hold, ramp=20.0)),
        run("train 2 h of triangles", motions.nested(rng, 7200, dt, *ends, 240.0)),
        run("train 1 h held after a step", step(bench.high, 0.8 * bench.high, 3540)),
    ]
    tests = {
        "other": [run("other 2 h", motions.turning(rng, 7200, dt, *ends, 150.0))],
        "faster": [run("faster 30 min", motions.turning(rng, 1800, dt, *ends, 40.0))],
        "longer": [run("held 5 h", step(0.7 * bench.high, 0.7 * bench.high, 18000))],
    }
    bench.truth["rate"] = {
        "kind": "power_law",
        "exponent": n,
        "sum_stiffness_N_per_mm": total,
        "times_s": [tau for _, tau in elements],
        "stiffnesses_N_per_mm": [k for k, _ in elements],
    }
    bench.truth["drift"] = "creep over decades; every run starts rested"
    return Plant(f"drifting {seed}", train, tests, rounded(bench.truth))


def load_rig(seed: int) -> Plant:
    """Muscles that lift loads; odd seeds have the loads' inertia too."""
    inertia = seed % 2 == 1
    kinds = ("maxwell_slip", "pressure_scaled", "lugre", "bouc_wen", "coulomb", "dahl")
    bench = Bench(
        np.random.default_rng([64, 8, seed]),
        "load",
        LAWS[(seed + 1) % 4],
        kinds[seed % 6],
        RATES[seed % 4],
        lift_mass=inertia,
        dt=0.02,
        filling=0.06,
    )

    def run(
        title: str, name: str, how: float | None, seconds: float, faster: float = 1.0,
        factor: float = 1.0,
    ) -> Recording:  # fmt: skip
        pattern = bench.pattern(name, seconds, faster)
        return bench.run(title, pattern, bench.load(seconds, how, factor))

    loads = (0.0, 0.35, 0.7, 1.0) if inertia else (0.0, 0.5, 1.0, None, None)
    each = zip((*MOTIONS, "turning"), loads, strict=False)
    train = [run(f"train {name}", name, how, 36.0) for name, how in each]
    tests = {
        "other": [run("other turning", "turning", 0.55, 36.0)],
        "heavier": [
            run(f"heavier {name}", name, 1.0, 30.0, factor=1.3) for name in ("turning", "nested")
        ],
        "fast": [run(f"fast {how}", "turning", how, 18.0, 3.5) for how in (0.2, 0.9)],
    }
    if not inertia:
        held = np.full(1800, 0.5 * (bench.low + bench.high))
        tests["load changes"] = [bench.run("load changes", held, bench.load(36.0, None))]
    bench.truth["loads_of_training_N"] = [bench.lightest, bench.heaviest]
    bench.truth["largest_test_load_N"] = 1.3 * bench.heaviest
    bench.truth["inertia"] = "of the load, force / 9.81" if inertia else "none"
    return Plant(f"load rig {seed}", train, tests, rounded(bench.truth))


def _sensors(noise_seed: int | None) -> np.random.Generator | None:
    return None if noise_seed is None else np.random.default_rng([64, 9, noise_seed])


def _runs(
    bench: Bench, names: Sequence[str] = MOTIONS, seconds: float = 36.0
) -> tuple[list[Recording], dict[str, list[Recording]], list[Array]]:
    """Return runs to fit, those to check, and x of those to fit."""
    faster = float(bench.rng.uniform(2.5, 4.0))
    bench.truth["faster_by"] = faster
    train, moved = [], []
    for name, how in zip(names, (0.0, 1.0, None, 0.5), strict=True):
        pattern = bench.pattern(name, seconds)
        train.append(bench.run(f"train {name}", pattern, bench.load(seconds, how)))
        moved.append(bench.moved)
    tests: dict[str, list[Recording]] = {}
    for group, name, how, duration, speed in (
        ("other", "turning", None, round(seconds / 1.2, 1), 1.0),
        ("other", "sines", 0.7, round(seconds / 1.2, 1), 1.0),
        ("faster", "turning", 0.4, seconds / 2, faster),
        ("faster", "nested", 1.0, seconds / 2, faster),
    ):
        pattern = bench.pattern(name, duration, speed)
        run = bench.run(f"{group} {name}", pattern, bench.load(duration, how))
        tests.setdefault(group, []).append(run)
    if bench.payload:
        duration = round(seconds / 1.5, 1)
        tests["heavier"] = []
        for title, name, how in (("constant", "turning", 1.0), ("varies", "sines", None)):
            pattern = bench.pattern(name, duration)
            run = bench.run(f"heavier {title}", pattern, bench.load(duration, how, 1.3))
            tests["heavier"].append(run)
        bench.truth["loads_of_training"] = [bench.lightest, bench.heaviest]
    return train, tests, moved


def _share_slack(bench: Bench, train: Sequence[Recording], moved: Sequence[Array]) -> float:
    """Return the share of training in which a cable is slack."""
    if not bench.joint:
        return float(np.mean(np.concatenate(moved) < bench.slack))
    loose = [
        bench.pull(p, bench.centre + bench.slack + side * x)[0] < 0
        for run, xs in zip(train, moved, strict=True)
        for side, channel in ((1, "pressure_1"), (-1, "pressure_2"))
        for p, x in zip(run[channel][::9], xs[::9], strict=True)
    ]
    return float(np.mean(loose))
