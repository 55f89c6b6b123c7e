"""What is stored of a case: ``data/<room>/<case>.json`` and, of its arrays, ``.npz`` beside it."""

from __future__ import annotations

import json
import platform
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np

from tests.golden.case import DATA

AT_MOST = "at most"
"""A stored ``{"at most": 2.0}`` is a bound, where the right value is known only as one."""


@dataclass(frozen=True)
class Stored:
    """The stored answer of a case.

    Parameters
    ----------
    leaves : dict
        Path -> value, or a bound ``{"at most": number}``.
    reason : str
        Why the case has the value that it has: first stored, or what changed it.
    machine : str
        On what kind of machine: the bits of computed numbers are those of its processor and libm.
    """

    leaves: Mapping[str, Any]
    reason: str
    machine: str


def machine() -> str:
    """Return what the last bits of computed numbers depend on."""
    import llvmlite.binding

    libm = " ".join(platform.libc_ver())
    cpu = llvmlite.binding.get_host_cpu_name()
    features = llvmlite.binding.get_host_cpu_features().flatten()  # a host can hide some
    return f"{platform.system()} {platform.machine()} {cpu} {crc32(features.encode()):08x} {libm}"


def _place(name: str) -> Path:
    return DATA / f"{name}.json"


def load(name: str) -> Stored | None:
    """Return what is stored of a case, None where nothing is."""
    place = _place(name)
    if not place.exists():
        return None
    text = json.loads(place.read_text(encoding="utf-8"))
    leaves = dict(text["expected"])
    arrays = place.with_suffix(".npz")
    if arrays.exists():
        with np.load(arrays, allow_pickle=False) as held:
            found = {key.replace("|", "/"): held[key] for key in held.files}
        if twice := leaves.keys() & found.keys():
            raise ValueError(f"{place}: {', '.join(twice)} stand in {arrays.name} too: delete one")
        leaves |= found
    return Stored(leaves, text["reason"], text["machine"])


def save(name: str, call: str, stored: Stored) -> None:
    """Store the answer of a case."""
    place = _place(name)
    place.parent.mkdir(parents=True, exist_ok=True)
    arrays = {k: v for k, v in stored.leaves.items() if isinstance(v, np.ndarray)}
    rest = {k: v for k, v in stored.leaves.items() if k not in arrays}
    text: dict[str, Any] = {"call": call, "reason": stored.reason, "machine": stored.machine}
    text["expected"] = rest
    place.write_text(json.dumps(text, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    place.with_suffix(".npz").unlink(missing_ok=True)
    if arrays:
        named: dict[str, Any] = {key.replace("/", "|"): value for key, value in arrays.items()}
        np.savez_compressed(place.with_suffix(".npz"), **named)


def names() -> set[str]:
    """Return the names of all that is stored."""
    return {str(path.relative_to(DATA).with_suffix("")) for path in DATA.rglob("*.json")}
