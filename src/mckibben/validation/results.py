"""What a check of a model finds: plain numbers, and sentences."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

from mckibben.system.showing import ShowsItself
from mckibben.validation.crossing import Crossing
from mckibben.validation.k_step import Ahead
from mckibben.validation.level import LEVEL
from mckibben.validation.patterns import Pattern
from mckibben.validation.residuals import Run
from mckibben.validation.whiteness import Whiteness

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True)
class Finding:
    """Something that a residual follows, or was asked whether it does.

    Parameters
    ----------
    kind : str
        What the model may miss, as `mckibben.validation.suspects.Group` names it.
    channel : str
        The channel by which, or "".
    p_value : float
        How likely noise alone would look so, beside what is missed more.
    share : float
        Of the residual's squares that it explains, 0 to 1, beside what is missed more.
    size : float
        The same as a root mean square, unit of the output.
    coefficient : float or None
        Of what has a single one: the offset, or the delay in samples.
    or_kinds : tuple of str
        What it may be as well, for these recordings do not tell them apart.
    """

    kind: str
    channel: str
    p_value: float
    share: float
    size: float
    coefficient: float | None = None
    or_kinds: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return it for JSON."""
        return {
            "kind": self.kind,
            "channel": self.channel,
            "p_value": self.p_value,
            "share": self.share,
            "size": self.size,
            "coefficient": self.coefficient,
            "or_kinds": list(self.or_kinds),
        }


@dataclass(frozen=True, eq=False)
class OutputCheck:
    """What a model leaves of one output.

    Parameters
    ----------
    output, unit : str
        Channel.
    n_samples : int
        Of all recordings.
    sample_time : float or None
        [s].
    span : float
        Range of the measured output.
    deviation : float
        Of the measured output from its mean, root mean square.
    rmse : float
        Of the free run.
    sensor_noise : float or None
        Standard deviation of the measured output's white noise, from its third differences; None
        where it cannot be told from movement.
    resolution : float
        Smallest step of the measured output.
    whiteness : Whiteness
    crossings : tuple of Crossing
        With every input that moves.
    patterns : tuple of Pattern
        Against inputs, loads, modelled output, rates and branches.
    suspects : tuple of Finding
        All that was asked, each by itself.
    missing : tuple of Finding
        What the model misses, most important first; each beside those before.
    slow : tuple of Finding
        Level and trend that explain much, but that noise as slow as the residual may bring about.
    noise_time : float
        Samples after which noise has forgotten all but a third.
    independent : float
        Independent samples that say as much of a level as all do.
    branch_length : float
        Samples of an input's usual branch.
    every : int
        Samples to a block, of which all tests but that of whiteness see means.
    ahead : tuple of Ahead
        Errors some samples ahead, and free-running.
    n_tests : int
        Tests that the level is shared by.
    large_steps : bool
        Whether an input steps far at once.
    """

    output: str
    unit: str
    n_samples: int
    sample_time: float | None
    span: float
    deviation: float
    rmse: float
    sensor_noise: float | None
    resolution: float
    whiteness: Whiteness
    crossings: tuple[Crossing, ...]
    patterns: tuple[Pattern, ...]
    suspects: tuple[Finding, ...]
    missing: tuple[Finding, ...]
    slow: tuple[Finding, ...]
    noise_time: float
    independent: float
    branch_length: float
    every: int
    ahead: tuple[Ahead, ...]
    n_tests: int
    large_steps: bool

    @property
    def white(self) -> bool:
        """Whether the residual passes for white noise."""
        return self.whiteness.p_value is None or self.whiteness.p_value > LEVEL / self.n_tests

    @property
    def p_branch(self) -> float | None:
        """How likely noise alone would look like hysteresis left, at most over all inputs; or None."""
        values = [one.p_value for one in self.suspects if one.kind == "hysteresis"]
        return min(1.0, len(values) * min(values)) if values else None

    @property
    def exact(self) -> bool:
        """Whether nothing is left but rounding, or the sensor's steps."""
        return self.rmse <= max(ROUNDING * self.span, STEP * self.resolution)

    @property
    def useless(self) -> bool:
        """Whether the mean of the measured output would be off by less."""
        return self.rmse >= self.deviation

    @property
    def right(self) -> bool:
        """Whether nothing is found that the model misses."""
        return self.exact or not (self.missing or self.useless)

    def to_dict(self) -> dict[str, Any]:
        """Return it for JSON."""
        from mckibben.validation.words import sentences

        return {
            "output": self.output,
            "unit": self.unit,
            "n_samples": self.n_samples,
            "sample_time": self.sample_time,
            "range": self.span,
            "deviation": self.deviation,
            "rmse": self.rmse,
            "sensor_noise": self.sensor_noise,
            "resolution": self.resolution,
            "right": self.right,
            "sentences": sentences(self),
            "missing": [one.to_dict() for one in self.missing],
            "slow": [one.to_dict() for one in self.slow],
            "level": LEVEL,
            "n_tests": self.n_tests,
            "p_whiteness": self.whiteness.p_value,
            "p_branch": self.p_branch,
            "suspects": [one.to_dict() for one in self.suspects],
            "whiteness": self.whiteness.to_dict(),
            "crossings": [one.to_dict() for one in self.crossings],
            "patterns": [one.to_dict() for one in self.patterns],
            "errors_ahead": [one.to_dict() for one in self.ahead],
            "independent_samples": self.independent,
            "samples_to_a_block": self.every,
        }


ROUNDING = 1e-9
"""Share of the range up to which a residual is rounding."""

STEP = 0.5
"""Steps of the sensor up to which a residual's root mean square tells nothing."""


@dataclass(frozen=True, eq=False)
class Validation(ShowsItself):
    """Whether a model is right on recordings, and what it misses.

    Parameters
    ----------
    model : str
        Kind of the model.
    recordings : tuple of str
        Names of what it was checked on.
    outputs : tuple of OutputCheck
    notes : tuple of str
        What to know of these recordings.
    runs : tuple of Run
        The recordings, and what the model makes of them; not in ``to_dict``.
    """

    face: ClassVar[str] = "validation"

    model: str
    recordings: tuple[str, ...]
    outputs: tuple[OutputCheck, ...]
    notes: tuple[str, ...] = ()
    runs: tuple[Run, ...] = field(default=(), repr=False)

    @property
    def right(self) -> bool:
        """Whether nothing is found that the model misses."""
        return all(one.right for one in self.outputs)

    @property
    def verdict(self) -> str:
        """Whether the model is right, in a sentence."""
        from mckibben.validation.words import verdict

        return verdict(self)

    @property
    def sentences(self) -> list[str]:
        """What it misses, in sentences, most important first."""
        from mckibben.validation.words import sentences

        several = len(self.outputs) > 1
        return [
            f"{one.output}: {said}" if several else said
            for one in self.outputs
            for said in sentences(one)
        ]

    def plot(self, axes: Sequence[Axes] | None = None, output: str | None = None) -> Sequence[Axes]:
        """Draw autocorrelation, cross-correlations, the branches and errors ahead of an output.

        Parameters
        ----------
        axes : sequence of four matplotlib Axes, optional
            What to draw into; default a new figure.
        output : str, optional
            Channel; default the first.

        Returns
        -------
        sequence of Axes

        Raises
        ------
        DataError
            If there is no such output, or the axes are not four.
        """
        from mckibben.validation.plotting import plot

        return plot(self, axes, output)

    def to_dict(self) -> dict[str, Any]:
        """Return everything for JSON."""
        return {
            "model": self.model,
            "recordings": list(self.recordings),
            "right": self.right,
            "verdict": self.verdict,
            "sentences": self.sentences,
            "notes": list(self.notes),
            "outputs": [one.to_dict() for one in self.outputs],
        }
