"""Model check: residuals of free runs, their autocorrelation, and what they depend on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.bands import inside
from mckibben.blocks.base import Block
from mckibben.blocks.fields import check_units
from mckibben.blocks.free_runs import free_run
from mckibben.blocks.runs import FreeRun
from mckibben.diagnosis.causes import Cause, averaged, block_length, causes
from mckibben.diagnosis.description import ModelDescription
from mckibben.errors import DataError
from mckibben.metrics import useful
from mckibben.numerics.statistics import NORMAL_95, correlation_length, rms
from mckibben.recording import Recording, check_sample_times, listed
from mckibben.signals.shared_rows import check_shared
from mckibben.system.atomic import Numbers, plain
from mckibben.system.progress import Tell, one_by_one, telling
from mckibben.system.showing import Result
from mckibben.system.threads import one_blas_thread

FEWEST_IN_ALL, FEWEST_IN_EACH = 60, 10
"""Smallest number of samples that can be tested, in total and per recording."""

FEWEST_BLOCKS = 6
"""Smallest number of blocks of a recording that is tested."""

ROUNDING, STEP_SHARE = 1e-9, 0.5
"""RMS residuals that are not tested: shares of the span, and of the sensor's resolution."""

UNMOVED_SHARE, OFF_GRID_SHARE = 0.05, 0.01
"""A sensor is quantised if this share of samples equals the preceding one and none is further than
this from the grid.
"""

MOST_LAGS_TESTED, SAMPLES_PER_TESTED_LAG = 12, 20
"""Largest number of lags tested together, and samples needed per lag."""

MOST_LAGS_DRAWN, SAMPLES_PER_DRAWN_LAG = 50, 5
"""Largest number of single lags drawn; samples needed per lag, as its multiple."""

NORMAL_99 = 2.5758
"""Half width, in standard deviations, of the central 99 % of a normal distribution."""

BINS = 10
"""Number of bins, of equal numbers of samples."""


@dataclass(frozen=True)
class Whiteness:
    """The autocorrelation of a residual.

    Parameters
    ----------
    lags : tuple of int
        In samples, from 1.
    autocorrelation, band : tuple of float
        At every lag, and how far from zero 99 % of those of white noise are.
    n_tested : int
        Lags tested together, the first ones.
    p_value : float or None
        Probability of white noise as far from zero; None where recordings are too short.
    """

    lags: tuple[int, ...]
    autocorrelation: tuple[float, ...]
    band: tuple[float, ...]
    n_tested: int
    p_value: float | None


@dataclass(frozen=True)
class Bin:
    """Mean residual of ``n`` samples between two ends, and its 95 % interval for correlated noise.

    ``label`` is the branch, "rising" or "falling", where there are two.
    """

    label: str
    low: float
    high: float
    n: int
    mean: float
    interval: tuple[float, float]


@dataclass(frozen=True)
class Pattern:
    """Mean residual over one variable.

    Parameters
    ----------
    against : str
        ``input``, ``load``, ``output`` or ``branch``.
    channel, unit : str
        What it is against.
    bins : tuple of Bin
    """

    against: str
    channel: str
    unit: str
    bins: tuple[Bin, ...]


@dataclass(frozen=True, eq=False)
class OutputCheck(Numbers):
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
    missing : tuple of Cause
        Significant causes of the residual, largest first.
    suspects : tuple of Cause
        All that was tested, each by itself.
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
    missing: tuple[Cause, ...]
    suspects: tuple[Cause, ...]
    whiteness: Whiteness
    patterns: tuple[Pattern, ...]

    @property
    def useless(self) -> bool:
        """Whether the mean predicts about as well; see `mckibben.metrics.useful`."""
        return not useful(self.rmse, self.mean_error)

    @property
    def right(self) -> bool:
        """Whether no cause is significant."""
        return self.exact or not (self.missing or self.useless)

    def to_dict(self) -> dict[str, Any]:
        """Return it for JSON."""
        content = super().to_dict()
        content["range"] = content.pop("span")
        return content | {"right": self.right}


@dataclass(frozen=True, eq=False, repr=False)
class Validation(Result):
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
    runs : tuple of FreeRun
        The recordings, and what the model makes of them; not in ``to_dict``.
    description : ModelDescription or None
        Of the model, where it was asked for.
    """

    face: ClassVar[str] = "validation"

    model: str
    recordings: tuple[str, ...]
    outputs: tuple[OutputCheck, ...] = field(repr=False)
    untested: tuple[str, ...] = ()
    runs: tuple[FreeRun, ...] = field(default=(), repr=False)
    description: ModelDescription | None = field(default=None, repr=False)

    @property
    def residuals(self) -> tuple[Array, ...]:
        """Modelled less measured outputs of every recording, shape (n, k) each."""
        return tuple(run.errors for run in self.runs)

    def to_frame(self) -> Any:
        """Return all causes that were tested, as a data frame."""
        import pandas as pd

        rows = [
            {"output": output.output, "missing": cause in output.missing, **vars(cause)}
            for output in self.outputs
            for cause in output.suspects
        ]
        return pd.DataFrame(rows)

    @property
    def right(self) -> bool:
        """Whether no cause is significant."""
        return all(output.right for output in self.outputs)

    def to_dict(self) -> dict[str, Any]:
        """Return everything for JSON, without runs."""
        described = {"description": plain(self.description)} if self.description else {}
        content = {"right": self.right, "outputs": plain(self.outputs), **described}
        return super().to_dict() | content


def check(
    model: Block,
    recordings: Recording | Sequence[Recording],
    *,
    progress: bool | Tell | None = None,
) -> Validation:
    """Check a model on recordings, and find what its residuals depend on.

    The model runs free. Its residual is regressed, in cross-validation over segments, on a lag of the
    output, inputs, their branches (remaining hysteresis), recorded loads, time, speed, holds (creep) and
    the modelled output.

    Parameters
    ----------
    model : Block
        What is checked.
    recordings : Recording or sequence of Recording
        With all inputs and outputs of the model; of one sample time. Those that the model was not
        fitted to say most. Other channels of pressure, voltage, force and torque are tested as causes.
    progress : bool or callable, optional
        Whether to show a bar; or what is called with the share done, and words.

    Raises
    ------
    DataError
        On recordings that lack channels, are too short or constant, differ in sample time, or are the
        same in part.
    ModelError
        Where the model's output is not finite, or runs away.
    """
    model, runs = inside(model), listed(recordings)
    check_usable(model, runs)
    inputs, outputs = ([c.name for c in channels] for channels in (model.inputs, model.outputs))
    check_shared({"check": runs}, inputs, outputs)
    with telling(progress, "checking") as tell:
        return check_runs(model, [free_run(model, run) for run in runs], tell)


def check_usable(block: Block, recordings: Sequence[Recording]) -> None:
    """Raise an error for recordings that cannot test a model; see `check`."""
    if not recordings:
        problem = "there are none to check the model on"
        raise DataError(problem, parameter="recordings", remedy="give at least one")
    for recording in recordings:
        check_units(recording, (*block.inputs, *block.outputs))
        if len(recording) < FEWEST_IN_EACH:
            raise DataError(
                f"{len(recording)} samples are too few: the residual is correlated over longer times",
                file=recording.source,
                remedy=f"leave this recording out, or record at least {FEWEST_IN_EACH} samples",
            )
    check_sample_times(recordings)
    total, source = sum(map(len, recordings)), recordings[0].source
    if total < FEWEST_IN_ALL:
        raise DataError(
            f"{total} samples are too few to distinguish a wrong model from noise",
            file=source,
            remedy=f"record at least {FEWEST_IN_ALL}, better ten cycles with 50 or more each",
        )
    driven = [c.name for c in block.inputs if c.name not in block.scheduling]
    still = [driven[0]] if all(_constant(recordings, name) for name in driven) else []
    still += [c.name for c in block.outputs if _constant(recordings, c.name)]
    if still:
        raise DataError(
            "the channel is constant, which does not test the model",
            file=source,
            channel=still[0],
            remedy="record while it moves, or name another column with `columns[CHANNEL]=COLUMN`",
        )


def _constant(recordings: Sequence[Recording], name: str) -> bool:
    return bool(np.ptp(np.concatenate([recording[name] for recording in recordings])) == 0)


def check_runs(
    model: Block, runs: Sequence[FreeRun], tell: Tell | None = None, means: Array | None = None
) -> Validation:
    """Check a model by its free runs on recordings; see `check`.

    Parameters
    ----------
    means : array, shape (m,), optional
        Of the training outputs, which the model has to beat; default those of the recordings.
    """
    block_size = block_length(model, runs)
    tested = [run for run in runs if len(run) // block_size >= FEWEST_BLOCKS] or list(runs)
    if means is None:
        means = np.concatenate([run.outputs for run in runs]).mean(axis=0)
    with one_blas_thread():
        outputs = tuple(
            _output(model, runs, tested, block_size, place, float(means[place]))
            for place in one_by_one(range(len(model.outputs)), tell)
        )
    names = tuple(run.name for run in runs)
    untested = tuple(run.name for run in runs if run not in tested)
    return Validation(model.kind, names, outputs, untested, tuple(runs))


def _output(
    model: Block,
    runs: Sequence[FreeRun],
    tested: Sequence[FreeRun],
    block_size: int,
    place: int,
    mean: float,
) -> OutputCheck:
    channel = model.outputs[place]
    residuals = [run.residual[:, place] for run in runs]
    measured = [run.outputs[:, place] for run in runs]
    span, rmse = float(np.ptp(np.concatenate(measured))), rms(np.concatenate(residuals))
    exact = rmse <= max(ROUNDING * span, STEP_SHARE * _resolution(measured))
    if exact:
        # what rounding follows is the arithmetic, or the sensor's steps
        residuals = [0.0 * e for e in residuals]
    means = [
        averaged(e, block_size) for e, run in zip(residuals, runs, strict=True) if run in tested
    ]
    missing, suspects = causes(model, tested, place, means, block_size)
    tested_causes = dict.fromkeys((cause.kind, cause.channel) for cause in suspects)
    patterns = [
        _pattern(against, name, runs[0].source.units[name], means, tested, block_size)
        for kind, against in (("curve", "input"), ("hysteresis", "branch"), ("load", "load"))
        for cause_kind, name in tested_causes
        if cause_kind == kind
    ]
    modelled = [run.modelled[:, place] for run in tested]
    bins_of = bins(means, [averaged(y, block_size) for y in modelled], block_size)
    patterns.append(Pattern("output", channel.name, channel.unit, bins_of))
    return OutputCheck(
        output=channel.name,
        unit=channel.unit,
        sample_time=runs[0].sample_time,
        span=span,
        rmse=rmse,
        mean_error=rms(np.concatenate(measured) - mean),
        exact=exact,
        missing=missing,
        suspects=suspects,
        whiteness=whiteness(residuals),
        patterns=tuple(patterns),
    )


def _pattern(
    against: str, name: str, unit: str, means: list[Array], runs: Sequence[FreeRun], block_size: int
) -> Pattern:
    values = [averaged(run.source[name], block_size) for run in runs]
    branches = [np.gradient(x) for x in values] if against == "branch" else None
    return Pattern(against, name, unit, bins(means, values, block_size, branches))


def whiteness(residuals: Sequence[Array]) -> Whiteness:
    """Return the autocorrelation of a residual, pieces (n,), and whether it is white noise.

    Products of samples at a lag are compared with their own scatter, so that white noise whose size
    depends on the input or the run passes as what it is.
    """
    from scipy.special import chdtrc

    longest_lag, n = (
        max(map(len, residuals)) // (SAMPLES_PER_DRAWN_LAG + 1),
        sum(map(len, residuals)),
    )
    lags = np.arange(1, min(MOST_LAGS_DRAWN, longest_lag) + 1)
    if longest_lag > MOST_LAGS_DRAWN:
        lags = np.union1d(
            lags, np.geomspace(MOST_LAGS_DRAWN, longest_lag, MOST_LAGS_DRAWN).astype(int)
        )
    mean = float(np.concatenate(residuals).mean())
    centred = [e - mean for e in residuals]
    power = float(sum(e @ e for e in centred))
    products_sum, scatter = np.zeros(lags.size), np.zeros(lags.size)
    for place, lag in enumerate(lags.tolist()):
        products = np.concatenate([e[lag:] * e[: len(e) - lag] for e in centred if len(e) > lag])
        # the mean was taken off: what noise itself would give is below zero
        products_sum[place] = products.sum() + len(products) / n * power / n
        scatter[place] = products @ products
    tested, deviation = (
        min(MOST_LAGS_TESTED, longest_lag, n // SAMPLES_PER_TESTED_LAG),
        np.sqrt(scatter),
    )
    ratio = np.divide(products_sum, deviation, out=np.zeros(lags.size), where=deviation > 0)
    p_value = float(chdtrc(tested, float(np.sum(ratio[:tested] ** 2)))) if tested else None
    by_lag = [(x / (power or 1.0)).tolist() for x in (products_sum, NORMAL_99 * deviation)]
    return Whiteness(tuple(lags.tolist()), tuple(by_lag[0]), tuple(by_lag[1]), tested, p_value)


def bins(
    residual_means: Sequence[Array],
    values: Sequence[Array],
    block_size: int,
    branches: Sequence[Array] | None = None,
) -> tuple[Bin, ...]:
    """Return means of a residual in bins of equal numbers of samples.

    Parameters
    ----------
    left, values : sequence of array, shape (n,)
        Means over blocks of ``every`` samples.
    branches : sequence of array, shape (n,), optional
        Positive on the rising branch and negative on the falling one, for a mean of each.
    """
    e, x = np.concatenate(residual_means), np.concatenate(values)
    branch = np.zeros(x.size) if branches is None else np.sign(np.concatenate(branches))
    ends = np.unique(np.quantile(x, np.linspace(0, 1, BINS + 1)))
    bin_number = np.clip(np.searchsorted(ends, x, "right") - 1, 0, ends.size - 2)
    labels = {"": 0} if branches is None else {"rising": 1, "falling": -1}
    memory, result = correlation_length(residual_means), []
    for k in range(ends.size - 1):
        for label, sign in labels.items():
            members = e[(bin_number == k) & (branch == sign)]
            if members.size:
                mean = float(members.mean())
                half = NORMAL_95 * float(members.std()) * np.sqrt(min(memory / members.size, 1.0))
                ends_of_bin = float(ends[k]), float(ends[k + 1])
                limits = mean - half, mean + half
                result.append(Bin(label, *ends_of_bin, members.size * block_size, mean, limits))
    return tuple(result)


def _resolution(measured: Sequence[Array]) -> float:
    """Return the resolution of a quantised output; otherwise 0."""
    values = np.unique(np.concatenate(measured))
    steps = np.diff(values)
    steps = steps[steps > ROUNDING * (values[-1] - values[0])]
    unmoved = np.mean(np.concatenate([np.diff(y) for y in measured]) == 0)
    if not steps.size or unmoved < UNMOVED_SHARE:
        return 0.0
    step = float(steps.min())
    places = (values - values[0]) / step
    return step if np.abs(places - np.round(places)).max() < OFF_GRID_SHARE else 0.0
