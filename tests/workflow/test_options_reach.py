"""Every field of every options class has an effect or is refused; commands equal their operations."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import pytest

from mckibben import MckibbenError, options
from mckibben.workflow import OPERATIONS
from tests.golden.commands import call as command
from tests.workflow.calls import (
    CALLS,
    COMMANDS,
    USES,
    Use,
    clear,
    outcome,
    prepare,
    scrubbed,
    typed,
    written,
)


@pytest.fixture(scope="module", autouse=True)
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    place = tmp_path_factory.mktemp("calls")
    prepare(place)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(place)
        yield place


def test_there_is_a_call_of_every_operation_and_a_value_of_every_field() -> None:
    assert set(OPERATIONS) <= set(CALLS)
    kinds = {one for one in vars(options).values() if isinstance(one, type) and is_dataclass(one)
             and one.__name__.endswith("Options")}  # fmt: skip
    assert kinds == {one.kind for one in CALLS.values() if one.kind} | {options.ReadOptions}
    for name, call in CALLS.items():
        if call.kind is not None:
            assert {one.name for one in fields(call.kind)} == set(USES[name]), name


EVERY = [(name, option) for name, uses in USES.items() for option in uses]
FOUND: dict[tuple[str, str], Any] = {}
"""Outcomes with the value, for the commands."""


PLAIN: dict[str, str] = {}


def without(name: str, use: Use) -> str:
    """Return the outcome of a call without the value, once for all options of the same call."""
    key = repr((name, use.base, use.args, use.spy))
    if key not in PLAIN:
        PLAIN[key] = repr(outcome(CALLS[name], use))
    return PLAIN[key]


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("name", USES)
def test_equal_calls_have_equal_outcomes(name: str) -> None:
    """Else any option would seem to have an effect."""
    for use in {one.spy: one for one in USES[name].values()}.values():
        assert repr(outcome(CALLS[name], use)) == without(name, use)


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize(("name", "option"), EVERY)
def test_an_option_has_an_effect_or_is_refused_by_its_name(name: str, option: str) -> None:
    call, use = CALLS[name], USES[name][option]
    found = outcome(call, use, {option: use.value})
    FOUND[name, option] = found
    if isinstance(found, MckibbenError):
        values = use.value if isinstance(use.value, dict | tuple) else [use.value]
        assert any(str(one) in str(found) for one in (option, *values)), found
    assert repr(found) != without(name, use), "it changes nothing"


SAME = [(name, option) for name, option in EVERY if not USES[name][option].spy and name in COMMANDS]


@pytest.mark.parametrize(("name", "option"), SAME)
def test_a_command_equals_its_operation(name: str, option: str) -> None:
    call, use = CALLS[name], USES[name][option]
    found = FOUND.get((name, option)) or outcome(call, use, {option: use.value})
    out = Path(call.out) if call.out else None
    clear(out)
    result = command(*typed(name, use, {option: use.value}), "--json")
    if isinstance(found, MckibbenError):
        assert result.code == 2
        return
    assert result.code == 0, result.err
    numbers, _, files = found
    assert scrubbed(json.loads(result.out)) == numbers
    assert written(out) == files
