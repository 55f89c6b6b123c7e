"""Measure everything that recordings tell about a muscle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mckibben.arrays import Array
from mckibben.characterization.beside import alone, effects, levelled, moves, of_one_zero
from mckibben.characterization.evidence import evidence
from mckibben.characterization.loops import (
    Loop,
    largest_of,
    loops_of,
    pooled_curves,
    unexplained,
)
from mckibben.characterization.mean_curve import mean_curve
from mckibben.characterization.memory import dead_zones, minor_loop_errors
from mckibben.characterization.results import Characterization
from mckibben.characterization.time_effects import creep, drift, rate_dependence
from mckibben.characterization.tracks import Scale, Track, prepare
from mckibben.errors import DataError
from mckibben.recording import Recording
from mckibben.signals.reversals import whole_cycles

JOULE_PER_SQUARE_METRE = 100.0
"""1 bar mm is 1e5 Pa times 1e-3 m."""

SHAPE = (
    *("loop_width", "mid_width", "asymmetry", "width_centroid", "loop_area", "loop_area_share"),
    *("loss_per_area", "dead_zone_upper", "dead_zone_lower", "gain", "onset", "saturation"),
    *("branch_gap", "creep", "creep_time", "drift", "rate_dependence"),
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

    Parameters
    ----------
    recordings : Recording or sequence of Recording
        One muscle; every recording starts with unknown memory.
    input, output : str
        Channels.
    beside : sequence of str
        Other inputs that move the output, such as a load: only stretches in which they rest are
        looked at.

    Returns
    -------
    Characterization

    Raises
    ------
    DataError
        On no recordings, a missing or constant channel, units that differ between recordings, fewer
        than ten samples, or an input that never moves while those beside rest.

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
    runs = [recordings] if isinstance(recordings, Recording) else list(recordings)
    n_recordings = len(runs)
    assumed = []
    beside = [name for name in beside if runs and moves(runs, name)]
    moved = effects(runs, input, output, beside) if beside else ()
    ends: tuple[float, float] | None = None
    if beside:
        runs, said = alone(runs, input, beside)
        assumed.append(said)
        ends = (
            min(float(one[output].min()) for one in runs),
            max(float(one[output].max()) for one in runs),
        )
        runs = levelled(runs, input, output)
    else:
        runs, said = of_one_zero(runs, input, output)
        assumed += [said] * bool(said)
    scale, tracks = prepare(runs, input, output)
    units = tuple(_unit(runs, channel) for channel in (input, output))
    loops = loops_of(tracks, scale)
    largest = largest_of(loops)
    curves = _branch_curves(tracks, largest, scale)
    curve = mean_curve(*curves, scale)
    if (left := unexplained(tracks, *curves)) is not None and left > OWN_WAY:
        curve = replace(curve, onset=None, saturation=None)
    upper, lower = dead_zones(tracks, scale)
    closure, wiping_out = minor_loop_errors(tracks, scale)
    crept, creep_time = creep(tracks, scale)
    slope, verdict = rate_dependence(loops)
    seen = evidence(tracks, scale)
    durations = [run.duration for run in runs]
    steps = {run.sample_time for run in runs}
    area = None if largest is None else largest.area
    found = Characterization(
        input=input,
        output=output,
        input_unit=units[0],
        output_unit=units[1],
        n_recordings=n_recordings,
        n_samples=sum(len(run) for run in runs),
        n_cycles=sum(len(whole_cycles(track.u, track.major_turns)) for track in tracks),
        n_reversals=sum(track.turns.size - 2 for track in tracks),
        duration=None if None in durations else float(sum(d for d in durations if d is not None)),
        sample_time=steps.pop() if len(steps) == 1 else None,
        input_range=(scale.u_low, scale.u_high),
        output_range=ends or (scale.y_low, scale.y_high),
        input_noise=None if np.isnan(scale.u_noise) else scale.u_noise,
        output_noise=None if np.isnan(scale.y_noise) else scale.y_noise,
        cycles=tuple(loop.cycle for loop in loops),
        loop_width=None if largest is None else largest.cycle.width,
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
        branch_gap=None if beside else curve.gap,  # stretches that only rise have an offset, too
        creep=crept,
        creep_time=creep_time,
        drift=drift(loops),
        rate_dependence=slope,
        rate_verdict=verdict,
        closure_error=closure,
        wiping_out_error=wiping_out,
        p_dependence=seen.dependence,
        p_loop=seen.loop,
        widest_gap=None if seen.widest is None else seen.widest * scale.y_span,
        drift_excluded=sum(track.major_turns.size - 1 for track in tracks) > 2,
        n_stretches=len(runs) if beside else None,
        falls=scale.sign < 0 and (curve.gain is None or curve.gain < 0),
        effects=moved,
        assumed=tuple(assumed),
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
