"""Rank models of a measured soft arm: three regulator inputs, two coordinates of the tip.

Run: python docs/models/real_arm.py FOLDER      writes docs/models/real_arm.md

FOLDER holds soft_arm_three_muscles (github.com/ramvasudevan/soft-robot-koopman: Bruder, Fu, Gillespie,
Remy and Vasudevan, IEEE T-RO 37, 2021), which does not come with the package.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from mckibben import Recording, compare

TRAIN, TEST = (0, 1, 5, 9), (2, 6, 10)
RATE = 12.0
"""Of the grid that the trials are interpolated to [Hz], as they were recorded on average."""

MODELS: dict[str, tuple[str, dict[str, Any]]] = {
    "coupled hysteresis: lags, plays, products": ("coupled-memory", {}),
    "the same without plays": ("coupled-memory", {"thresholds": ()}),
    "linear: three lags of every input": ("coupled-memory", {"thresholds": (), "degree": 1}),
    "uncoupled PI: plays of every input added": (
        "coupled-memory",
        {"lags": (0.01,), "degree": 1, "thresholds": (0.02, 0.05, 0.1, 0.2, 0.4)},
    ),
    "balance of forces, each muscle along its direction": ("balance", {}),
    "raw fuzzy network": ("tsfnn", {"constants": True}),
}

HEAD = """# A measured soft arm

Made by `python docs/models/real_arm.py FOLDER`; do not edit. The recordings are not distributed here.
Three regulator inputs (pressures are not measured), two coordinates of the tip; fitted to trials 0, 1, 5
and 9, tested free-running on trials 2, 6 and 10 (Bruder and others, IEEE T-RO 37, 2021).

| model | RMSE y1 [mm] | RMSE y2 [mm] | largest [mm] | parameters | fit [s] |
|---|---:|---:|---:|---:|---:|
"""


def trial(folder: Path, number: int) -> Recording:
    """Return a trial on an even grid; inputs are named pressures, in volts."""
    table = pd.read_csv(folder / "soft_arm_three_muscles" / f"trial_{number:02d}.csv")
    t = table["time_s"].to_numpy()
    grid = np.arange(t[0], t[-1], 1 / RATE)
    channels = {f"input_{k}": np.interp(grid, t, table[f"u{k}_V"]) for k in (1, 2, 3)}
    channels |= {f"displacement_{k}": 10 * np.interp(grid, t, table[f"y{k}_cm"]) for k in (1, 2)}
    units = {f"input_{k}": "V" for k in (1, 2, 3)}
    return Recording(channels, 1 / RATE, units, meta={"source": f"trial {number}"})


def main() -> None:
    """Write the page."""
    folder = Path(sys.argv[1])
    train, test = ([trial(folder, number) for number in numbers] for numbers in (TRAIN, TEST))
    inputs = ("input_1", "input_2", "input_3")
    found = []
    for title, (model, settings) in MODELS.items():
        board = compare(
            train, test, inputs=inputs, models=[model], settings={model: settings}, n_folds=0
        )
        (row,) = board.rows
        if row.test is None:
            sys.exit(f"{title}: {row.reason}")
        found.append((row.test, title, row))
    lines = [
        f"| {title} | {row.outputs['displacement_1'].rmse:.2f} "
        f"| {row.outputs['displacement_2'].rmse:.2f} | {scores.max_error:.1f} "
        f"| {row.n_parameters} | {row.fit_seconds:.2f} |"
        for scores, title, row in sorted(found, key=lambda item: item[0].rmse)
    ]
    Path(__file__).with_name("real_arm.md").write_text(HEAD + "\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
