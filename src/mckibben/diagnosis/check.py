"""Model check: whether residuals are noise, and otherwise what they depend on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, ClassVar

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.bands import inside
from mckibben.blocks.base import Block
from mckibben.comparison.choosing import useful
from mckibben.diagnosis.description import ModelDescription
from mckibben.diagnosis.free_runs import Run, runs_of
from mckibben.diagnosis.patterns import Pattern, Whiteness, bins, whiteness
from mckibben.diagnosis.regression import FTest, Regression
from mckibben.diagnosis.suspects import Group, averaged, block_length, suspects
from mckibben.recording import Recording, listed
from mckibben.system.progress import Tell, one_by_one, telling
from mckibben.system.showing import DrawsItself
from mckibben.system.threads import one_blas_thread

LEVEL = 0.01
"""Probability of a false finding for a correct model, over all tests and outputs (Bonferroni)."""

FEWEST_BLOCKS = 6
"""Smallest number of blocks of a recording that is tested."""

ROUNDING, STEP = 1e-9, 0.5
"""RMS residuals that are not tested: shares of the span, and of the sensor's resolution."""

UNMOVED, OFF_GRID = 0.05, 0.01
"""A sensor is quantised if this share of samples equals the preceding one and none is further than
this from the grid.
"""

AGAINST = {"curve": "input", "load": "load", "hysteresis": "branch"}
"""Axis over which residuals are averaged, by kind of group."""

LAST = ("runs", "offset")
"""Groups without a shape, tested with the others: any other misfit shifts the mean."""

ALONE = ("drift", "offset")
"""Groups that count as findings only if no other does: any misfit has a mean and a trend."""


@dataclass(frozen=True)
class Finding:
    """A tested cause of a residual.

    Parameters
    ----------
    kind, channel : str
        As `mckibben.diagnosis.suspects.Group` has them.
    p_value : float
        p-value of noise alone, given the findings before.
    share : float
        Share of the residual's variance explained, 0 to 1, given the findings before.
    size : float
        The same as a root mean square, unit of the output.
    coefficient : float or None
        The offset [unit of the output], or how much later measured motion is than modelled [samples].
    or_causes : tuple of (str, str)
        Alternatives from which it is not distinguished.
    """

    kind: str
    channel: str
    p_value: float
    share: float
    size: float
    coefficient: float | None = None
    or_causes: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, eq=False)
class OutputCheck:
    """Residual of one output.

    Parameters
    ----------
    output, unit : str
        Channel.
    sample_time : float or None
        [s].
    span : float
        Range of the measured output.
    rmse : float
        Of the free run.
    mean_error : float
        The same of the mean, which a model has to beat to be of use.
    exact : bool
        Whether nothing is left but rounding, or the sensor's steps.
    missing : tuple of Finding
        What the model misses, most important first.
    suspects : tuple of Finding
        All that was tested, each by itself.
    n_tests : int
        Tests that share `LEVEL`.
    whiteness : Whiteness
    patterns : tuple of Pattern
        Means of the residual over inputs, loads, modelled output and branches.
    """

    output: str
    unit: str
    sample_time: float | None
    span: float
    rmse: float
    mean_error: float
    exact: bool
    missing: tuple[Finding, ...]
    suspects: tuple[Finding, ...]
    n_tests: int
    whiteness: Whiteness
    patterns: tuple[Pattern, ...]

    @property
    def useless(self) -> bool:
        """Whether the mean predicts about as well; see `mckibben.comparison.choosing.useful`."""
        return not useful(self.rmse, self.mean_error)

    @property
    def right(self) -> bool:
        """Whether no cause is significant."""
        return self.exact or not (self.missing or self.useless)

    def to_dict(self) -> dict[str, Any]:
        """Return it for JSON."""
        found = asdict(self)
        found["range"] = found.pop("span")
        return found | {"right": self.right, "level": LEVEL}


@dataclass(frozen=True, eq=False)
class Validation(DrawsItself):
    """Result of a model check on recordings.

    Parameters
    ----------
    model : str
        Kind of the model.
    recordings : tuple of str
        Names of what it was checked on.
    outputs : tuple of OutputCheck
    untested : tuple of str
        Names of recordings too short to be tested.
    runs : tuple of Run
        The recordings, and what the model makes of them; not in ``to_dict``.
    description : ModelDescription or None
        Of the model, where it was asked for.
    """

    face: ClassVar[str] = "validation"

    model: str
    recordings: tuple[str, ...]
    outputs: tuple[OutputCheck, ...] = field(repr=False)
    untested: tuple[str, ...] = ()
    runs: tuple[Run, ...] = field(default=(), repr=False)
    description: ModelDescription | None = field(default=None, repr=False)

    @property
    def right(self) -> bool:
        """Whether no cause is significant."""
        return all(one.right for one in self.outputs)

    def to_dict(self) -> dict[str, Any]:
        """Return everything for JSON, without runs."""
        return {
            "model": self.model,
            "recordings": list(self.recordings),
            "right": self.right,
            "untested": list(self.untested),
            "outputs": [one.to_dict() for one in self.outputs],
            **({"description": self.description.to_dict()} if self.description else {}),
        }


def check(
    model: Block,
    recordings: Recording | Sequence[Recording],
    *,
    progress: bool | Tell | None = None,
) -> Validation:
    """Check a model on recordings, and find what its residuals depend on.

    The model runs free, from an honest start of its memory. What it leaves is tested for following a
    lag of the output, inputs, their branches by region (hysteresis that is left), recorded loads, time,
    speed, holds (creep) and the modelled output. The tests hold for noise whose samples are like their
    neighbours and whose size varies; they share one level.

    Parameters
    ----------
    model : Block
        What is checked.
    recordings : Recording or sequence of Recording
        With all inputs and outputs of the model; of one sample time. Those that the model was not
        fitted to say most. Other channels of pressure, voltage, force and torque are tested as causes.
    progress : bool or callable, optional
        Whether to show a bar; or what is called with the share done, and words.

    Returns
    -------
    Validation

    Raises
    ------
    DataError
        On recordings that lack channels, are too short or constant, differ in sample time, or are the
        same in part.
    ModelError
        Where the model's output is not finite, or runs away.
    """
    model = inside(model)
    with telling(progress, "checking") as tell:
        return check_runs(model, runs_of(model, listed(recordings)), tell)


def check_runs(
    model: Block, runs: Sequence[Run], tell: Tell | None = None, means: Array | None = None
) -> Validation:
    """Check a model by its free runs on recordings; see `check`.

    Parameters
    ----------
    means : array, shape (m,), optional
        Of the training outputs, which the model has to beat; default those of the recordings.
    """
    every = block_length(model, runs)
    tested = [run for run in runs if len(run.inputs) // every >= FEWEST_BLOCKS] or list(runs)
    if means is None:
        means = np.concatenate([run.measured for run in runs]).mean(axis=0)
    with one_blas_thread():
        outputs = tuple(
            _output(model, runs, tested, every, place, float(means[place]))
            for place in one_by_one(range(len(model.outputs)), tell)
        )
    names = tuple(run.recording.name for run in runs)
    untested = tuple(run.recording.name for run in runs if run not in tested)
    return Validation(model.kind, names, outputs, untested, tuple(runs))


def _output(
    model: Block, runs: Sequence[Run], tested: Sequence[Run], every: int, place: int, mean: float
) -> OutputCheck:
    channel = model.outputs[place]
    residuals = [run.residual[:, place] for run in runs]
    measured = [run.measured[:, place] for run in runs]
    span, rmse = float(np.ptp(np.concatenate(measured))), _rms(residuals)
    exact = rmse <= max(ROUNDING * span, STEP * _resolution(measured))
    if exact:
        # what rounding follows is the arithmetic, or the sensor's steps
        residuals = [0.0 * e for e in residuals]
    every_group, tables = suspects(model, tested, place, every)
    groups = [group for group in every_group if group.kind != "start"]
    left = [averaged(e, every) for e, run in zip(residuals, runs, strict=True) if run in tested]
    regression = Regression(left, tables)

    def pattern(
        against: str, name: str, unit: str, values: list[Array], way: int | None = None
    ) -> Pattern:
        means = [averaged(x, every) for x in values]
        branches = None if way is None else [table[:, way] for table in tables]
        return Pattern(against, name, unit, bins(left, means, every, regression, branches))

    patterns = [
        pattern(
            *(AGAINST[group.kind], group.channel, runs[0].recording.units[group.channel]),
            [run.recording[group.channel] for run in tested],
            group.columns[0] if group.kind == "hysteresis" else None,
        )
        for group in groups
        if group.kind in AGAINST
    ]
    modelled = [run.modelled[:, place] for run in tested]
    patterns.append(pattern("output", channel.name, channel.unit, modelled))
    n_tests = len(model.outputs) * len(groups)
    always = [
        p for group in every_group if group.kind in ("offset", "start") for p in group.columns
    ]
    search = _Search(regression, left, groups, LEVEL / n_tests, always)
    return OutputCheck(
        output=channel.name,
        unit=channel.unit,
        sample_time=runs[0].recording.sample_time,
        span=span,
        rmse=rmse,
        mean_error=_rms([y - mean for y in measured]),
        exact=exact,
        missing=search.missing(),
        suspects=tuple(search.finding(group) for group in groups),
        n_tests=n_tests,
        whiteness=whiteness(residuals),
        patterns=tuple(patterns),
    )


class _Search:
    """Forward selection of groups that explain a residual, the most important first."""

    def __init__(
        self,
        regression: Regression,
        left: Sequence[Array],
        groups: Sequence[Group],
        level: float,
        always: Sequence[int],
    ) -> None:
        self.regression, self.groups, self.level = regression, groups, level
        self.always = always
        self.residual = np.concatenate(left)

    def missing(self) -> tuple[Finding, ...]:
        """Return the significant groups, each given those before."""
        found: list[Finding] = []
        known: tuple[int, ...] = ()
        for kinds in ({g.kind for g in self.groups} - set(LAST), *({kind} for kind in LAST)):
            left = [g for g in self.groups if g.kind in kinds and not (found and g.kind in ALONE)]
            while certain := [g for g in left if self._certain(g, known)]:
                best = max(certain, key=lambda group: self._gain(group, known))
                others = {
                    (group.kind, group.channel): None
                    for group in certain
                    if group is not best
                    and not self._certain(best, (*known, *group.beside, *group.columns))
                }
                found.append(self.finding(best, known, tuple(others)))
                known = (*known, *best.columns)
                left = [
                    g
                    for g in left
                    if g is not best and (g.kind, g.channel) not in others and g.kind not in ALONE
                ]
        return tuple(found)

    def finding(
        self, group: Group, known: tuple[int, ...] = (), others: tuple[tuple[str, str], ...] = ()
    ) -> Finding:
        """Return what a group explains in addition to others."""
        test = self._test(group, known)
        coefficient, about = None, float(self.residual.mean())
        if group.kind == "lag":
            coefficient = float(group.delay)
        elif group.kind == "offset":
            coefficient, about = self.regression.coefficient(group.columns[0]), 0.0
        total = float(np.sum((self.residual - about) ** 2))
        return Finding(
            *(group.kind, group.channel, test.p_value),
            share=min(test.explained / total, 1.0) if total > 0 else 0.0,
            size=float(np.sqrt(test.explained / self.residual.size)),
            coefficient=coefficient,
            or_causes=others,
        )

    def _test(self, group: Group, known: Sequence[int]) -> FTest:
        beside = set(known) | set(group.beside)
        return self.regression.test(group.columns, tuple(sorted(beside - set(group.columns))))

    def _certain(self, group: Group, known: tuple[int, ...]) -> bool:
        return self._test(group, known).p_value <= self.level

    def _gain(self, group: Group, known: tuple[int, ...]) -> float:
        """Return the variance that a group explains beyond noise, by Mallows' C_p.

        Beside mean and start, and with what it is beside: a branch by region may move the curve, too.
        """
        before = {*known, *self.always}
        new = {*group.beside, *group.columns} - before
        found = self.regression.test(tuple(sorted(new)), tuple(sorted(before)))
        return found.explained - 2 * found.by_noise


def _rms(pieces: Sequence[Array]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(pieces) ** 2)))


def _resolution(measured: Sequence[Array]) -> float:
    """Return the resolution of a quantised output; otherwise 0."""
    values = np.unique(np.concatenate(measured))
    steps = np.diff(values)
    steps = steps[steps > ROUNDING * (values[-1] - values[0])]
    unmoved = np.mean(np.concatenate([np.diff(y) for y in measured]) == 0)
    if not steps.size or unmoved < UNMOVED:
        return 0.0
    step = float(steps.min())
    places = (values - values[0]) / step
    return step if np.abs(places - np.round(places)).max() < OFF_GRID else 0.0
