"""From what was wished for to what was measured: the error as a sum, link by link.

With M the model, running free, the error is what the model misses of the measured pressures (y − M[p]),
and what these do otherwise than the wanted ones (M[p] − M[w]), and what the wanted ones do otherwise than
was wished for (M[w] − r).
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from mckibben.arrays import Array
from mckibben.comparison.free_run import measured_start
from mckibben.errors import ModelWarning
from mckibben.recording import Recording
from mckibben.studying.log import COMMAND, REFERENCE, Loop, scored
from mckibben.studying.shifts import EARLY, Delay, dead_time, most_samples, shifted

SAME = 0.01
"""Of the range, root mean square: up to it, commands are what the compensator gives."""

HELD = 3
"""Samples in a row at an extreme from which a command is at a limit."""

MOVES = 1e-3
"""Share of its range that the reference moves in meanwhile."""

ROUNDING = 1e-9
"""Share of a range."""


@dataclass(frozen=True, eq=False)
class Chain:
    """One log, link by link.

    Parameters
    ----------
    log : Recording
    given : Recording
        The same, with commands for pressures where none are measured.
    rows : array of bool, shape (n,)
        Samples that are scored.
    modelled : array, shape (n, m)
        Of all outputs of the model, running free on the measured pressures.
    links : mapping of str to array, shape (n, k)
        Cause to its part of the error of what is followed, without what the model misses.
    predicted : array, shape (n, k)
        The error that model and compensator foresee.
    delays : tuple of Delay
    clipped : int
        Scored samples at a limit, or with the reference out of reach.
    judged_by : {"command", "compensator", ""}
        What measured pressures are compared with.
    feedback : bool
        Whether commands are others than the compensator's.
    """

    log: Recording
    given: Recording
    rows: Array
    modelled: Array
    links: Mapping[str, Array] = field(repr=False)
    predicted: Array = field(repr=False)
    delays: tuple[Delay, ...]
    clipped: int
    judged_by: str
    feedback: bool


def chain(loop: Loop, log: Recording) -> Chain:
    """Return what every link between reference and pressure does to the error."""
    model, names = loop.model, loop.inputs
    step = float(log.sample_time or 1.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        wished = log.matrix(REFERENCE + name for name in loop.outputs)
        places = [[c.name for c in model.outputs].index(name) for name in loop.outputs]
        sent, asked = _sent(log, names), _asked(loop, log)
        low, high = _rails(sent, asked, wished)
        allowed = None if asked is None else np.clip(asked, low, high)
        lead = 0 if sent is None or allowed is None else _lead(sent, allowed, step)
        # a command ahead of the reference makes up for what follows; one behind it is late
        timed = None if sent is None else shifted(sent, max(lead, 0))
        blind = any(name not in log for name in names)
        given = log
        if blind and timed is not None:
            given = log.with_channels(**dict(zip(names, timed.T, strict=True)))
        start = _start(loop, given)

        def through(pressures: Array, begun: list[float] | None = None) -> Array:
            driven = given.with_channels(**dict(zip(names, pressures.T, strict=True)))
            initial = {} if begun is None else {"initial": begun}
            outputs = [channel.name for channel in model.outputs]
            return model.simulate(driven, **initial).matrix(outputs)

        measured = given.matrix(names)
        modelled = through(measured, start)
        wanted, judged_by = (measured, "") if blind else _wanted(measured, timed, allowed)
        limits = np.zeros(len(log), dtype=bool)
        if sent is not None:
            limits |= _at_rails(sent, low, high)
        if asked is not None:
            limits |= (np.abs(np.clip(asked, low, high) - asked) > ROUNDING).any(axis=1)
        delays = []
        meant = measured if wanted is None else wanted
        from_rest = through(meant)
        late, dead = meant, np.zeros(len(names))
        if wanted is not None and judged_by:
            shifts = [dead_time(w, p, step) for w, p in zip(wanted.T, measured.T, strict=True)]
            dead = np.array([s if s - half > EARLY else 0.0 for s, half, _ in shifts])
            late = np.column_stack([shifted(w, d) for w, d in zip(wanted.T, dead, strict=True)])
            delays = [
                Delay(f"{name} after {judged_by}", s * step, _interval(s, half, d, step), lag * step)
                for name, (s, half, lag), d in zip(names, shifts, dead, strict=True)
                if np.isfinite(half)
            ]
        own, moved = through(meant, start)[:, places], through(late, start)[:, places]
        links = {
            "actuator": modelled[:, places] - moved,
            "delay": moved - own,
            "model": own - from_rest[:, places],  # of how its memory was at the start
        }
        foreseen = from_rest[:, places] - wished
        predicted = foreseen
        feedback = False
        if lead < 0:
            delays.append(Delay("command after reference", -lead * step, (-lead * step,) * 2))
        if allowed is None or asked is None:
            links["limits"] = foreseen * limits[:, np.newaxis]
            links["feedback"] = foreseen - links["limits"]
        else:
            free, clipped = through(asked)[:, places], through(allowed)[:, places]
            predicted = clipped - wished
            reach = free - wished
            span = np.maximum(np.ptp(wished, axis=0), np.finfo(float).tiny)
            limits |= loop.exact & (np.abs(reach) > SAME * span).any(axis=1)
            links["compensator"] = reach * (not loop.exact)
            links["limits"] = predicted - links["compensator"]
            rest = from_rest[:, places] - clipped
            tardy = (shifted(wished, -lead) - wished) if lead < 0 else np.zeros_like(wished)
            if judged_by != "compensator":
                links["delay"] = links["delay"] + tardy
                links["feedback"] = rest - tardy
                spread = np.sqrt(np.mean((rest - tardy) ** 2, axis=0))
                feedback = bool((spread > SAME * span).any())
    rows = scored(log)
    return Chain(
        log=log,
        given=given,
        rows=rows,
        modelled=modelled,
        links=links,
        predicted=predicted,
        delays=tuple(delays),
        clipped=int(np.sum(limits & rows)),
        judged_by=judged_by,
        feedback=feedback,
    )


def _interval(samples: float, half: float, dead: float, step: float) -> tuple[float, float]:
    return (max(samples - half, 0.0) * step if dead else 0.0, (samples + half) * step)


def _start(loop: Loop, given: Recording) -> list[float]:
    """Return the memory at the start, of the two rules, that leaves less of the log."""
    model = loop.model
    names = [channel.name for channel in model.outputs]
    measured = given.matrix(names)
    first = given.matrix(c.name for c in model.inputs)[0]
    tried = [model.initial_state(first), measured_start(model, given, names)]

    def left(state: Array) -> float:
        found = model.simulate(given, initial=state.tolist()).matrix(names)
        return float(np.sum((found - measured) ** 2))

    return [float(value) for value in min(tried, key=left)]


def _sent(log: Recording, names: tuple[str, ...]) -> Array | None:
    """Return commands, where all are logged."""
    if all(COMMAND + name in log for name in names):
        return log.matrix(COMMAND + name for name in names)
    return None


def _asked(loop: Loop, log: Recording) -> Array | None:
    """Return what the compensator gives for the reference."""
    if loop.compensator is None or not loop.known:
        return None
    names = [channel.name for channel in loop.compensator.inputs]
    wished = {n: log[REFERENCE + n] for n in loop.outputs}
    units = {n: c.unit for c in loop.model.outputs if (n := c.name) in wished}
    wanted = log.with_channels(units, **wished).select(names)
    return loop.compensator.simulate(wanted).matrix(loop.inputs)


def _rails(sent: Array | None, asked: Array | None, wished: Array) -> tuple[Array, Array]:
    """Return the pressures beyond which commands are cut off, infinite where none are seen."""
    k = 1 if sent is None else sent.shape[1]
    low, high = np.full(k, -np.inf), np.full(k, np.inf)
    if sent is None:
        return low, high
    moving = np.ptp(wished, axis=0).max() * MOVES
    for place in range(k):
        c = sent[:, place]
        for end, extreme in ((low, c.min()), (high, c.max())):
            flat = np.abs(c - extreme) <= ROUNDING * max(np.ptp(c), 1.0)
            if not _stays(flat, wished, moving):
                continue
            beyond = True
            if asked is not None:
                over = asked[:, place] - extreme
                beyond = bool(np.any((over if end is high else -over) > ROUNDING))
            if beyond:
                end[place] = extreme
    return low, high


def _stays(flat: Array, wished: Array, moving: float) -> bool:
    """Tell whether a command stays at an extreme while the reference moves."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flat.astype(int), [0]])))
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        if end - begin >= HELD and np.ptp(wished[begin:end], axis=0).max() > moving:
            return True
    return False


def _at_rails(sent: Array, low: Array, high: Array) -> Array:
    return np.asarray(((sent <= low + ROUNDING) | (sent >= high - ROUNDING)).any(axis=1))


def _lead(sent: Array, asked: Array, step: float) -> int:
    """Return by how many samples commands are ahead of what the compensator gives; below 0 if late.

    0 where they are others than the compensator's.
    """
    most = most_samples(len(sent), step)
    inner = slice(most, len(sent) - most)

    def left(lead: int) -> float:
        return float(np.sqrt(np.mean((shifted(sent, lead)[inner] - asked[inner]) ** 2)))

    best = min(range(-most, most + 1), key=lambda lead: (left(lead), abs(lead)))
    size = float(np.std(asked[inner]))
    return best if left(best) < 0.5 * left(0) or left(best) <= SAME * size else 0


def _wanted(
    measured: Array,
    sent: Array | None,
    asked: Array | None,
) -> tuple[Array | None, str]:
    """Return what measured pressures were to follow: commands, or what the compensator gives.

    Of the two, what they follow closer: an inner loop of pressure sends commands that overdo.
    """
    found = [] if asked is None else [("compensator", asked)]
    if sent is not None:  # it may be logged beside what was measured before it
        found += [("command", sent), ("command", shifted(sent, 1))]
    if not found:
        return None, ""
    kind, wanted = min(found, key=lambda pair: float(np.mean((pair[1] - measured) ** 2)))
    if sent is not None and asked is not None and np.allclose(sent, asked, atol=1e-6):
        kind = "command"
    return wanted, kind
