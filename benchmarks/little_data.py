"""How much data models need: errors over the share of the training side that they are given.

    peers-env/bin/python benchmarks/little_data.py FOLDER      writes docs/measured/little-data.md

FOLDER and the environment are those of benchmarks/peers.py. Of `MANY` or more training recordings
some are taken, evenly spread; of fewer, the first part of each. The test is the same. Other methods
have the settings that the leaderboard states, so that only their weights are of the little data. Takes
about a quarter of an hour.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from mckibben.measured.scoring import START_SAMPLES, Part, parts_of
from mckibben.measured.sets import chosen_in
from mckibben.numerals import numeral
from mckibben.recording import Recording
from peers import BOARD, data_of, own_results, results_of
from peers_libraries import LIBRARIES
from peers_networks import NETWORKS

TASKS = {
    "cavatappi_loads": ("sample 3, 200 and 400 g", ("balance", "coupled-memory")),
    "festo_dmsp10_levels": ("", ("balance", "cpi")),
    "festo_isometric_20mm": ("12 cm, run 3", ("balance-force", "force-chou")),
    "soft_arm_three_muscles": ("", ("balance", "coupled-memory")),
}
"""Set -> task, and this package's models."""

OTHERS = ("sysidentpy FROLS", "SIPPY ARX", "torch GRU 32", "reservoirpy ESN")

SHARES = (0.125, 0.25, 0.5, 1.0)

MANY = 5
"""Training recordings from which on some are taken whole."""

PAGE_FILE = Path(__file__).parent.parent / "docs" / "measured" / "little-data.md"

PAGE = """# How much data a model needs

```{{index}} little data, data efficiency, networks, when physics wins
```

Free-run errors on the test, of models that are given a part of the training data: some of the recordings
where there are {many} or more of them (DMSP-20), otherwise the first part of each. The settings of other
libraries are those of the [leaderboard](leaderboard.md), found on all of the training data; their
weights, as all of this package's models, are of the part alone.

Written by `python benchmarks/little_data.py FOLDER`, in the environment of `benchmarks/peers.txt`.

Least error of this package's models over the least of the other methods; below 1 where a physical
model wins:

| set | least data | half | all data | all data, all methods of the leaderboard |
|---|---:|---:|---:|---:|
{summary}

A model of forces extrapolates only what its terms determine. The first quarter of the recordings of
cavatappi ends at 1.6 bar of 20, before the muscle moves, and no method has a useful error there.
Physical models lead where they describe what drives the muscle. Networks lead on the tasks of the
[leaderboard](leaderboard.md) whose physics they lack: tanks that drain by the root of their level, a
sweep through a resonance, coiled polymer muscles.
{tables}"""


def part_of(runs: Sequence[Recording], share: float) -> Iterator[Recording]:
    """Yield some of many recordings, evenly spread; of few, the first part of each."""
    if len(runs) >= MANY:
        some = max(round(share * len(runs)), 1)
        yield from (runs[round((place + 0.5) * len(runs) / some - 0.5)] for place in range(some))
        return
    for run in runs:
        yield run.slice(0, max(round(share * len(run)), 3 * START_SAMPLES))


def little(part: Part, share: float) -> Part:
    """Return a task with a part of its training data."""
    train = tuple(part_of(part.split.train, share))
    return replace(part, split=replace(part.split, train=train))


def rmse(part: Part, found: Sequence[np.ndarray]) -> float:
    """Return the error of predictions on the rows that are scored, of several outputs the mean."""
    outputs = part.channels.outputs
    each = zip(found, part.split.test, part.rows, strict=True)
    missed = np.vstack([(y - run.matrix(outputs))[rows] for y, run, rows in each])
    return float(np.sqrt((missed**2).mean(axis=0)).mean())


def errors(
    part: Part, models: Sequence[str], how: Mapping[str, str]
) -> Iterator[tuple[str, float, float]]:
    """Yield model, seconds of training and error."""
    for share in SHARES:
        given = little(part, share)
        seconds = sum(run.duration or 0.0 for run in given.split.train)
        for result in own_results(given, [f"mckibben {model}" for model in models]):
            yield result.name, seconds, rmse(given, result.found) if result.found else np.nan
        data = data_of(given)
        for peer in (one for one in (*LIBRARIES, *NETWORKS) if one.name in OTHERS):
            best = results_of(replace(peer, defaults=False), data, given, how.get(peer.name, ""))[0]
            yield peer.name, seconds, rmse(given, best.found) if best.found else np.nan


def table(rows: pd.DataFrame, unit: str) -> str:
    """Return a table of errors, a column for every amount of data."""
    wide = rows.pivot_table(index="model", columns="seconds", values="error", dropna=False)
    heads = [f"{numeral(float(str(seconds)), 3)} s" for seconds in wide.columns]
    lines = [f"| model | {' | '.join(heads)} |", f"|---|{'---:|' * len(heads)}"]
    for model, values in wide.sort_values(wide.columns[-1]).iterrows():
        lines.append(f"| {model} | {' | '.join(numeral(float(x), 3) for x in values)} |")
    return f"RMSE [{unit}]:\n\n" + "\n".join(lines)


def ratio(rows: pd.DataFrame, error: str) -> pd.Series[float]:
    """Return this package's least error over that of the others, for every amount of data."""
    ours = rows["model"].str.startswith("mckibben ")
    least = [rows[side].groupby("seconds")[error].min() for side in (ours, ~ours)]
    return (least[0] / least[1]).sort_index()


def main() -> None:
    """Measure, and write the page."""
    warnings.simplefilter("ignore")
    (folder,) = map(Path, sys.argv[1:])
    board = pd.read_csv(BOARD).fillna({"task": "", "how": ""})
    tables, summary = [], []
    for one in chosen_in(folder, list(TASKS)):
        task, models = TASKS[one.name]
        (part,) = (each for each in parts_of(one, one.recordings()) if each.task.name == task)
        lines = board[(board["set"] == one.name) & (board["task"] == task)]
        how = dict(zip(lines["model"], lines["how"], strict=True))
        rows = []
        for row in errors(part, models, how):
            print(one.name, *row, flush=True)
            rows.append(row)
        frame = pd.DataFrame(rows, columns=["model", "seconds", "error"])
        heading = ": ".join(filter(None, [one.title, task]))
        unit = part.split.test[0].units[part.channels.outputs[0]]
        shares = [*ratio(frame, "error").iloc[[0, -2, -1]], *ratio(lines.assign(seconds=0), "rmse")]
        cells = " | ".join(numeral(float(share), 2) for share in shares)
        summary.append(f"| {heading} | {cells} |")
        tables.append(f"\n## {heading}\n\n{table(frame, unit)}\n")
    PAGE_FILE.write_text(
        PAGE.format(many=MANY, summary="\n".join(summary), tables="".join(tables)), encoding="utf-8"
    )


if __name__ == "__main__":
    main()
