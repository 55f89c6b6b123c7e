"""Whether recordings belong together: of one sign, one zero and one muscle."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mckibben.arrays import Array
from mckibben.comparison.recognising import DRIVING
from mckibben.files.notices import listed
from mckibben.recording import Recording
from mckibben.signals.zeroing import apart

COVERS = 0.7
"""Share of the widest range of the input that recordings cover whose travel is compared."""

ENDS = 0.1
"""Share of the range that both have: so wide is what is looked at round each of its ends."""

SURE = 2.0
"""Standard errors beyond which travels differ."""

OWN = 0.3
"""Share of the output's range that the travel has at least: of one that resonates it is chance."""

OTHER = 1.5
"""Ratio of two travels from which on it is another muscle, or another speed."""

REPEATED, WITHIN = 1.1, 0.2
"""The same where all repeat: of parts that spread by at most such a share of what is between them."""

NAMED = 12
"""Recordings of a part that are named."""

STILL = 0.02
"""Share of a channel's largest range, or value, below which it is held in a recording."""


@dataclass(frozen=True)
class Travel:
    """How far an output moves over the part of an input's range that some recordings share.

    Parameters
    ----------
    given, wanted : str
        Input and output.
    low, high : float
        Ends of that part.
    by_name : tuple of (str, float)
        Recordings and their travel, from the least to the most.
    doubt : float
        Difference of two travels that scatter at the ends may give.
    one_range : bool
        Whether the input turns alike in all.
    """

    given: str
    wanted: str
    low: float
    high: float
    by_name: tuple[tuple[str, float], ...]
    doubt: float
    one_range: bool

    @property
    def turned(self) -> bool:
        """Whether some move the other way."""
        least, most = self.by_name[0][1], self.by_name[-1][1]
        return least < 0 < most and min(-least, most) > self.doubt

    @property
    def parts(self) -> tuple[tuple[tuple[str, float], ...], tuple[tuple[str, float], ...]]:
        """Those that move less and those that move more, by the widest gap; or the other way."""
        if self.turned:
            place = sum(travel < 0 for _, travel in self.by_name)
            return self.by_name[:place], self.by_name[place:]
        ordered = sorted(self.by_name, key=lambda pair: abs(pair[1]))
        place = int(np.argmax(np.diff([abs(travel) for _, travel in ordered]))) + 1
        return tuple(ordered[:place]), tuple(ordered[place:])

    @property
    def differs(self) -> bool:
        """Whether some move so much more than others that they are not of one muscle."""
        less, more = (np.abs([travel for _, travel in part]) for part in self.parts)
        between, spread = more.min() - less.max(), max(np.ptp(less), np.ptp(more))
        if between <= self.doubt:
            return False
        if more.max() > OTHER * less.min():
            return True
        repeated = (
            self.one_range
            and min(less.size, more.size) > 1
            and more.mean() > REPEATED * less.mean()
        )
        return bool(repeated and spread <= WITHIN * between)

    def said(self, units: Mapping[str, str]) -> str:
        """Return it in words."""
        less, more = (
            f"{spanned(sorted((part[0][1], part[-1][1]), key=abs), units[self.wanted])} in "
            f"{listed([name for name, _ in part], NAMED)}"
            for part in self.parts
        )
        return (
            f"over {self.low:.3g} to {self.high:.3g} {units[self.given]} of {self.given}, {self.wanted} "
            f"moves by {less} and by {more}"
        )


def spanned(ends: Sequence[float], unit: str) -> str:
    """Return the least and the most, or one where they are alike."""
    least, most = (f"{end:.3g}" for end in ends)
    return f"{least} {unit}".rstrip() if least == most else f"{least} to {most} {unit}".rstrip()


def alike(
    recordings: Sequence[Recording], names: Sequence[str], wanted: str
) -> Iterator[tuple[str, list[Recording]]]:
    """Yield the one input that moves, and the recordings in which all else is held alike.

    Parameters
    ----------
    recordings : sequence of Recording
    names : sequence of str
        Inputs, loads and what else may be held.
    wanted : str
        Output.
    """
    known = [one for one in recordings if wanted in one]
    if not known:
        return
    every = [n for n in (*names, *DRIVING) if n != wanted and all(n in one for one in known)]
    sizes = {n: max(float(np.abs(one[n]).max()) for one in known) for n in every}
    moves = {n: [np.ptp(one[n]) > STILL * sizes[n] for one in known] for n in every}
    driven = any(any(moves[name]) for name in names if name in moves)
    beside = [n for n in dict.fromkeys(every) if n in names or not driven]
    groups: dict[tuple[str, ...], list[Recording]] = {}
    for place, one in enumerate(known):
        moving = [name for name in beside if moves[name][place]]
        if len(moving) == 1:
            rests = [f"{n} {np.median(one[n]):.2g}" for n in beside if n not in moving]
            groups.setdefault((moving[0], *rests), []).append(one)
    for (given, *_), group in groups.items():
        yield given, group


def travels(recordings: Sequence[Recording], given: str, wanted: str) -> Travel | None:
    """Return how far an output moves in recordings of about one range of the input, or None."""
    widest = max((float(np.ptp(one[given])) for one in recordings), default=0.0)
    some = [one for one in recordings if np.ptp(one[given]) >= COVERS * widest > 0]
    if len(some) < 2:
        return None
    lows, highs = ([float(end(one[given])) for one in some] for end in (np.min, np.max))
    low, high = max(lows), min(highs)
    edge = ENDS * (high - low)
    if high - low < COVERS * widest * COVERS:
        return None
    found, scatter = [], [0.0]
    for one in some:
        u, y = one[given], one[wanted]
        top, bottom = (np.abs(u - end) <= edge / 2 for end in (high, low))
        if not (top.any() and bottom.any()):
            continue
        travel = float(np.median(y[top]) - np.median(y[bottom]))
        if abs(travel) >= OWN * np.ptp(y):
            found.append((one.name, travel))
            scatter.append(sum(_scatter(u[at], y[at]) / _visits(at) for at in (top, bottom)))
    if len(found) < 2:
        return None
    return Travel(
        given,
        wanted,
        low,
        high,
        tuple(sorted(found, key=lambda pair: pair[1])),
        SURE * float(np.sqrt(2 * max(scatter))),
        max(np.ptp(lows), np.ptp(highs)) <= ENDS * widest,
    )


def _scatter(u: Array, y: Array) -> float:
    """Return the variance of an output beside a line over the input."""
    slope = float(np.cov(u, y, ddof=0)[0, 1] / np.var(u)) if np.ptp(u) > 0 else 0.0
    return float(np.var(y - slope * u))


def _visits(there: NDArray[np.bool_]) -> int:
    """Return how often an input came where it is."""
    return int(there[0]) + int(np.sum(there[1:] & ~there[:-1]))


def unlike(
    recordings: Sequence[Recording], names: Sequence[str], wanted: str, loads: Sequence[str]
) -> Iterator[str]:
    """Yield in words which recordings are of another sign, or another muscle, than the others.

    Parameters
    ----------
    recordings : sequence of Recording
    names : sequence of str
        Inputs, and what is told beside them.
    wanted : str
        Output.
    loads : sequence of str
        Those of the names that are loads.
    """
    for given, some in alike(recordings, names, wanted):
        found = travels(some, given, wanted)
        if found is not None and found.turned:
            yield (
                f"{found.said(some[0].units)}: they are of two muscles that move the other way, or the "
                "sign of one was turned and has to be turned back"
            )
        elif found is not None and found.differs:
            why = "another muscle" if loads else "another muscle or load"
            yield (
                f"{found.said(some[0].units)}: {why}, or one was driven much faster. Models take all "
                "for one muscle: fit them apart"
            )


def zeros(
    recordings: Sequence[Recording], names: Sequence[str], wanted: str, loads: Sequence[str]
) -> Iterator[str]:
    """Yield in words where recordings under one load, or under none that is known, rest apart.

    Parameters are those of `unlike`.
    """
    for given, some in alike(recordings, names, wanted):
        if rests := apart(some, wanted, given):
            why = "another muscle hung there" if loads else "another load hung there"
            yield (
                f"{wanted} rests at {rests[0]:.3g} to {rests[1]:.3g} {some[0].units[wanted]} where "
                f"{given} is lowest: a sensor was zeroed anew, or {why}. Models take it "
                f"for what {given} does; see --zero {wanted} and mckibben.signals.zeroed"
            )
