"""Every block has equations, and every number of it a name, a unit, a meaning and one symbol in them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import fields, replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.equations import channel_symbols, quantities, written
from mckibben.blocks.laws import examples
from mckibben.blocks.notation import Written, symbols
from mckibben.blocks.parameters import Parametrised, leaves
from mckibben.report.mathematics import mathml
from tests.blocks.balances import balances

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


# -- one symbol, one parameter -------------------------------------------------------------------

Token = tuple[str, tuple[str, ...]]
"""A letter, and its indices."""

LETTER = re.compile(r"(\\[A-Za-z]+|[A-Za-z])(?:_(\{(?:[^{}]|\{[^{}]*\})*\}|\\[a-z]+|\w))?")


def tokens(lines: Sequence[str]) -> set[Token]:
    """Return the letters with their indices in lines of LaTeX, also those within indices."""
    found: set[Token] = set()
    for line in lines:
        line = re.sub(r"\\(text|operatorname|mathrm|begin|end)\{[^}]*\}", " ", line)
        for letter, below in LETTER.findall(re.sub(r"\\[a-z]*(dot|bar|hat)\b", " ", line)):
            inner = re.sub(r"[+-]\d", "", below)
            found.add((letter, tuple(re.findall(r"\\[a-z]+|[A-Za-z]|\d+", inner))))
            found |= tokens([inner.strip("{}")]) if "_" in inner or "/" in inner else set()
    return found


def means(number: Token, general: Token) -> bool:
    """Return whether a letter with numbers as indices is one with letters, or without any."""
    (letter, own), (other, indices) = number, general
    counted = len(own) == len(indices) and all(
        mine == index or (mine.isdigit() and not index.isdigit())
        for mine, index in zip(own, indices, strict=True)
    )
    return letter == other and (counted or not indices)


def inside(part: Parametrised) -> Iterator[Parametrised]:
    yield part
    for field in fields(part):  # type: ignore[arg-type]
        for _, value in leaves(getattr(part, field.name)):
            if isinstance(value, Parametrised):
                yield from inside(value)


def obey(block: Parametrised) -> None:
    """Assert that every number has one symbol, which its equations have, and the other way round."""
    for part in inside(block):
        declared = [*dict.fromkeys((*part.parameters, *symbols(type(part))))]
        numbers = {
            (field, index): value
            for field in declared
            for index, value in leaves(getattr(part, field, None))
            if isinstance(value, float)
        }
        called = {at: part.symbol_of(*at) for at in numbers}
        assert len({*called.values()}) == len(called), part
        equations = tokens(part.equations())
        known = {at: next(iter(tokens([symbol]))) for at, symbol in called.items()}
        for (field, index), symbol in known.items():
            used = any(value for (of, _), value in numbers.items() if of == field)
            there = any(means(symbol, one) for one in equations)
            assert there or not used, f"{called[field, index]} is not in {part.equations()}"
        channels = {letter for letter, _ in tokens([*channel_symbols(part).values()])}
        letters = {letter for letter, _ in known.values()} - channels - {"F"}  # that of a play, too
        for one in equations:
            there = any(means(symbol, one) for symbol in known.values())
            assert there or one[0] not in letters, f"{one} has no number in {part}"


@pytest.mark.parametrize("title", EXAMPLES)
def test_a_parameter_is_one_symbol_in_equations_and_tables(title: str) -> None:
    obey(EXAMPLES[title])
    own = [one.symbol for one in quantities(EXAMPLES[title])]
    assert all(own)


@given(st.data(), st.booleans(), st.booleans())
@settings(max_examples=20)
def test_so_it_is_in_every_balance(data: st.DataObject, crowded: bool, heavy: bool) -> None:
    driven = data.draw(st.sampled_from([None, 0])) if crowded else None
    block = data.draw(balances(m=2, crowded=crowded, heavy=heavy, driven=driven))
    obey(replace(block, preload=0.0) if block.drive else block)  # of these one alone is used


def test_channels_have_the_letters_of_the_equations() -> None:
    assert channel_symbols(EXAMPLES["gpi"]) == {"pressure": "u", "displacement": "y"}
    assert channel_symbols(EXAMPLES["balance-inverse"]) == {
        **{f"displacement_{k}": f"y_{{{k}}}" for k in (1, 2)},
        **{f"pressure_{k}": f"p_{{{k}}}" for k in (1, 2)},
        "pressure_extensor": "x",
        "force": "F",
    }
    for title, block in EXAMPLES.items():
        names = {channel.name for channel in (*block.inputs, *block.outputs)}
        letters = [letter for name, letter in channel_symbols(block).items() if name in names]
        assert len({*letters}) == len(letters), title


def test_springs_are_counted_as_in_the_equation() -> None:
    symbols_of = {one.name: one.symbol for one in quantities(EXAMPLES["balance"])}
    assert symbols_of["constant force of muscle 1"] == "S_{1,0,0}"
    assert symbols_of["spring of muscle 2 to muscle 1 by pressure_extensor"] == "S_{2,1,1}"
