"""Characterization in numbers: a table that explains itself."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mckibben.characterization.wording import spanning

if TYPE_CHECKING:
    from mckibben.characterization.results import Characterization

Row = tuple[str, float | int | str | None, str, str]


def table(found: Characterization) -> list[Row]:
    """Return rows of quantity, value, unit and explanation."""
    u, y = found.input_unit, found.output_unit
    gain = f"{y}/{u}" if u else y
    area = " ".join(part for part in (u, y) if part)
    step = found.sample_time
    return [
        ("recordings", found.n_recordings, "", "files or segments looked at"),
        ("stretches", found.n_stretches, "", "of them, those in which all other inputs rest"),
        ("samples", found.n_samples, "", "looked at in all"),
        ("duration", found.duration, "s", "looked at in all; none without time"),
        ("sample time", step, "s", "none where unknown or not the same everywhere"),
        (
            "cycles" if found.n_stretches is None else "cycles while other inputs rest",
            found.n_cycles,
            "",
            "whole ones over at least a tenth of the input range",
        ),
        (
            "reversals",
            found.n_reversals,
            "",
            "where the input turns back by 1 % of its range or more, minor loops too",
        ),
        (f"lowest {found.input}", found.input_range[0], u, "input range"),
        (f"highest {found.input}", found.input_range[1], u, "input range"),
        (f"lowest {found.output}", found.output_range[0], y, "output range"),
        (f"highest {found.output}", found.output_range[1], y, "output range"),
        (f"noise of {found.input}", found.input_noise, u, "standard deviation of a sample"),
        (f"noise of {found.output}", found.output_noise, y, "standard deviation of a sample"),
        (
            "chance that noise looks so dependent",
            _chance(found.p_dependence),
            "",
            "p-value: how likely noise alone makes the output depend on the input as much",
        ),
        (
            "chance that noise looks so much like a loop",
            _chance(found.p_loop),
            "",
            "p-value: the same of the input's direction, beside a curve without memory",
        ),
        (
            "largest gap that noise hides",
            None if found.has_loop else found.widest_gap,
            y,
            "where no loop is found, branches may be as far apart on average all the same",
        ),
        (
            "loop width e_w",
            found.loop_width,
            "%",
            "of the largest cycle: distance of its branches at mid input over its output range; of "
            "several recordings the median",
        ),
        *_ends(
            ("e_w of the narrowest repeat", "e_w of the widest repeat"),
            found.repeated_width,
            "%",
            "of the largest cycles of several recordings",
        ),
        ("width at mid input", found.mid_width, y, "the same distance in units of the output"),
        (
            "mean branch gap",
            found.branch_gap,
            y,
            "same input reached from above and from below: mean difference of the output",
        ),
        (
            "asymmetry",
            found.asymmetry,
            "%",
            "distance of the loop from its image turned by half a turn; 0 for a classical "
            "Prandtl-Ishlinskii model",
        ),
        (
            "where the loop is widest",
            found.width_centroid,
            "",
            "on average over its width: −1 at low, 0 at mid, 1 at high input",
        ),
        ("loop area", found.loop_area, area, "enclosed by the largest cycle"),
        (
            "loop area share",
            found.loop_area_share,
            "%",
            "of the rectangle round the loop: 0 no hysteresis, 100 a relay",
        ),
        (
            "loss per effective area",
            found.loss_per_area,
            "J/m²",
            "the loop area as work lost in a cycle; times the effective area it is an energy",
        ),
        (
            "dead zone after upper reversals",
            found.dead_zone_upper,
            u,
            "input change before the output moves back; 2 r for a play operator of radius r",
        ),
        ("dead zone after lower reversals", found.dead_zone_lower, u, "the same from below"),
        ("gain", found.gain, gain, "slope of the mean of both branches at mid input"),
        *(
            (
                f"effect of {one.channel}",
                one.change,
                y,
                f"change of the output as it goes {spanning((one.low, one.high), one.unit)} at equal "
                "input, by one straight line",
            )
            for one in found.effects
        ),
        *(row for level in found.levels for row in _level_rows(level.found, level.at, gain)),
        ("onset", found.onset, u, "below it the slope is under a fifth of its maximum"),
        ("saturation", found.saturation, u, "above it the slope is under a fifth of its maximum"),
        ("creep", found.creep, y, "in a hold of the input; positive: it goes on as it was going"),
        ("creep time", found.creep_time, "s", "the time over which it crept so far"),
        ("drift", found.drift, y, "change of the output from one cycle to the next alike"),
        ("rate dependence", found.rate_dependence, "%", "growth of e_w at twice the speed"),
        *_ends(
            ("slowest compared", "fastest compared"),
            found.speeds,
            f"{u}/s".lstrip("/"),
            "mean speed of the input in cycles alike",
        ),
        ("rate verdict", found.rate_verdict, "", "from cycles alike at different speed"),
        (
            "closure error",
            found.closure_error,
            "%",
            "return-point memory: output after a minor loop, of 5 % of the input range or more, "
            "against output before it",
        ),
        (
            "wiping-out error",
            found.wiping_out_error,
            "%",
            "output beyond a minor loop against that without one",
        ),
    ]


def _ends(
    names: tuple[str, str], ends: tuple[float, float] | None, unit: str, meaning: str
) -> list[Row]:
    """Return a row of either end, of what is known."""
    return [(name, end, unit, meaning) for name, end in zip(names, ends or (), strict=False)]


def _level_rows(found: Characterization, at: str, unit: str) -> tuple[Row, Row]:
    return (
        (f"loop width at {at}", found.loop_width, "%", "e_w of the largest cycle there"),
        (f"gain at {at}", found.gain, unit, "slope at mid input there"),
    )


def _chance(p: float | None) -> float | str | None:
    """Return a p-value, without figures that no test has."""
    return "< 0.001" if p is not None and p < 0.001 else p
