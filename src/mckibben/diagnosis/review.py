"""Review of a loop's log: tracking error, and the contribution of every link.

With M the model, running free, the error is, sample by sample, what the model misses of the measured
pressures (y - M[p]), what these do otherwise than the commands (M[p] - M[c]), and what the commands
leave of the reference according to the model (M[c] - r).
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, ClassVar

import numpy as np

from mckibben import registry
from mckibben.arrays import Array, true_runs
from mckibben.blocks.bands import inside
from mckibben.blocks.base import Block
from mckibben.blocks.compose import Series
from mckibben.blocks.feedback import FeedforwardFeedback
from mckibben.blocks.fields import Channel
from mckibben.blocks.inverse import Inverse
from mckibben.channels import channels_of
from mckibben.errors import DataError, MckibbenError, ModelError, ModelWarning
from mckibben.estimators.catalogue import declared
from mckibben.numerics.blocks import BlockBootstrap, block_length, interval
from mckibben.numerics.statistics import NORMAL_95, correlation_length, rms
from mckibben.recording import COMMAND, MEASURED, REFERENCE, Recording, listed, sample_time_of
from mckibben.signals.shared_rows import check_shared
from mckibben.splits import parts_of
from mckibben.system.atomic import Numbers
from mckibben.system.showing import Result

LONGEST_DELAY, SAMPLES_AT_LIMIT = 1.0, 3
"""Longest delay searched [s], at most an eighth of the log; number of successive samples at an
extreme, while the reference moves, above which a command is at a limit.
"""

ROUNDING = 1e-9
"""Share of a range up to which values are equal."""


@dataclass(frozen=True)
class Delay:
    """Delay of one signal after another, dead time and lag together.

    ``where`` says which is later than which; ``seconds`` is positive where the first comes later, and
    ``interval`` its interval of 95 % [s].
    """

    where: str
    seconds: float
    interval: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Followed(Numbers):
    """Tracking of one output: root mean square errors, in its unit.

    Parameters
    ----------
    output, unit : str
        Channel.
    achieved, residual : float
        Measured less reference, and less what the model gives for measured pressures.
    predicted, pressure : float or None
        What the model gives for the commands, less reference; and what it gives for measured pressures
        less that. None where commands are not known.
    drift, drift_interval : float, (float, float)
        Slope of the residual over time [unit/s], and its interval of 95 %.
    time, reference, measured : array, shape (n,)
        At the scored samples of all logs, which follow one another.
    parts : mapping of str to array, shape (n,)
        ``model``, ``pressure`` and ``command``, which add up to the error.
    """

    output: str
    unit: str
    achieved: float
    predicted: float | None
    pressure: float | None
    residual: float
    drift: float
    drift_interval: tuple[float, float]
    time: Array = field(repr=False)
    reference: Array = field(repr=False)
    measured: Array = field(repr=False)
    parts: Mapping[str, Array] = field(repr=False)


@dataclass(frozen=True, eq=False, repr=False)
class Review(Result):
    """Review of the log of a running compensator.

    Parameters
    ----------
    logs, model : tuple of str, str
        Names of the recordings, and the model's kind.
    outputs : tuple of Followed
    delays : tuple of Delay
        Of measured pressures after commands, and of measured after modelled motion, log by log.
    clipped, n_samples : int
        Scored samples with a command at a limit, and all.
    judged_by : {"command", "compensator", ""}
        Where commands come from: the log, or what the compensator gives for the reference.
    refit : Refit, str or None
        A model fitted again to the log, or why there is none; None where none was asked for.
    """

    face: ClassVar[str] = "review"

    logs: tuple[str, ...]
    model: str
    outputs: tuple[Followed, ...]
    delays: tuple[Delay, ...]
    clipped: int
    n_samples: int
    judged_by: str
    refit: Refit | str | None = None


def review(
    log: Recording | Sequence[Recording],
    *,
    model: Block | None = None,
    compensator: Block | None = None,
    refit: bool = True,
    seed: int = 0,
) -> Review:
    """Find the tracking error of a loop, the contribution of each link, and whether a refit is better.

    Parameters
    ----------
    log : Recording or sequence of Recording
        With ``reference_...`` channels and the measured ones, as `track` writes them; with
        ``command_...`` channels where commands are logged. Recordings without any reference are older
        data, to which a refit is fitted as well.
    model : Block, optional
        What ran; default what the compensator undoes.
    compensator : Block, optional
        What ran; default the model's inverse.
    refit : bool
        Whether the same kind of model is fitted to the log, and compared with the old one.
    seed : int
        Of the refit.

    Raises
    ------
    DataError
        On logs without reference, time or channels of the model.
    ModelError
        Where no model is given, or model and compensator do not belong together.
    """
    recordings = listed(log)
    logs = [recording for recording in recordings if has_reference(recording)]
    model, compensator = _model_and_compensator(model, compensator)
    inputs = [c.name for c in model.inputs if c.name not in model.scheduling]
    outputs = [
        c for c in model.outputs if all(REFERENCE + c.name in recording for recording in logs)
    ]
    _check(logs, model, inputs, bool(outputs))
    check_shared({"review": logs}, inputs, [channel.name for channel in model.outputs])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        links = [_link_of(recording, model, compensator, inputs) for recording in logs]
    result = Review(
        logs=tuple(recording.name for recording in logs),
        model=model.kind,
        outputs=tuple(_followed(links, channel) for channel in outputs),
        delays=tuple(delay for link in links for delay in link.delays if delay is not None),
        clipped=sum(link.clipped for link in links),
        n_samples=sum(len(link.log) for link in links),
        judged_by=links[0].judged_by,
    )
    if not refit or all(
        recording.achieved <= ROUNDING * np.ptp(recording.reference) for recording in result.outputs
    ):
        return result
    older = [recording for recording in recordings if not has_reference(recording)]
    return replace(result, refit=refitted(model, [link.log for link in links], older, seed=seed))


def has_reference(recording: Recording) -> bool:
    """Return whether a recording is a loop's log."""
    return any(name.startswith(REFERENCE) for name in recording.channels)


def _model_and_compensator(
    model: Block | None, compensator: Block | None
) -> tuple[Block, Block | None]:
    """Return the model and the compensator of the run; None if the model has no inverse."""
    if isinstance(compensator, FeedforwardFeedback):
        compensator = compensator.compensator
    if model is None and compensator is not None:
        model = compensator.forward_model
    if model is None:
        raise ModelError(
            "it is not known which model was in the loop",
            parameter="model",
            remedy="give it with `model`",
        )
    model = inside(model)
    if compensator is None:
        try:
            compensator = model.inverse()
        except ModelError:
            return model, None
    driven = {c.name for c in model.inputs}.difference(model.scheduling)
    if {c.name for c in compensator.outputs} != driven:
        raise ModelError(
            f"the compensator gives {', '.join(c.name for c in compensator.outputs)}, "
            f"but the model takes {', '.join(sorted(driven))}",
            remedy="give a compensator and the model that it inverts",
        )
    return model, compensator


def _check(logs: Sequence[Recording], model: Block, inputs: Sequence[str], followed: bool) -> None:
    """Raise an error for logs with missing channels."""
    if not logs or not followed:
        name = REFERENCE + model.outputs[0].name
        raise DataError(
            "there is no such channel to compare with the model's",
            file=logs[0].source if logs else None,
            channel=name,
            remedy=f"map its column, as in `columns[{name}]=COLUMN`",
        )
    for log in logs:
        sample_time_of(log, "be the log of a loop")
        for name in [channel.name for channel in (*model.inputs, *model.outputs)]:
            if name not in inputs or COMMAND + name not in log:
                log[name]  # which says what is absent


@dataclass(frozen=True, eq=False)
class _Link:
    """The scored samples of a log, and the model's outputs for measured pressures and for commands."""

    log: Recording
    modelled: Recording
    commanded: Recording | None
    delays: Sequence[Delay | None]
    clipped: int
    judged_by: str


def _link_of(
    log: Recording, model: Block, compensator: Block | None, inputs: Sequence[str]
) -> _Link:
    names = [channel.name for channel in model.outputs]
    sent, judged_by = _commands(log, model, compensator, inputs)
    measured = [name for name in inputs if name in log]
    blind = {name: _shifted(log[COMMAND + name], 1.0) for name in inputs if name not in log}
    log = log.with_channels(**blind)
    start = model.start_on(log).tolist()
    modelled = model.simulate(log, initial=start)
    # all counts from time zero on; `track` begins before it
    scored = slice(int(np.argmax(log.time >= -ROUNDING)), len(log))
    commanded, pairs, clipped = None, {}, 0
    if sent is not None:
        # whatever was commanded at first, the muscle was where it was measured
        whole = {name: np.append(log[name][:1], sent[name][1:]) for name in inputs}
        commanded = model.simulate(log.with_channels(**whole), initial=start)
        pairs = {f"{name} after command": (sent[name], log[name]) for name in measured}
        references = [x[scored] for name, x in log.channels.items() if name.startswith(REFERENCE)]
        limits = [_at_limit(command[scored], references) for command in sent.values()]
        clipped = int(np.any(limits, axis=0).sum())
    followed = [name for name in names if REFERENCE + name in log]
    pairs |= {f"measured after modelled {n}": (modelled[n], log[n]) for n in followed}
    step = log.step
    return _Link(
        log=log.slice(scored.start, scored.stop),
        modelled=modelled.slice(scored.start, scored.stop),
        commanded=None if commanded is None else commanded.slice(scored.start, scored.stop),
        delays=[_delay(where, x[scored], y[scored], step) for where, (x, y) in pairs.items()],
        clipped=clipped,
        judged_by=judged_by,
    )


def _commands(
    log: Recording, model: Block, compensator: Block | None, inputs: Sequence[str]
) -> tuple[dict[str, Array] | None, str]:
    """Return the commands by input, logged or computed, and which; None if unknown."""
    computed = _computed_commands(log, model, compensator, inputs)
    if any(COMMAND + name not in log for name in inputs):
        return computed, "" if computed is None else "compensator"
    sent = {name: log[COMMAND + name] for name in inputs}
    later = {name: _shifted(values, 1.0) for name, values in sent.items()}
    expected = computed or {name: log[name] for name in inputs if name in log}

    def deviation(commands: Mapping[str, Array]) -> float:
        return float(
            sum(np.sum((commands[name] - values) ** 2) for name, values in expected.items())
        )

    # a command is logged when it is sent, for the reference of the next sample, or together with it
    return min((later, sent), key=deviation), "command"


def _computed_commands(
    log: Recording, model: Block, compensator: Block | None, inputs: Sequence[str]
) -> dict[str, Array] | None:
    """Return a compensator's outputs for the reference; None if it needs other inputs."""
    outputs = [channel.name for channel in model.outputs]
    if compensator is None or any(REFERENCE + name not in log for name in outputs):
        return None
    if any(channel.name.endswith(MEASURED) for channel in compensator.inputs):
        return None
    ahead = compensator.samples_ahead
    desired = log.with_channels(**{n: _shifted(log[REFERENCE + n], -ahead) for n in outputs})
    commands = compensator.simulate(desired.select([c.name for c in compensator.inputs]))
    return {name: commands[name] for name in inputs}


def _at_limit(command: Array, references: Sequence[Array]) -> Array:
    """Return where a command stays at an extreme while a reference moves, bool (n,)."""
    limited = np.zeros(command.size, dtype=bool)
    tolerance = ROUNDING * max(float(np.ptp(command)), 1.0)
    for extreme in (command.min(), command.max()):
        flat = np.abs(command - extreme) <= tolerance
        for begin, end in true_runs(flat):
            moves = any(np.ptp(r[begin:end]) > ROUNDING * np.ptp(r) for r in references)
            limited[begin:end] |= end - begin >= SAMPLES_AT_LIMIT and moves
    return limited


def _followed(links: Sequence[_Link], channel: Channel) -> Followed:
    logs, name = [link.log for link in links], channel.name
    step = logs[0].step
    measured, reference = (
        np.concatenate([log[prefix + name] for log in logs]) for prefix in ("", REFERENCE)
    )
    pairs = [(link.modelled[name], link.log[name]) for link in links]
    modelled = np.concatenate([model for model, _ in pairs])
    parts = {"model": measured - modelled}
    commanded_parts = [link.commanded[name] for link in links if link.commanded is not None]
    if len(commanded_parts) == len(links):
        commanded = np.concatenate(commanded_parts)
        parts |= {"pressure": modelled - commanded, "command": commanded - reference}
    rounding = ROUNDING * float(np.ptp(reference))
    sizes = {kind: size if (size := rms(part)) > rounding else 0.0 for kind, part in parts.items()}
    slope, half = _slope([measured_part - model for model, measured_part in pairs], step)
    time = logs[0].time if len(logs) == 1 else step * np.arange(measured.size)
    return Followed(
        output=name,
        unit=channel.unit,
        achieved=rms(measured - reference),
        predicted=sizes.get("command"),
        pressure=sizes.get("pressure"),
        residual=sizes["model"],
        drift=slope,
        drift_interval=(slope - half, slope + half),
        time=np.asarray(time),
        reference=reference,
        measured=measured,
        parts=parts,
    )


def _slope(series: Sequence[Array], step: float) -> tuple[float, float]:
    """Return the common slope of series over time, and half of its 95 % interval."""
    times = [step * (np.arange(y.size) - 0.5 * (y.size - 1)) for y in series]
    power = sum(float(t @ t) for t in times)
    slope = sum(float(t @ y) for t, y in zip(times, series, strict=True)) / power
    residuals = [y - y.mean() - slope * t for y, t in zip(series, times, strict=True)]
    variance = float(np.var(np.concatenate(residuals))) * correlation_length(residuals)
    return slope, NORMAL_95 * float(np.sqrt(variance / power))


def _delay(where: str, first: Array, then: Array, step: float) -> Delay | None:
    """Return the delay of a signal after another, with any gain and offset, by least squares.

    The standard error is that of sums over blocks that are long against the correlation of errors.
    """
    most = min(round(LONGEST_DELAY / step), len(first) // 8)
    if most < 1 or np.ptp(first) == 0 or np.ptp(then) == 0:
        return None
    inner = slice(most, len(first) - most)
    centred = then[inner] - then[inner].mean()

    def columns_at(samples: float) -> Array:
        moved = _shifted(first, samples)
        columns = np.column_stack([moved, -np.gradient(moved)])[inner]
        return columns - columns.mean(axis=0)

    def explained(samples: float) -> float:
        x = _shifted(first, samples)[inner]
        x -= x.mean()
        return float((x @ centred) ** 2 / (x @ x))

    delay, gain = float(max(range(-most, most + 1), key=explained)), 1.0
    for _ in range(3):
        gain, change = np.linalg.lstsq(columns_at(delay), centred, rcond=None)[0]
        delay = float(np.clip(delay + change / gain, -most, most))
    x, slope = columns_at(delay).T
    independent = slope - x * (x @ slope) / (x @ x)
    product = independent * (centred - gain * x)
    block = block_length(product.size, correlation_length([product]))
    sums = [part.sum() for part in np.array_split(product, max(product.size // block, 2))]
    half = NORMAL_95 * float(np.linalg.norm(sums) / (abs(gain) * (independent @ independent)))
    # decimals behind the ninth of a sample are rounding
    low, middle, high = (
        round(samples, 9) * step for samples in (delay - half, delay, delay + half)
    )
    return Delay(where, middle, (low, high))


def _shifted(x: Array, samples: float) -> Array:
    """Return a signal (n,) shifted by so many samples, extended by its end values."""
    at = np.arange(len(x)) - samples
    return np.interp(at, np.arange(len(x)), x)


@dataclass(frozen=True, eq=False)
class Refit(Numbers):
    """Model of the same kind, refitted to the log and to older data if there are any.

    Parameters
    ----------
    model : Block
    old, new : float
        Root mean square error, running free, on parts held out, of the old model and of the new one as
        it would be without the part; of several outputs that of each over its range, on the mean.
    ratio : (float, float)
        95 % interval of new over old, by a paired block bootstrap.
    n_parts, older : int
        Parts, and recordings of older data.
    """

    model: Block = field(repr=False)
    old: float
    new: float
    ratio: tuple[float, float]
    n_parts: int
    older: int

    @property
    def recommended(self) -> bool:
        """Whether it is significantly better than the old model."""
        return self.ratio[1] < 1

    def to_dict(self) -> dict[str, Any]:
        """Return it for JSON, without the model."""
        return {
            "kind": self.model.kind,
            "old_rmse": self.old,
            "new_rmse": self.new,
            "ratio_interval": list(self.ratio),
            "n_parts": self.n_parts,
            "older_recordings": self.older,
            "recommended": self.recommended,
        }


def refitted(
    old: Block, logs: Sequence[Recording], older: Sequence[Recording], *, seed: int = 0
) -> Refit | str:
    """Refit a model of the same kind to logs, or return why that is not possible.

    ``older`` recordings are fitted as well; those without its channels are left out.
    """
    kinds = " ".join(_kinds(old))
    estimators = map(declared, registry.names("estimators"))
    estimator = next((kind for kind in estimators if kinds in kind.makes), None)
    if estimator is None:
        return f"No estimator makes models of kind {old.kind!r}."
    inputs, outputs = ([c.name for c in channels] for channels in (old.inputs, old.outputs))
    names = [*inputs, *outputs]
    runs = [log.select(names) for log in logs]
    older_runs = [run.select(names) for run in older if all(name in run for name in names)]
    driving = [name for name in inputs if name not in old.scheduling]
    channels = channels_of(runs, driving, outputs, old.scheduling)
    settings = {"seed": seed} | estimator.channel_settings(channels) | _size(old, estimator)
    parts = parts_of(runs, channels)
    if not parts:
        return "The log is too short to leave parts of it out."
    not_left_out = tuple(np.zeros(len(run), dtype=bool) for run in older_runs)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ModelWarning)
            pairs = [(old.simulate(log).matrix(outputs), log.matrix(outputs)) for log in runs]
            old_errors = [modelled - measured for modelled, measured in pairs]
            refit = estimator(**settings).fit([*runs, *older_runs])
            held_out = refit.held_out(
                [*runs, *older_runs], [(*part, *not_left_out) for part in parts]
            )
    except MckibbenError as error:
        return f"No model could be fitted to the log: {error}"
    if held_out is None:
        return "The model has too many parameters to leave parts of the log out."
    new = refit.fitted
    # older recordings come last
    new_errors = [table - measured for table, (_, measured) in zip(held_out, pairs, strict=False)]
    if not any(errors.any() for errors in old_errors):
        return "The model has no error on the log."
    spans = np.ptp(np.concatenate([measured for _, measured in pairs]), axis=0)
    scales = spans if len(outputs) > 1 else np.ones(1)
    rmse, ratio = _compared(old_errors, new_errors, scales, seed)
    return Refit(new, *rmse, ratio, len(parts), len(older_runs))


def _size(old: Block, estimator: Any) -> dict[str, int]:
    """Return the setting by which an estimator fits as many operators as a model has."""
    n_operators = {}
    for part in old.parts if isinstance(old, Series) else (old,):
        thresholds = getattr(part, "thresholds", None)
        if thresholds is not None and "n_operators" in {field.name for field in fields(estimator)}:
            n_operators["n_operators"] = len(thresholds) - (thresholds[0] == 0)
    return n_operators


def _compared(
    old: Sequence[Array], new: Sequence[Array], scales: Array, seed: int
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the RMSE of two models relative to scales, and the 95 % interval of their ratio.

    The errors, shape (n, k) each, are those of every log.
    """
    squares = [((errors / scales) ** 2).mean(axis=1) for errors in new]
    bootstrap = BlockBootstrap([len(errors) for errors in old], seed, correlation_length(squares))
    old_scaled, new_scaled = (np.concatenate(errors) / scales for errors in (old, new))
    old_rmse, new_rmse = (bootstrap.rmse(errors) for errors in (old_scaled, new_scaled))
    ratio = interval(new_rmse / np.maximum(old_rmse, np.finfo(float).tiny))
    means = (np.sqrt((errors**2).mean(axis=0)).mean() for errors in (old_scaled, new_scaled))
    old_mean, new_mean = map(float, means)
    return (old_mean, new_mean), ratio


def _kinds(block: Block) -> list[str]:
    """Return the kinds of a model's parts in their order."""
    if isinstance(block, Series):
        return [kind for part in block.parts for kind in _kinds(part)]
    return [f"{block.forward.kind}-inverse" if isinstance(block, Inverse) else block.kind]
