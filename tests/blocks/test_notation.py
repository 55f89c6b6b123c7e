"""Every block says how it is written, and what each of its numbers is."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest

from mckibben.blocks.core.block import Block
from mckibben.blocks.core.inverse import Inverse
from mckibben.blocks.core.notation import MANY, Written, meanings
from mckibben.blocks.core.writing import quantities, written
from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.laws.examples import examples
from mckibben.registry import load, names
from mckibben.report.mathematics import mathml

EXAMPLES = examples()

SHARED = {"input_scale"}
"""Documented in one breath with a field of another unit."""

IN_WORDS = {"command", "bar per contraction"}
"""Units that docstrings tell in words."""

OLD = {"force-balance"}
"""Kept for files alone: nothing identifies it, and its numbers have no names."""


def parts(of: Written) -> Iterator[Written]:
    yield of
    for part in of.parts:
        yield from parts(part)


@pytest.mark.parametrize("title", EXAMPLES)
def test_equations_are_there_and_browsers_can_set_them(title: str) -> None:
    for part in parts(written(EXAMPLES[title])):
        assert part.equations, part.title
        for line in (*part.equations, *part.numbers):
            set_in = str(mathml(line))
            assert set_in.startswith("<math"), line
            assert "\\" not in set_in, line


@pytest.mark.parametrize("title", sorted(EXAMPLES.keys() - OLD))
def test_every_parameter_has_a_unit_and_a_meaning(title: str) -> None:
    block = EXAMPLES[title]
    found = quantities(block)
    assert len(found) == block.n_parameters
    assert len({one.name for one in found}) == len(found)
    if title.removesuffix("-inverse") not in OLD:
        assert all(one.meaning for one in found)
        assert not any("{" in one.unit for one in found)


@pytest.mark.parametrize("title", sorted(EXAMPLES))
def test_every_number_of_a_short_model_is_written_out(title: str) -> None:
    block = EXAMPLES[title]
    if block.n_parameters > MANY or title.startswith(tuple(OLD)):
        pytest.skip("its numbers are in its file")
    text = " ".join(line for part in parts(written(block)) for line in part.numbers)
    mantissas = text.replace(r" \times 10^{", "e")
    for value in block.pack().tolist():
        assert f"{value:.4g}" in mantissas, value


@pytest.mark.parametrize("kind", names("blocks"))
def test_units_declared_are_those_documented(kind: str) -> None:
    """Where a docstring gives one unit of a field in brackets, the notation gives the same."""
    cls = load("blocks", kind)
    documented = meanings(cls)
    for field in cls.notation.symbols:
        found = re.findall(r"\[([^\]]+)\]", documented.get(field, ""))
        declared = cls.notation.unit(field)
        own = field not in SHARED and not any(mark in declared for mark in "{|")
        if own and len(found) == 1 and found[0] not in IN_WORDS:
            assert declared == found[0], field


def test_an_inverse_is_written_as_what_it_undoes() -> None:
    block: Block = EXAMPLES["pi"].inverse()
    assert isinstance(block, Inverse)
    found = written(block)
    assert found.parts[0].equations == written(EXAMPLES["pi"]).equations
    assert [one.unit for one in quantities(block)] == [
        one.unit for one in quantities(EXAMPLES["pi"])
    ]


def test_units_follow_the_channels() -> None:
    by_name = {one.name: one.unit for one in quantities(EXAMPLES["rate-dependent-pi"])}
    assert by_name["weights 1"] == "mm/bar"
    assert by_name["rate weights 1"] == "mm s/bar^2"
    assert by_name["offset"] == "mm"


def test_the_springs_of_a_balance_grow_with_what_schedules() -> None:
    by_name = {one.name: one.unit for one in quantities(EXAMPLES["balance"])}
    own = ["constant force of muscle 1", "spring of muscle 1", "spring of muscle 1 to muscle 2"]
    springs = [by_name[name] for name in (*own, *(f"{name} by pressure_extensor" for name in own))]
    assert springs == ["N", "N/mm", "N/mm", "N/bar", "N/mm bar", "N/mm bar"]


def test_a_balance_is_written_in_its_own_letters() -> None:
    model = Balance.example().inverse()
    found = written(model)
    assert found.title.startswith("balance: pressure")
    assert found.equations == model.inverse().equations()
    assert not any(r"\hat{u}" in line for part in parts(found) for line in part.numbers)
