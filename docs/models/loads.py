"""One model for two loads against one for each, on measured coiled muscles.

Run: python docs/models/loads.py FOLDER      writes docs/models/loads.md

FOLDER holds cavatappi_loads (github.com/DiegotheSoftRoboticist: coiled polymer muscles under dead loads
of 200 and 400 g), which does not come with the package.
"""

from __future__ import annotations

import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from mckibben import Recording, compare
from mckibben.comparison.results import Row

SAMPLES = (2, 3)
LOADS = (200, 400)
STEP = 0.1
"""Of the grid [s]; gaps of up to 2 s are joined by lines."""

FITTED = 2 / 3
"""Share of every recording that is fitted; the rest is tested on."""

MODELS: dict[str, dict[str, Any]] = {
    "coupled-memory": {"lags": (0.3, 1.5), "degree": 2},
    "balance": {},
}

HEAD = """# One model for two loads, on measured coiled muscles

Made by `python docs/models/loads.py FOLDER`; do not edit. The recordings are not distributed here. Two
samples of coiled polymer muscles, each under 200 and 400 g: strongly rate-dependent, with loops of 53
to 85 % of their range. The first two thirds of every recording are fitted, the last third is tested
free-running; RMSE in per cent of the test's range. "One each": `p2uz`, or `mpi`, for every load.
"""


def recording(folder: Path, sample: int, grams: int) -> Recording:
    """Return a recording on an even grid, displacement from its first sample."""
    table = pd.read_csv(folder / "cavatappi_loads" / f"sample{sample}_load{grams}g.csv").dropna()
    t = table["time_s"].to_numpy()
    grid = np.arange(t[0], t[-1], STEP)
    y = np.interp(grid, t, table["position_mm"])
    channels = {
        "pressure": np.interp(grid, t, table["pressure_psi"]) * 0.0689476,
        "displacement": y[0] - y,
        "force": np.full(grid.size, 9.81e-3 * grams),
    }
    return Recording(channels, STEP, meta={"source": f"sample {sample}, {grams} g"})


def tried(
    train: list[Recording], test: list[Recording], model: str, settings: dict[str, Any]
) -> Row:
    """Return what came of one model."""
    (row,) = compare(train, test, models=[model], settings={model: settings}, n_folds=0).rows
    return row


def main() -> None:
    """Write the page."""
    folder = Path(sys.argv[1])
    warnings.simplefilter("ignore")
    lines = [HEAD, "| sample | model | both loads, one model | one each |", "|---|---|---:|---:|"]
    for sample in SAMPLES:
        whole = [recording(folder, sample, grams) for grams in LOADS]
        cuts = [round(FITTED * len(run)) for run in whole]
        train = [run.slice(0, cut) for run, cut in zip(whole, cuts, strict=True)]
        test = [run.slice(cut, len(run)) for run, cut in zip(whole, cuts, strict=True)]
        span = max(float(np.ptp(run["displacement"])) for run in test)
        for model, settings in MODELS.items():
            row = tried(train, test, model, settings)
            cell = "failed" if row.reason else f"{100 * row.test_error / span:.1f} %"
            lines.append(f"| {sample} | `{model}` | {cell} | |")
        for model in ("p2uz", "mpi"):
            squares, count = 0.0, 0
            for one, other in zip(train, test, strict=True):
                row = tried([one], [other], model, {})
                squares += row.test_error**2 * len(other)
                count += len(other)
            lines.append(
                f"| {sample} | `{model}` | | {100 * np.sqrt(squares / count) / span:.1f} % |"
            )
    Path(__file__).with_name("loads.md").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
