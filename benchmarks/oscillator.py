"""Identify the Bouc-Wen benchmark of Noël and Schoukens: hysteresis inside a dynamic loop.

Run: python benchmarks/oscillator.py FOLDER

The folder has uest, yest, uval and yval of the multisines as MATLAB files. Grey models are told the
equations, all but their numbers; light-grey ones a mass, a spring, a damper and an element of one
state, whose shape they find; black ones nothing. They are not to be ranked against one another. Fits
are to four periods with noise, and to three of them, each left out once; all have the same force.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import loadmat

from mckibben import Recording
from mckibben.registry import load

STEP, PERIODS = 1 / 750, 4

MODELS: tuple[tuple[str, str, dict[str, int]], ...] = (
    ("grey", "bouc-wen-oscillator", {}),
    ("light grey", "duhem-oscillator", {}),
    ("light grey", "duhem-oscillator", {"n_pieces": 1}),
    ("light grey", "duhem-oscillator", {"n_pieces": 4}),
    ("black", "state-network", {}),
    ("black", "state-network", {"n_units": 15}),
)

PUBLISHED = (
    ("black", "best", "40 960 samples", 7.2e-6),
    ("black", "PNLSS, 217 parameters", "", 1.2e-5),
    ("black", "meta-learned", "500 samples, median", 3.2e-5),
    ("black", "dynoNet", "", 4.5e-5),
)
"""Test errors on the multisine [m]."""


def samples(folder: Path, name: str) -> np.ndarray:
    """Return the one array of a file, flat."""
    content = loadmat(folder / f"{name}_multisine.mat")
    (found,) = (value for key, value in content.items() if not key.startswith("__"))
    return np.asarray(found, dtype=float).ravel()


def main() -> None:
    """Fit, test and print."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    forces, moved = (samples(folder, name).reshape(PERIODS, -1) for name in ("uest", "yest"))
    runs = [
        Recording({"force": u, "displacement": 1e3 * y}, STEP)
        for u, y in zip(forces, moved, strict=True)
    ]
    test, truth = Recording({"force": samples(folder, "uval")}, STEP), samples(folder, "yval")

    def row(kind: str, name: str, learned: str, seconds: float, error: float) -> None:
        took = "" if np.isnan(seconds) else f"{seconds:.1f} s"
        print(f"{kind:>10}  {name:<32} {learned:<22} {took:>7} {error:10.3g} m", flush=True)

    for kind, name, settings in MODELS:
        estimator: Any = load("estimators", name)
        estimator(periodic=True, **settings).fit(runs[0])  # so that compiling is not measured
        for left in (None, *range(PERIODS)):
            given = [run for place, run in enumerate(runs) if place != left]
            began = time.perf_counter()
            model = estimator(periodic=True, **settings).fit(given).model_
            seconds = time.perf_counter() - began
            error = 1e-3 * model.steady_state(test)["displacement"] - truth
            learned = "four periods" if left is None else f"three, without {left + 1}"
            called = f"{name} ({model.n_parameters} numbers)"
            row(kind, called, learned, seconds, float(np.sqrt(np.mean(error**2))))
    print("published:")
    for kind, name, learned, known in PUBLISHED:
        row(kind, name, learned, np.nan, known)


if __name__ == "__main__":
    main()
