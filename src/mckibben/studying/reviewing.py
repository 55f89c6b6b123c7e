"""Back from a robot's log: predicted against achieved error, and where the difference comes from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.comparison.shared_rows import check_shared
from mckibben.diagnosis.check import OutputCheck, check_runs
from mckibben.diagnosis.free_runs import Run, check_usable
from mckibben.diagnosis.regression import Regression
from mckibben.diagnosis.suspects import Suspects, averaged, suspects
from mckibben.recording import Recording, listed
from mckibben.studying import review_words
from mckibben.studying.causes import Cause, explained, shares
from mckibben.studying.chain import ROUNDING, Chain, chain
from mckibben.studying.closed import each_closed
from mckibben.studying.log import Loop, has_reference, loop_of
from mckibben.studying.refitting import Refit, refitted
from mckibben.studying.shifts import Delay, shifted
from mckibben.system.showing import DrawsItself

CAUSE_OF = {"lag": "delay", "drift": "drift"}
"""What a residual follows -> its cause; all else that follows motion is the model's."""

MISSED = ("model", "delay", "drift", "noise")
"""Causes of what the model misses."""

TELLABLE = 2.0
"""Times the error that a cause may be, root mean square: beyond it causes that a loop answers are large
and opposite, and a slip in one of them would be called another."""

NORMAL = 1.96
"""Standard errors of a 95 % interval."""


@dataclass(frozen=True, eq=False)
class Followed:
    """How one output followed its reference, and why no better.

    Parameters
    ----------
    output, unit : str
        Channel.
    achieved, predicted : float
        Root mean square of measured less reference; and what model and compensator foresee of it.
    residual : float
        Root mean square of what the model misses of the measured motion.
    gain : float
        Measured motion over modelled motion.
    causes : tuple of Cause
        Their signals add up to the error and their shares to 1; largest share first. None where the
        error is rounding.
    delays : tuple of Delay
        Of measured motion after modelled motion.
    missing : tuple of str
        What the model misses, in words, most important first.
    time, reference, measured : array, shape (n,)
        At the scored samples of all logs, which follow one another.
    """

    output: str
    unit: str
    achieved: float
    predicted: float
    residual: float
    gain: float
    causes: tuple[Cause, ...]
    delays: tuple[Delay, ...]
    missing: tuple[str, ...]
    time: Array = field(repr=False)
    reference: Array = field(repr=False)
    measured: Array = field(repr=False)

    @property
    def exact(self) -> bool:
        """Whether nothing is wrong but rounding, of which no cause can be told."""
        return self.achieved <= ROUNDING * float(np.ptp(self.reference))

    def to_dict(self) -> dict[str, Any]:
        """Return it for JSON, without samples."""
        return {
            "output": self.output,
            "unit": self.unit,
            "achieved": self.achieved,
            "predicted": self.predicted,
            "residual": self.residual,
            "gain": self.gain,
            "causes": [cause.to_dict() for cause in self.causes],
            "delays": [delay.to_dict() for delay in self.delays],
            "missing": list(self.missing),
        }


@dataclass(frozen=True, eq=False)
class Review(DrawsItself):
    """What a robot's log says of the compensator that ran.

    Parameters
    ----------
    logs : tuple of str
        Names of the recordings.
    model : str
        Kind of the model.
    outputs : tuple of Followed
    delays : tuple of Delay
        Of measured pressures after wanted ones.
    clipped, n_samples : int
        Scored samples at a limit, and all.
    judged_by : {"command", "compensator", ""}
        What measured pressures are compared with; "" where commands and pressures are not both logged.
    feedback : bool
        Whether commands are others than the compensator's.
    refit : Refit, str or None
        A model refitted on the log, or why there is none; None where none was asked for.
    notes : tuple of str
        What to know of the log.
    """

    face: ClassVar[str] = "review"

    logs: tuple[str, ...]
    model: str
    outputs: tuple[Followed, ...]
    delays: tuple[Delay, ...]
    clipped: int
    n_samples: int
    judged_by: str
    feedback: bool
    refit: Refit | str | None = None
    notes: tuple[str, ...] = ()

    @property
    def verdict(self) -> str:
        """Achieved against predicted error and the first cause, in a sentence for every output."""
        return review_words.verdict(self)

    @property
    def sentences(self) -> list[str]:
        """Every cause that counts, most important first, then the refit."""
        return review_words.sentences(self)

    def __str__(self) -> str:
        return "\n".join([self.verdict, *(f"- {said}" for said in self.sentences), *self.notes])

    def to_dict(self) -> dict[str, Any]:
        """Return everything for JSON, without samples."""
        refit = self.refit.to_dict() if isinstance(self.refit, Refit) else self.refit
        return {
            "logs": list(self.logs),
            "model": self.model,
            "verdict": self.verdict,
            "sentences": self.sentences,
            "outputs": [one.to_dict() for one in self.outputs],
            "delays": [delay.to_dict() for delay in self.delays],
            "clipped": self.clipped,
            "n_samples": self.n_samples,
            "judged_by": self.judged_by,
            "feedback": self.feedback,
            "refit": refit,
            "notes": list(self.notes),
        }


def review(
    log: Recording | Sequence[Recording],
    *,
    model: Block | None = None,
    compensator: Block | None = None,
    refit: bool = True,
    seed: int = 0,
) -> Review:
    """Say how far a loop was off its reference, against what was predicted, and why.

    The error is split, sample by sample, into what the model misses (`model`, `delay`, `drift`,
    `noise`), what pressures do otherwise than wanted (`actuator`, `delay`), and what the wanted
    pressures cannot or do not ask for (`limits`, `feedback`, `compensator`). Shares are Shapley values,
    and add up to the error's mean square.

    Parameters
    ----------
    log : Recording or sequence of Recording
        With ``reference_...`` channels beside what is measured, such as `track` writes; with
        ``command_...`` channels where commands are logged. Recordings without any reference are older
        data, which a refit is given beside the log.
    model : Block, optional
        What ran; default what the compensator undoes.
    compensator : Block, optional
        What ran; default the model's inverse.
    refit : bool
        Whether the same kind of model is fitted to the log, and tried against the old one.
    seed : int
        Of the refit.

    Returns
    -------
    Review
        Print it, or read its ``verdict`` and ``sentences``.

    Raises
    ------
    DataError
        On logs without reference, time or channels of the model.
    ModelError
        Where no model is given, or model and compensator do not belong together.
    """
    every = listed(log)
    logs = [one for one in every if has_reference(one)]
    loop = loop_of(model, compensator, logs)
    chains = [chain(loop, one) for one in logs]
    kept = [one.log.slice(int(np.argmax(one.rows)), len(one.log)) for one in chains]
    runs = [_run(loop, one, part) for one, part in zip(chains, kept, strict=True)]
    check_usable(loop.model, [run.recording for run in runs])
    check_shared({"review": [run.recording for run in runs]}, loop.inputs, loop.outputs)
    checked = check_runs(loop.model, runs)
    names = [channel.name for channel in loop.model.outputs]
    outputs = []
    for place, name in enumerate(loop.outputs):
        one = checked.outputs[names.index(name)]
        outputs.append(_followed(loop, chains, runs, one, names.index(name), place))
    found = Review(
        logs=tuple(one.name for one in logs),
        model=loop.model.kind,
        outputs=tuple(outputs),
        delays=_delays(chains),
        clipped=sum(one.clipped for one in chains),
        n_samples=sum(int(one.rows.sum()) for one in chains),
        judged_by=chains[0].judged_by,
        feedback=any(one.feedback for one in chains),
    )
    found = replace(found, notes=review_words.notes(found, loop))
    if refit and not all(one.exact for one in outputs):
        older = [one for one in every if not has_reference(one)]
        parts = [run.recording for run in runs]
        found = replace(found, refit=refitted(loop.model, parts, older, seed=seed))
    return found


def _run(loop: Loop, one: Chain, kept: Recording) -> Run:
    """Return what the model made of the scored samples of a log."""
    inputs = [channel.name for channel in loop.model.inputs]
    driven = {name: one.given[name][one.rows] for name in inputs}
    part = kept.with_channels(**driven)
    measured = part.matrix(channel.name for channel in loop.model.outputs)
    return Run(part, part.matrix(inputs), measured, one.modelled[one.rows], start_chosen=True)


def _followed(
    loop: Loop,
    chains: Sequence[Chain],
    runs: Sequence[Run],
    one: OutputCheck,
    place: int,
    column: int,
) -> Followed:
    """Return what came of one output: its place among the model's, its column among the followed."""
    table = suspects(loop.model, runs, place, one.every)
    missed = _missed(table, runs, one, place)
    signals: dict[str, Array] = {}
    for kind in dict.fromkeys([*missed, *(k for c in chains for k in c.links)]):
        total = missed.get(kind, np.zeros(sum(int(c.rows.sum()) for c in chains)))
        links = [c.links[kind][c.rows, column] for c in chains if kind in c.links]
        signals[kind] = total + np.concatenate(links) if links else total
    reference = np.concatenate([c.log[f"reference_{one.output}"][c.rows] for c in chains])
    measured = np.concatenate([run.measured[:, place] for run in runs])
    modelled = np.concatenate([run.modelled[:, place] for run in runs])
    about = modelled - modelled.mean()
    power = float(about @ about)
    foreseen = np.concatenate([c.predicted[c.rows, column] for c in chains])
    late = _delay(table, runs, one, place)
    partial = Followed(
        output=one.output,
        unit=one.unit,
        achieved=_rms(measured - reference),
        predicted=_rms(foreseen) if _rms(foreseen) > ROUNDING * np.ptp(reference) else 0.0,
        residual=one.rmse,
        gain=float(about @ measured) / power if power > 0 else 1.0,
        causes=(),
        delays=() if late is None else (late,),
        missing=tuple(review_words.missing(one)),
        time=_time(chains),
        reference=reference,
        measured=measured,
    )
    if partial.exact:
        return replace(partial, delays=())
    told = review_words.told(partial, one, chains)
    if any(c.feedback for c in chains):
        ends = np.cumsum([int(c.rows.sum()) for c in chains])[:-1]
        signals = each_closed(signals, ends) or signals
    answered = loop.learns or any(c.feedback for c in chains)
    if answered and max(map(_rms, signals.values())) > TELLABLE * partial.achieved:
        parts = [signals.pop(kind) for kind in MISSED if kind in signals]
        signals["model"], told["model"] = np.sum(parts, axis=0), review_words.UNDIVIDED
    return replace(partial, causes=shares(signals, told))


def _missed(table: Suspects, runs: Sequence[Run], one: OutputCheck, place: int) -> dict[str, Array]:
    """Return what the model misses of one output, split by what it follows; the rest is noise."""
    residual = np.concatenate([run.residual[:, place] for run in runs])
    level = list(_columns(table, "offset", ""))
    columns: dict[str, list[int]] = {}
    for each in one.missing:
        if each.kind != "offset":
            # a curve and a drift have a level of their own, and share it where there are both
            kind = CAUSE_OF.get(each.kind, "model")
            columns.setdefault(kind, [] if kind == "delay" else [*level])
            columns[kind].extend(_columns(table, each.kind, each.channel))
    if not columns.keys() & {"model", "drift"}:
        columns["model"] = level
    whole = np.concatenate(table.tables)
    averages = np.concatenate([averaged(r.residual[:, place], table.every) for r in runs])
    found = explained(averages, {kind: whole[:, own] for kind, own in columns.items()})
    lengths = [len(part) for part in table.tables]
    signals = {
        kind: np.concatenate(
            [
                _spread(part, len(run.inputs), table.every)
                for part, run in zip(np.split(blocks, np.cumsum(lengths)[:-1]), runs, strict=True)
            ]
        )
        for kind, blocks in found.items()
    }
    return signals | {"noise": residual - sum(signals.values())}


def _columns(table: Suspects, kind: str, channel: str) -> tuple[int, ...]:
    found = [g for g in table.groups if g.kind == kind and g.channel == channel]
    return found[0].columns if found else ()


def _spread(blocks: Array, n: int, every: int) -> Array:
    """Return samples between the middles of blocks."""
    middles = (np.arange(len(blocks)) + 0.5) * every - 0.5
    return np.asarray(np.interp(np.arange(n), middles, blocks))


def _delay(table: Suspects, runs: Sequence[Run], one: OutputCheck, place: int) -> Delay | None:
    """Return how much later measured motion is than modelled motion, beside what else is missed."""
    group, step = table.of("lag"), one.sample_time
    if group is None or step is None or one.exact:
        return None
    others = [
        column
        for each in one.missing
        if each.kind not in ("lag", "output")  # a curve of the modelled motion holds its delay
        for column in _columns(table, each.kind, each.channel)
    ]
    others = list(dict.fromkeys([*_columns(table, "offset", ""), *others]))
    late = [shifted(run.modelled[:, place], group.delay) for run in runs]
    pieces = []
    for run, moved, part in zip(runs, late, table.tables, strict=True):
        left = averaged(run.measured[:, place] - moved, table.every)
        # a gain that is wrong is no delay, however the loop bends
        beside = averaged(np.column_stack([moved, -np.gradient(moved)]), table.every)
        pieces.append((left, np.column_stack([part[:, others], beside])))
    whole = np.concatenate([columns for _, columns in pieces])
    weights = np.linalg.pinv(whole, rcond=1e-9)[-1]
    more = float(weights @ np.concatenate([left for left, _ in pieces]))
    ends = np.cumsum([len(left) for left, _ in pieces])[:-1]
    sure = Regression(*zip(*pieces, strict=True)).deviation(np.split(weights, ends))
    samples = group.delay + more
    return Delay(
        "measured motion after modelled",
        samples * step,
        ((samples - NORMAL * sure) * step, (samples + NORMAL * sure) * step),
    )


def _delays(chains: Sequence[Chain]) -> tuple[Delay, ...]:
    """Return the delays of all logs, by name where there are several."""
    if len(chains) == 1:
        return chains[0].delays
    return tuple(replace(d, where=f"{c.log.name}: {d.where}") for c in chains for d in c.delays)


def _time(chains: Sequence[Chain]) -> Array:
    """Return the time of the scored samples [s]; of several logs, as if one followed the other."""
    if len(chains) == 1:
        return np.asarray(chains[0].log.time[chains[0].rows])
    steps = [np.full(int(c.rows.sum()), c.log.sample_time) for c in chains]
    return np.asarray(np.cumsum(np.concatenate(steps)))


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
