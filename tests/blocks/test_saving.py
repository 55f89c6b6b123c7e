"""Saved models: exact to the last bit, and nothing but what the package wrote is believed."""

from __future__ import annotations

import json
import stat
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mckibben import GPI, PI, DataError, ModelError, load
from mckibben.blocks import saving
from mckibben.blocks.base import VERSION
from mckibben.blocks.laws import examples
from mckibben.blocks.parameters import plain
from tests.golden.models import all_models

EXAMPLES = examples()
GOOD: dict[str, Any] = GPI.example().to_dict()
TEXT = json.dumps(GOOD)


def refused(path: Path, content: bytes | None = None) -> None:
    """Demand that a file is refused by its name, after writing content into it, if any."""
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(ModelError) as caught:
        load(path)
    assert "Remedy:" in str(caught.value)
    assert str(path) in str(caught.value)


def test_whole_numbers_and_what_a_windows_editor_puts_before_them_are_read(tmp_path: Path) -> None:
    content = PI.example().to_dict() | {"offset": 2, "weights": [3, 1.5, 1, 0.5]}
    path = tmp_path / "model.json"
    path.write_bytes(b"\xef\xbb\xbf" + json.dumps(content).encode())
    assert load(path) == PI.example()


def without(field: str) -> Callable[[dict[str, Any]], object]:
    return lambda d: {k: v for k, v in d.items() if k != field}


def with_(**fields: object) -> Callable[[dict[str, Any]], object]:
    return lambda d: d | fields


DAMAGES: dict[str, Callable[[dict[str, Any]], object]] = {
    "another format": with_(format="onnx"),
    "no format": without("format"),
    "a later version": with_(version=3),
    "no version": without("version"),
    "an unknown kind": with_(kind="unheard-of"),
    "a kind that is a location": with_(kind="os:system"),
    "a kind that is a path": with_(kind="../gpi"),
    "an estimator as a kind": with_(kind="mpi"),
    "a method as a field": with_(bind=1.0),
    "an absent field": without("weights"),
    "a number as text": with_(weights=["9.0", 4.0, 2.0, 1.0]),
    "an unknown start": with_(initial="fresh"),
    "a start that is not finite": with_(initial=[1e999, 0.0]),
    "a channel without a unit": with_(input={"name": "pressure"}),
    "an unknown envelope": with_(rising={"kind": "erf", "slope": 1.0, "shift": 0.0}),
    "an envelope that falls": with_(rising=GOOD["rising"] | {"slope": -1.0}),
    "a list": lambda d: [d],
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_content_is_refused(damage: str, tmp_path: Path) -> None:
    content = DAMAGES[damage](dict(GOOD))
    refused(tmp_path / "model.json", json.dumps(content).encode())


PART = json.dumps(plain(PI.example()))

RAW: dict[str, bytes] = {
    "nothing": b"",
    "truncated": TEXT[: len(TEXT) // 2].encode(),
    "more behind it": (TEXT + TEXT).encode(),
    "NaN": TEXT.replace("9.0", "NaN").encode(),
    "a number too large for a double": TEXT.replace("9.0", "1e999").encode(),
    "an integer too large for a double": TEXT.replace("9.0", "9" * 400).encode(),
    "a field twice": TEXT.replace('"kind": "gpi"', '"kind": "gpi", "kind": "gpi"', 1).encode(),
    "not UTF-8": TEXT.replace("gpi", "gp\xef", 1).encode("latin-1"),
    "a pickle": b"\x80\x04\x95\x1d\x00\x00\x00\x00\x00\x00\x00\x8c\x05posix\x94\x8c\x06system",
    "deep lists": b"[" * 100_000,
    "a deep series": (
        '{"format": "mckibben-model", "version": 1, '
        + ('{"kind": "series", "parts": [' * 900)[1:]
        + PART
        + "]}" * 900
    ).encode(),
}


@pytest.mark.parametrize("raw", RAW)
def test_damaged_files_are_refused(raw: str, tmp_path: Path) -> None:
    refused(tmp_path / "model.json", RAW[raw])


def test_what_is_no_file_or_too_large_is_refused(tmp_path: Path) -> None:
    refused(tmp_path / "absent.json")
    refused(tmp_path)
    with (tmp_path / "model.json").open("wb") as file:
        file.truncate(saving.LARGEST_FILE + 1)
    refused(tmp_path / "model.json")


@pytest.mark.parametrize("kind", EXAMPLES)
def test_no_block_takes_an_unknown_field(kind: str) -> None:
    for surplus in ("kernel", "__init__"):
        with pytest.raises(ModelError):
            saving.from_dict({**EXAMPLES[kind].to_dict(), surplus: 1.0})


SAVED = {**EXAMPLES, **all_models()}


def parts_of(content: Any) -> Iterator[dict[str, Any]]:
    """Yield a saved model and all of its parts."""
    if isinstance(content, dict):
        yield content
    for each in content.values() if isinstance(content, dict) else content:
        if isinstance(each, dict | list):
            yield from parts_of(each)


@pytest.mark.parametrize("name", SAVED)
def test_no_field_may_be_missing_but_those_added_since(name: str) -> None:
    for version in range(1, VERSION + 1):
        content = json.loads(json.dumps(SAVED[name].to_dict() | {"version": version}))
        for part in parts_of(content):
            default = defaults_of(part.get("kind"), version)
            for field in tuple(part):
                value = part.pop(field)
                found = answer(content)
                if field in default:
                    part[field] = default[field]
                    assert found == answer(content), (name, field)
                else:
                    assert isinstance(found, str), (name, field)
                    assert field in found
                part[field] = value


def defaults_of(kind: str | None, version: int) -> dict[str, Any]:
    """Return the values of what a part may lack in a file of a version."""
    cls: Any = type(EXAMPLES.get(kind or ""))
    added = [name for name, since in getattr(cls, "added", {}).items() if version < since]
    return (
        {one.name: plain(one.default) for one in fields(cls) if one.name in added} if added else {}
    )


def answer(content: Mapping[str, Any]) -> Any:
    """Return the block of a saved model, or why it is none."""
    try:
        return saving.from_dict(content)
    except ModelError as error:
        return str(error)


def test_inverses_that_had_kinds_of_their_own_still_load() -> None:
    content = PI.example().inverse().to_dict()
    assert content["kind"] == "inverse"
    assert saving.from_dict({**content, "kind": "pi-inverse"}) == PI.example().inverse()
    for kind in ("nothing-inverse", "pi-inverse-inverse", "-inverse"):
        with pytest.raises(ModelError):
            saving.from_dict({**content, "kind": kind})


OLDER = {
    "format": "mckibben-model",
    "version": 1,
    "kind": "balance",
    "degree": 1,
    "scale": 50.0,
    "springs": [[2.0, 14.0, 0.5, 0.2]],
    "elasticity": [[6.0]],
    "areas": [[60.0, -25.0]],
    "friction": [[3.0, 1.5]],
    "relaxation": [[]],
    "loads": [[1.0]],
    "damping": [0.0],
    "walls": [0.05],
    "limits": [0.2, 0.8],
    "friction_offset": 0.5,
    "friction_slopes": [0.3],
    "lags": [],
    "hull": [[-20.0, 50.0]],
    "asymmetry": 0.7,
    "pressure_range": [0.0, 6.0],
    "driven": [{"name": "displacement", "unit": "mm"}],
    "scheduled": [{"name": "extensor", "unit": "bar"}, {"name": "force", "unit": "N"}],
    "given": [{"name": "pressure", "unit": "bar"}],
}
"""A balance whose stops break away at ``limits (p + friction_offset + friction_slopes x)``."""

MOVED = ((0, 0, 0), (5, 1, 10), (9, 0.5, 20), (7, 0.5, 20), (3, 1.5, 0), (4, 1.5, 0), (8, 0.2, -5))
PRESSURES = (
    *(0.04238164285471853, 1.526032315978456, 2.8028752327746735, 2.1413991492105113),
    *(0.7442202141900939, 1.0567717139819637, 2.040250922509225),
)
"""Coordinates, extensor's pressure and load; the pressures that it gave for them."""


@pytest.mark.parametrize("named", [{}, {"friction_offset": "grip", "friction_slopes": "grips"}])
@pytest.mark.parametrize("ranged", [True, False])
def test_older_balances_give_the_same_numbers(named: dict[str, str], *, ranged: bool) -> None:
    content = {named.get(name, name): value for name, value in OLDER.items()}
    if not ranged:
        content.pop("pressure_range")
    block = saving.from_dict(content)
    np.testing.assert_allclose(block.simulate(MOVED)[:, 0], PRESSURES, rtol=0, atol=1e-12)
    assert saving.from_dict(block.to_dict()) == block


@pytest.mark.parametrize("wrong", ["0.5", [[0.5]], {}, 10**400])
def test_older_balances_that_are_damaged_are_refused(wrong: object) -> None:
    for name in ("friction_offset", "limits", "friction_slopes", "pressure_range"):
        with pytest.raises(ModelError):
            saving.from_dict(OLDER | {name: wrong})


def test_nothing_is_imported_on_the_word_of_a_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "trap.py").write_text("raise SystemExit('the trap was sprung')")
    monkeypatch.syspath_prepend(tmp_path)
    for kind in ("trap", "trap:Trap", "mckibben.blocks.trap:Trap"):
        refused(tmp_path / "model.json", json.dumps(GOOD | {"kind": kind}).encode())


def test_saving_replaces_all_or_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "model.json"
    GPI.example().save(path)
    PI.example().save(path)
    assert stat.S_IMODE(path.stat().st_mode) & 0o600 == 0o600

    def fail(self: Path, target: Path) -> Path:
        raise OSError("the disk is full")

    with monkeypatch.context() as broken:
        broken.setattr(Path, "replace", fail)
        with pytest.raises(DataError):
            GPI.example().save(path)
    assert load(path) == PI.example()
    assert [file.name for file in tmp_path.iterdir()] == ["model.json"]
