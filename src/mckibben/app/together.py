"""What keeps the recordings in use from being fitted together."""

from __future__ import annotations

from collections.abc import Mapping

from mckibben.app.desk import Desk
from mckibben.app.fields import READING
from mckibben.comparison.channels import recognised
from mckibben.recording import Recording

Kinds = dict[tuple[str, ...], list[str]]
"""By their channels, the names of recordings."""


def kinds(used: Mapping[str, Recording]) -> Kinds:
    """Return recordings by the channels that they have, most first."""
    found: Kinds = {}
    for name, recording in used.items():
        found.setdefault(tuple(sorted(recording.channels)), []).append(name)
    return dict(sorted(found.items(), key=lambda kind: -len(kind[1])))


def differing(desk: Desk) -> Kinds:
    """Return the kinds of the recordings in use where that matters, else none.

    Where only counts differ, of levels or cycles, which are without a unit, all are fitted together.
    """
    used, common = desk.workspace.used(), desk.workspace.channels()
    found = kinds(used)
    units = {each: unit for run in used.values() for each, unit in run.units.items()}
    known = set(desk.inputs + desk.outputs) <= set(common)
    if len(found) < 2 or (known and not any(units[each] for each in units.keys() - set(common))):
        return {}
    return found


def sample_times(desk: Desk) -> tuple[float, float] | None:
    """Return the shortest and the longest sample time in use [s]; None where they may be as they are."""
    if len(desk.inputs) > 1 or len(desk.outputs) > 1:
        return None  # models of several muscles take several
    used = desk.workspace.used().values()
    times = [run.sample_time for run in used if run.sample_time is not None]
    if not times or max(times) - min(times) <= 1e-3 * min(times):
        return None
    return min(times), max(times)


def obstacle(desk: Desk) -> str:
    """Return why no model can be fitted to the recordings in use, with the remedy; empty if one can."""
    used = desk.workspace.used()
    if not used:
        return ""
    both = [name for name in desk.inputs if name in desk.outputs]
    missing = set(desk.inputs + desk.outputs).difference(desk.workspace.channels())
    if (both or missing) and len(found := kinds(used)) > 1:
        return f"{_counted(found, used)}: set all kinds but one unused."
    if both:
        return f"{', '.join(both)} would be input and output: choose other channels under Data."
    if missing:
        return f"There is no channel {', '.join(sorted(missing))}: choose others under Data."
    units = {unit for name in desk.outputs for unit in [next(iter(used.values())).units[name]]}
    if len(units) > 1:
        return (
            f"Outputs are in {' and in '.join(sorted(units))}, so that their errors have no mean: "
            "choose outputs of one unit under Data."
        )
    timeless = [name for name, run in used.items() if run.sample_time is None]
    if 0 < len(timeless) < len(used):
        listed = ", ".join(timeless[:4]) + (", …" if len(timeless) > 4 else "")
        return (
            f"Some recordings have time and others have none ({listed}): give these a rate by "
            f"“{READING}” under Data; or, where speed does not matter, say there of the others' time "
            "that it is “(left out)”; or set one kind unused."
        )
    if times := sample_times(desk):
        return (
            f"Recordings have sample times from {times[0]:.4g} to {times[1]:.4g} s, and models of one "
            "muscle need one: bring all to one sample time; or, where speed does not matter, say by "
            f"“{READING}” under Data of every time that it is “(left out)”."
        )
    return ""


def _counted(found: Kinds, used: Mapping[str, Recording]) -> str:
    """Return how many recordings there are of how many muscles, or of which channels."""
    inputs = [
        recognised([used[n] for n in names], list(used[names[0]].channels))[0]
        for names in found.values()
    ]
    told = len({len(each) for each in inputs}) == len(inputs)
    said = []
    for number, ((channels, names), given) in enumerate(zip(found.items(), inputs, strict=True)):
        runs = f"{len(names)} recording{'s' * (len(names) > 1)}" if not number else f"{len(names)}"
        muscles = "one muscle" if len(given) == 1 else f"{len(given)} muscles"
        said.append(f"{runs} of {muscles if told else ', '.join(channels)}"[:200])
    return "; ".join(said[:4]) + ("; …" if len(said) > 4 else "")
