"""Identify the muscles of the library: python docs/measured/library.py [FOLDER].

Those of the virtual rigs are put on one virtual bench, under random pressures and pulls. FOLDER holds
measured recordings (festo_isometric_20mm, festo_dmsp10_levels); without it, or where it lacks them, the
files of measured muscles stay what they are. Only numbers fitted here are written, no data.
"""

from __future__ import annotations

import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np

import mckibben
from mckibben.blocks.coupled.balance import balance_in
from mckibben.errors import DataWarning, ModelWarning
from mckibben.estimators.coupled.balance import BalanceEstimator
from mckibben.muscles.library import FOLDER, Conditions, Muscle, described
from mckibben.muscles.sheet import Sheet
from mckibben.muscles.traits import ALONG, PLACES, traits
from mckibben.recording import Recording
from mckibben.rigs.parameters import Air, Range, Sensor
from mckibben.rigs.parameters import Muscle as Physics
from mckibben.rigs.setups.moving_end import MovingEnd

STEP, SECONDS = 0.02, 120.0
SEED = 7

RIGS = {
    "mas10-test-stand": (6.0, "Festo MAS-10, 200 mm"),
    "mas20-hanging": (6.0, "Festo MAS-20, 200 mm"),
    "mckibben-530": (5.0, "Self-made McKibben muscle, 10 mm, 530 mm"),
    "rail": (6.0, "Fluidic muscle of the rail, 22 mm, 220 mm"),
    "soft-arm": (2.5, "Contractile muscle of the soft arm, 30 mm, 600 mm"),
}
"""Highest pressures [bar] and titles."""

HELD = {
    "dmsp20-150": (150.0, "muscle12cm", "Festo DMSP-20, 150 mm"),
    "dmsp20-300": (300.0, "muscle30cm", "Festo DMSP-20, 300 mm"),
}
"""Rest lengths [mm], names of files, titles."""

HELD_UNTOLD = ["friction", "relaxation", "damping", "wall"]
"""Traits that muscles at rest cannot identify separately."""

LEVELS = "dmsp10-250"

HELD_SOURCE = "Muscle_Sensory of Agile-and-Adaptive-Robotics, BPA_Static_Characterization_Test"
LEVELS_SOURCE = "pam_lqi_pid of tbazina, lqr_steady_state_points.csv"

FURTHER = 1.1
"""Factor of the largest displacement up to which traits are given."""

OWN_DATA = "numbers fitted by this package to its own virtual rig: free, as the package is"
NO_LICENCE = "numbers fitted here; the recordings have no licence and are not distributed"

SHEET_20 = {"diameter_mm": 20.0, "max_force_N": 1500.0, "max_contraction": 0.25}
SHEET_10 = {
    "diameter_mm": 10.0,
    "max_force_N": 630.0,
    "max_pressure_bar": 8.0,
    "max_contraction": 0.25,
}
"""From the manufacturer's catalogue."""


def wandering(rng: np.random.Generator, n: int, low: float, high: float, longest: float) -> Any:
    """Return a random motion: straight between random levels, at random rates, with rests."""
    times, levels = [0.0], [low]
    while times[-1] < n * STEP:
        times.append(times[-1] + float(np.exp(rng.uniform(np.log(0.3), np.log(longest)))))
        levels.append(float(rng.uniform(low, high)) if rng.random() < 0.8 else levels[-1])
    return np.interp(np.arange(n) * STEP, times, levels)


def bench(name: str) -> tuple[MovingEnd, Sheet]:
    """Return a test bench with a rig's muscle, and its data sheet."""
    rig: Any = mckibben.load_rig(name)
    muscle: Physics = rig.muscle.model_copy(update={"push": 0.0})
    sheet = Sheet(
        diameter_mm=muscle.diameter,
        rest_length_mm=muscle.length,
        braid_angle_deg=muscle.braid_angle,
        max_pressure_bar=RIGS[name][0],
    )
    room = np.pi / 4 * muscle.diameter**2 * muscle.length * 1e-3
    fast = max(1.0, 0.02 * room)
    stand = MovingEnd(
        name="bench",
        title="bench",
        source="",
        sample_time=STEP,
        muscle=muscle,
        moved_mass=0.3,
        range={"pressure": Range(high=sheet.max_pressure_bar), "force": Range(high=sheet.force)},
        sensor={
            "pressure": Sensor(noise=0.004, resolution=0.0024),
            "displacement": Sensor(noise=2e-4 * sheet.stroke),
            "force": Sensor(noise=5e-4 * sheet.force),
        },
        air=Air(supply=sheet.max_pressure_bar + 1.0, fill=fast, vent=fast, valve_time=0.004,
                gain=0.6, dead_band=0.005, dead_volume=0.1 * room),
    )  # fmt: skip
    slowly = np.linspace(0.0, sheet.max_pressure_bar, round(60.0 / STEP))
    free = stand.run(Recording({"pressure": slowly, "force": 0.0 * slowly}, STEP), ideal=True)
    most = float(free["displacement"][-1]) / muscle.length
    return stand, sheet.model_copy(update={"max_contraction": round(most, 3)})


def driven(stand: MovingEnd, sheet: Sheet) -> list[Recording]:
    """Return recordings under random pressures and pulls."""
    made = []
    for number, pulled in enumerate((0.5, 0.5, 0.02)):
        rng = np.random.default_rng([SEED, number])
        n = round(SECONDS / STEP)
        pressure = wandering(rng, n, 0.0, sheet.max_pressure_bar, 20.0)
        share = np.clip(pressure / sheet.max_pressure_bar, 0.05, 1.0)
        force = pulled * sheet.force * wandering(rng, n, 0.02, 0.9, 20.0) * share
        made.append(stand.run(Recording({"pressure": pressure, "force": force}, STEP), seed=number))
    return made


def identified(
    name: str, recordings: list[Recording], sheet: Sheet, told: dict[str, Any], **settings: Any
) -> Muscle:
    """Return a muscle as identified from recordings."""
    found = BalanceEstimator(elasticity=7, **settings).fit(recordings)
    placed = balance_in(found.model_)
    assert placed is not None
    balance = placed.balance
    moved = np.concatenate([run["displacement"] for run in recordings])
    pressed = np.concatenate([run["pressure"] for run in recordings])
    pulled = np.concatenate([run["force"] for run in recordings if "force" in run] or [[]])
    speed = max(
        float(np.quantile(np.abs(np.gradient(run["displacement"], run.sample_time)), 0.99))
        for run in recordings
    )
    conditions = Conditions(
        pressure_bar=ends(pressed),
        displacement_mm=ends(moved),
        force_N=ends(pulled) if pulled.size else None,
        fastest_mm_per_s=short(speed),
        seconds=short(sum(len(run) * (run.sample_time or 0.0) for run in recordings)),
        rmse=short(found.diagnostics_.rmse),
    )
    held = all(np.ptp(run["displacement"]) == 0.0 for run in recordings)
    errors = trait_errors(found, balance, sheet, held)
    print(name, f"rmse {found.diagnostics_.rmse:.3g}", *found.diagnostics_.notes, sep="\n  ")
    for place, (value, error) in enumerate(zip(traits(balance, sheet), errors, strict=True)):
        print(f"  {place}: {value:.3f} +- {error:.3f}")
    return Muscle(name, sheet=sheet, conditions=conditions, balance=balance, errors=errors, **told)


def trait_errors(found: BalanceEstimator, balance: Any, sheet: Sheet, held: bool) -> Any:
    """Return standard errors of traits from those of the balance; inf if not identified.

    Without a measured force, area and elasticity are told in their ratio only.
    """
    values = balance.pack()
    covariance = found.diagnostics_.covariance[-values.size :, -values.size :]
    told = np.isfinite(np.diag(covariance))
    base = traits(balance, sheet)
    slopes = np.zeros((base.size, values.size))
    for place in range(values.size):
        step = 1e-5 * max(abs(values[place]), 1e-3)
        moved = values.copy()
        moved[place] += step
        slopes[:, place] = (traits(balance.unpack(moved), sheet) - base) / step
    slopes = np.nan_to_num(slopes)
    own = covariance[np.ix_(told, told)]
    variance = np.einsum("ij,jk,ik->i", slopes[:, told], own, slopes[:, told])
    errors = np.where(np.isfinite(base), np.round(np.sqrt(variance), 4), np.inf)
    beyond = ALONG * sheet.stroke > FURTHER * balance.hull[0][1]
    for name in ("loss", "elasticity"):
        errors[PLACES[name]][beyond if balance.n_loads else slice(None)] = np.inf
    untold = [] if balance.lags else ["relaxation", "damping"]
    untold += HELD_UNTOLD if held else []
    for name in untold:
        errors[PLACES[name]] = np.inf
    return errors


def about(title: str, source: str, licence: str, *, virtual: bool = False) -> dict[str, Any]:
    """Return the description of a muscle."""
    return {"title": title, "source": source, "licence": licence, "virtual": virtual}


def ends(values: Any) -> tuple[float, float]:
    """Return lowest and highest."""
    return short(np.min(values)), short(np.max(values))


def short(value: Any) -> float:
    """Return a number of four digits."""
    return float(f"{float(value):.4g}")


def main(folder: Path | None, only: list[str]) -> None:
    """Write the files."""
    for category in (DataWarning, ModelWarning):
        warnings.simplefilter("ignore", category)
    for name, (_, title) in RIGS.items():
        if only and name not in only:
            continue
        rig: Any = mckibben.load_rig(name)
        source = f"virtual rig {name}, version {rig.version}, its muscle on a bench; {rig.source}"
        told = about(f"{title} (virtual)", source, OWN_DATA, virtual=True)
        stand, sheet = bench(name)
        write(identified(name, driven(stand, sheet), sheet, told))
    for name, (length, files, title) in HELD.items():
        runs = sorted(folder.glob(f"festo_isometric_20mm/{files}*.csv")) if folder else []
        if (only and name not in only) or not runs:
            continue
        told = about(f"{title} (measured, held)", HELD_SOURCE, NO_LICENCE)
        sheet = Sheet(rest_length_mm=length, **SHEET_20)
        write(identified(name, [mckibben.read(run)[0] for run in runs], sheet, told))
    levels = folder / "festo_dmsp10_levels" if folder else Path("none")
    for path in sorted(levels.glob("*.csv")) if not only or LEVELS in only else []:
        told = about("Festo DMSP-10, 250 mm (measured, levels)", LEVELS_SOURCE, NO_LICENCE)
        runs = [run.select(["pressure", "displacement"]) for run in mckibben.read(path)]
        sheet = Sheet(rest_length_mm=250.0, **SHEET_10)
        write(identified(LEVELS, runs, sheet, told, n_lags=0))


def write(muscle: Muscle) -> None:
    """Write a muscle into the library."""
    (FOLDER / f"{muscle.name}.toml").write_text(described(muscle), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else None, sys.argv[2:])
