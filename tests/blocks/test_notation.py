"""Every block has equations, and every number of it a name, a unit and a meaning."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest

from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.equations import quantities, written
from mckibben.blocks.laws import examples
from mckibben.blocks.notation import Written
from mckibben.report.mathematics import mathml

EXAMPLES = examples()


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


@pytest.mark.parametrize("title", EXAMPLES)
def test_every_parameter_has_a_unit_and_a_meaning(title: str) -> None:
    block = EXAMPLES[title]
    found = quantities(block)
    assert len({one.name for one in found}) == len(found) == block.n_parameters
    assert all(one.meaning for one in found)
    assert not any("{" in one.unit for one in found)


def test_units_follow_the_channels() -> None:
    rated = {one.name: one.unit for one in quantities(EXAMPLES["rate-dependent-pi"])}
    assert [rated[name] for name in ("weights 1", "rate weights 1", "offset")] == [
        *("mm/bar", "mm s/bar^2", "mm"),
    ]
    balance = {one.name: one.unit for one in quantities(EXAMPLES["balance"])}
    own = ["constant force of muscle 1", "spring of muscle 1", "spring of muscle 1 to muscle 2"]
    springs = [balance[name] for name in (*own, *(f"{name} by pressure_extensor" for name in own))]
    assert springs == ["N", "N/mm", "N/mm", "N/bar", "N/mm bar", "N/mm bar"]
    metric = Balance.example()
    relative = replace(metric, areas=((1.0, -0.1, 0.0), (1.1, -0.1, 0.0)))
    assert [one.unit_of("friction", (0, 0)) for one in (metric, relative)] == ["N/mm", "bar/mm"]
