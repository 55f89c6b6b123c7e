"""Other libraries and a GRU beside this package's models, on the same splits of measured recordings.

Their environment: python3 -m venv peers-env && peers-env/bin/pip install . -r benchmarks/peers.txt
Run: peers-env/bin/python benchmarks/peers.py FOLDER [--page docs/measured/peers.md]

FOLDER holds a folder for every set, as for ``mckibben.measured``. The page's introduction, which says
how peers are fitted and started, is left as it is; the tables are written anew.
"""

from __future__ import annotations

import argparse
import contextlib
import io
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
from mckibben.blocks.free_run import predecessor
from mckibben.comparison.channels import Channels
from mckibben.comparison.leaderboard import Leaderboard
from mckibben.comparison.planning import plan_of
from mckibben.errors import MckibbenError
from mckibben.measured.sets import Set, Task, parted, sets_in
from mckibben.numerals import numeral
from mckibben.recording import Recording
from peers_libraries import GRU, PEERS, START, Array, Peer, Run, Settings, Trial

OURS = ("balance", "balance-force", "gpi", "cpi", "preisach")

BUDGET = 30.0
"""Seconds that a search may take: the same for every peer but the GRU."""

HELD_BACK = 4
"""One of so many recordings is held back of the training side; of fewer, each one's last such part."""

AWAY = 1e3
"""Times the spread of the training output beyond which a free run has run away."""

TABLES = "## The best of each"
"""Heading at which the page's introduction ends."""


@dataclass(frozen=True)
class Data:
    """A task's recordings as peers are given them.

    Of `train`, `fitted` is what is left where a quarter is `held` back; `scale` and `span` are the
    outputs' standard deviation in training and their largest range in the tests.
    """

    train: Sequence[Run]
    fitted: Sequence[Run]
    held: Sequence[Trial]
    tests: Sequence[Trial]
    scale: Array
    span: float


@dataclass(frozen=True)
class Row:
    """What came of a model on a task; without an error, the reason.

    `validation` is the free-running RMSE on the quarter held back, of the settings searched for.
    """

    name: str
    chosen: bool = False
    settings: str = ""
    validation: float = np.inf
    rmse: float = np.inf
    percent: float = np.inf
    reason: str = ""

    @property
    def best(self) -> str:
        """The row in the overview."""
        name = self.name.strip("*")
        return f"{name} {self.percent:.2f}" if np.isfinite(self.percent) else "none"


def data_of(train: Sequence[Recording], test: Sequence[Recording], channels: Channels) -> Data:
    """Return recordings as peers are given them, scaled as they are on the training side."""
    names = inputs_of([*train, *test], channels)
    inputs = np.vstack([one.matrix(names) for one in train])
    outputs = np.vstack([one.matrix(channels.outputs) for one in train])
    middle, spread = inputs.mean(axis=0), inputs.std(axis=0)
    spread[spread == 0] = 1.0
    offset, scale = outputs.mean(axis=0), outputs.std(axis=0)

    def scaled(one: Recording) -> Run:
        u, y = one.matrix(names), one.matrix(channels.outputs)
        return (u - middle) / spread, (y - offset) / scale

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
    return Data(runs, fitted, held, [trial(one) for one in test], scale, span)


def inputs_of(recordings: Sequence[Recording], channels: Channels) -> list[str]:
    """Return what peers are given: what any of our models is, which of a force is the pressure too."""
    given = [*channels.inputs, *channels.scheduled(recordings)]
    if "force" in channels.outputs and all("pressure" in one for one in recordings):
        given.append("pressure")
    return list(dict.fromkeys(given))


def held_back(runs: Sequence[Run]) -> tuple[list[Run], list[Trial]]:
    """Return what is fitted and what is tried where a quarter of the training side is held back.

    Of four or more runs every fourth, whole; of fewer the last quarter of each, which goes on.
    """
    if len(runs) >= HELD_BACK:
        last = HELD_BACK - 1
        rest = [run for place, run in enumerate(runs) if place % HELD_BACK != last]
        return rest, [Trial(u, y, START) for u, y in runs[last::HELD_BACK]]
    cuts = [len(u) - len(u) // HELD_BACK for u, _ in runs]
    fitted = [(u[:cut], y[:cut]) for (u, y), cut in zip(runs, cuts, strict=True)]
    return fitted, [Trial(u, y, cut) for (u, y), cut in zip(runs, cuts, strict=True)]


def rms(trials: Sequence[Trial], found: Sequence[Array], scale: Array) -> float:
    """Return the RMSE of free runs, of several outputs the mean; infinite where they ran away."""
    pairs = zip(trials, found, strict=True)
    missed = np.vstack([(y - one.outputs)[one.known :] for one, y in pairs])
    if not np.all(np.abs(missed) < AWAY):  # NaN is not less
        return float("inf")
    return float(np.mean(np.sqrt(np.mean(missed**2, axis=0)) * scale))


@contextlib.contextmanager
def limited(seconds: float) -> Iterator[None]:
    """Stop what takes longer, and keep libraries quiet."""

    def stop(signum: int, frame: FrameType | None) -> None:
        raise TimeoutError(f"takes more than {seconds:.0f} s")

    signal.signal(signal.SIGALRM, stop)
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


def reason(error: BaseException) -> str:
    words = str(error).strip().splitlines() or ["no reason given"]
    return f"{type(error).__name__}: {words[0]}"[:200]


def tested(peer: Peer, how: Settings, data: Data, row: Row) -> Row:
    """Return the row of a peer with these settings: fitted to the whole training side, and tested."""
    try:
        with limited(4 * BUDGET):
            simulate = peer.fit(data.fitted if peer is GRU else data.train, how, data.held)
            if peer is GRU:
                held = rms(data.held, [one.run(simulate) for one in data.held], data.scale)
                row = replace(row, validation=held)
            found = [one.run(simulate) for one in data.tests]
            error = rms(data.tests, found, data.scale)
            if not np.isfinite(error):
                return replace(row, reason="its free run on the test runs away")
            return replace(row, rmse=error, percent=100 * error / data.span)
    except (Exception, SystemExit) as error:  # a peer may fail in ways of its own
        return replace(row, reason=reason(error))


def searched(peer: Peer, data: Data, row: Row) -> Row:
    """Return the row of a peer with the settings that do best on what is held back, in the budget.

    One that takes a quarter of the budget is given up, so that others get their turn.
    """
    best: Settings = {}
    best_error, tries, why = float("inf"), 0, "none of its settings runs free"
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
            why = reason(failed)
            continue
        if error < best_error:
            best, best_error = how, error
    there = len(peer.grid)
    count = f"the best of {tries}" + (f" in time, of {there}" if tries < there else "")
    row = replace(row, settings=", ".join([*words(best), count]), validation=best_error)
    return tested(peer, best, data, row) if best else replace(row, reason=why)


def words(how: Settings) -> list[str]:
    return [f"{name}={value}" for name, value in how.items()]


def rows_of(peer: Peer, data: Data) -> list[Row]:
    """Return the rows of a peer: by its defaults and by a search, or of the seed that is the median."""
    row = Row(f"{peer.package} {peer.name}")
    if peer is GRU:
        seeds = [tested(peer, how, data, replace(row, settings=words(how)[0])) for how in peer.grid]
        return [sorted(seeds, key=lambda one: one.rmse)[len(seeds) // 2]]
    defaults = tested(peer, {}, data, replace(row, name=f"{row.name}, defaults"))
    return [defaults, searched(peer, data, row)]


def own_rows(board: Leaderboard, span: float) -> Iterator[Row]:
    """Yield the rows of this package's models, and of the one that it chooses."""
    for one in board.rows:
        chosen = board.best is not None and one.model == board.best.model
        if one.model not in OURS and not chosen:
            continue
        row = Row(f"**`{one.model}`**", chosen=chosen, reason=one.reason or "")
        if one.test is not None:
            row = replace(row, rmse=one.test.rmse, percent=100 * one.test.rmse / span)
        yield row


def run(one: Set, task: Task, recordings: list[Recording]) -> tuple[str, str]:
    """Return a task's line in the overview, and its section."""
    title = f"{one.title}: {task.name}" if task.name else one.title
    print(title, file=sys.stderr, flush=True)
    train, test = parted(task, recordings, one.folder)
    about = task.model_dump(include={"models", "settings", "inputs", "outputs", "load"})
    asked: dict[str, Any] = about | {"seed": 0}
    plan = plan_of(train, test, **asked)
    split, channels = plan.data.split, plan.data.channels
    data = data_of(split.train, split.test, channels)
    peers = [row for peer in PEERS for row in rows_of(peer, data)]
    board = compare(train, test, jobs=1, **asked)
    if board.stopped:
        raise SystemExit("stopped")
    ours = list(own_rows(board, data.span))
    chosen = next((row for row in ours if row.chosen), Row(""))
    pairs = (
        (chosen, min(peers, key=lambda row: row.validation)),
        (min(ours, key=lambda row: row.rmse), min(peers, key=lambda row: row.rmse)),
    )
    cells = [f"{a.best} | {b.best} | {b.rmse / a.rmse:.2f}" for a, b in pairs]
    given = ", ".join(inputs_of([*train, *test], channels))
    lines = [
        f"## {title}\n",
        f"{', '.join(channels.outputs)} [{plan.empty.unit}] from {given}; {plan.board().split}.\n",
        f"| model | test RMSE [{plan.empty.unit}] | of range [%] | settings |",
        "|---|---:|---:|---|",
        *section([*peers, *ours]),
    ]
    return f"| {title} | {' | '.join(cells)} |", "\n".join(lines) + "\n"


def section(rows: Sequence[Row]) -> Iterator[str]:
    """Yield lines of a table, the best first, and of what failed."""
    for row in sorted(rows, key=lambda row: row.rmse):
        name = f"{row.name}, chosen" if row.chosen else row.name
        if np.isfinite(row.rmse):
            cells = (name, numeral(row.rmse, 3), f"{row.percent:.2f}", row.settings)
            yield f"| {' | '.join(cells)} |"
        else:
            yield f"\n- {name}: {row.reason}{f' ({row.settings})' if row.settings else ''}."


def main() -> None:
    """Write the tables of the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--page", type=Path, default=Path("docs/measured/peers.md"))
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    tasks = []
    for one in sets_in(given.folder):
        try:
            recordings = one.recordings()
            tasks += [run(one, task, recordings) for task in one.tasks() if not task.leave_out]
        except MckibbenError as error:
            print(f"{one.title}: not read: {error}", file=sys.stderr)
    introduction = given.page.read_text(encoding="utf-8").partition(TABLES)[0]
    overview = [
        f"{TABLES}\n",
        "Test RMSE in per cent of range. Chosen without the test: of ours by cross-validation, of the "
        "peers by the error on the quarter held back. The best are known by the test alone.\n",
        "| set | ours, chosen | peer, chosen | ratio | ours, best | peer, best | ratio |",
        "|---|---:|---:|---:|---:|---:|---:|",
        *(line for line, _ in tasks),
        "",
    ]
    text = introduction + "\n".join([*overview, *(section for _, section in tasks)])
    given.page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
