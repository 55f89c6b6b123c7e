"""Loads that the names of files speak of, such as ``sample2_load200g``."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from mckibben.files.units import convert, weight

_AMOUNT = r"(?P<value>\d{1,6}(?:\.\d{1,6})?)[ _-]?(?P<unit>kg|g|N)(?![A-Za-z0-9])"
_WORD = r"(?i:loads?|payload|weights?|mass)"
_SAID = (rf"{_WORD}[ _-]*{_AMOUNT}", rf"(?<![A-Za-z0-9.]){_AMOUNT}[ _-]*{_WORD}(?![A-Za-z])")
_BARE = rf"(?<![A-Za-z0-9.]){_AMOUNT}"


@dataclass(frozen=True)
class Load:
    """A load as a name tells it.

    Parameters
    ----------
    value : float
    unit : {"g", "kg", "N"}
    """

    value: float
    unit: str

    @property
    def force(self) -> float:
        """What it pulls with [N]."""
        return float(convert(np.array([self.value]), weight(self.unit), "N")[0])


def load_in(name: str) -> Load | None:
    """Return the one load that a name tells with a word beside it, or None.

    >>> load_in("sample2_load200g"), load_in("run 1.5kg load"), load_in("muscle_200g")
    (Load(value=200.0, unit='g'), Load(value=1.5, unit='kg'), None)
    """
    found = {_load(match) for way in _SAID for match in re.finditer(way, name)}
    return found.pop() if len(found) == 1 and None not in found else None


def loads_in(names: Iterable[str]) -> Mapping[str, Load]:
    """Return the loads that some of the names tell: by a word, or as all in which two differ.

    >>> sorted(loads_in(["slow_2N", "slow_5N", "fast_3N"]))
    ['slow_2N', 'slow_5N']
    """
    names = list(names)
    found = {name: load for name in names if (load := load_in(name))}
    alike: dict[tuple[str, str], dict[str, Load]] = {}
    for name in names:
        matches = list(re.finditer(_BARE, name))
        if name not in found and len(matches) == 1 and (load := _load(matches[0])):
            rest = name[: matches[0].start()], name[matches[0].end() :]
            alike.setdefault(rest, {})[name] = load
    for group in alike.values():
        if len(set(group.values())) > 1:
            found |= group
    return found


def _load(match: re.Match[str]) -> Load | None:
    value = float(match["value"])
    return Load(value, match["unit"]) if value > 0 and math.isfinite(value) else None
