"""Errors name what is wrong, where, and a remedy that exists, in the terms of each face."""

from __future__ import annotations

import ast
import pickle
import re
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import click
import pytest

import mckibben
from mckibben import errors
from mckibben.app.terms import PLACES, message_of
from mckibben.cli.main import app
from mckibben.cli.parameters import COMMANDS, Command, as_command, as_flag
from mckibben.errors import DataError, KernelError, MckibbenError, ModelError, rendered
from mckibben.files.channels import description
from mckibben.muscles.library import parsed
from mckibben.rigs.files import fields_of
from tests.refusals import refused

FACES = ("app", "cli", "report")
TEXTS = ("problem", "remedy", "instead", "no_inverse", "made_again", "hint")
RAISED = {name for name in dir(errors) if name.endswith(("Error", "Warning"))} | {"warn", "error"}


@cache
def commands() -> tuple[Command, ...]:
    """Every command, those in groups too."""

    def inside(group: click.Command) -> Iterator[Command]:
        if isinstance(group, click.Group):
            context = click.Context(group)
            for name in group.list_commands(context):
                yield from inside(group.get_command(context, name) or group)
        elif isinstance(group, Command):
            yield group

    return tuple(inside(app))


@cache
def nodes() -> tuple[tuple[str, ast.AST], ...]:
    """Return what calls or assigns in the library's source, with its place."""
    root = Path(mckibben.__file__).parent
    found: list[tuple[str, ast.AST]] = []
    for path in sorted(root.rglob("*.py")):
        if path.relative_to(root).parts[0] not in FACES:
            for node in ast.walk(ast.parse(path.read_text())):
                if isinstance(node, ast.Call | ast.Assign) or hasattr(node, "target"):
                    place = f"{path.relative_to(root)}:{getattr(node, 'lineno', 0)}"
                    found.append((place, node))
    return tuple(found)


@cache
def calls() -> tuple[tuple[str, str, ast.Call], ...]:
    """Return each call that makes an error or warns: its place, its name and itself."""
    found = []
    for place, node in nodes():
        if isinstance(node, ast.Call):
            name = ast.unparse(node.func).rpartition(".")[2]
            if name in RAISED or any(one.arg == "remedy" for one in node.keywords):
                found.append((place, name, node))
    return tuple(found)


@cache
def texts() -> tuple[tuple[str, str], ...]:
    """Return the strings in these calls, and those that become problems and remedies."""
    parents: list[tuple[str, ast.AST]] = [(place, call) for place, _, call in calls()]
    for place, node in nodes():
        targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
        if any(isinstance(one, ast.Name) and one.id in TEXTS for one in targets):
            parents.append((place, node))
    found = []
    for place, parent in parents:
        for node in ast.walk(parent):
            if isinstance(node, ast.JoinedStr):
                found.append((place, ast.unparse(node)))
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                found.append((place, node.value))
    return tuple(found)


def test_the_library_names_no_flag() -> None:
    assert [
        one for one in texts() if re.search(r"(?<![\w-])--[a-z]|mckibben [a-z]+ ", one[1])
    ] == []


def test_every_error_has_a_remedy() -> None:
    kinds = {n for n in RAISED if issubclass(getattr(errors, n, str), MckibbenError)} - {
        "KernelError"
    }
    bare = [
        place
        for place, name, call in calls()
        if name in kinds and not {"remedy", None} & {one.arg for one in call.keywords}
    ]
    assert bare == []


def test_remedies_name_parameters_and_operations_that_exist() -> None:
    known = {param.name for command in commands() for param in command.params}
    for place, text in texts():
        for name, call in re.findall(r"`(\w+)(\(\))?(?:\[[^`]*?\])?(?:=[^`]*)?`", text):
            assert name in (COMMANDS if call else known), (place, name)


ERROR = ModelError(
    "there are gaps",
    remedy="give `gaps=split`, `columns[force]=F 1`, `settings[monotone]=true`, or use `plan()`",
    file="run.csv",
    channel="force",
    row=3,
)


@pytest.mark.parametrize("error", [ERROR, KernelError("kernel.py", 3, "a set", "use a list")])
def test_errors_survive_pickling(error: MckibbenError) -> None:
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error)
    assert (str(again), again.__dict__) == (str(error), error.__dict__)


def test_each_face_renders_in_its_own_terms() -> None:
    python = str(ERROR)
    assert python.startswith("run.csv, channel 'force', row 3: there are gaps. Remedy: ")
    for part in (
        "gaps='split'",
        "columns={'force': 'F 1'}",
        "settings={'monotone': True}",
        "plan()",
    ):
        assert part in python
    fit = next(one for one in commands() if one.name == "fit")
    fit.make_context("fit", ["pi", "run.csv", "-o", "m.json"])
    terminal = rendered(ERROR, as_flag, as_command)
    for part in ("--gaps split", "--column 'force=F 1'", "--set monotone=true", "mckibben plan"):
        assert part in terminal
    page = message_of(ERROR)
    assert not re.search(r"`|\(\)", page)
    assert PLACES["plan"] in page
    assert message_of(ModelError("none")) == "None"


@pytest.mark.parametrize("read", [description, parsed, fields_of])
def test_a_file_that_is_absent_is_not_called_one_of_another_form(
    read: Callable[[Path], object], tmp_path: Path
) -> None:
    """An error in data is a ValueError, as what a parser raises is."""
    with refused(ValueError, file=tmp_path / "absent.toml") as found:
        read(tmp_path / "absent.toml")
    assert isinstance(found.value, DataError)
    assert "TOML" not in found.value.problem
