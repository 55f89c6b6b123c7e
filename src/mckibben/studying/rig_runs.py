"""Commands of rigs from text, and recording of whole protocols to a folder."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mckibben import registry
from mckibben.errors import DataError
from mckibben.recording import Recording
from mckibben.rigs.files import rig_names
from mckibben.rigs.recording import record
from mckibben.rigs.rig import Rig, load_rig
from mckibben.signals import build, settings_of
from mckibben.signals.protocol import Protocol, Scaled, protocol, scaling
from mckibben.system import ordinary
from mckibben.system.atomic import to_json, write_text, written


def catalogue() -> dict[str, Any]:
    """Return the rigs, their protocols, and the available signals."""
    rigs = {name: load_rig(name) for name in rig_names()}
    plans = {name: protocol(name) for name in registry.names("protocols")}
    signals = {name: settings_of(name) for name in registry.names("signals")}
    fields = ("title", "version", "inputs", "outputs")
    return {
        "rigs": {name: {key: getattr(rig, key) for key in fields} for name, rig in rigs.items()},
        "protocols": {
            name: {"rig": plan.rig, "runs": len(plan.runs), "source": plan.source}
            for name, plan in plans.items()
        },
        "signals": {
            name: {key: kind for key, (kind, _) in settings.items()}
            for name, settings in signals.items()
        },
    }


def commands(
    rig: Rig, signals: Sequence[str], duration: float, rate: float | None, seed: int
) -> Recording:
    """Return commands for a rig from signals, as ``pressure=triangle:period=10,high=5``.

    Parameters
    ----------
    signals : sequence of str
        By default of the first input; low and high are by default the ends of the input's range.
    duration : float
        [s].
    rate : float, optional
        Samples per second; default the rig's.

    Raises
    ------
    DataError
        On an unknown channel, signal or setting, or too many samples.
    """
    rate = 1 / rig.sample_time if rate is None else rate
    if not (0 < duration < 1e6 and 0 < rate <= 1e5 and duration * rate >= 1):
        raise DataError(
            f"{duration:g} s at {rate:g} samples a second cannot be recorded",
            remedy="give a `duration` up to 1e6 and a `rate` up to 1e5, and at least two samples",
        )
    time = np.arange(round(duration * rate) + 1) / rate
    channels = {}
    for item in signals:
        channel, kind, settings = _signal_of(item, rig)
        limits = rig.limits(channel)
        defaults = {"low": limits.low, "high": limits.high, "peaks": limits.high, "seed": seed}
        taken = {key: defaults[key] for key in settings_of(kind) if key in defaults}
        channels[channel] = build(kind, time, **taken | settings)
    return Recording(channels, 1 / rate)


def _signal_of(text: str, rig: Rig) -> tuple[str, str, dict[str, Any]]:
    """Return channel, kind and settings of a signal, such as ``pressure=triangle:period=10,high=5``."""
    head, _, tail = text.partition(":")
    channel, equals, kind = head.rpartition("=")
    channel = channel if equals else rig.inputs[0]
    if channel not in rig.inputs:
        raise DataError(
            f"the rig {rig.name!r} has no input {channel!r}",
            parameter="signal",
            remedy=f"use one of {', '.join(rig.inputs)}",
        )
    settings: dict[str, Any] = {}
    for pair in filter(None, tail.split(",")):
        key, equals, value = pair.partition("=")
        if not (key and equals and value):
            raise DataError(
                f"{pair!r} is not of the form SETTING=VALUE",
                parameter="signal",
                remedy="write for instance triangle:period=10,high=5.5",
            )
        settings[key.replace("-", "_")] = value
    return channel, kind, settings


def at_first_commands(rig: Rig, commands: Recording) -> Rig:
    """Return a rig at rest at the first commands, unless it has its own start."""
    if rig.start:
        return rig
    limits = {name: rig.limits(name) for name in rig.inputs if name in commands}
    starts = {
        f"start.{name}": min(max(float(commands[name][0]), limit.low), limit.high)
        for name, limit in limits.items()
    }
    return rig.changed(starts)


def record_protocol(
    name: str,
    folder: Path,
    *,
    rig: str | None = None,
    changes: Mapping[str, Any] | None = None,
    only: str | None = None,
    seed: int = 0,
    jobs: int | None = None,
    force: bool = False,
    progress: Callable[[float, str], None] | None = None,
) -> tuple[list[str], list[str], list[Scaled]]:
    """Record a protocol to a folder: one file per run, and ``protocol.json``.

    Returns
    -------
    (list of str, list of str, list of Scaled)
        Runs recorded, runs that were there already, and how levels were scaled for the rig.

    Raises
    ------
    DataError
        If the folder holds another protocol, rig or seed, or files of the user's without ``force``.
    """
    from mckibben.files import write
    from mckibben.files.own import is_own
    from mckibben.outputs import claim

    plant = load_rig(rig or protocol(name).rig).changed(changes or {})
    plan = protocol(name, plant)
    runs = _runs_named(plan, only)
    text, protocol_file = to_json(_roles(plan, plant, seed)) + "\n", folder / "protocol.json"
    _require_same_protocol(protocol_file, text)
    files = {run: folder / f"{run}.csv" for run in runs}
    earlier = [run for run, file in files.items() if is_own(file)]
    with written(folder):
        folder.mkdir(parents=True, exist_ok=True)
    missing = [run for run in runs if run not in earlier]
    for run in missing:
        claim(files[run], inputs=[Path(rig or "")], force=force)
    write_text(protocol_file, text)
    recorded = record(plan, plant, runs=missing, seed=seed, jobs=jobs)
    for count, (planned, recording) in enumerate(recorded, start=1):
        write(recording, files[planned.name])
        if progress is not None:
            progress(count / len(missing), planned.name)
    return missing, earlier, scaling(name, plant)


def _runs_named(plan: Protocol, only: str | None) -> list[str]:
    """Return the runs of a protocol with a text in their name; all where there is no text."""
    runs = [run.name for run in plan.runs if only is None or only in run.name]
    if not runs:
        examples = ", ".join(run.name for run in plan.runs[:5])
        problem = f"no run of {plan.name!r} has {only!r} in its name"
        raise DataError(problem, parameter="only", remedy=f"there are {examples}, ...")
    return runs


def _require_same_protocol(file: Path, text: str) -> None:
    """Raise an error if a folder has the description of another protocol, rig or seed."""
    if os.path.lexists(file) and ordinary.read_text(file, most=ordinary.DESCRIPTION) != text:
        raise DataError(
            "the folder holds another protocol, rig or seed",
            file=file,
            remedy="give another folder, or remove this one",
        )


def _roles(plan: Protocol, rig: Rig, seed: int) -> dict[str, Any]:
    return {
        "protocol": plan.name,
        "source": plan.source,
        "notes": plan.notes,
        "seed": seed,
        "rig": rig.model_dump(mode="json"),
        "runs": [
            {
                "name": run.name,
                "file": f"{run.name}.csv",
                "role": run.role,
                "labels": dict(run.labels),
                "settings": dict(run.settings),
            }
            for run in plan.runs
        ],
    }
