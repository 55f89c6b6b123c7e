"""Every public name of version 0.1 is there, or is refused with what to do now."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import fields
from importlib import import_module
from inspect import signature
from pathlib import Path

import pytest

import mckibben
from mckibben import DataError, ModelError, estimator
from mckibben.estimators.catalogue import settings_of
from mckibben.hints import (
    FORMER_OPERATIONS,
    FORMER_PACKAGES,
    FORMER_PLUGINS,
    FORMER_SETTINGS,
    MODULE,
    former,
)
from mckibben.options import RENAMED, ReadOptions, given_options
from mckibben.registry import load, names
from mckibben.workflow.operation import OPERATIONS
from tests.cli.calls import commands
from tests.cli.conftest import Cli
from tests.refusals import refused

COMMANDS = dict(commands())


def of_kind(wanted: str) -> Iterator[tuple[str, str]]:
    """Yield names of version 0.1 of a kind, each behind its owner."""
    for line in Path(__file__).with_name("names_0_1.txt").read_text("utf-8").splitlines()[1:]:
        place, _, every = line.partition(": ")
        kind, _, owner = place.partition(" ")
        if kind == wanted:
            yield from ((owner, name) for name in every.split())


def test_names_of_python() -> None:
    hints = {"mckibben": MODULE} | {f"mckibben.{k}": v for k, v in FORMER_PACKAGES.items()}
    for package, name in of_kind("names"):
        module = import_module(package)
        if not hasattr(module, name):
            with pytest.raises(AttributeError, match=re.escape(hints[package][name])):
                getattr(module, name)


def test_what_leads_on_names_what_there_is() -> None:
    for package, hints in FORMER_PACKAGES.items():
        module = import_module(f"mckibben.{package}")
        for name, hint in hints.items():
            assert not hasattr(module, name)
            first = re.match(r"(?:mckibben\.)?(\w+)", hint)
            assert first is not None
            there = mckibben if hint.startswith("mckibben.") else module
            assert first[1] == "run" or hasattr(there, first[1]), hint


def test_commands_and_options() -> None:
    groups = {""} | {path.partition(" ")[0] for path in COMMANDS if " " in path}
    for path, flag in of_kind("options"):
        if path in groups | {"-"}:
            continue
        if path not in COMMANDS:
            above, _, command = path.rpartition(" ")
            assert former(above.split(), command), path
            continue
        known = {word for one in COMMANDS[path].params for word in (*one.opts, *one.secondary_opts)}
        if flag not in known:
            assert former(path.split(), flag), (path, flag)


def test_a_command_line_is_refused_in_its_own_terms(cli: Cli) -> None:
    for line, name in (("export c model.json --overwrite", "--force"), ("ros", "ros2")):
        refusal = cli(*line.split())
        assert refusal.code != 0
        assert name in refusal.err


def test_former_commands_and_options_are_no_more() -> None:
    for key, hint in FORMER_OPERATIONS.items():
        path, _, flag = key.rpartition(" ")
        if not flag.startswith("-"):
            assert key not in COMMANDS
        for command in (one for one in COMMANDS if path and f"{one} ".startswith(f"{path} ")):
            assert not any(flag in one.opts for one in COMMANDS[command].params), key
        for name in re.findall(r"`(\w+)\(\)`", hint):
            assert hasattr(mckibben, name)
        if path in OPERATIONS and (kind := OPERATIONS[path].options) is not None:
            known = {one.name for one in (*fields(kind), *fields(ReadOptions))} | {"data"}
            named = {*re.findall(r"`(\w+)(?:\[\w+\]=\.\.\.)?`", hint)} - {"executor", "settings"}
            assert named <= known, key


def test_keywords_of_operations() -> None:
    for name, keyword in of_kind("keywords"):
        if name not in OPERATIONS:
            continue
        declared = OPERATIONS[name]
        kind = declared.options or ReadOptions
        known = {one.name for one in (*fields(kind), *fields(ReadOptions))}
        if keyword not in known | {*signature(declared.run).parameters, *RENAMED}:
            with refused(ModelError, names=f"'{keyword}'") as refusal:
                given_options(kind, None, {keyword: None})
            hint = former([name], f"--{keyword.replace('_', '-')}")
            assert hint or refusal.value.remedy.startswith("use `"), (name, keyword)


def test_plugins() -> None:
    for group, name in of_kind("plugins"):
        if name not in names(group):
            with refused(ModelError, names=f"'{name}'") as refusal:
                load(group, name)
            assert refusal.value.remedy == FORMER_PLUGINS[f"{group} {name}"]
    for key, hint in FORMER_PLUGINS.items():
        group, name = key.split()
        assert name not in names(group)
        found = re.findall(r"'([\w-]+)'", hint)
        assert found
        assert all(callable(load(group, one)) for one in found)


def test_settings() -> None:
    for model, name in of_kind("settings"):
        if model in names("estimators") and name not in {
            one.name for one in fields(estimator(model))
        }:
            with refused((DataError, ModelError), parameter=name) as refusal:
                settings_of(model, {name: 1})
            assert refusal.value.remedy == former([model], name, FORMER_SETTINGS), (model, name)
    for key, hint in FORMER_SETTINGS.items():
        model, _, name = key.rpartition(" ")
        if model:
            known = {one.name for one in fields(estimator(model))}
            assert name not in known
            assert {*re.findall(r"`settings\[(\w+)\]`", hint)} <= known
