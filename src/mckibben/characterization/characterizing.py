"""Measure everything that recordings tell about a muscle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mckibben.arrays import Array
from mckibben.characterization.beside import (
    alone,
    effects,
    levelled,
    moves,
    of_one_zero,
    without,
)
from mckibben.characterization.evidence import evidence
from mckibben.characterization.levels import conditions, levels_of
from mckibben.characterization.loops import (
    Cycle,
    Loop,
    largest_of,
    loops_of,
    pooled_curves,
    unexplained,
)
from mckibben.characterization.mean_curve import mean_curve
from mckibben.characterization.memory import dead_zones, minor_loop_errors
from mckibben.characterization.results import Characterization, Level
from mckibben.characterization.time_effects import creep, drift, rate_dependence
from mckibben.characterization.tracks import Scale, Track, prepare
from mckibben.characterization.wording import resting
from mckibben.errors import DataError
from mckibben.recording import Recording, listed
from mckibben.signals.reversals import whole_cycles

JOULE_PER_SQUARE_METRE = 100.0
"""1 bar mm is 1e5 Pa times 1e-3 m."""

SHAPE = (
    *(
        "loop_width",
        "repeated_width",
        "mid_width",
        "asymmetry",
        "width_centroid",
        "loop_area",
        "loop_area_share",
    ),
    *("loss_per_area", "dead_zone_upper", "dead_zone_lower", "gain", "onset", "saturation"),
    *("branch_gap", "creep", "creep_time", "drift", "rate_dependence", "speeds"),
    *("closure_error", "wiping_out_error"),
)
"""What nothing is known of where the output does not depend on the input."""

OWN_WAY = 0.5
"""Share of its variance by which an output goes its own way, as in resonance: no flat end is told."""

COVERED = 0.8
"""Share of the input range that one cycle must cover to speak for all."""


def characterize(
    recordings: Recording | Sequence[Recording],
    input: str = "pressure",  # noqa: A002
    output: str = "displacement",
    *,
    beside: Sequence[str] = (),
) -> Characterization:
    """Measure what a muscle does: width and shape of its loop, memory, creep, dependence on rate.

    Sensor noise is averaged away first, over samples within which the input moves by no more than
    half a percent of its range. Ranges are those of all recordings together. What the recordings
    cannot tell is None: widths without a whole cycle, rates and creep without time, and all of it where
    the output does not depend on the input by more than noise would give, tested at a level of 1 %.
    Recordings that rest at different outputs are counted from a zero of their own, which is said.

    Where every recording holds other inputs, such as a length or a load, every level has a loop of its
    own: told is that at which the output moves most, beside all of them. Where others move, told are the
    stretches in which they rest; where none tells, what is left without their effect.

    Parameters
    ----------
    recordings : Recording or sequence of Recording
        One muscle; every recording starts with unknown memory.
    input, output : str
        Channels.
    beside : sequence of str
        Other inputs that move the output, such as a load. Channels that every recording holds, not all
        of them alike, are among them unasked.

    Returns
    -------
    Characterization

    Raises
    ------
    DataError
        On no recordings, a missing or constant channel, units that differ between recordings, fewer
        than ten samples, or an input that moves only together with those beside.

    Examples
    --------
    >>> import numpy as np
    >>> from mckibben import Recording
    >>> from mckibben.signals import triangle
    >>> pressure = triangle(np.arange(401) / 100, period=2.0, peaks=4.0)
    >>> lag = 0.5 * np.sign(np.gradient(pressure))
    >>> run = Recording({"pressure": pressure, "displacement": pressure - lag}, 0.01)
    >>> found = characterize(run)
    >>> found.n_cycles, round(found.mid_width, 6)
    (2, 1.0)
    """
    runs = listed(recordings)
    told = dict.fromkeys((*beside, *conditions(runs, (input, output))))
    others = [name for name in told if moves(runs, name)]
    levels = levels_of(runs, input, output, others)
    runs, zeros = of_one_zero(runs, input, output, levels)
    if not others:
        return _measured(runs, zeros, input, output)
    moved = effects(runs, input, output, others)
    if levels:
        found = _by_level(runs, levels, others, zeros, input, output)
    elif rested := alone(runs, input, others):
        share = sum(map(len, rested)) / sum(map(len, runs))
        said = f"Told where {resting(others)}, {100 * share:.0f} % of the samples."
        found = replace(
            _measured(levelled(rested, input, output), said, input, output),
            output_range=_ends(rested, output),
            branch_gap=None,  # stretches that only rise have an offset, too
            n_stretches=len(rested),
        )
    elif moved:
        said = (
            f"As {input} never moves while {resting(others)}, the loop is what is left when the effect "
            f"of {' and '.join(others)} by straight lines is taken away: what bends of it, or "
            "remembers, is in the loop."
        )
        left, zeros = of_one_zero(without(runs, output, moved), input, output, [range(len(runs))])
        found = _measured(left, " ".join(filter(None, (zeros, said))), input, output)
    else:
        raise DataError(
            f"it never moves while {resting(others)}, so that what it does alone cannot be told",
            file=runs[0].source,
            channel=input,
            remedy="record one in which it moves alone; models of several inputs need no such recording",
        )
    return replace(found, n_recordings=len(runs), effects=moved)


def _by_level(
    runs: Sequence[Recording],
    levels: Sequence[Sequence[int]],
    others: Sequence[str],
    zeros: str,
    given: str,
    wanted: str,
) -> Characterization:
    """Return what is found where the output moves most, beside all levels that recordings hold."""
    found = []
    for places in levels:
        here = [runs[k] for k in places]
        one = _measured(here, "", given, wanted)
        cycles = tuple(replace(each, recording=places[each.recording]) for each in one.cycles)
        at = (float(np.mean([run[name].mean() for run in here])) for name in others)
        units = (here[0].units[name] for name in others)
        held = tuple(zip(others, at, units, strict=True))
        found.append(Level(held, replace(one, cycles=cycles)))
    each = [level.found for level in found]
    most = max(found, key=lambda level: (level.found.depends, level.found.output_span))
    durations = [one.duration for one in each]
    steps = {one.sample_time for one in each}
    where = f"Told where {resting(others)} at {most.at}, the level at which {wanted} moves most."
    return replace(
        most.found,
        n_samples=sum(one.n_samples for one in each),
        n_cycles=sum(one.n_cycles for one in each),
        n_reversals=sum(one.n_reversals for one in each),
        duration=None if None in durations else float(sum(d for d in durations if d is not None)),
        sample_time=steps.pop() if len(steps) == 1 else None,
        input_range=_ends(runs, given),
        output_range=_ends(runs, wanted),
        cycles=tuple(sorted((cycle for one in each for cycle in one.cycles), key=_place)),
        levels=tuple(found),
        assumed=(*([zeros] if zeros else []), where),
    )


def _place(cycle: Cycle) -> int:
    return cycle.recording


def _ends(runs: Sequence[Recording], channel: str) -> tuple[float, float]:
    """Return the lowest and the highest value in recordings."""
    seen = [run[channel] for run in runs]
    return float(min(x.min() for x in seen)), float(max(x.max() for x in seen))


def _measured(runs: Sequence[Recording], said: str, given: str, wanted: str) -> Characterization:
    """Return what is found in recordings in which nothing else moves, and a sentence on them."""
    scale, tracks = prepare(runs, given, wanted)
    units = tuple(_unit(runs, channel) for channel in (given, wanted))
    loops = loops_of(tracks, scale)
    repeats = largest_of(loops)
    largest = repeats[(len(repeats) - 1) // 2] if repeats else None
    curves = _branch_curves(tracks, largest, scale)
    curve = mean_curve(*curves, scale)
    if (left := unexplained(tracks, *curves)) is not None and left > OWN_WAY:
        curve = replace(curve, onset=None, saturation=None)
    upper, lower = dead_zones(tracks, scale)
    closure, wiping_out = minor_loop_errors(tracks, scale)
    crept, creep_time = creep(tracks, scale)
    rate = rate_dependence(loops)
    seen = evidence(tracks, scale)
    durations = [run.duration for run in runs]
    steps = {run.sample_time for run in runs}
    area = None if largest is None else largest.area
    found = Characterization(
        input=given,
        output=wanted,
        input_unit=units[0],
        output_unit=units[1],
        n_recordings=len(runs),
        n_samples=sum(len(run) for run in runs),
        n_cycles=sum(len(whole_cycles(track.u, track.major_turns)) for track in tracks),
        n_reversals=sum(track.turns.size - 2 for track in tracks),
        duration=None if None in durations else float(sum(d for d in durations if d is not None)),
        sample_time=steps.pop() if len(steps) == 1 else None,
        input_range=(scale.u_low, scale.u_high),
        output_range=(scale.y_low, scale.y_high),
        input_noise=None if np.isnan(scale.u_noise) else scale.u_noise,
        output_noise=None if np.isnan(scale.y_noise) else scale.y_noise,
        cycles=tuple(loop.cycle for loop in loops),
        loop_width=None if largest is None else largest.cycle.width,
        repeated_width=(
            (repeats[0].cycle.width, repeats[-1].cycle.width) if len(repeats) > 1 else None
        ),
        mid_width=None if largest is None else largest.mid_width,
        asymmetry=None if largest is None else largest.asymmetry,
        width_centroid=None if largest is None else largest.width_centroid,
        loop_area=area,
        loop_area_share=(
            None
            if largest is None
            else 100 * largest.area / (largest.cycle.amplitude * largest.span)
        ),
        loss_per_area=(
            JOULE_PER_SQUARE_METRE * area if area is not None and units == ("bar", "mm") else None
        ),
        dead_zone_upper=upper,
        dead_zone_lower=lower,
        gain=curve.gain,
        onset=curve.onset,
        saturation=curve.saturation,
        branch_gap=curve.gap,
        creep=crept,
        creep_time=creep_time,
        drift=drift(loops),
        rate_dependence=rate.growth,
        rate_verdict=rate.verdict,
        speeds=rate.speeds,
        closure_error=closure,
        wiping_out_error=wiping_out,
        p_dependence=seen.dependence,
        p_loop=seen.loop,
        widest_gap=None if seen.widest is None else seen.widest * scale.y_span,
        drift_excluded=sum(track.major_turns.size - 1 for track in tracks) > 2,
        falls=scale.sign < 0 and (curve.gain is None or curve.gain < 0),
        assumed=(said,) if said else (),
    )
    if found.depends:
        return found
    blank = replace(found, cycles=(), rate_verdict="unknown")
    return replace(blank, **dict.fromkeys(SHAPE))  # type: ignore[arg-type]  # all of them may be None


def _branch_curves(
    tracks: Sequence[Track], largest: Loop | None, scale: Scale
) -> tuple[Array, Array, Array]:
    """Return the curves of the largest cycle where it covers the input range, else those of all."""
    if largest is not None and largest.cycle.amplitude >= COVERED * scale.u_span:
        return largest.levels, largest.up, largest.down
    return pooled_curves(tracks, scale)


def _unit(runs: Sequence[Recording], channel: str) -> str:
    units = {run.units[channel] for run in runs}
    if len(units) > 1:
        raise DataError(
            f"recordings have it in different units: {', '.join(sorted(units))}",
            channel=channel,
            remedy="convert them, or read the files with --unit",
        )
    return units.pop()
