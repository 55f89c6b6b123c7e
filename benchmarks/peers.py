"""Other libraries and a GRU beside this package's models, on the same splits of measured recordings.

Their environment: python3 -m venv peers-env && peers-env/bin/pip install . -r benchmarks/peers.txt
Run: peers-env/bin/python benchmarks/peers.py FOLDER [--out peers] [--page docs/measured/peers.md]

FOLDER holds a folder for every set, as for ``mckibben.measured``. What is finished is kept in ``--out``:
the same command goes on from there; remove that folder to begin anew.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import shlex
import signal
import sys
import time
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

from mckibben import compare
from mckibben.comparison.channels import Channels
from mckibben.comparison.memory_test import branch_gaps
from mckibben.comparison.planning import plan_of
from mckibben.comparison.results import Leaderboard
from mckibben.comparison.splits import predecessor
from mckibben.errors import MckibbenError
from mckibben.measured.sets import Set, parted, sets_in
from mckibben.measured.splits import Task
from mckibben.recording import Recording
from peers_gru import GRU
from peers_libraries import LINEAR, NARX, START, Array, Peer, Run, Settings, Simulate, Trial
from peers_rows import Kept, Row, TaskRows, page

PEERS = (*LINEAR, *NARX, GRU)

OURS = ("balance", "balance-force", "gpi", "cpi", "preisach")

BUDGET = 30.0
"""Seconds that a search may take, and a single fit: the same for every peer but the GRU."""

HELD_BACK = 4
"""One of so many recordings is held back of the training side; of fewer, each one's last such part."""

TIMED = 20_000
"""Samples of the long simulation that a step is timed by."""

AWAY = 1e3
"""Times the spread of the training output beyond which a free run has run away."""


@dataclass(frozen=True)
class Data:
    """A task's recordings as peers are given them.

    Parameters
    ----------
    train : sequence of Run
    fitted : sequence of Run
        What is left where a quarter is held back.
    held : sequence of Trial
        The quarter held back.
    tests : sequence of Trial
    measured : sequence of Recording
        Tests as they are.
    pairs : sequence of (str, str)
        Every output, and the input that its branches are told apart by.
    scale : array, shape (m,)
        Standard deviation of the outputs.
    offset : array, shape (m,)
        Their mean.
    span : float
        Range of the tests' outputs, the largest.
    """

    train: Sequence[Run]
    fitted: Sequence[Run]
    held: Sequence[Trial]
    tests: Sequence[Trial]
    measured: Sequence[Recording]
    pairs: Sequence[tuple[str, str]]
    scale: Array
    offset: Array
    span: float


def told_of(recordings: Sequence[Recording], channels: Channels) -> list[str]:
    """Return what peers are told: what any of our models is, which of a force is the pressure too."""
    told = [*channels.inputs, *channels.scheduled(recordings)]
    forced = "force" in channels.outputs and all("pressure" in one for one in recordings)
    return list(dict.fromkeys([*told, *(["pressure"] if forced else [])]))


def data_of(train: Sequence[Recording], test: Sequence[Recording], channels: Channels) -> Data:
    """Return recordings as peers are given them, scaled as they are on the training side."""
    told = told_of([*train, *test], channels)
    inputs = np.vstack([one.matrix(told) for one in train])
    outputs = np.vstack([one.matrix(channels.outputs) for one in train])
    middle, spread = inputs.mean(axis=0), inputs.std(axis=0)
    spread[spread == 0] = 1.0
    offset, scale = outputs.mean(axis=0), outputs.std(axis=0)

    def scaled(one: Recording) -> Run:
        return (one.matrix(told) - middle) / spread, (one.matrix(channels.outputs) - offset) / scale

    def trial(one: Recording) -> Trial:
        before = predecessor(one, train)
        u, y = scaled(one)
        if before is None:
            return Trial(u, y, START)
        first_u, first_y = scaled(before)
        return Trial(np.vstack([first_u, u]), np.vstack([first_y, y]), len(first_y))

    runs = [scaled(one) for one in train]
    fitted, held = held_back(runs)
    span = max(float(np.ptp(np.concatenate([r[name] for r in test]))) for name in channels.outputs)
    pairs = [(_moving(given, told, test), output) for given, output in channels.pairs()]
    trials = [trial(one) for one in test]
    return Data(runs, fitted, held, trials, test, pairs, scale, offset, span)


def _moving(given: str, told: Sequence[str], tests: Sequence[Recording]) -> str:
    """Return an input, or where it rests the first that moves, as the memory test does."""
    moving = [n for n in (given, *told) if any(np.ptp(one[n]) > 0 for one in tests)]
    return moving[0] if moving else given


def held_back(runs: Sequence[Run]) -> tuple[list[Run], list[Trial]]:
    """Return what is fitted and what is tried where a quarter of the training side is held back.

    Of four or more runs every fourth, whole; of fewer the last quarter of each, which goes on.
    """
    if len(runs) >= HELD_BACK:
        last = HELD_BACK - 1
        kept = [run for place, run in enumerate(runs) if place % HELD_BACK != last]
        return kept, [Trial(u, y, START) for u, y in runs[last::HELD_BACK]]
    cuts = [len(u) - len(u) // HELD_BACK for u, _ in runs]
    fitted = [(u[:cut], y[:cut]) for (u, y), cut in zip(runs, cuts, strict=True)]
    return fitted, [Trial(u, y, cut) for (u, y), cut in zip(runs, cuts, strict=True)]


def rms(trials: Sequence[Trial], found: Sequence[Array], scale: Array) -> float:
    """Return the RMSE of free runs, of several outputs the mean; infinite where they ran away."""
    missed = np.vstack(
        [(y - one.outputs)[one.known :] for one, y in zip(trials, found, strict=True)]
    )
    if not np.all(np.abs(missed) < AWAY):  # NaN is not less
        return float("inf")
    return float(np.mean(np.sqrt(np.mean(missed**2, axis=0)) * scale))


def gap_ratio(data: Data, found: Sequence[Array]) -> float | None:
    """Return the slope of modelled over measured gaps between branches, as the memory test has it."""
    measured, modelled = [], []
    for recording, outputs in zip(data.measured, found, strict=True):
        own = outputs[-len(recording) :] * data.scale + data.offset
        for place, (given, output) in enumerate(data.pairs):
            both = np.column_stack([recording[output], own[:, place]])
            gaps = branch_gaps(recording[given], both)
            measured.append(gaps[:, 0])
            modelled.append(gaps[:, 1])
    gap, own_gap = np.concatenate(measured), np.concatenate(modelled)
    power = float(gap @ gap)
    return float(own_gap @ gap) / power if power > 0 else None


@contextlib.contextmanager
def limited(seconds: float) -> Iterator[None]:
    """Stop what takes longer, and keep libraries quiet."""

    def stop(signum: int, frame: FrameType | None) -> None:
        raise TimeoutError(f"takes more than {seconds:.0f} s")

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, max(seconds, 0.01))
    try:
        with (
            warnings.catch_warnings(),
            np.errstate(all="ignore"),
            contextlib.redirect_stdout(io.StringIO()),
        ):
            warnings.simplefilter("ignore")
            yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def timed(simulate: Simulate, data: Data) -> float:
    """Return the time of a sample in a long simulation [ns]."""
    u, y = data.train[0]
    long = np.resize(u, (TIMED, u.shape[1]))
    times = []
    for _ in range(2):
        started = time.perf_counter()
        simulate(long, y[:START])
        times.append(time.perf_counter() - started)
    return min(times) / TIMED * 1e9


def tested(peer: Peer, how: Settings, data: Data, row: Row) -> Row:
    """Return the row of a peer with these settings: fitted to the whole training side, and tested."""
    try:
        with limited(4 * BUDGET):
            started = time.perf_counter()
            simulate = peer.fit(data.fitted if peer is GRU else data.train, how, data.held)
            row = replace(row, fit_seconds=time.perf_counter() - started, settings=dict(how))
            if peer is GRU:
                held = rms(data.held, [one.run(simulate) for one in data.held], data.scale)
                row = replace(row, validation=held)
            found = [one.run(simulate) for one in data.tests]
            error = rms(data.tests, found, data.scale)
            if not np.isfinite(error):
                return replace(row, reason="its free run on the test runs away")
            return replace(
                row,
                rmse=error,
                percent=100 * error / data.span,
                gap=gap_ratio(data, found),
                step_ns=timed(simulate, data),
            )
    except (Exception, SystemExit) as error:  # a peer may fail in ways of its own
        return replace(row, settings=dict(how), reason=_told(error))


def searched(peer: Peer, data: Data, row: Row) -> Row:
    """Return the row of a peer with the settings that do best on what is held back, in the budget.

    One that takes a quarter of the budget is given up, so that others get their turn.
    """
    best, best_error, tries, reason = None, float("inf"), 0, "none of its settings runs free"
    started = time.perf_counter()
    for how in peer.grid:
        left = BUDGET - (time.perf_counter() - started)
        if left <= 0:
            break
        tries += 1
        try:
            with limited(min(left, BUDGET / 4)):
                simulate = peer.fit(data.fitted, how, data.held)
                error = rms(data.held, [one.run(simulate) for one in data.held], data.scale)
        except (Exception, SystemExit) as failed:
            reason = _told(failed)
            continue
        if error < best_error:
            best, best_error = how, error
    seconds = time.perf_counter() - started
    row = replace(row, search_seconds=seconds, tries=tries, settings_there=len(peer.grid))
    if best is None:
        return replace(row, reason=reason)
    return tested(peer, best, data, replace(row, validation=best_error))


def seeded(peer: Peer, data: Data, row: Row) -> Row:
    """Return the row of the seed whose test error is the median."""
    rows = [tested(peer, how, data, row) for how in peer.grid]
    rows.sort(key=lambda one: float("inf") if one.rmse is None else one.rmse)
    return rows[len(rows) // 2]


def _told(error: BaseException) -> str:
    words = str(error).strip().splitlines() or ["no reason given"]
    return f"{type(error).__name__}: {words[0]}"[:200]


def rows_of(peer: Peer, data: Data) -> list[Row]:
    """Return the rows of a peer: by its defaults, and by a search."""
    row = Row(model=peer.name, package=peer.package)
    inputs = data.train[0][0].shape[1]
    if peer.one_input and inputs > 1:
        return [replace(row, reason=f"takes one input only, and there are {inputs}")]
    if peer is GRU:
        return [seeded(peer, data, row)]
    found = [searched(peer, data, row)]
    if peer.default is not None:
        found.insert(0, tested(peer, peer.default, data, replace(row, defaults=True)))
    return found


def own_rows(board: Leaderboard, span: float, seconds: float) -> list[Row]:
    """Return the rows of this package's models, and of the one that it chooses."""
    best, found = board.best, []
    for one in board.rows:
        chosen = best is not None and one.model == best.model
        if one.model not in OURS and not chosen:
            continue
        row = Row(model=one.model, package="mckibben", chosen=chosen, reason=one.reason or "")
        if one.test is not None:
            row = replace(
                row,
                rmse=one.test.rmse,
                percent=100 * one.test.rmse / span,
                fit_seconds=one.fit_seconds,
                search_seconds=seconds if chosen else None,
                step_ns=one.step_ns,
                gap=None if one.memory is None else one.memory.gap_ratio,
            )
        found.append(row)
    return found


def run(one: Set, task: Task, recordings: list[Recording], kept: Kept) -> TaskRows:
    """Return all rows of a task, from what is kept or made now."""
    title = f"{one.title}: {task.name}" if task.name else one.title
    train, test = parted(task, recordings, one.folder)
    asked: dict[str, Any] = {
        "inputs": task.inputs,
        "outputs": task.outputs,
        "load": task.load,
        "seed": 0,
    }
    plan = plan_of(train, test, models=task.models, settings=task.settings, **asked)
    split, channels = plan.data.split, plan.data.channels
    data = data_of(split.train, split.test, channels)
    told = told_of([*train, *test], channels)
    gives = TaskRows(title, plan.unit, told, list(channels.outputs), plan.board().split)
    for peer in PEERS:
        rows = kept.get(title, f"{peer.package} {peer.name}")
        if rows is None:
            print(f"{title}: {peer.package} {peer.name}", file=sys.stderr, flush=True)
            rows = kept.put(title, f"{peer.package} {peer.name}", rows_of(peer, data))
        gives.rows.extend(rows)
    rows = kept.get(title, "mckibben")
    if rows is None:
        started = time.perf_counter()
        board = compare(
            train,
            test,
            models=task.models,
            settings=task.settings,
            jobs=1,
            folder=kept.folder / "mckibben" / title.replace("/", "-"),
            progress=lambda now: print(f"{title}: mckibben {now}", file=sys.stderr, flush=True),
            **asked,
        )
        if board.stopped:
            raise KeyboardInterrupt
        rows = own_rows(board, data.span, time.perf_counter() - started)
        kept.put(title, "mckibben", rows)
    gives.rows.extend(rows)
    return gives


def main() -> None:
    """Make the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--out", type=Path, default=Path("peers"), help="where rows are kept")
    parser.add_argument("--page", type=Path, default=Path("docs/measured/peers.md"))
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    kept, tasks, unread = Kept(given.out), [], {}
    try:
        for one in sets_in(given.folder):
            try:
                recordings = one.recordings()
                for left, task in one.tasks():
                    if not left:
                        tasks.append(run(one, task, recordings, kept))
            except MckibbenError as error:
                unread[one.title] = str(error).replace(f"{given.folder}/", "")
    except KeyboardInterrupt:
        raise SystemExit("stopped; the same command goes on from what is finished") from None
    words = [f"benchmarks/{Path(__file__).name}", "FOLDER"]
    given.page.parent.mkdir(parents=True, exist_ok=True)
    text = page(tasks, unread, PEERS, shlex.join(["python", *words]), BUDGET)
    given.page.write_text(text, encoding="utf-8")
    print(given.page)


if __name__ == "__main__":
    main()
