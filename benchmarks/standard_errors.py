"""How often intervals of 95 % hold the true number, where residuals remember and where they do not.

    python benchmarks/standard_errors.py [SEEDS]

Of models of the tests, each fitted anew to every seed's noise by a search that is none of the package's.
Beside the intervals of descriptions stand those as if residuals were independent.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))

from tests.diagnosis.runs import noise
from tests.diagnosis.test_parameters import MODELS, STEP, fitted

from mckibben import Recording
from mckibben.diagnosis.description import describe
from mckibben.numerics import statistics


def measure(name: str, memory: float, seeds: int) -> tuple[float, float]:
    """Return the coverage of intervals under correlated residuals, and as if they were white."""
    block, drive, _ = MODELS[name]
    truth, u = block.pack(), drive()
    clean = np.asarray(block.simulate(u, sample_time=STEP))
    hits: list[list[bool]] = [[], []]
    for seed in range(seeds):
        y = clean + 0.1 * noise(clean.size, memory, 1000 + seed)
        model = fitted(block, u, y)
        recording = Recording({"pressure": u, "displacement": y}, STEP)
        most = statistics.MOST_TERMS
        for place, terms in enumerate((most, 0)):
            statistics.MOST_TERMS = terms
            found = describe(model, [recording]).parameters
            for one, true in zip(found, truth.tolist(), strict=True):
                if one.interval is not None:
                    hits[place].append(one.interval[0] <= true <= one.interval[1])
        statistics.MOST_TERMS = most
    return float(np.mean(hits[0])), float(np.mean(hits[1]))


def main() -> None:
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    print(
        f"{'model':6s} {'residuals':10s} {'held':>7s} {'if white':>9s}  (95 % asked for, {seeds} seeds)"
    )
    for name in MODELS:
        for memory in (0.0, 0.9):
            started = time.perf_counter()
            ours, white = measure(name, memory, seeds)
            kind = f"AR({memory:g})" if memory else "white"
            seconds = time.perf_counter() - started
            print(
                f"{name:6s} {kind:10s} {100 * ours:6.1f}% {100 * white:8.1f}%  {seconds:.0f} s",
                flush=True,
            )


if __name__ == "__main__":
    main()
