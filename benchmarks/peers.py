"""Other libraries and networks beside this package's models: their lines of the leaderboard.

Their environment: python3 -m venv peers-env && peers-env/bin/pip install . -r benchmarks/peers.txt
Run: peers-env/bin/python benchmarks/peers.py FOLDER ENTRIES [--only SET] [--models NAME] [--again]

FOLDER holds a folder for every set, as for ``mckibben measured``. Each model's predictions are written
to ENTRIES, scored as anybody's are (docs/measured/rules.md), and replace its lines in
docs/measured/leaderboard.csv; then run docs/measured/leaderboard.py.

Peers are given inputs and outputs of zero mean and unit variance, and start from the last known outputs.
Their settings are searched for by the free-running error on a quarter of the training side, the cheapest
first, within a budget of processor time; the best are fitted again to all of the training side. This
package's models are fitted as they are offered. ``--again`` takes the settings that the leaderboard has.
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
from hashlib import sha256
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import pandas as pd

from mckibben import compare
from mckibben.errors import MckibbenError
from mckibben.measured.scoring import START_SAMPLES, Part, entries, parts_of
from mckibben.measured.sets import Set, chosen_in
from mckibben.numerals import numeral
from mckibben.recording import Recording
from peers_libraries import LIBRARIES, Array, Peer, Run, Settings, Simulate, Trial
from peers_networks import NETWORKS

OURS = (
    *("balance", "balance-force", "gpi", "cpi", "preisach", "coupled-memory", "force-chou"),
    *("state-network", "narx-play"),
)

BUDGET = 30.0
"""Seconds of processor time that a search may take."""

TRY, SECONDS = 5.0, 25.0
"""Seconds of processor time that a training may take in a search, and after it."""

HELD_BACK = 4
"""One of so many recordings is held back of the training side; of fewer, each one's last such part."""

AWAY = 1e3
"""Times the spread of the training output beyond which a free run has run away."""

BOARD = Path("docs/measured/leaderboard.csv")
"""With the lines of the leaderboard."""

KEY = ["model", "set", "task"]
"""Columns that say which line it is."""


@dataclass(frozen=True)
class Data:
    """A task's recordings as peers are given them.

    Of `train`, `fitted` is what is left where a quarter is `held` back; `offset` and `scale` are the
    outputs' mean and standard deviation in training.
    """

    train: Sequence[Run]
    fitted: Sequence[Run]
    held: Sequence[Trial]
    tests: Sequence[Trial]
    offset: Array
    scale: Array


@dataclass(frozen=True)
class Result:
    """A model's predictions (n, k) on the tests of a task; without any, the reason."""

    name: str
    how: str = ""
    validation: float = np.inf
    error: float = np.inf
    found: Sequence[Array] = ()
    reason: str = ""


def data_of(part: Part) -> Data:
    """Return recordings as peers are given them, scaled as they are on the training side."""
    train, channels = part.split.train, part.channels
    names = [*channels.inputs_in([*train, *part.split.test])]
    inputs = np.vstack([one.matrix(names) for one in train])
    outputs = np.vstack([one.matrix(channels.outputs) for one in train])
    middle, spread = inputs.mean(axis=0), inputs.std(axis=0)
    spread[spread == 0] = 1.0
    offset, scale = outputs.mean(axis=0), outputs.std(axis=0)

    def scaled(one: Recording) -> Run:
        u, y = one.matrix(names), one.matrix(channels.outputs)
        return (u - middle) / spread, (y - offset) / scale

    def trial(one: Recording) -> Trial:
        return Trial(*scaled(one), START_SAMPLES)

    runs = [scaled(one) for one in train]
    fitted, held = held_back(runs)
    return Data(runs, fitted, held, [trial(one) for one in part.split.test], offset, scale)


def held_back(runs: Sequence[Run]) -> tuple[list[Run], list[Trial]]:
    """Return what is fitted and what is tried where a quarter of the training side is held back.

    Of four or more runs every fourth, whole; of fewer the last quarter of each, which goes on.
    """
    if len(runs) >= HELD_BACK:
        last = HELD_BACK - 1
        rest = [run for place, run in enumerate(runs) if place % HELD_BACK != last]
        return rest, [Trial(u, y, START_SAMPLES) for u, y in runs[last::HELD_BACK]]
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
    """Stop what takes more processor time, and keep libraries quiet."""

    def stop(signum: int, frame: FrameType | None) -> None:
        raise TimeoutError(f"takes more than {seconds:.0f} s")

    signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, max(seconds, 0.01))
    try:
        with (
            warnings.catch_warnings(),
            np.errstate(all="ignore"),
            contextlib.redirect_stdout(io.StringIO()),
        ):
            warnings.simplefilter("ignore")
            yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)


def reason(error: BaseException) -> str:
    words = str(error).strip().splitlines() or ["no reason given"]
    return f"{type(error).__name__}: {words[0]}"[:200]


FITTED: dict[str, Simulate] = {}
SEARCHED: dict[str, tuple[Settings | None, Result]] = {}
"""Models and searches by name, settings and data: two tasks may have the same training side."""


def digest(runs: Sequence[Run]) -> str:
    return sha256(b"".join(np.hstack(run).tobytes() for run in runs)).hexdigest()


def fitted(peer: Peer, runs: Sequence[Run], how: Settings, data: Data) -> Simulate:
    """Return a peer's model, fitted once."""
    key = f"{peer.name} {how} {digest(runs)}"
    if key not in FITTED:
        FITTED[key] = peer.fit(runs, how, data.held)
    return FITTED[key]


def validated(peer: Peer, how: Settings, data: Data) -> float:
    """Return the error on what is held back of a peer fitted to the rest."""
    simulate = fitted(peer, data.fitted, how, data)
    return rms(data.held, [one.run(simulate) for one in data.held], data.scale)


def tested(peer: Peer, how: Settings, data: Data, part: Part, row: Result) -> Result:
    """Return the result of a peer with these settings, fitted to the whole training side."""
    how = how | {"seconds": SECONDS} if peer.stops_early else how
    try:
        with limited(peer.seconds):
            if peer.seeds and not peer.stops_early:
                row = replace(row, validation=validated(peer, how, data))
            runs = data.fitted if peer.stops_early else data.train
            simulate = fitted(peer, runs, how, data)
            if peer.stops_early:
                held = rms(data.held, [one.run(simulate) for one in data.held], data.scale)
                row = replace(row, validation=held)
            found = [one.run(simulate) for one in data.tests]
    except (Exception, SystemExit) as error:  # a peer may fail in ways of its own
        return replace(row, reason=reason(error))
    missed = rms(data.tests, found, data.scale)
    if not np.isfinite(missed):
        return replace(row, reason="its free run on the test runs away")
    lengths = [len(run) for run in part.split.test]
    own = [y[len(y) - n :] for y, n in zip(found, lengths, strict=True)]
    return replace(row, found=[y * data.scale + data.offset for y in own], error=missed)


def seeded(peer: Peer, how: Settings, data: Data, part: Part, row: Result) -> Result:
    """Return the result of the seed whose validation error is the median, and all seeds' errors."""
    tries = [tested(peer, how | {"seed": seed}, data, part, row) for seed in range(peer.seeds)]
    order = sorted(range(peer.seeds), key=lambda seed: tries[seed].validation)
    seed = order[peer.seeds // 2]
    errors = sorted(one.error for one in tries)
    spread = f"seed={seed} of {peer.seeds} with {numeral(errors[0], 3)} to {numeral(errors[-1], 3)}"
    return replace(tries[seed], how=", ".join(filter(None, [row.how, spread])))


def searched(peer: Peer, data: Data, row: Result) -> tuple[Settings | None, Result]:
    """Return the settings that do best on what is held back, in the budget; none if all fail.

    One that takes a quarter of the budget is given up, so that others get their turn.
    """
    best: Settings | None = None
    best_error, tries, why = float("inf"), 0, "none of its settings runs free"
    started = time.process_time()
    for how in peer.grid:
        left = BUDGET - (time.process_time() - started)
        if left <= 0:
            break
        tries += 1
        try:
            with limited(min(left, BUDGET / 4)):
                given = how | {"seed": 0} if peer.seeds else how
                error = validated(
                    peer, given | {"seconds": TRY} if peer.stops_early else given, data
                )
        except (Exception, SystemExit) as failed:
            why = reason(failed)
            continue
        if error < best_error:
            best, best_error = how, error
    there = len(peer.grid)
    count = f"the best of {tries}" + (f" in time, of {there}" if tries < there else "")
    if best is None:
        return None, replace(row, reason=why)
    return best, replace(row, how=", ".join([*words(best), count]), validation=best_error)


def words(how: Settings) -> list[str]:
    return [f"{name}={value}" for name, value in how.items()]


def results_of(peer: Peer, data: Data, part: Part, again: str) -> list[Result]:
    """Return the results of a peer: by a search, and by its defaults if it has any.

    ``again`` has the settings found before, which are then not searched for.
    """
    before = {*again.split(", ")}
    matching = [how for how in peer.grid if again and {*words(how)} <= before]
    row = Result(peer.name, again.partition(", seed=")[0])
    best: Settings | None = next(iter(matching), None)
    if best is None and len(peer.grid) > 1:
        key = f"{peer.name} {digest(data.train)}"
        if key not in SEARCHED:
            SEARCHED[key] = searched(peer, data, Result(peer.name))
        best, row = SEARCHED[key]
    elif best is None:
        best, row = peer.grid[0], Result(peer.name, ", ".join(words(peer.grid[0])))
    of_best = seeded if peer.seeds else tested
    found = [row if best is None else of_best(peer, best, data, part, row)]
    if peer.defaults:
        found.append(tested(peer, {}, data, part, Result(f"{row.name} defaults")))
    return found


def own_results(part: Part, models: Sequence[str]) -> Iterator[Result]:
    """Yield the results of this package's models."""
    task, split = part.task, part.split
    asked = [name for name in OURS if f"mckibben {name}" in models or not models]
    about: dict[str, Any] = task.model_dump(include={"inputs", "outputs", "load"})
    for name in (one for one in asked if task.models == "all" or one in task.models):
        settings = {name: task.settings[name]} if name in task.settings else {}
        row = Result(f"mckibben {name}")
        try:
            board = compare(
                split.train,
                split.test,
                models=[name],
                settings=settings,
                jobs=1,
                **about,
            )
        except MckibbenError:
            continue  # it does not apply to these channels
        block = board.rows[0].block
        if block is None:
            yield replace(row, reason=board.rows[0].reason or "")
            continue
        outputs = part.channels.outputs
        try:
            found = [block.simulate(run).matrix(outputs) for run in split.test]
        except MckibbenError as error:  # of another sample time
            yield replace(row, reason=str(error))
            continue
        yield replace(row, found=found)


def frame_of(one: Set, part: Part, result: Result) -> pd.DataFrame:
    """Return predictions as docs/measured/rules.md asks for them."""
    frames = []
    for run, found in zip(part.split.test, result.found, strict=True):
        columns = dict(zip(part.channels.outputs, found.T, strict=True))
        keys = {"set": one.name, "task": part.task.name, "recording": run.name}
        frames.append(pd.DataFrame(keys | {"row": np.arange(len(run))} | columns))
    return pd.concat(frames)


def takes_part(peer: Peer, one: Set, part: Part) -> bool:
    """Return whether a peer takes part: not where models use a data sheet."""
    sheet = any("prior" in own for own in part.task.settings.values())
    return not sheet and (one.name in peer.sets if peer.sets else not part.task.leave_out)


def main() -> None:
    """Write predictions, and their lines of the leaderboard."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("entries", type=Path)
    parser.add_argument("--only", action="append", default=[])
    parser.add_argument("--models", action="append", default=[])
    parser.add_argument("--again", action="store_true")
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    peers = [one for one in (*LIBRARIES, *NETWORKS) if one.name in given.models or not given.models]
    for one in chosen_in(given.folder, given.only):
        board = pd.read_csv(BOARD).fillna({"task": "", "how": ""}) if BOARD.exists() else None
        lines = [] if board is None else [board]
        before = {(*key,): how for table in lines for *key, how in table[[*KEY, "how"]].to_numpy()}
        frames: dict[str, list[pd.DataFrame]] = {}
        how: dict[tuple[str, str], str] = {}
        failed = set[tuple[str, str]]()
        for part in parts_of(one, one.recordings()):
            data, task = data_of(part), part.task.name
            results = list(own_results(part, given.models))
            for peer in (peer for peer in peers if takes_part(peer, one, part)):
                again = before.get((peer.name, one.name, task), "") if given.again else ""
                results += results_of(peer, data, part, again)
            for result in results:
                said = f"{one.name} {task} {part.task.leave_out}: {result.name}: {result.reason}"
                print(said, file=sys.stderr, flush=True)
                if result.found:
                    frames.setdefault(result.name, []).append(frame_of(one, part, result))
                    how[result.name, task] = result.how
                else:
                    failed.add((result.name, task))
        (given.entries / one.name).mkdir(parents=True, exist_ok=True)
        for name, parts in frames.items():
            whole = pd.concat(parts)
            whole = whole[[(name, task) not in failed for task in whole["task"]]]
            if whole.empty:
                continue
            file = given.entries / one.name / f"{name}.csv"
            whole.to_csv(file, index=False)
            scored = pd.DataFrame([vars(line) for line in entries(file, [one])])
            scored["how"] = [how[name, task] for task in scored["task"]]
            lines.append(scored)
        board = pd.concat(lines).drop_duplicates(KEY, keep="last")
        board.sort_values(["set", "task", "rmse"]).to_csv(BOARD, index=False, float_format="%.4g")


if __name__ == "__main__":
    main()
