"""What characterization finds: plain numbers, a table and sentences."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, fields
from typing import Any, ClassVar

from mckibben.characterization.evidence import LEVEL
from mckibben.characterization.loops import Cycle
from mckibben.system.showing import DrawsItself

Range = tuple[float, float]

NO_GAP = 0.01
"""Branches that are on average at most so far apart, over the output range, are no loop."""


@dataclass(frozen=True)
class Effect:
    """How far another input, such as a load, moves the output at equal input.

    Parameters
    ----------
    channel : str
        The other input.
    low, high : float
        Between which it goes.
    unit : str
        Its unit.
    change : float
        Of the output from low to high [output unit].
    """

    channel: str
    low: float
    high: float
    unit: str
    change: float


@dataclass(frozen=True)
class Level:
    """What a muscle does where other inputs are held.

    Parameters
    ----------
    held : tuple of (str, float, str)
        Their channels, at which level each, and its unit.
    found : Characterization
        Of the recordings that hold them there.
    """

    held: tuple[tuple[str, float, str], ...]
    found: Characterization

    @property
    def at(self) -> str:
        """The level in words, by name where several are held."""
        several = len(self.held) > 1
        return " and ".join(
            f"{f'{name} ' if several else ''}{at:.3g} {unit}".rstrip()
            for name, at, unit in self.held
        )


@dataclass(frozen=True)
class Characterization(DrawsItself):
    """What a muscle does, from recordings alone; None for what they cannot tell.

    ``table()`` explains every number, ``sentences`` says the most important ones in words. Units are
    those of the channels; percentages are of the output range.

    Parameters
    ----------
    input, output, input_unit, output_unit : str
        Channels, and their units.
    n_recordings, n_samples, n_cycles, n_reversals : int
        Whole cycles run from minimum to minimum of the input and over at least a tenth of its
        range; reversals are where it turns, minor loops included.
    duration, sample_time : float or None
        All recordings together [s]; the sample time that they share [s].
    input_range, output_range : (float, float)
        Lowest and highest value.
    input_noise, output_noise : float or None
        Standard deviation of a sample.
    cycles : tuple of Cycle
        Those with enough samples to measure a width.
    loop_width : float or None
        e_w of the largest cycle [%]: of a recording's the last, of several recordings' the median one.
    repeated_width : (float, float) or None
        Of the narrowest and the widest of several recordings' largest cycles [%].
    mid_width : float or None
        Distance of its branches at mid input [output unit].
    asymmetry : float or None
        How far it is from its own image, turned by half a turn [%].
    width_centroid : float or None
        Where it is wide, from -1 (low input) to 1 (high input).
    loop_area, loop_area_share : float or None
        Area that it encloses [input unit x output unit], and that over the rectangle round it [%].
    loss_per_area : float or None
        The area as work lost a cycle and effective area [J/m²], for pressure over displacement.
    dead_zone_upper, dead_zone_lower : float or None
        Change of the input after upper and lower reversals before the output moves [input unit].
    gain : float or None
        Slope at mid input [output unit/input unit].
    onset, saturation : float or None
        Input below, and above, which the output hardly moves [input unit].
    branch_gap : float or None
        Mean distance of falling and rising output at the same input, positive where the output
        lags [output unit].
    creep, creep_time : float or None
        Change of the output in a hold of the input [output unit], and over what time [s].
    drift : float or None
        Change of the output from one cycle to the next alike [output unit].
    rate_dependence : float or None
        Growth of e_w at twice the speed [%].
    rate_verdict : str
        "none", "weak", "strong" or "unknown".
    speeds : (float, float) or None
        Mean speeds between which that is told [input unit/s].
    closure_error, wiping_out_error : float or None
        Return-point memory and wiping-out: how far minor loops fail to close, and to be forgotten
        [%].
    p_dependence, p_loop : float or None
        How likely noise alone would show as much dependence of the output on the input, and on its
        direction beside a curve without memory; None where there are too few samples.
    widest_gap : float or None
        How far apart the branches may be on average for all that the test tells [output unit].
    drift_excluded : bool
        Whether the input went up or down more than once, so that drift over a single cycle is not
        taken for a loop.
    n_stretches : int or None
        Where other inputs rest, of all recordings; None where nothing else moves.
    falls : bool
        Whether the output falls as the input rises.
    effects : tuple of Effect
        What other inputs do.
    levels : tuple of Level
        Those at which recordings hold other inputs. What is told of the loop is then that of the one at
        which the output moves most; numbers and ranges of what was looked at are those of all.
    assumed : tuple of str
        Sentences on what is looked at: where other inputs rest, counted from which zero.
    """

    face: ClassVar[str] = "characterization"

    input: str
    output: str
    input_unit: str
    output_unit: str
    n_recordings: int
    n_samples: int
    n_cycles: int
    n_reversals: int
    duration: float | None
    sample_time: float | None
    input_range: Range
    output_range: Range
    input_noise: float | None
    output_noise: float | None
    cycles: tuple[Cycle, ...]
    loop_width: float | None
    repeated_width: Range | None
    mid_width: float | None
    asymmetry: float | None
    width_centroid: float | None
    loop_area: float | None
    loop_area_share: float | None
    loss_per_area: float | None
    dead_zone_upper: float | None
    dead_zone_lower: float | None
    gain: float | None
    onset: float | None
    saturation: float | None
    branch_gap: float | None
    creep: float | None
    creep_time: float | None
    drift: float | None
    rate_dependence: float | None
    rate_verdict: str
    speeds: Range | None
    closure_error: float | None
    wiping_out_error: float | None
    p_dependence: float | None = None
    p_loop: float | None = None
    widest_gap: float | None = None
    drift_excluded: bool = True
    n_stretches: int | None = None
    falls: bool = False
    effects: tuple[Effect, ...] = ()
    levels: tuple[Level, ...] = ()
    assumed: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return str(self)

    @property
    def has_loop(self) -> bool | None:
        """Whether there is a loop that noise would not give, or no test that says otherwise.

        False only where a loop of any size that matters would have been seen; None where it cannot be
        told.
        """
        if self.p_loop is None or self.p_loop <= LEVEL:
            return True
        seen = self.widest_gap is not None and self.widest_gap <= NO_GAP * self.output_span
        return False if seen else None

    @property
    def depends(self) -> bool:
        """Whether the output depends on the input by more than noise would give, likewise."""
        return self.p_dependence is None or self.p_dependence <= LEVEL or self.has_loop is True

    @property
    def output_span(self) -> float:
        """Range of the output."""
        return self.output_range[1] - self.output_range[0]

    @property
    def sentences(self) -> list[str]:
        """What the muscle does, in plain words, most important first."""
        from mckibben.characterization.wording import sentences

        return sentences(self)

    def table(self) -> list[tuple[str, float | int | str | None, str, str]]:
        """Return rows of quantity, value, unit and explanation."""
        from mckibben.characterization.table import table

        return table(self)

    def to_dict(self) -> dict[str, Any]:
        """Return everything as JSON holds it, with None for what could not be measured."""
        found = {field.name: _plain(getattr(self, field.name)) for field in fields(self)}
        found["cycles"] = [
            {
                "recording": cycle.recording,
                "low": cycle.low,
                "high": cycle.high,
                "amplitude": cycle.amplitude,
                "rate": cycle.rate,
                "width": cycle.width,
            }
            for cycle in self.cycles
        ]
        found["effects"] = [asdict(effect) for effect in self.effects]
        found["levels"] = [
            {"held": {name: at for name, at, _ in one.held}} | one.found.to_dict()
            for one in self.levels
        ]
        found["sentences"] = self.sentences
        return found


def _plain(value: Any) -> Any:
    if isinstance(value, tuple):
        return list(value)
    return None if isinstance(value, float) and not math.isfinite(value) else value
