"""Rows of other libraries' models beside ours, kept while they are made, and the page of them."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from mckibben.numerals import numeral
from mckibben.system.atomic import replacing
from peers_libraries import START, Peer

OWN = "mckibben"


@dataclass(frozen=True)
class Row:
    """What came of a model on a task.

    Parameters
    ----------
    model, package : str
    defaults : bool
        Whether its settings are the package's defaults.
    chosen : bool
        Whether this package's cross-validation chooses it.
    settings : mapping
        Those given.
    validation : float or None
        Free-running RMSE on the quarter held back, of the settings searched for.
    rmse, percent : float or None
        Free-running on the test, in the unit of the output, and of its range; None where it failed.
    fit_seconds, search_seconds : float or None
    tries, settings_there : int
        Settings tried within the budget, and in the grid.
    step_ns : float or None
        Of a sample in a long simulation.
    gap : float or None
        Modelled gap between branches over the measured one.
    reason : str
        Why it failed.
    """

    model: str
    package: str
    defaults: bool = False
    chosen: bool = False
    settings: Mapping[str, Any] = field(default_factory=dict)
    validation: float | None = None
    rmse: float | None = None
    percent: float | None = None
    fit_seconds: float | None = None
    search_seconds: float | None = None
    tries: int = 0
    settings_there: int = 0
    step_ns: float | None = None
    gap: float | None = None
    reason: str = ""

    @property
    def error(self) -> float:
        """The RMSE, infinite where there is none."""
        return float("inf") if self.rmse is None else self.rmse


@dataclass
class TaskRows:
    """All rows of a task."""

    title: str
    unit: str
    told: Sequence[str]
    outputs: Sequence[str]
    split: str
    rows: list[Row] = field(default_factory=list)

    def best(self, own: bool) -> Row | None:
        """Return the row of the least test error, of ours or of others."""
        rows = [row for row in self.rows if (row.package == OWN) == own and row.rmse is not None]
        return min(rows, key=lambda row: row.error, default=None)

    @property
    def promising(self) -> Row | None:
        """The peer of the least error on what is held back."""
        rows = [row for row in self.rows if row.validation is not None]
        return min(rows, key=lambda row: row.validation or 0.0, default=None)


class Kept:
    """Rows that are finished, in a file.

    Parameters
    ----------
    folder : Path
        Holds ``rows.json``.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        self._file = folder / "rows.json"
        self._rows: dict[str, dict[str, list[dict[str, Any]]]] = (
            json.loads(self._file.read_text()) if self._file.exists() else {}
        )

    def get(self, task: str, whose: str) -> list[Row] | None:
        """Return rows that are finished, or None."""
        found = self._rows.get(task, {}).get(whose)
        return None if found is None else [Row(**one) for one in found]

    def put(self, task: str, whose: str, rows: list[Row]) -> list[Row]:
        """Keep rows, and return them."""
        self._rows.setdefault(task, {})[whose] = [asdict(row) for row in rows]
        with replacing(self._file) as new:
            new.write_text(json.dumps(self._rows, indent=1))
        return rows


HEAD = """# Other libraries, side by side

Made by `{command}`, in an environment of its own (see the top of that file); do not edit.

Every row is fitted to the same training side and runs free on the same test: from the inputs alone,
after a start. Peers start from measured outputs: the last ones of the training side where the test
continues it, else the first {start} of the test, which are not scored for them. Ours start from the end
of the training side as well, else from the first measured output. All peers are given inputs and outputs
of zero mean and unit variance.

- **defaults**: the library's own settings. Else settings are searched for by the free-running error on a
  quarter of the training side (the last quarter of each recording; of four or more recordings, every
  fourth one), within {budget:.0f} s a peer and set, the cheapest first; one that takes a quarter of that
  is given up. The best are fitted again to all of the training side.
- **test RMSE**: also in per cent of the range of what is tested on; of several outputs, the mean.
- **fit**: one fit with the settings shown; **search**: all that came before it. Ours are fitted as they
  are offered, without a search but their own; of the one chosen, the search is the whole comparison of
  all models with its cross-validation.
- **step**: time of a sample in a simulation of 20 000, as the library simulates.
- **branch kept**: the model's gap between rising and falling branches over the measured one, on the
  test, as in the memory test of `mckibben.compare`: 1 is perfect, 0 has forgotten. A dash: no pairs.
  Where the input mostly rests, as the pressure at held lengths does, noise makes the branches, and the
  figure means little.

Of ours, `balance`, `balance-force`, `gpi`, `cpi` and `preisach` are shown where they are offered, and
the one chosen among all. Times are of one machine of two cores, in several sittings beside other work:
their orders of magnitude count, and on a quiet one the searches of the large sets get further.
"""


def page(
    tasks: Sequence[TaskRows],
    unread: Mapping[str, str],
    peers: Sequence[Peer],
    command: str,
    budget: float,
) -> str:
    """Return the page, in Markdown."""
    lines = [HEAD.format(command=command, start=START, budget=budget), *_overview(tasks)]
    for task in tasks:
        lines += ["", *_section(task)]
    lines += ["", "## What was done to give peers what they take", ""]
    lines += [f"- {peer.package}, {peer.name}: {peer.note}." for peer in peers]
    lines += [
        "- harold is not here: it identifies no models from recordings. Nor are others of SIPPY's and "
        "sysidentpy's methods: one of each kind stands for them."
    ]
    if unread:
        lines += ["", "## Not read", "", *(f"- {name}: {why}" for name, why in unread.items())]
    return "\n".join(lines).rstrip("\n") + "\n"


def _overview(tasks: Sequence[TaskRows]) -> Iterator[str]:
    yield "## The best of each"
    yield ""
    yield (
        "Test RMSE in per cent of range. Chosen without the test: of ours by cross-validation, of the "
        "peers by the error on the quarter held back. The best are known by the test alone."
    )
    yield ""
    yield "| set | ours, chosen | peer, chosen | ratio | ours, best | peer, best | ratio |"
    yield "|---|---:|---:|---:|---:|---:|---:|"
    for task in tasks:
        chosen = next((row for row in task.rows if row.chosen), None)
        pairs = ((chosen, task.promising), (task.best(own=True), task.best(own=False)))
        cells = [
            text
            for own, other in pairs
            for text in (_named(own), _named(other), _ratio(own, other))
        ]
        yield f"| {task.title} | " + " | ".join(cells) + " |"


def _ratio(own: Row | None, other: Row | None) -> str:
    """Return the peer's error over ours, where both have one."""
    if own is None or other is None or not own.rmse or other.rmse is None:
        return "–"
    return f"{other.rmse / own.rmse:.2f}"


def _named(row: Row | None) -> str:
    if row is None or row.percent is None:
        return "none"
    name = f"`{row.model}`" if row.package == OWN else f"{row.package} {row.model}"
    return f"{name} {row.percent:.2f}"


def _section(task: TaskRows) -> Iterator[str]:
    yield f"## {task.title}"
    yield ""
    yield f"{', '.join(task.outputs)} [{task.unit}] from {', '.join(task.told)}; {task.split}."
    yield ""
    yield (
        f"| model | test RMSE [{task.unit}] | of range [%] | fit [s] | search [s] | step [ns] "
        "| branch kept | settings |"
    )
    yield "|---|---:|---:|---:|---:|---:|---:|---|"
    done = sorted((row for row in task.rows if row.rmse is not None), key=lambda row: row.error)
    for row in done:
        percent = "" if row.percent is None else f"{row.percent:.2f}"
        gap = "–" if row.gap is None else f"{row.gap:.2f}"
        cells = [
            *(_title(row), numeral(row.error, 3), percent, _figure(row.fit_seconds)),
            *(_figure(row.search_seconds), _figure(row.step_ns), gap, _settings(row)),
        ]
        yield "| " + " | ".join(cells) + " |"
    failed = [row for row in task.rows if row.rmse is None]
    if failed:
        yield ""
    for row in failed:
        settings = _settings(row)
        yield f"- {_title(row)}: {row.reason}{f' ({settings})' if settings else ''}."


def _title(row: Row) -> str:
    if row.package == OWN:
        return f"**`{row.model}`**" + (", chosen" if row.chosen else "")
    return f"{row.package} {row.model}" + (", defaults" if row.defaults else "")


def _figure(value: float | None) -> str:
    if value is None:
        return "–"
    return f"{value:.0f}" if value >= 100 else numeral(value, 2)


def _settings(row: Row) -> str:
    words = [f"{name}={value}" for name, value in row.settings.items()]
    if row.tries:
        short = "" if row.tries == row.settings_there else f" in time, of {row.settings_there}"
        words.append(f"the best of {row.tries}{short}")
    return ", ".join(words)
