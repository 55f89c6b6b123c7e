"""Re-run of a paper: recordings, fits, free runs, tables and figures, by one builder for all papers.

A paper's module says what is recorded, fitted and compared; every word of it is in its ``paper.toml``.
"""

from __future__ import annotations

import re
import string
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, TypeVar

import numpy as np

from mckibben import registry
from mckibben.arrays import Array
from mckibben.blocks.base import Block
from mckibben.checkpoints import Checkpoints
from mckibben.errors import DataError, ModelError, ModelWarning
from mckibben.papers.paper import FigureText, Paper, TableText, paper
from mckibben.papers.recognising import Labels, Recognised, Runs, of_its_size, recognise
from mckibben.recording import Recording
from mckibben.rigs import Rig, load_rig, record
from mckibben.signals.protocol import Protocol, protocol, scaling
from mckibben.system.progress import telling, words_of
from mckibben.system.showing import Result
from mckibben.system.threads import one_blas_thread

Cell = str | float | None
Curves = Mapping[str, tuple[Array, Array]]
Progress = Callable[[float, str], None]
Item = TypeVar("Item")

OWN = "User recordings; descriptions of signals refer to the paper's rig."
OTHER_SIZE = "Of another size than the paper's rig: printed figures in its units are left out."

RECOGNISED = "Which run of the paper each recording is"
SCALED = TableText(title="How the protocol is scaled for this rig", rows="command")
SCALED_COLUMNS = ("command", "in the paper, from", "to", "here, from", "here, to", "factor")

MOST = 2000
"""Points of a curve that is drawn."""


def _no_progress(share: float, text: str) -> None:
    """Ignore progress."""


@dataclass(frozen=True)
class Table:
    """A table of a re-run: its texts, filled in, headings with units, and rows of cells.

    Headings of printed figures end with ``", printed"``.
    """

    key: str
    text: TableText
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]

    def to_dict(self) -> dict[str, Any]:
        """Return the table as in ``tables.json``."""
        rows = [dict(zip(self.columns, row, strict=True)) for row in self.rows]
        words = {"title": self.text.title, "of": self.text.of, "note": self.text.note}
        return {"key": self.key, **words, "rows": rows}


@dataclass(frozen=True)
class Axes:
    """A panel: x and y of its curves by name, the key of its labels, and shaded intervals of x."""

    curves: Curves
    key: str = ""
    shaded: Sequence[tuple[float, float]] = ()


@dataclass(frozen=True)
class Figure:
    """A figure of a re-run: its texts, filled in, and panels by their titles."""

    key: str
    text: FigureText
    panels: Mapping[str, Axes]


@dataclass(frozen=True, repr=False)
class Reproduction(Result):
    """A re-run of a paper's experiment: on a rig or recordings, with notes on differences."""

    name: str
    paper: Paper
    on: str
    summary: tuple[str, ...]
    tables: tuple[Table, ...]
    figures: tuple[Figure, ...]
    notes: tuple[str, ...]
    quick: bool = False
    seed: int = 0

    face: ClassVar[str] = "reproduction"

    def to_frame(self) -> Any:
        """Return the rows of all tables, each with the key of its table."""
        import pandas as pd

        frames = [pd.DataFrame(table.to_dict()["rows"]) for table in self.tables]
        return pd.concat(frames, keys=[table.key for table in self.tables], names=["table", "row"])

    def to_dict(self) -> dict[str, Any]:
        """Return all but the figures, as in ``tables.json``."""
        return {
            "name": self.name,
            "title": self.paper.title,
            "doi": self.paper.doi,
            "on": self.on,
            "quick": self.quick,
            "seed": self.seed,
            "summary": list(self.summary),
            "tables": [table.to_dict() | {"quick": self.quick} for table in self.tables],
            "notes": list(self.notes),
        }


@dataclass(frozen=True)
class Fitted:
    """Result of a fit.

    ``rmse`` is the free-running error on the data fitted, in the unit of the output, of several the
    largest; ``standard_errors`` are of ``block.pack()``, NaN where not known; ``search`` is the least
    error so far, whenever the search reported it.
    """

    __pydantic_config__: ClassVar[dict[str, bool]] = {"arbitrary_types_allowed": True}

    block: Block
    rmse: float
    seconds: float
    n_free: int
    standard_errors: tuple[float, ...] = field(default=(), compare=False)
    search: tuple[float, ...] = field(default=(), compare=False)


class Verdict(NamedTuple):
    """Whether a result agrees with what the paper concludes.

    A sentence has a text for either case: ``{order:As in|Unlike} the paper``.
    """

    agrees: bool

    def __format__(self, texts: str) -> str:
        return texts.split("|")[not self.agrees]


@dataclass
class Experiment:
    """A paper's experiment in progress.

    Parameters
    ----------
    name : str
        Of `mckibben.registry.names` ("papers").
    rig : Rig, optional
        That is recorded, and on which loops are closed.
    data : sequence of Recording, optional
        Recordings of the paper's runs instead, of any size; see `recognise`.
    quick : bool
        Whether to leave out what takes long.
    seed, jobs
        Of everything random; processes, default as many as there are cores.
    checkpoints : Checkpoints
        Fits, until all is done.
    progress : callable
        Called with the share done, and what is next.
    """

    name: str
    rig: Rig | None
    data: Sequence[Recording] | None
    quick: bool = False
    seed: int = 0
    jobs: int | None = None
    checkpoints: Checkpoints = field(default_factory=lambda: Checkpoints(None))
    progress: Progress = _no_progress

    def __post_init__(self) -> None:
        self.paper = paper(self.name)
        self.models: dict[str, Block] = {}
        self.tables: list[Table] = []
        self.figures: list[Figure] = []
        self.facts: dict[str, Any] = {}
        self.warned: dict[str, None] = {}
        self.part = (0.0, 0.0)
        self.absent: list[str] = []
        self.of_its_size = True
        self.reached, self.bounds = 0.0, (0.0, 1.0)
        self._free: dict[tuple[str, int], tuple[Recording, Recording]] = {}

    def report(self, share: float, text: str) -> None:
        """Report a share of the whole, unless more was done; what is not to be done is no part of it."""
        low, high = self.bounds
        self.reached = min(max(share, self.reached, low), high)
        self.progress((self.reached - low) / (high - low), text)

    def within(self, low: float, high: float) -> Progress:
        """Return the progress callback of a part."""
        return lambda share, text: self.report(low + (high - low) * share, text)

    def steps(self, low: float, high: float, items: Sequence[Item]) -> Iterator[Item]:
        """Yield items between two shares of the whole; a fit reports how far it is in its own."""
        for i, item in enumerate(items):
            width = (high - low) / len(items)
            self.part = low + width * i, low + width * (i + 1)
            yield item

    def record(
        self,
        plan: Protocol | None = None,
        names: Sequence[str] | None = None,
        *,
        until: float = 0.3,
        loops: float = 1.0,
    ) -> Runs:
        """Return the runs of the paper's protocol on the rig, or the user's recordings of it.

        Parameters
        ----------
        plan : Protocol, optional
            Default the one registered under the paper's name, for the rig.
        names : sequence of str, optional
            Of the runs that are needed; default all.
        until, loops : float
            Shares of the whole that are done then, and when closed loops on a rig begin.
        """
        self.bounds = 0.0 if self.data is None else until, loops if self.rig is None else 1.0
        runs = (
            self._recorded(plan, names, until) if self.data is None else self._recognised(self.data)
        )
        self.of_its_size = of_its_size(self.name, runs)
        return runs

    def _recognised(self, data: Sequence[Recording]) -> Runs:
        recognised = recognise(self.name, data)
        self.tables.append(recognised_table(recognised))
        self.absent = [f"Not recorded: {recognised.absent}."] if recognised.absent else []
        return recognised.runs

    def _recorded(self, plan: Protocol | None, names: Sequence[str] | None, until: float) -> Runs:
        plan = protocol(self.name, self.rig) if plan is None else plan
        rows = [(o.what, *o.printed, *o.here, o.factor) for o in scaling(self.name, self.rig)]
        if any(abs(row[-1] - 1) > 1e-6 for row in rows):
            self.tables.append(Table("scaled", SCALED, SCALED_COLUMNS, tuple(rows)))
        names = [run.name for run in plan.runs] if names is None else names
        tell, runs = self.within(0.0, until), dict[str, Recording]()
        recorded = record(plan, self.rig, runs=names, seed=self.seed, jobs=self.jobs)
        for run, recording in recorded:
            runs[run.name] = recording
            tell(len(runs) / len(names), f"recorded {run.name}")
        return Runs(runs, {name: Labels(plan[name].role, plan[name].labels) for name in runs})

    def fit(
        self,
        name: str,
        model: str,
        recordings: Recording | Sequence[Recording],
        settings: Mapping[str, Any] | None = None,
        **how: Any,
    ) -> Fitted:
        """Return the model fitted to recordings, or its stored fit.

        The block is one of ``models`` from then on, under its name. ``model`` is the estimator's short
        name; ``how`` is what else its ``fit`` takes. Errors are those of its ``fit``; a model that is no
        better than the mean is returned, as its errors in the tables tell.
        """
        estimator_class = registry.load("estimators", model)
        estimator: Any = estimator_class(**{"seed": self.seed} | dict(settings or {}))
        search: list[float] = []

        def fit() -> Fitted:
            def on_progress(share: float, best: float) -> None:
                search.append(float(best))
                self.within(*self.part)(share, f"{name}, {words_of(best)}")

            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ModelWarning)
                try:
                    estimator.fit(recordings, **{"progress": on_progress} | how)
                except ModelError:
                    if not hasattr(estimator, "model_"):
                        raise
            diagnostics = estimator.diagnostics_
            errors = tuple(getattr(diagnostics, "standard_errors", ()))
            best = tuple(cost for cost in search if np.isfinite(cost))
            error = float(np.max(diagnostics.rmse))
            return Fitted(
                estimator.model_, error, diagnostics.seconds, diagnostics.n_free, errors, best
            )

        self.within(*self.part)(0.0, name)
        depends = model, estimator.get_params(), recordings, how
        fitted = self.checkpoints.once(name, Fitted, fit, *depends)
        self.models[name] = fitted.block
        return fitted

    def simulate(self, name: str, recording: Recording) -> Recording:
        """Return the free run of a model on a recording, cached."""
        key = name, id(recording)
        if key not in self._free:
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always", ModelWarning)
                run = self.models[name].simulate(recording)
            self.warned |= {f"{name} on {recording.name}: {w.message}.": None for w in caught}
            self._free[key] = (recording, run)  # with the recording, so that its id stays its own
        return self._free[key][1]

    def table(
        self,
        key: str,
        columns: Sequence[str],
        rows: Mapping[str, Sequence[Cell]] | Sequence[Sequence[Cell]],
        **facts: Any,
    ) -> None:
        """Add a table of ours; printed figures of ``paper.toml`` precede their columns.

        With a rig of another size than the paper's, rows and columns of printed figures are left out,
        but for those in percent or ``relative``.

        Parameters
        ----------
        key : str
            As ``paper.toml`` has it.
        columns : sequence of str
            Headings of what was found, with units.
        rows : mapping of str to sequence, or sequence of sequences
            The name of each row, and a cell for every column; without rows there is no table.
        **facts
            That fill the fields of its title and note.
        """
        text = self.paper.tables[key]
        lines = [(n, *cells) for n, cells in rows.items()] if isinstance(rows, Mapping) else rows
        lines = [line for line in lines if self._compares(text, line[0])]
        if not lines:
            return
        ours = dict(zip([text.rows, *columns], zip(*lines, strict=True), strict=True))
        kept_columns = {of: cells for of, cells in self._columns(text, ours) if {*cells} - {None}}
        words = {"title": text.title.format(**facts), "note": text.note.format(**facts)}
        filled_text = text.model_copy(update=words)
        self.tables.append(
            Table(key, filled_text, (*kept_columns,), (*zip(*kept_columns.values(), strict=True),))
        )

    def _compares(self, text: TableText, name: Cell) -> bool:
        """Return whether a row or column of some name has a meaning for a rig of this size."""
        relative = "[%]" in str(name) or name in text.relative
        return self.of_its_size or relative or not re.search(r"(^|, )printed$", str(name))

    def _columns(
        self, text: TableText, ours: Mapping[str, Sequence[Cell]]
    ) -> Iterator[tuple[str, Sequence[Cell]]]:
        """Yield columns, the paper's before ours of the same quantity."""
        # recordings need not have all that the paper has
        paper_columns = [of for of in text.printed if self.data is None or of in ours]
        for column in dict.fromkeys((*ours, *paper_columns)):
            heading = f"{column}, printed"
            if column in paper_columns and self._compares(text, heading):
                yield heading, [text.printed[column].get(str(name)) for name in ours[text.rows]]
            if column in ours and (column == text.rows or self._compares(text, column)):
                yield column, ours[column]

    def figure(self, key: str, panels: Mapping[str, Curves | Axes], **facts: Any) -> None:
        """Add a figure: panel title -> curve name -> its x and y, of which some are drawn.

        Without any panel there is no figure; ``facts`` fill the fields of its axis labels.
        """
        if not panels:
            return
        drawn: dict[str, Axes] = {}
        for title, panel in panels.items():
            axes = panel if isinstance(panel, Axes) else Axes(panel)
            thin = {
                name: (thinned(x), thinned(y))
                for name, (x, y) in axes.curves.items()
                if self.of_its_size or name != "printed"
            }
            drawn[title] = replace(axes, curves=thin)
        text = self.paper.figures[key].filled(facts)
        others = {name: labels.filled(facts) for name, labels in text.axes.items()}
        self.figures.append(Figure(key, text.model_copy(update={"axes": others}), drawn))

    def add_facts(self, **facts: Any) -> None:
        """Set facts of sentences in ``paper.toml``; ``*_printed`` are in units of the paper's rig."""
        for name, fact in facts.items():
            if self.of_its_size or not name.endswith("_printed"):
                self.facts[name] = fact

    def done(self, on: str) -> Reproduction:
        """Return all results; sentences without facts are left out."""
        sentences = []
        for text in self.paper.summary.values():
            fields = (name for _, name, _, _ in string.Formatter().parse(text) if name)
            if {name.partition("[")[0] for name in fields} <= {*self.facts}:
                sentences.append(text.format(**self.facts))
        notes = [*self.paper.rig_notes] if self.data is None else [OWN, *self.absent]
        notes += [] if self.of_its_size else [OTHER_SIZE]
        return Reproduction(
            self.name,
            self.paper,
            on,
            tuple(sentences),
            tuple(self.tables),
            tuple(self.figures),
            (*notes, *self.paper.notes, *([self.paper.quick] if self.quick else []), *self.warned),
            self.quick,
            self.seed,
        )


def recognised_table(recognised: Recognised) -> Table:
    """Return the table of which run of the paper each recording is, and why."""
    by = ", ".join(f"{original} is {channel}" for original, channel in recognised.by_units.items())
    text = TableText(title=RECOGNISED, rows="file", note=f"By their units: {by}." if by else "")
    return Table("recognised", text, ("file", "run of the paper", "role", "why"), recognised.rows)


def reproduce(
    name: str,
    *,
    rig: Rig | str | None = None,
    data: Sequence[Recording] | None = None,
    quick: bool = False,
    seed: int = 0,
    jobs: int | None = None,
    folder: str | Path | None = None,
    clear: bool = True,
    progress: bool | Progress | None = None,
) -> Reproduction:
    """Re-run a paper's experiment; parameters are those of `Experiment`, and these.

    Parameters
    ----------
    rig : Rig or str, optional
        Default the protocol's, with ``data`` none.
    folder : path, optional
        Where fits are kept until all is done, so that a stopped re-run, called again, goes on.
    clear : bool
        Whether to forget these then; else the caller does, by ``Checkpoints(folder).clear()``.
    progress : bool or callable, optional
        Whether to show a bar; or a callback for the share done, and the next step.

    Raises
    ------
    ModelError, DataError
        If there is no such paper, or a recording that it needs is missing.
    """
    run: Callable[[Experiment], None] = registry.load("papers", name)
    plant = _plant(name, rig, data)
    stored = Checkpoints(folder, name, quick, seed)
    with one_blas_thread(), telling(progress, name) as tell:
        experiment = Experiment(name, plant, data, quick, seed, jobs, stored, tell or _no_progress)
        run(experiment)
    if clear:
        stored.clear()
    on = f"{len(data)} recordings" if data is not None else f"rig {plant.name}" if plant else ""
    return experiment.done(on)


def _plant(name: str, rig: Rig | str | None, data: Sequence[Recording] | None) -> Rig | None:
    """Return the rig, if any; a `DataError` if it lacks a channel, or if there is no recording."""
    if data is not None and not data:
        remedy = f"record its protocol: {name}"
        raise DataError("there are none", parameter="recordings", remedy=remedy)
    if rig is None and data is not None:
        return None
    plant = load_rig(rig or protocol(name).rig)
    measurable = {*plant.inputs, *plant.outputs}
    measurable |= {"contraction"} if "displacement" in measurable else set()
    for channel in paper(name).channels:
        if channel not in measurable:
            raise DataError(
                f"{name} needs it, and the rig {plant.name!r} has {', '.join(sorted(measurable))}",
                channel=channel,
                remedy=f"give a rig like {protocol(name).rig}",
            )
    return plant


def rms(errors: Array) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(errors**2)))


def thinned(values: Sequence[float] | Array, most: int = MOST) -> Array:
    """Return every k-th value, so that at most so many remain."""
    array = np.asarray(values, dtype=np.float64)
    return array[:: max(1, -(-array.size // most))]
