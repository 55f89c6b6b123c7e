"""Rate dependence: whether like branches run at speeds that differ."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mckibben.excitation.gap import Gap, between, counted, lasting, value
from mckibben.excitation.seen import Branch, Seen

ENOUGH = 5.0
"""Ratio of speeds that tells what depends on rate over some decades."""

ONE = 1.2
"""Ratio of speeds that are one speed."""

NONE = 2.0
"""Ratio of speeds that tells next to nothing."""

ALIKE = 2.0
"""Branches are compared with those at most so many times as long, or speed would stand for size."""

RESTS = 0.25
"""A hold that lasts this share of a way over the range shows what the output settles to."""

TAIL = 0.05
"""Share of the branches that may be faster, or slower, than what counts."""

FEWEST = 2
"""Branches of like size that tell of speed."""

EFFECT = (
    "damping, lags and dead times (balance, rdpi, oe, process models), and how errors grow away from "
    "these speeds"
)


def speeds(seen: Seen) -> Iterator[Gap]:
    """Give inputs whose branches all run at about one speed."""
    if not seen.timed:
        return
    for name in seen.moving:
        if len(seen.branches[name]) > 1:
            ratio, slow, fast = ratio_of(seen.branches[name])
            if 0 < ratio < ENOUGH:
                yield _gap(seen, name, ratio, slow, fast)


def ratio_of(branches: Sequence[Branch]) -> tuple[float, float, float]:
    """Return how many times faster some branches are than others of like size, and both speeds.

    A hold behind a fast branch counts as slow: what it settles to is what a slow branch would have
    reached.
    """
    known = [b for b in branches if b.slow is not None and b.fast is not None]
    travel = np.array([b.travel for b in known])
    slow, fast = (
        np.array([getattr(b, name) for b in known], dtype=float) for name in ("slow", "fast")
    )
    best = (0.0, 0.0, 0.0)
    for least in np.unique(np.quantile(travel, np.linspace(0, 1, 40), method="lower")):
        like = (travel >= 0.999 * least) & (travel <= ALIKE * least)
        if like.sum() < min(FEWEST, travel.size):  # such as the way to where the motion begins
            continue
        low = float(np.quantile(slow[like], TAIL, method="higher" if like.sum() > 20 else "lower"))
        high = float(
            np.quantile(fast[like], 1 - TAIL, method="lower" if like.sum() > 20 else "higher")
        )
        if low > 0:
            best = max(best, (high / low, low, high))
    return best


def _gap(seen: Seen, name: str, ratio: float, slow: float, fast: float) -> Gap:
    unit = f"{seen.unit(name)}/s".lstrip("/") if seen.unit(name) else "1/s"
    of = f" of {name}" if len(seen.moving) > 1 else ""
    n = counted(len(seen.branches[name]), "branch", "branches")
    middle = float(np.sqrt(slow * fast))
    slower, faster = _round(middle / 4), _round(4 * middle)
    span = seen.scales[name].span
    lasts = lasting(2 * span / slower + 6 * span / faster)
    can = "cannot" if ratio < ONE else "can hardly"
    rests = max((hold.seconds for hold in seen.holds), default=0.0) > RESTS * span / fast
    if rests:
        sentence = (
            f"Rate dependence{of} is told at rest and at {between(slow, fast, unit)} only: there "
            f"{n} run, where they are of like size."
        )
    elif ratio < NONE:
        sentence = (
            f"Rate dependence{of} {can} be told: {n} run at {between(slow, fast, unit)}, "
            "where they are of like size."
        )
    else:
        sentence = (
            f"Rate dependence{of} is told over a factor of {value(ratio)} only: branches of like size "
            f"run at {between(slow, fast, unit)}."
        )
    return Gap(
        "rate",
        sentence,
        f"Record the same cycles at {value(slower, unit)} and at {value(faster, unit)} ({lasts}).",
        EFFECT,
        0.35 if rests else 0.8 if ratio < NONE else 0.5,
        {"slow": slow, "fast": fast, "ratio": ratio, "branches": len(seen.branches[name])},
        (name,),
    )


def _round(speed: float) -> float:
    """Return a speed to one digit, as a person sets it."""
    return float(f"{speed:.0e}")
