"""Test every model on measured recordings that do not come with the package; nothing is chosen.

Run: python docs/models/measured.py FOLDER      writes docs/models/measured.md

FOLDER holds festo_dmsp10_levels and festo_dmsp10_static (github.com/tbazina/pam_lqi_pid: a Festo
DMSP-10-250), cavatappi_loads (github.com/DiegotheSoftRoboticist: coiled muscles), and sma_wing
(github.com/HaammiiD: a wing moved by shape-memory alloy).
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd

import mckibben
from mckibben.comparison.results import Leaderboard
from mckibben.recording import Recording

HEAD = """# Every model on measured recordings

Made by `python docs/models/measured.py FOLDER`; do not edit. The recordings are not distributed here.
Figures are free-running test RMSE in per cent of the test output's range; the models were fitted to
other data of the same recording.
"""

Split = tuple[Recording, Recording]


def levels(folder: Path) -> Split:
    """Return 200 random levels with minor loops: 150 to fit, 50 to test."""
    table = pd.read_csv(folder / "festo_dmsp10_levels" / "festo_dmsp10_levels.csv")
    channels = {
        "pressure": table["pressure_bar"].to_numpy(),
        "displacement": table["displacement_mm"].to_numpy(),
    }
    whole = Recording(channels, 4.0)
    return whole.slice(0, 150), whole.slice(150, len(whole))


def static(folder: Path) -> Split:
    """Return two cycles of a staircase: the first to fit, the second to test."""
    table = pd.read_csv(folder / "festo_dmsp10_static" / "festo_dmsp10_static.csv")
    channels = {
        "pressure": table["pressure_bar"].to_numpy(),
        "displacement": table["displacement_mm"].to_numpy(),
    }
    whole = Recording(channels, 0.6)
    return whole.slice(0, len(whole) // 2), whole.slice(len(whole) // 2, len(whole))


def cavatappi(folder: Path) -> Split:
    """Return pulses of a coiled muscle under 200 g at 10 Hz: two thirds to fit, one to test."""
    table = pd.read_csv(folder / "cavatappi_loads" / "sample1_load200g.csv").dropna()
    t = table["time_s"].to_numpy()
    grid = np.arange(t[0], t[-1], 0.1)
    channels = {
        "pressure": np.interp(grid, t, table["pressure_psi"]) * 0.0689476,
        "displacement": np.interp(grid, t, table["position_mm"]),
    }
    whole = Recording(channels, 0.1)
    cut = 2 * len(whole) // 3
    return whole.slice(0, cut), whole.slice(cut, len(whole))


def wing(folder: Path) -> Split:
    """Return first-order reversal curves of an SMA wing: two thirds to fit, one to test."""
    table = pd.read_csv(folder / "sma_wing" / "sma_wing.csv")
    channels = {
        "pressure": table["input_V"].to_numpy(),
        "displacement": table["output_deg"].to_numpy(),
    }
    whole = Recording(channels, 1.0)
    cut = 2 * len(whole) // 3
    return whole.slice(0, cut), whole.slice(cut, len(whole))


SETS: dict[str, Callable[[Path], Split]] = {
    "DMSP-10 levels": levels,
    "DMSP-10 staircase": static,
    "cavatappi, 200 g": cavatappi,
    "SMA wing": wing,
}


def main() -> None:
    """Write the page."""
    folder = Path(sys.argv[1])
    warnings.simplefilter("ignore")
    boards: dict[str, Leaderboard] = {}
    errors: dict[str, dict[str, float]] = {}
    reasons: list[str] = []
    for name, read in SETS.items():
        train, test = read(folder)
        board = boards[name] = mckibben.compare(train, test, n_folds=0)
        span = float(np.ptp(test["displacement"]))
        errors[name] = {
            row.model: 100 * row.test.rmse / span for row in board.rows if row.test is not None
        }
        reasons += [f"- {name}, {row.model}: {row.reason}" for row in board.rows if row.reason]
    models = sorted(
        {model for board in errors.values() for model in board},
        key=lambda model: np.mean([board.get(model, np.inf) for board in errors.values()]),
    )
    lines = [HEAD, "| model | " + " | ".join(SETS) + " |", "|---|" + "---:|" * len(SETS)]
    for model in models:
        cells = [_cell(errors[name].get(model), errors[name]) for name in SETS]
        lines.append(f"| `{model}` | " + " | ".join(cells) + " |")
    lines += ["", "Bold: the best of its column, and those within a tenth of it.", ""]
    if reasons:
        lines += ["Failed:", "", *reasons, ""]
    Path(__file__).with_name("measured.md").write_text("\n".join(lines))


def _cell(error: float | None, board: dict[str, float]) -> str:
    if error is None:
        return "failed"
    text = f"{error:.2f}" if error < 100 else ">100"
    return f"**{text}**" if error <= 1.1 * min(board.values()) else text


if __name__ == "__main__":
    main()
