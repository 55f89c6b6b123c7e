"""A paper: authors, question, printed results, and the place of its equations and tables here.

All of it is data, ``paper.toml`` in the paper's folder; the code there computes the rest.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from functools import cache
from importlib import resources
from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, Field

from mckibben import registry
from mckibben.blocks.saving import part_from_dict
from mckibben.errors import ModelError

Words = Annotated[str, Field(min_length=1)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Item(_Strict):
    """A system, equation, table or figure of the paper.

    ``of`` is its number in the paper. ``here`` is a table or figure of the re-run or a printed model by
    its key (``table:KEY``, ``figure:KEY``, ``model:NAME``), a rig, a module or class, or nothing.
    ``differs`` is empty where it is exact. ``command`` is the name of the command that computes it; of a
    table or figure of the re-run, by default that of the re-run.
    """

    of: Words
    what: Words
    here: str = ""
    differs: str = ""
    command: str = ""

    @property
    def computed_by(self) -> str:
        """Name of the command that computes it, empty if none does."""
        return self.command or ("reproduce" if re.match("table:|figure:", self.here) else "")


class RunKind(_Strict):
    """A kind of run: what it is, and by what signals; the first kind that has its labels is a run's.

    ``where`` are its role and labels, ``why`` what is seen, with labels in braces. With fewer than
    ``least`` nothing can be fitted; without one that may be absent, only ``gives`` is.
    """

    what: Words
    why: Words
    where: dict[str, Any]
    gives: Words = "every table"
    least: int = 0


class TableText(_Strict):
    """Title of a re-run's table, and the paper's printed values.

    Title and note may have fields in braces, which the experiment fills. ``of`` is the paper's table or
    figure, empty for ours; ``rows`` the heading of the first column; ``printed`` the paper's figures by
    column and row; ``relative`` are headings of printed figures that hold on a rig of any size.
    ``drawn`` is what its columns measure, with the unit, if printed and ours are drawn, and ``unit`` the
    unit of headings without one; ``bound`` what the paper says that its figures are below, where it
    prints no more.
    """

    title: Words
    of: str = ""
    rows: str = "model"
    note: str = ""
    printed: dict[str, dict[str, int | float]] = {}
    relative: tuple[str, ...] = ()
    drawn: str = ""
    unit: str = ""
    bound: float | None = None


class AxesText(_Strict):
    """Labels of axes, each with its unit, ``[-]`` for none; they may have fields in braces."""

    x: Words
    y: Words

    def filled(self, facts: Mapping[str, Any]) -> Self:
        """Return the labels with their fields filled in."""
        return self.model_copy(update={k: getattr(self, k).format(**facts) for k in ("x", "y")})


class FigureText(AxesText):
    """Title of a re-run's figure, the paper's figure that it redraws, and axis labels.

    ``axes`` are the labels of panels that show something else, by key; ``shaded`` is what intervals
    are shaded for.
    """

    title: Words
    of: str = ""
    axes: dict[str, AxesText] = {}
    shaded: str = ""


class Paper(_Strict):
    """A paper.

    ``given`` is what is taken from the paper or set, ``found`` what the recordings determine.
    Sentences of ``summary`` have fields in braces, which the experiment fills; one without its fields
    is left out. ``notes`` are differences from the paper, ``rig_notes`` those of the virtual rig,
    ``quick`` what a quick run omits. Commands run
    in one folder, in the order of the items, once ``record`` has. They, kinds of runs, tables, figures
    and printed models are by key.
    """

    number: int
    title: Words
    question: Words
    authors: str = ""
    published: str = ""
    doi: str = ""
    protocol: Words
    channels: tuple[str, ...]
    given: tuple[Words, ...]
    found: tuple[Words, ...]
    summary: dict[str, Words]
    notes: tuple[Words, ...]
    rig_notes: tuple[Words, ...]
    quick: Words
    commands: dict[str, Words]
    items: tuple[Item, ...]
    runs: dict[str, RunKind]
    tables: dict[str, TableText]
    figures: dict[str, FigureText]
    models: dict[str, dict[str, Any]] = {}

    def about(self) -> dict[str, Any]:
        """Return its number, title and question, for JSON."""
        return {key: getattr(self, key) for key in ("number", "title", "question")}

    def kind_of(self, role: str, labels: Mapping[str, Any]) -> RunKind | None:
        """Return the kind of a run by its role and labels, None if it is of none."""
        labels_of_run = {"role": role, **labels}
        kinds = (kind for kind in self.runs.values() if kind.where.items() <= labels_of_run.items())
        return next(kinds, None)

    def printed(self, name: str) -> Any:
        """Return the block of a model as printed."""
        return part_from_dict(self.models[name])


@cache
def paper(name: str) -> Paper:
    """Return a paper by its short name; raise a `ModelError` that lists them if unknown."""
    module = registry.load("papers", name).__module__
    text = resources.files(module.rpartition(".")[0]).joinpath("paper.toml").read_text("utf-8")
    return Paper.model_validate(tomllib.loads(text))


def papers() -> Mapping[str, Paper]:
    """Return all papers by their short names, in the order of their numbers."""
    by_name = {name: paper(name) for name in registry.names("papers")}
    return dict(sorted(by_name.items(), key=lambda item: item[1].number))


def printed_models() -> tuple[str, ...]:
    """Return the names of all models as printed."""
    return tuple(sorted(name for each_paper in papers().values() for name in each_paper.models))


def printed(name: str) -> Any:
    """Return the block of a model with the paper's printed parameters.

    Raises
    ------
    ModelError
        If there is none of that name; the text lists those there are.

    Examples
    --------
    >>> from mckibben.papers.paper import printed
    >>> printed("field-models-pi").thresholds[1]
    0.3392
    """
    for each_paper in papers().values():
        if name in each_paper.models:
            return each_paper.printed(name)
    raise ModelError(
        f"there is no printed model {name!r}", remedy=f"use one of {', '.join(printed_models())}"
    )
