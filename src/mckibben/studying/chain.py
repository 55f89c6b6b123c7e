"""From what was wished for to what was measured: the error as a sum, link by link.

With M the model, running free, the error is what the model misses of the measured pressures
(y − M[p]), what feedback does to these (M[p] − M[q]), what they do otherwise than the wanted ones
(M[q] − M[w]), and what the wanted ones do otherwise than was wished for (M[w] − r).
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from mckibben.arrays import Array
from mckibben.blocks.feedback import MEASURED
from mckibben.blocks.free_run import measured_start
from mckibben.control.twin import COMMAND
from mckibben.errors import ModelWarning
from mckibben.recording import Recording
from mckibben.studying.closed import TAPS
from mckibben.studying.log import REFERENCE, Loop, scored
from mckibben.studying.shifts import EARLY, Delay, dead_time, lagged, most_samples, shifted

SAME = 0.01
"""Of the range, root mean square: up to it, commands are what the compensator gives."""

EQUAL = 1e-3
"""Of the deviation, likewise: beyond it, something else is in the commands."""

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
        span = np.maximum(np.ptp(wished, axis=0), np.finfo(float).tiny)
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
            if begun is not None:  # whatever came after, the muscle was there at first
                pressures = np.concatenate([given.matrix(names)[:1], pressures[1:]])
            driven = given.with_channels(**dict(zip(names, pressures.T, strict=True)))
            outputs = [channel.name for channel in model.outputs]
            return model.simulate(driven, initial=begun).matrix(outputs)

        measured = given.matrix(names)
        modelled = through(measured, start)
        wanted, judged_by = (
            (measured, "")
            if blind
            else _wanted(measured, timed, allowed, log.matrix(loop.outputs) - wished)
        )
        limits = np.zeros(len(log), dtype=bool)
        if sent is not None:
            limits |= _at_rails(sent, low, high)
        if asked is not None:
            limits |= (np.abs(np.clip(asked, low, high) - asked) > ROUNDING).any(axis=1)
        delays = []
        meant = measured if wanted is None else wanted
        dead = lags = np.zeros(len(names))
        if judged_by:
            shifts = [dead_time(w, p, step) for w, p in zip(meant.T, measured.T, strict=True)]
            dead = np.array([s if s - half > EARLY else 0.0 for s, half, _ in shifts])
            lags = np.array([lag for _, _, lag in shifts])
            delays = [
                Delay(
                    f"{name} after {judged_by}", s * step, _interval(s, half, d, step), lag * step
                )
                for name, (s, half, lag), d in zip(names, shifts, dead, strict=True)
                if np.isfinite(half)
            ]
        base, unanswered = meant, measured
        if allowed is not None and judged_by != "compensator":
            # as the pressures would have been without feedback, through the same actuator
            base = allowed
            unanswered = measured - _acted(meant, dead, lags) + _acted(allowed, dead, lags)
        late = _acted(base, dead, np.zeros(len(names)))
        open_loop, own, moved = (through(p, start)[:, places] for p in (unanswered, base, late))
        from_rest = through(base)[:, places]
        answer = modelled[:, places] - open_loop
        foreseen = from_rest - wished
        links = {
            "actuator": open_loop - moved,
            "delay": moved - own,
            "model": own - from_rest,  # of how its memory was at the start
            "compensator": np.zeros_like(wished),
        }
        if lead < 0:
            delays.append(Delay("command after reference", -lead * step, (-lead * step,) * 2))
            tardy = shifted(wished, -lead) - wished
            links["delay"], answer = links["delay"] + tardy, answer - tardy
        if asked is None:
            links["limits"] = foreseen * limits[:, np.newaxis]
            links["feedback"] = answer + foreseen - links["limits"]
        else:
            reach = through(asked)[:, places] - wished
            limits |= loop.exact & (np.abs(reach) > SAME * span).any(axis=1)
            own_part = reach * (not loop.exact)
            links["limits"] = foreseen - own_part
            # where it learns, it undoes another model than the one given, and what both miss is one
            links["model" if loop.learns else "compensator"] += own_part
            if loop.learns:
                foreseen = foreseen - own_part
            links["feedback"] = answer
        feedback = timed is not None
        if timed is not None and allowed is not None:
            differs = np.sqrt(np.mean((timed - allowed)[1:] ** 2, axis=0))
            feedback = bool((differs > EQUAL * np.std(allowed, axis=0)).any())
    rows = scored(log)
    return Chain(
        log=log,
        given=given,
        rows=rows,
        modelled=modelled,
        links=links,
        predicted=foreseen,
        delays=tuple(delays),
        clipped=int(np.sum(limits & rows)),
        judged_by=judged_by,
        feedback=feedback,
    )


def _acted(pressures: Array, dead: Array, lags: Array) -> Array:
    """Return what comes of pressures through dead times and lags [samples]."""
    columns = zip(pressures.T, dead, lags, strict=True)
    return np.column_stack([lagged(shifted(p, d), lag) for p, d, lag in columns])


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
    """Return what the compensator gives for the reference, and for what is measured where it learns."""
    if loop.compensator is None or not loop.known:
        return None
    names = [channel.name for channel in loop.compensator.inputs]
    wished = {n: shifted(log[REFERENCE + n], -loop.compensator.samples_ahead) for n in loop.outputs}
    units = {c.name: c.unit for c in loop.model.outputs if c.name in wished}
    wanted = log.with_channels(units, **wished)
    if not loop.learns:
        return loop.compensator.simulate(wanted.select(names)).matrix(loop.inputs)
    # a pressure that is due at a sample was found at the one before, with what was measured there
    late = {f"{n}{MEASURED}": shifted(log[n], 1) for n in loop.outputs}
    wanted = wanted.with_channels({f"{n}{MEASURED}": unit for n, unit in units.items()}, **late)
    found = loop.compensator.simulate(wanted.select(names).slice(1, len(log))).matrix(loop.inputs)
    return np.concatenate([found[:1], found])


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
    return best if left(best) <= SAME * size else 0  # feedback, too, may be ahead


def _wanted(
    measured: Array, sent: Array | None, asked: Array | None, error: Array
) -> tuple[Array | None, str]:
    """Return what measured pressures were to follow: commands, or what the compensator gives.

    What the compensator gives, where commands go beyond it to make pressures follow: an inner loop
    of pressure overdoes them.
    """
    if sent is None:
        return asked, "" if asked is None else "compensator"
    if asked is None or np.sqrt(np.mean((sent - asked) ** 2)) <= SAME * np.std(asked):
        return sent, "command"
    inner = asked[1:] - measured[:-1]
    if _unanswered(sent, asked, inner) < _unanswered(sent, asked, error[:-1]):
        return asked, "compensator"
    # a command may be logged beside what was measured before it acted
    late = shifted(sent, EARLY)
    return min((sent, late), key=lambda one: float(np.mean((one - measured) ** 2))), "command"


def _unanswered(sent: Array, asked: Array, errors: Array) -> float:
    """Return what is left of commands when they answer errors now, before, and in sum."""
    past = [shifted(errors, k) for k in range(TAPS)]
    ones = np.ones((len(errors), 1))
    table = np.concatenate([*past, np.cumsum(errors, axis=0), asked[1:], asked[:-1], ones], axis=1)
    table = table / np.maximum(np.sqrt(np.mean(table**2, axis=0)), np.finfo(float).tiny)
    left = sent[:-1] - table @ np.linalg.lstsq(table, sent[:-1], rcond=1e-12)[0]
    return float(np.sum(left**2))
