"""Recordings that cannot be modelled together as they are, and what makes them alike."""

from __future__ import annotations

from dataclasses import replace

from mckibben.app.steps import Step
from mckibben.app.workspace import Workspace


def pairs(workspace: Workspace) -> list[tuple[str, ...]]:
    """Return recordings in use that may be channels of one run, in the order of their names.

    They are as long, at one rate, without a channel twice, and each has its other.
    """
    sizes: dict[tuple[int, float | None], dict[tuple[str, ...], list[str]]] = {}
    for name, run in sorted(workspace.used().items()):
        kinds = sizes.setdefault((len(run), run.sample_time), {})
        kinds.setdefault(tuple(run.channels), []).append(name)
    found: list[tuple[str, ...]] = []
    for kinds in sizes.values():
        channels = [channel for kind in kinds for channel in kind]
        as_many = len({len(names) for names in kinds.values()}) == 1
        if len(kinds) > 1 and as_many and len(set(channels)) == len(channels):
            found += zip(*kinds.values(), strict=True)
    return found


def join(workspace: Workspace) -> list[str]:
    """Make one recording of each of `pairs`, in a file of its own, and return their names.

    Channels of later runs are called as those of the first, place by place.
    """
    joined: list[str] = []
    first: dict[str, str] = {}
    for names in pairs(workspace):
        whole, *others = (workspace.recording(name) for name in names)
        for other in others:
            whole = whole.with_channels(other.units, **other.channels)
        first = first or dict(whole.units)
        alike = zip(whole.units.values(), first.values(), strict=False)
        if len(whole.units) == len(first) and all(one in ("", other) for one, other in alike):
            samples = dict(zip(first, whole.channels.values(), strict=True))
            whole = replace(whole, channels=samples, units=first)
        role = workspace.entry(names[0]).role
        joined.append(workspace.add_recording(whole, name="-".join(names), role=role))
        for name in names:
            workspace.remove(name)
    return joined


def sample_times(workspace: Workspace) -> tuple[float, float] | None:
    """Return the shortest and the longest sample time in use [s]; None where they are alike."""
    times = [run.sample_time for run in workspace.used().values() if run.sample_time is not None]
    if not times or max(times) - min(times) <= 1e-3 * min(times):
        return None
    return min(times), max(times)


def resample(workspace: Workspace, step: float) -> None:
    """Resample the recordings in use that have another sample time."""
    for name, run in workspace.used().items():
        if run.sample_time is not None and abs(run.sample_time - step) > 1e-9 * step:
            workspace.do(name, Step(do="resample", sample_time=step))
