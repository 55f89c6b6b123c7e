"""Fit the same models to a measured muscle and to a rig made from that muscle's data sheet.

The rig repeats the measured pressures, level by level, and is read as the experimenters read theirs.
Nothing of the rig was fitted to the recordings.

Run: python docs/rigs/measured.py FOLDER      writes docs/rigs/measured.md

FOLDER holds festo_dmsp10_levels and festo_dmsp10_static (github.com/tbazina/pam_lqi_pid: a Festo
DMSP-10-250), which do not come with the package.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas as pd

import mckibben
from mckibben.recording import Recording
from mckibben.rigs import Rig, load_rig

LEVEL_TIME = 4.0
STEP_TIME = 0.6
"""Time that the experimenters held each level, and each step of the staircase [s]."""

N_FIT = 150
"""Levels to fit, of 200."""

MODELS = ("pi", "gpi", "mpi", "eupi", "rdpi")

HEAD = """# A measured muscle and a rig from its data sheet

Made by `python docs/rigs/measured.py FOLDER`; do not edit. The muscle is a Festo DMSP-10-250 measured
by the authors of github.com/tbazina/pam_lqi_pid (not distributed here). The rig uses data-sheet values
only (10 mm, 250 mm, 630 N at 8 bar, 25 %, and a loop width of 16 %). It was driven with the measured
pressures and sampled in the same way. Models, settings and splits are the same. Errors are free-run test
RMSE in per cent of the displacement range.
"""


def rig() -> Rig:
    """Return a rig of the measured muscle, from its data sheet."""
    return load_rig(Path(__file__).with_name("dmsp-10-250.toml"))


def repeated(plant: Rig, pressures: np.ndarray, hold: float, n_mean: int) -> np.ndarray:
    """Return the displacement after each level, as the mean of its last samples."""
    per_level = round(hold / plant.sample_time)
    commands = np.repeat(pressures, per_level)
    run = plant.run(Recording({"pressure": commands}, plant.sample_time), held=True)
    levels = run["displacement"].reshape(-1, per_level)
    return np.asarray(levels[:, -n_mean:].mean(axis=1))


def ranked(
    pressure: np.ndarray, displacement: np.ndarray, n_fit: int, hold: float
) -> dict[str, float]:
    """Return every model's test RMSE over the range [%]."""
    whole = Recording({"pressure": pressure, "displacement": displacement}, hold)
    board = mckibben.compare(
        whole.slice(0, n_fit), whole.slice(n_fit, len(whole)), models=list(MODELS)
    )
    frame = board.to_frame().set_index("model")
    return {name: 100 * frame.loc[name, "test.rmse"] / np.ptp(displacement) for name in MODELS}


def spans(measured: np.ndarray, virtual: np.ndarray) -> str:
    """Return both ranges of displacement in words."""
    return f"measured {np.ptp(measured):.1f} mm, rig {np.ptp(virtual):.1f} mm"


def table(title: str, ranges: str, columns: dict[str, dict[str, float]]) -> list[str]:
    """Return the lines of one table."""
    lines = [
        f"## {title}",
        "",
        f"| model | {' | '.join(columns)} |",
        "|---" * (len(columns) + 1) + "|",
    ]
    for name in MODELS:
        cells = " | ".join(f"{column[name]:.2f} %" for column in columns.values())
        lines.append(f"| {name} | {cells} |")
    orders = [" < ".join(sorted(MODELS, key=column.__getitem__)) for column in columns.values()]
    lines += [
        "",
        f"Range: {ranges}.",
        "",
        "Order: " + "; ".join(f"{n}: {o}" for n, o in zip(columns, orders, strict=True)),
        "",
    ]
    return lines


def main() -> None:
    """Write the page."""
    if len(sys.argv) != 2:
        sys.exit("Usage: python docs/rigs/measured.py FOLDER")
    folder, plant = Path(sys.argv[1]), rig()
    levels = pd.read_csv(folder / "festo_dmsp10_levels" / "festo_dmsp10_levels.csv")
    pressure = np.clip(levels["pressure_bar"].to_numpy(), 0.0, None)
    measured = levels["displacement_mm"].to_numpy()
    virtual = repeated(plant, pressure, LEVEL_TIME, 20)
    lines = [HEAD]
    lines += table(
        "Random levels: 150 to fit, 50 to test",
        spans(measured, virtual),
        {
            "measured": ranked(pressure, measured, N_FIT, LEVEL_TIME),
            "rig": ranked(pressure, virtual, N_FIT, LEVEL_TIME),
        },
    )
    stairs = pd.read_csv(folder / "festo_dmsp10_static" / "festo_dmsp10_static.csv")
    pressure = np.clip(stairs["pressure_bar"].to_numpy(), 0.0, None)
    measured = stairs["displacement_mm"].to_numpy()
    virtual = repeated(plant, pressure, STEP_TIME, 1)
    n_fit = int((stairs["cycle"] == stairs["cycle"].iloc[0]).sum())
    lines += table(
        "Staircases: first cycle to fit, second to test",
        spans(measured, virtual),
        {
            "measured": ranked(pressure, measured, n_fit, STEP_TIME),
            "rig": ranked(pressure, virtual, n_fit, STEP_TIME),
        },
    )
    Path(__file__).with_name("measured.md").write_text("\n".join(lines), encoding="utf-8")
    print("\n".join(lines))


if __name__ == "__main__":
    main()
