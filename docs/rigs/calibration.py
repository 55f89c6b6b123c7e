"""Make the table of what the virtual rigs do beside what the papers print.

Run: python docs/rigs/calibration.py            writes docs/rigs/calibration.md
     python docs/rigs/calibration.py --stdout   prints it instead
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mckibben.estimators.hysteresis.gpi import GPIEstimator
from mckibben.estimators.hysteresis.mpi import MPIEstimator
from mckibben.metrics import err, loop_width
from mckibben.papers.activation_pressure import protocol as activation
from mckibben.papers.mpi_narmax.protocol import HIGH, LOW
from mckibben.papers.multistate_friction.protocol import SHORTEST
from mckibben.papers.paper import paper
from mckibben.papers.sdchm.protocol import PATTERNS
from mckibben.recording import Recording
from mckibben.rigs import load_rig, record
from mckibben.signals import resample, sine, triangle
from mckibben.signals.protocol import protocol

Array = NDArray[np.float64]
Row = tuple[str, str, str, str]

TABLE_3 = {"12": 0.1124, "13": 0.0356, "21": 0.1521, "23": 0.2153, "31": 0.5368, "32": 0.6321}
"""Coupling gains that the soft arm's paper prints: first the muscle driven."""

MODELS = ("SDCHM", "raw network")
"""Of that paper's Table 4."""

CONTRACTIONS = (
    (-4.33e-9, 3.58e-6, -1.11e-3, 1.33e-1),
    (-1.99e-9, 8.70e-7, -4.50e-4, 2.04e-1),
    (6.98e-9, -3.03e-6, -3.61e-4, 3.03e-1),
)
PRESSURES = (activation.LOWEST, activation.HIGHEST, (7.40e-11, 7.25e-8, -2.91e-5, 3.91e-1))
"""Characteristic points 1, 2 and 4 of Table 1 of the McKibben muscle's paper, as cubics of force."""


def recorded(name: str, wanted: Callable[[str], bool] = lambda run: True) -> dict[str, Recording]:
    """Return the recordings of a protocol whose run names are wanted."""
    runs = [run.name for run in protocol(name).runs if wanted(run.name)]
    return {run.name: recording for run, recording in record(name, runs=runs)}


def last_cycle(recording: Recording, period: float) -> Recording:
    """Return the last whole cycle of a recording that began at a minimum of its input."""
    assert recording.sample_time is not None
    n = round(period / recording.sample_time)
    whole = (len(recording) - 1) // n
    return recording.slice((whole - 1) * n, whole * n + 1)


def span(values: list[float], digits: int = 1) -> str:
    """Return the range of some numbers in words."""
    return f"{min(values):.{digits}f} to {max(values):.{digits}f}"


def soft_arm() -> Iterator[Row]:
    """Give the rows of the soft arm."""
    wanted = ("coupling", "stiffness", "gpi", "prediction-p0-0.1")
    runs = recorded("sdchm", lambda name: name.startswith(wanted))
    widths, driven = [], []
    for name, recording in runs.items():
        if name.startswith("coupling"):
            cycle = last_cycle(recording, 50.0)
            pattern = name.rpartition("-")[2]
            for k in (1, 2, 3):
                u = cycle[f"pressure_{k if str(k) in pattern else pattern[0]}"]
                width = loop_width(u, cycle[f"displacement_{k}"])
                widths.append(width)
                if str(k) in pattern:
                    driven.append(width)
    yield (
        "loop width over the 12 patterns of Section 2.2",
        "28.5 to 50.1 %",
        f"{span(widths)} %",
        "p0 = 1 bar, 1.3 bar peaks",
    )
    yield "driven muscles only", "-", f"{span(driven)} %", ""
    stiff = {
        p0: [
            float(np.ptp(last_cycle(runs[f"stiffness-p0-{p0:.1f}"], 50.0)[f"displacement_{k}"]))
            for k in (1, 2, 3)
        ]
        for p0 in (0.0, 0.5, 1.0, 2.5)
    }
    for k, (who, wanted) in enumerate(
        (("driven muscle I", "small"), ("passive II", "sharp"), ("passive III", "sharp"))
    ):
        moved = ", ".join(f"{stiff[p0][k]:.1f}" for p0 in stiff)
        change = 100 * (1 - stiff[2.5][k] / stiff[0.0][k])
        yield (
            f"{who}: range at p0 = 0, 0.5, 1, 2.5 bar",
            f"{wanted} decrease (Figure 5)",
            f"{moved} mm",
            f"-{change:.0f} % in total",
        )
    for k in (1, 2, 3):
        recording = runs[f"gpi-{k}"]
        own = recording[f"displacement_{k}"]
        for j in (1, 2, 3):
            if j != k:
                gain = float(own @ recording[f"displacement_{j}"] / (own @ own))
                yield f"coupling gain G{k}{j}", f"{TABLE_3[f'{k}{j}']:.4f}", f"{gain:.2f}", ""
    # The second cycle goes to 1.5 bar, over 50 s at 50 Hz.
    rise = runs["gpi-1"].slice(2500, 3750)
    order = np.argsort(rise["pressure_1"], kind="stable")
    there = np.interp(1.4, rise["pressure_1"][order], rise["displacement_1"][order])
    yield "displacement of I when rising to 1.4 bar, p0 = 0", "about 45 mm", f"{there:.0f} mm", ""
    yield from arm_hysteresis(runs["gpi-1"])
    yield from arm_motion(
        {pattern: runs[f"prediction-p0-0.1-drive-{pattern}"] for pattern in PATTERNS}
    )


def arm_hysteresis(identification: Recording) -> Iterator[Row]:
    """Give the errors of the paper's hysteresis model on one muscle (its Table 2)."""
    for n, printed in paper("sdchm").tables["orders"].printed["Err [%]"].items():
        model = GPIEstimator(
            input="pressure_1",
            output="displacement_1",
            n_operators=int(n),
            threshold_rule="paper",
            initial="virgin",
        )
        block = model.fit(identification).model_
        modelled = block.simulate(identification["pressure_1"])
        found = err(identification["displacement_1"], modelled)
        yield f"Err of GPI 1 with N = {n}", f"{printed:.2f} %", f"{found:.2f} %", "tanh envelopes"


def arm_motion(runs: Mapping[str, Recording]) -> Iterator[Row]:
    """Give the mean deviation of each muscle's motion from its mean (what Table 4 divides by).

    A mean absolute error is at most the root mean square, so that RMSE / Err bounds it from above.
    """
    columns = paper("sdchm").tables["groups"].printed
    err_, rmse_ = (
        np.array([[*columns[f"{what}, {name}, as published"].values()] for name in MODELS])
        for what in ("Err [%]", "RMSE [mm]")
    )
    bounds = (100 * rmse_ / err_).T.reshape(len(runs), 3, 2)
    for (pattern, recording), bound in zip(runs.items(), bounds, strict=True):
        sdchm, raw = bound.T
        moved = [recording[f"displacement_{k}"] for k in (1, 2, 3)]
        here = np.array([np.abs(y - y.mean()).mean() for y in moved])
        yield (
            f"mean deviation of I, II, III, driven {pattern}, p0 = 0.1 bar",
            f"RMSE/Err: {listed(sdchm)} (raw network {listed(raw)}) mm",
            f"{listed(here)} mm",
            "printed: upper bounds",
        )
        if len(pattern) == 1:
            driven = int(pattern) - 1
            passive = [k for k in range(3) if k != driven]
            own, other, ours = (x[passive] / x[driven] for x in (sdchm, raw, here))
            yield (
                f"passive over driven, driven {pattern}",
                f"{listed(own, 2)} (raw network {listed(other, 2)})",
                listed(ours, 2),
                "of the preceding row",
            )


def listed(values: Array, digits: int = 0) -> str:
    """Return numbers in words, in their order."""
    return ", ".join(f"{value:.{digits}f}" for value in values)


def branch_heights(u: Array, y: Array) -> tuple[float, float]:
    """Return how far rise and fall lie above the line between their ends, at mid input [% of range].

    Of a cycle from its minimum.
    """
    top = int(u.argmax())
    low, high = float(u[0]), float(u[top])
    middle = 0.5 * (low + high)
    rise = np.interp(middle, u[: top + 1], y[: top + 1]) - 0.5 * (y[0] + y[top])
    fall = np.interp(-middle, -u[top:], y[top:]) - 0.5 * (y[-1] + y[top])
    return float(100 * rise / np.ptp(y)), float(100 * fall / np.ptp(y))


def hanging() -> Iterator[Row]:
    """Give the rows of the MAS-20."""
    runs = recorded("field-models")
    first = runs["decaying-triangle"]
    rig = load_rig("mas20-hanging")
    yield (
        "stroke from 1.0 to 5.5 bar under 20 kg",
        "37 mm",
        f"{first['displacement'].max():.1f} mm",
        "",
    )
    unloaded = rig.changed({"payload": 0.0, "start.pressure": 0.0})
    filled = np.concatenate([np.linspace(0.0, 6.0, 500), np.full(500, 6.0)])
    shortened = unloaded.run(Recording({"pressure": filled}, 0.02))["displacement"][-1]
    yield (
        "contraction at 6 bar without load",
        "25 % (manufacturer)",
        f"{100 * shortened / rig.known()['rest_length']:.1f} %",
        "",
    )
    time = np.arange(1001) * 0.02
    wave = triangle(time, 10.0, 5.5, 1.0)
    model = np.asarray(paper("field-models").printed("field-models-pi").simulate(wave))
    moved = rig.run(Recording({"pressure": wave}, 0.02))["displacement"]
    yield (
        "loop width of the second major cycle",
        f"{loop_width(wave[500:], model[500:]):.1f} % (PI model)",
        f"{loop_width(wave[500:], moved[500:]):.1f} %",
        "",
    )
    for name, printed, ours in zip(
        ("rising", "falling"),
        branch_heights(wave[500:], model[500:]),
        branch_heights(wave[500:], moved[500:]),
        strict=True,
    ):
        yield (
            f"curvature of its {name} branch: height over its chord at mid pressure",
            f"{printed:+.1f} % (PI model)",
            f"{ours:+.1f} %",
            "of the range",
        )
    printed = paper("field-models").printed("field-models-pi")
    shapes = [printed.simulate(r)["unscaled_displacement"] for r in runs.values()]
    matched, fitted = (
        _range_match(shapes[0], first),
        np.polyfit(shapes[0], first["displacement"], 1),
    )
    errors = [
        np.sqrt(np.mean((np.polyval(line, shape) - run["displacement"]) ** 2))
        for line in (matched, fitted)
        for shape, run in zip(shapes, runs.values(), strict=True)
    ]
    yield (
        "error of the printed PI model, calibration and test, matched as in the paper",
        "2.60, 2.48 mm RMSE (Table 2)",
        f"{errors[0]:.2f}, {errors[1]:.2f} mm RMSE",
        f"matched by least squares on the calibration: {errors[2]:.2f}, {errors[3]:.2f} mm",
    )
    yield (
        "lowest point after the first cycle",
        "above 0 (Figure 2)",
        f"{first['displacement'][480:520].min():.1f} mm",
        "memory and creep",
    )


def _range_match(shape: Array, recording: Recording) -> Array:
    """Return gain and offset that match ranges and first samples."""
    measured = recording["displacement"]
    gain = np.ptp(measured) / np.ptp(shape)
    return np.array([gain, measured[0] - gain * shape[0]])


def static_force(length: Array, pressure: Array | float) -> Array:
    """Return the MAS-10's static force as its paper prints it, Eq. (3) with Table 1 [N]."""
    return np.asarray(
        7596 - 136.6 * pressure - 93.14 * length + 1.176 * length * pressure + 0.2758 * length**2
    )


def test_stand() -> Iterator[Row]:
    """Give the rows of the MAS-10."""
    runs = recorded("multistate-friction")
    off = []
    for name, recording in runs.items():
        if name.startswith("isometric"):
            law = static_force(recording["length"], recording["pressure"])
            taut = law > 0
            off.append((recording["force"] - law)[taut])
    error = np.concatenate(off)
    yield (
        "isometric force compared with the static law, where the muscle pulls",
        "15.4 N RMSE (fit of the paper)",
        f"{np.sqrt(np.mean(error**2)):.1f} N RMSE",
        "9 lengths of 184 to 200 mm",
    )
    for pressure in SHORTEST:
        recording = runs[f"isobaric-{pressure:.0f}bar"]
        late = recording.slice(len(recording) * 2 // 3, len(recording))
        extracted = late["force"] - static_force(late["length"], pressure)
        yield (
            f"extracted hysteresis at {pressure:.0f} bar",
            "-117 to 129 N (Table 2)" if pressure == 4 else "-",
            f"{extracted.min():.0f} to {extracted.max():.0f} N",
            f"{SHORTEST[pressure]:.1f} to 200 mm",
        )


def model_error(known: Recording, other: Recording) -> float:
    """Return the MAE on another run of the MPI that is identified on a known one [mm]."""
    known, other = (
        resample(run.select(["voltage", "displacement"]), 0.02) for run in (known, other)
    )
    model = (
        MPIEstimator(input="voltage", rate_dependent=True, rate_time_constant=0.1).fit(known).model_
    )
    missed = model.simulate(other)["displacement"] - other["displacement"]
    return float(np.mean(np.abs(missed)))


def rail() -> Iterator[Row]:
    """Give the rows of the muscle on a rail."""
    runs = recorded("mpi-narmax")
    free = last_cycle(runs["status-1"], 10.0)
    yield (
        "displacement at 10 V without load",
        "48 mm",
        f"{runs['status-1']['displacement'].max():.1f} mm",
        "",
    )
    for frequency in (0.05, 0.1, 0.2):
        period = 1 / frequency
        time = np.arange(round(2 * period / 0.001) + 1) * 0.001
        wave = sine(time, period, HIGH, LOW)
        given = Recording({"voltage": wave}, 0.001)
        model = paper("mpi-narmax").printed("mpi-narmax-mpi").simulate(given)["displacement"]
        half = time.size // 2
        cycle = last_cycle(runs[f"free-{frequency:g}Hz"], period)
        yield (
            f"loop width at {frequency:g} Hz, no load",
            f"{loop_width(wave[half:], model[half:]):.1f} % (MPI model)",
            f"{loop_width(cycle['voltage'], cycle['displacement']):.1f} %",
            "",
        )
    for name, load in (
        ("weight-0.1Hz", "91 N"),
        ("status-2", "10.04 kg"),
        ("status-3", "21.75 kg"),
    ):
        period = 10.0 if name.startswith("weight") else 5.0
        moved = last_cycle(runs[name], period)["displacement"]
        yield (
            f"stroke under {load}",
            f"reduced, from {np.ptp(free['displacement']):.1f} mm without (Figure 2)",
            f"{np.ptp(moved):.1f} mm, highest point {moved.max():.1f} mm",
            "",
        )
    for known, other, printed in ((1, 2, "6.86"), (1, 3, "10.06"), (2, 3, "3.23")):
        yield (
            f"MAE of MPI identified on status {known}, tested on status {other}",
            f"{printed} mm (Table 2)",
            f"{model_error(runs[f'status-{known}'], runs[f'status-{other}']):.2f} mm",
            "load sensitivity",
        )
    pulled, left = runs["hand-0.1Hz"]["displacement"], runs["free-0.1Hz"]["displacement"]
    yield (
        "distortion by three pulls of 100 N",
        "regional (Figure 2)",
        f"up to {np.abs(pulled - left).max():.1f} mm",
        "",
    )
    held = runs["held-6V"]
    n = 20_000
    force, moved = held["force"][-n:], held["displacement"][-n:]
    yield (
        "force-displacement loop at 6 V, 0 to 150 N",
        "a loop (Figure 3)",
        f"{np.ptp(moved):.1f} mm, {loop_width(force, -moved):.0f} % wide",
        "",
    )


def mckibben() -> Iterator[Row]:
    """Give the rows of the self-made muscle."""
    runs = recorded("activation-pressure", lambda name: not name.startswith("random"))
    off = []
    for force in activation.FORCES:
        recording = runs[f"static-{force:.0f}N"]
        top = int(recording["pressure"].argmax())
        # The slow cycle's middle: the static pressure lies between rise and fall.
        rise = recording.slice(0, top)
        fall = recording.slice(top, len(recording))
        for contractions, pressures in zip(CONTRACTIONS, PRESSURES, strict=True):
            contraction = float(np.polyval(contractions, force))
            printed = 10 * float(np.polyval(pressures, force))
            found = [_pressure_at(part, contraction) for part in (rise, fall)]
            if None not in found:
                off.append(0.5 * (found[0] + found[1]) - printed)  # type: ignore[operator]
    yield (
        "static pressure at the characteristic points of Table 1",
        "-",
        f"{np.sqrt(np.mean(np.square(off))):.2f} bar RMSE over {len(off)} points",
        "reachable points of 1, 2, 4 at 0 to 300 N; 0.3 to 3.9 bar",
    )
    for force in (0.0, 50.0, 150.0, 300.0):
        widths, printed = [], []
        for frequency in activation.FREQUENCIES:
            cycle = last_cycle(runs[f"sine-{force:.0f}N-{frequency:.1f}Hz"], 1 / frequency)
            contraction = cycle["displacement"] / 530.0
            widths.append(_pressure_width(contraction, cycle["pressure"]))
            speed = np.pi * frequency * np.ptp(contraction)
            phi = -2.19e-6 * force**3 + 9.55e-4 * force**2 - 9.42e-3 * force + 35.1
            printed.append(2 * (0.267 * frequency + 0.667) * phi * speed / 100)
        yield (
            f"width in pressure at 0.5, 1, 1.5, 2 Hz, {force:.0f} N",
            ", ".join(f"{width:.2f}" for width in printed) + " bar (2 z at our speeds)",
            ", ".join(f"{width:.2f}" for width in widths) + " bar",
            f"{widths[-1] / widths[0]:.1f} times wider",
        )


def _pressure_at(part: Recording, contraction: float) -> float | None:
    reached = part["displacement"] / 530.0
    if not reached.min() < contraction < reached.max():
        return None
    order = np.argsort(reached, kind="stable")
    return float(np.interp(contraction, reached[order], part["pressure"][order]))


def _pressure_width(contraction: Array, pressure: Array) -> float:
    start = int(contraction.argmin())
    c, p = np.roll(contraction[:-1], -start), np.roll(pressure[:-1], -start)
    top, middle = int(c.argmax()), 0.5 * (c.min() + c.max())
    up = np.interp(middle, np.maximum.accumulate(c[: top + 1]), p[: top + 1])
    down = np.interp(-middle, np.maximum.accumulate(-c[top:]), p[top:])
    return float(up - down)


RIGS: Mapping[str, tuple[str, Callable[[], Iterator[Row]]]] = {
    "soft-arm": ("sdchm", soft_arm),
    "mas20-hanging": ("field-models", hanging),
    "mas10-test-stand": ("multistate-friction", test_stand),
    "rail": ("mpi-narmax", rail),
    "mckibben-530": ("activation-pressure", mckibben),
}

HEAD = """# Virtual rigs compared with their papers

Made by `python docs/rigs/calibration.py`; do not edit. Each rig was recorded with the protocol of
its paper (`mckibben rig record PROTOCOL --out DIR`). A dash means that the paper prints no value.
For the reasons of the differences, see [Differences](differences.md).
"""


def table() -> str:
    """Return the whole page."""
    parts = [HEAD]
    for name, (plan, rows) in RIGS.items():
        print(f"{name} ...", file=sys.stderr)
        parts.append(f"## {name}\n\n{load_rig(name).title}. Protocol: `{plan}`.\n")
        parts.append("| quantity | paper | rig | |\n|---|---|---|---|")
        parts += [f"| {' | '.join(row)} |" for row in rows()]
        parts.append("")
    return "\n".join(parts)


def main() -> None:
    """Write or print the page."""
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    arguments.add_argument("--stdout", action="store_true", help="print, do not write")
    page = table()
    if arguments.parse_args().stdout:
        print(page, end="")
    else:
        Path(__file__).with_name("calibration.md").write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
