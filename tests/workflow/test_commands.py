"""Commands without what they need: they end with code 2 and their usage."""

from __future__ import annotations

import inspect
from pathlib import Path

import click
import pytest

from mckibben.workflow import OPERATIONS
from tests.golden.commands import call
from tests.workflow.calls import COMMANDS

FREE = {"app", "example", "info", "muscles list", "rig list"}
"""Commands that need nothing."""

NEEDED = {
    (name, param)
    for name, command in COMMANDS.items()
    for param in command.params
    if param.required
}


def test_a_command_needs_what_its_operation_needs() -> None:
    for name, operation in OPERATIONS.items():
        params = {one.name: one for one in COMMANDS[name].params}
        for key, one in inspect.signature(operation.run).parameters.items():
            if key in operation.arguments:
                assert params[key].required == (one.default is one.empty), (name, key)
        if operation.out is not None:
            assert params["out"].required == operation.must_write, name


@pytest.mark.parametrize("name", sorted(set(COMMANDS) - FREE))
def test_without_arguments_it_exits_2(name: str, tmp_path: Path) -> None:
    result = call(*name.split(), folder=tmp_path)
    assert result.code == 2
    assert "MCKIBBEN_DEBUG" not in result.err
    assert "Usage: " in result.err or name == "reproduce"  # whose paper may be left out for a list
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", sorted({name for name, _ in NEEDED}))
def test_without_any_one_of_them_it_names_that_one(name: str, tmp_path: Path) -> None:
    needed = [param for param in COMMANDS[name].params if param.required]
    for absent in needed:
        if isinstance(absent, click.Argument) and absent is not needed[0]:
            continue  # the word before it is taken for it
        words: list[str] = []
        for one in needed:
            if one is not absent and isinstance(one, click.Option):
                words += [one.opts[-1], "absent"]
        arguments = [one for one in needed if isinstance(one, click.Argument)]
        words += ["absent"] * (len(arguments) - isinstance(absent, click.Argument))
        result = call(*name.split(), *words, folder=tmp_path)
        assert result.code == 2
        assert "Usage: " in result.err
        named = arguments[-1] if isinstance(absent, click.Argument) else absent
        assert any(one in result.err for one in (named.opts[-1], named.make_metavar(
            click.Context(COMMANDS[name])))), result.err  # fmt: skip
    assert not list(tmp_path.iterdir())
