"""Settings of an exported model's serial server, fixed at export."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.errors import ModelError, require
from mckibben.exporting.templating import literal, render

SERVER = tuple(Path(__file__).parent / "server" / f"mck_server.{end}" for end in ("c", "h"))

ROOM = 236
"""Payload of a frame [bytes]."""

MOST_NUMBERS = 0xFFFF
"""Largest number of a half word: numbers of the memory, and bytes of the description."""

MOST_TICKS = 2**31 - 1
"""Longest silence [ticks]."""

MOST_MICROSECONDS = 2**32 - 1
"""Longest time between ticks [us], in a word."""

OVERHEAD = 6
"""Bytes of a frame's payload besides the channels."""


@dataclass(frozen=True)
class Serving:
    """Settings of a serial server.

    Parameters
    ----------
    limits : mapping of str to (float, float)
        Lowest and highest of a channel, in its unit; default what the model knows.
    safe : mapping of str to float
        Of an output, its value while no host leads; default its lowest.
    watchdog : float
        How long a host may be silent at most [s].
    """

    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    safe: Mapping[str, float] = field(default_factory=dict)
    watchdog: float = 0.5


def limits(block: Block, serving: Serving) -> tuple[Array, Array, Array]:
    """Return the lowest, highest and safe values of inputs, then outputs, each of shape (n_channels,).

    Raises
    ------
    ModelError
        If they are unknown, or none, or name what is no channel.
    """
    names = [channel.name for channel in (*block.inputs, *block.outputs)]
    n_in = len(block.inputs)
    for bounds, allowed in ((serving.limits, names), (serving.safe, names[n_in:])):
        if strange := sorted(set(bounds) - set(allowed)):
            raise ModelError(
                "the model has no such channel",
                channel=strange[0],
                remedy=f"name one of {', '.join(allowed)}",
            )

    low, high = np.full(len(names), -np.inf), np.full(len(names), np.inf)
    low[:n_in], high[:n_in] = block.known_inputs.T
    low[n_in:], high[n_in:] = block.reachable()
    for k, name in enumerate(names):
        if name in serving.limits:
            low[k], high[k] = serving.limits[name]
    unknown = [n for n, a, b in zip(names, low, high, strict=True) if not np.isfinite(b - a)]
    if unknown:
        raise ModelError(
            f"the model has no limits of {', '.join(unknown)}",
            parameter="limits",
            remedy=f"give them for each, `limits[{unknown[0]}]=LOW:HIGH`",
        )
    for name, a, b in zip(names, low, high, strict=True):
        if not a < b:
            raise ModelError(
                f"its limits are {a:g} and {b:g}", channel=name, remedy="give the lower one first"
            )

    safe = low.copy()
    for k, name in enumerate(names[n_in:], start=n_in):
        safe[k] = serving.safe.get(name, low[k])
        if not low[k] <= safe[k] <= high[k]:
            raise ModelError(
                f"its safe value is {safe[k]:g}, beyond its limits {low[k]:g} to {high[k]:g}",
                channel=name,
                remedy="give one within",
            )
    return low, high, safe


def served(
    block: Block, content: Mapping[str, Any], serving: Serving, period: float | None
) -> dict[str, Any]:
    """Return the template values of a served model, in addition to those of the model.

    Raises
    ------
    ModelError
        If settings will not do, or the channels are too many for a frame.
    """
    ticks = _ticks(serving, period)
    assert period is not None
    single, n_in, n = content["single"], len(block.inputs), len(block.inputs) + len(block.outputs)
    if n * content["bytes"] + OVERHEAD > ROOM:
        raise ModelError(
            f"{n} channels do not fit into a frame of the serial link",
            remedy="export in single precision, `single`, or fewer channels",
        )

    bounds = [[literal(value, single=single) for value in each] for each in limits(block, serving)]
    ports = (*content["inputs"], *content["outputs"])
    channels = [
        port | {"low": low, "high": high, "safe": safe}
        for port, low, high, safe in zip(ports, *bounds, strict=True)
    ]
    about: dict[str, Any] = {
        "fingerprint": "",
        "period": round(1e6 * period) / 1e6,
        "silence": ticks,
        "numbers": "float32" if single else "float64",
        "n_memory": content["n_memory"] if content["n_memory"] <= MOST_NUMBERS else 0,
        "n_missable": n_in - content["n_needed"],
        "inputs": [_port(channel, single) for channel in channels[:n_in]],
        "outputs": [_port(channel, single) for channel in channels[n_in:]],
    }
    server = about | {"microseconds": round(1e6 * period), "channels": channels}
    return {
        "served": server | _identity(content, server, about),
        "shared": [*content["shared"], *SERVER],
        "sources": [*content["sources"], SERVER[0].name, f"{content['name']}_server.c"],
    }


def _identity(
    content: Mapping[str, Any], server: Mapping[str, Any], about: dict[str, Any]
) -> dict[str, Any]:
    """Return the fingerprint of the code, and the description of the device that has it.

    The fingerprint is a digest of the code and the description without it; ``about`` is then complete.
    """
    blank = {**content, "served": {**server, "about": [], "fingerprint_bytes": ""}}
    texts = [render("mckibben.exporting.c", file, blank) for file in ("model.c.j2", "server.c.j2")]
    digest = hashlib.sha256("\n".join([*texts, json.dumps(about)]).encode()).digest()[:8]
    about["fingerprint"] = digest.hex()
    text = json.dumps(about, separators=(",", ":"))
    if len(text) > MOST_NUMBERS:
        n = len(server["channels"])
        raise ModelError(f"{n} channels are too many to describe", remedy="export fewer channels")
    return {
        "fingerprint": digest.hex(),
        "fingerprint_bytes": ", ".join(f"0x{byte:02X}" for byte in digest),
        "about": [json.dumps(text[k : k + 80]) for k in range(0, len(text), 80)],
        "link.json": json.dumps(about, indent=2) + "\n",
    }


def _port(channel: Mapping[str, str], single: bool) -> dict[str, Any]:
    """Return a channel as in ``link.json``, with the device's numbers."""
    kind = np.float32 if single else np.float64
    numbers = {key: float(kind(channel[key].rstrip("f"))) for key in ("low", "high", "safe")}
    unit = "" if channel["unit"] == "1" else channel["unit"]
    return {"name": channel["name"], "unit": unit, **numbers}


def _ticks(serving: Serving, period: float | None) -> int:
    """Return the number of silent ticks after which the watchdog acts."""
    step = period or 0.0
    longest = 1e-6 * MOST_MICROSECONDS
    require(1 <= 1e6 * step <= MOST_MICROSECONDS, "sample_time", period, f"1e-6 to {longest:.0f} s")
    ticks = serving.watchdog / step if math.isfinite(serving.watchdog) else math.inf
    longest = step * MOST_TICKS
    require(1 <= ticks <= MOST_TICKS, "watchdog", serving.watchdog, f"{step:g} to {longest:g} s")
    return math.floor(ticks + 1e-9)


def served_files(content: Mapping[str, Any]) -> dict[str, str]:
    """Return the files of the server, text by path, in addition to those of the model."""
    name, server = content["name"], content["served"]
    files = {
        f"src/{name}_server.h": "server.h.j2",
        f"src/{name}_server.c": "server.c.j2",
        "examples/link_posix.c": "link_posix.c.j2",
        "examples/link_mps2.c": "link_mps2.c.j2",
    }
    return {
        **{path: render("mckibben.exporting.c", file, content) for path, file in files.items()},
        "link.json": server["link.json"],
    }
