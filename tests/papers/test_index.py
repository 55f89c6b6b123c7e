"""The index of each paper: every row leads somewhere, and its command runs as printed."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from fnmatch import fnmatch
from importlib import import_module
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest

from mckibben import Recording, registry
from mckibben.cli.main import app
from mckibben.papers.paper import paper
from mckibben.rigs import load_rig, rig_names
from mckibben.signals.protocol import PlannedRun, protocol
from tests.cli.conftest import Cli
from tests.cli.conftest import cli as cli  # a fixture

PAPERS = registry.names("papers")

MODELLED = {
    "activation-pressure": {"contraction"},
    "field-models": {"pressure"},
    "mpi-narmax": {"voltage"},
    "multistate-friction": {"length", "pressure"},  # the latter is the input of the static law
    "sdchm": {"pressure_1", "pressure_2", "pressure_3"},
}
"""What each paper's models are driven by."""


def exists(where: str) -> bool:
    """Tell whether a dotted name can be imported, or is of a rig."""
    if where in rig_names():
        return True
    parts = where.split(".")
    for end in range(len(parts), 0, -1):
        try:
            found = import_module(".".join(parts[:end]))
        except ImportError:
            continue
        for name in parts[end:]:
            found = getattr(found, name, None)  # type: ignore[assignment]
        return found is not None
    return False


def commands(name: str) -> Iterator[list[str]]:
    """Yield the words of every command in the order in which they run in one folder."""
    about = paper(name)
    every = dict.fromkeys(["record", *(item.computed_by for item in about.items)])
    yield from (shlex.split(about.commands[key]) for key in every if key)


def parsed(words: list[str]) -> dict[str, Any]:
    """Return the parameters of a command by the command line's own parser."""
    command: Any = app
    rest = words[1:]
    while isinstance(command, click.Group):
        command, rest = command.get_command(click.Context(app), rest[0]), rest[1:]
    params: dict[str, Any] = command.make_context(words[1], rest).params
    return params


def planned(name: str, pattern: str) -> list[PlannedRun]:
    """Return the runs of the protocol whose files a pattern names."""
    return [run for run in protocol(name).runs if fnmatch(f"runs/{run.name}.csv", pattern)]


@pytest.mark.parametrize("name", PAPERS)
def test_every_row_leads_somewhere_and_every_command_is_of_a_row(name: str) -> None:
    about = paper(name)
    for item in about.items:
        kind, _, key = item.here.partition(":")
        keys = {"table": [*about.tables], "figure": [*about.figures], "model": [*about.models]}
        known = keys.get(kind)
        assert not item.here or (exists(item.here) if known is None else key in known), item
        assert bool(item.here) == bool(item.computed_by), item
    assert {item.computed_by for item in about.items} - {""} == {*about.commands}
    listed = {item.here for item in about.items}
    redrawn = {f"table:{key}": text.of for key, text in about.tables.items()}
    redrawn |= {f"figure:{key}": text.of for key, text in about.figures.items()}
    assert {key for key, of in redrawn.items() if of} <= listed


@pytest.mark.parametrize("name", PAPERS)
def test_every_command_is_read_by_the_command_line_and_names_files_that_are_there(
    name: str,
) -> None:
    written = set[str]()
    for words in commands(name):
        params = parsed(words)
        for word in words[2:]:
            if word.startswith("runs/"):
                assert planned(name, word), words
            elif word.endswith(".json") and word != str(params["out"]):
                assert word in written, words
        written.add(str(params.get("out")))


@pytest.mark.parametrize("name", PAPERS)
def test_commands_fit_what_the_paper_fits(name: str) -> None:
    rig = load_rig(protocol(name).rig)
    channels = sorted({*rig.inputs, *rig.outputs, *paper(name).channels})
    waves = np.random.default_rng(0).uniform(1.0, 2.0, (len(channels), 100))
    whole = Recording(dict(zip(channels, waves, strict=True)), 0.1)
    still = {one: np.ones(100) for one in rig.inputs}
    alone = [whole.with_channels(**still | {one: whole[one]}) for one in rig.inputs]
    for words in commands(name):
        if words[1] == "fit":
            learned = [run for word in words if "/" in word for run in planned(name, word)]
            assert {run.role for run in learned} == {"train"}, words
            given = {side: words[words.index(side) + 1] for side in words if side[:2] == "--"}
            model = registry.load("estimators", words[2])
            found = model.resolved(
                [whole, *alone], given.get("--input"), given.get("--output"), None
            )
            assert model.objection([whole, *alone], found) is None, words
            assert {*model.own_roles(found).inputs} <= MODELLED[name], words


@pytest.mark.long
@pytest.mark.parametrize("name", PAPERS)
def test_every_command_runs_in_one_folder(
    name: str, cli: Cli, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for words in commands(name):
        quick = ["--quick"] * (words[1] == "reproduce")
        files = (sorted(map(str, Path().glob(word))) if "*" in word else [word] for word in words)
        result = cli(*[word for some in files for word in some][1:], *quick)
        assert result.code == 0, (words, result.err)
        if "-o" in words:
            assert Path(words[words.index("-o") + 1]).exists(), words
