"""Forces at constant length and the spread of repetitions: python docs/measured/repeats.py FOLDER.

For each length of festo_isometric_20mm: the pairwise differences of the three inflations at equal
pressure on the same branch; the error of a balance fitted to the first two inflations of all
lengths on the third; and mean loops (venting minus inflating) of the three and of the model, with
the error on the third. All values are RMS [N] except these means; the last line is over all lengths
of a muscle.
"""

from __future__ import annotations

import sys
import warnings
from itertools import combinations
from pathlib import Path

import numpy as np

from mckibben import Recording
from mckibben.arrays import Array
from mckibben.estimators.coupled.balance_force import BalanceForceEstimator
from mckibben.measured.sets import sets_in

PLATEAU = 0.03
"""Pressure below the highest at which a branch ends [bar]."""


def branches(recording: Recording, force: Array, pressures: Array) -> Array:
    """Return the force at pressures while inflated and while vented, shape (2, n)."""
    p = recording["pressure"]
    high = np.flatnonzero(p > p.max() - PLATEAU)
    found = []
    for part in (slice(0, high[0] + 1), slice(high[-1], None)):
        order = np.argsort(p[part], kind="stable")
        found.append(np.interp(pressures, p[part][order], force[part][order]))
    return np.array(found)


def rms(values: Array) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def main() -> None:
    """Print one line per length."""
    warnings.simplefilter("ignore")
    (held,) = (one for one in sets_in(Path(sys.argv[1])) if one.name == "festo_isometric_20mm")
    whole = held.recordings()
    print(
        "muscle, length: differences of repetitions | model error, same pressures | loops 1, 2, 3, "
        "model | error"
    )
    for muscle in ("12cm", "30cm"):
        runs = [run for run in whole if muscle in run.name]
        train = [run for run in runs if not run.name.endswith("run3")]
        model = BalanceForceEstimator().fit(train).fitted
        rows = []
        for length in sorted({float(run["length"][0]) for run in runs}, reverse=True):
            same = [run for run in runs if run["length"][0] == length]
            low = max(float(run["pressure"][-1]) for run in same)
            top = min(float(run["pressure"].max()) for run in same)
            p = np.linspace(low + 0.02, top - 0.05, 200)
            forces = [branches(run, run["force"], p) for run in same]
            found = branches(same[2], model.simulate(same[2])["force"], p)
            apart = rms(np.array([a - b for a, b in combinations(forces, 2)]))
            loops = [one[1] - one[0] for one in (*forces, found)]
            rows.append((apart, rms(found - forces[2]), rms(loops[2]), rms(loops[3] - loops[2])))
            told = ", ".join(f"{np.mean(loop):.0f}" for loop in loops)
            print(
                f"{muscle}, {length:g} mm: {apart:.1f} | {rows[-1][1]:.1f}, {rows[-1][1] / apart:.2f} x"
                f" | {told} | {rows[-1][3]:.1f} of {rows[-1][2]:.1f}"
            )
        apart, off, loop, missed = (rms(np.array(column)) for column in zip(*rows, strict=True))
        share = 1.0 - missed**2 / loop**2
        print(
            f"{muscle}, all: {apart:.1f} | {off:.1f}, {off / apart:.2f} x | loops {share:.0%} explained"
        )


if __name__ == "__main__":
    main()
