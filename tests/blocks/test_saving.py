"""Saved models: exact to the last bit, and nothing but what the package wrote is believed."""

from __future__ import annotations

import json
import stat
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mckibben import GPI, PI, DataError, ModelError, Series, load
from mckibben.blocks.core import saving
from mckibben.blocks.laws.examples import examples
from tests.blocks.strategies import gpi_models, pi_models, rate_dependent_models

EXAMPLES = examples()
GOOD: dict[str, Any] = GPI.example().to_dict()
TEXT = json.dumps(GOOD)


def written(path: Path, content: object) -> Path:
    text = content if isinstance(content, str) else json.dumps(content)
    path.write_text(text, encoding="utf-8")
    return path


def refused(path: Path) -> str:
    """Return what `load` says of a file that it must refuse."""
    with pytest.raises(ModelError) as caught:
        load(path)
    message = str(caught.value)
    assert "Remedy:" in message
    assert str(path) in message
    return message


@given(st.one_of(pi_models(), gpi_models(), rate_dependent_models()))
def test_round_trip_is_exact(model: Any) -> None:
    text = json.dumps(model.to_dict(), allow_nan=False)
    assert saving.from_dict(json.loads(text)) == model


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=1, max_size=5))
def test_every_double_comes_back(weights: list[float]) -> None:
    model = PI(tuple(float(i) for i in range(len(weights))), tuple(weights))
    copy = saving.from_dict(json.loads(json.dumps(model.to_dict())))
    assert copy.pack().tobytes() == model.pack().tobytes()


def test_a_person_can_read_it(tmp_path: Path) -> None:
    Series.example().save(tmp_path / "model.json")
    lines = (tmp_path / "model.json").read_text().splitlines()
    assert lines[1].strip() == '"format": "mckibben-model",'
    assert lines[2].strip() == '"version": 1,'
    assert lines[3].strip() == '"kind": "series",'


def test_lists_arrays_and_whole_numbers_are_taken(tmp_path: Path) -> None:
    content = PI.example().to_dict() | {"offset": 2, "weights": [3, 1.5, 1, 0.5]}
    assert load(written(tmp_path / "model.json", content)) == PI.example()


DAMAGES: dict[str, Callable[[dict[str, Any]], object]] = {
    "another format": lambda d: d | {"format": "onnx"},
    "no format": lambda d: {k: v for k, v in d.items() if k != "format"},
    "a later version": lambda d: d | {"version": 2},
    "a version that is text": lambda d: d | {"version": "1"},
    "a version that is true": lambda d: d | {"version": True},
    "no version": lambda d: {k: v for k, v in d.items() if k != "version"},
    "no kind": lambda d: {k: v for k, v in d.items() if k != "kind"},
    "an unknown kind": lambda d: d | {"kind": "preisach"},
    "a kind that is a list": lambda d: d | {"kind": ["gpi"]},
    "a kind that is a location": lambda d: d | {"kind": "os:system"},
    "a kind that is a location of ours": lambda d: (
        d | {"kind": "mckibben.blocks.play_type.gpi:GPI"}
    ),
    "a kind that is a path": lambda d: d | {"kind": "../gpi"},
    "a kind of another group": lambda d: d | {"kind": "tanh"},
    "an estimator as a kind": lambda d: d | {"kind": "mpi"},
    "an unknown field": lambda d: d | {"gain": 1.0},
    "a dunder field": lambda d: d | {"__class__": "PI"},
    "a method as a field": lambda d: d | {"bind": 1.0},
    "an absent field": lambda d: {k: v for k, v in d.items() if k != "weights"},
    "a number as text": lambda d: d | {"weights": ["9.0", 4.0, 2.0, 1.0]},
    "a truth value as a number": lambda d: d | {"weights": [True, 4.0, 2.0, 1.0]},
    "null for a number": lambda d: d | {"weights": [None, 4.0, 2.0, 1.0]},
    "a number for a list": lambda d: d | {"weights": 9.0},
    "an object for a list": lambda d: d | {"weights": {"0": 9.0}},
    "text for a list": lambda d: d | {"weights": "9421"},
    "too few weights": lambda d: d | {"weights": [9.0]},
    "thresholds out of order": lambda d: d | {"thresholds": [0.0, 0.3, 0.1, 0.5]},
    "a nested list": lambda d: d | {"weights": [[9.0], 4.0, 2.0, 1.0]},
    "an empty input range": lambda d: d | {"input_range": [5.0, 0.0]},
    "an input range of three": lambda d: d | {"input_range": [0.0, 1.0, 5.0]},
    "an unknown start": lambda d: d | {"initial": "fresh"},
    "a start that is not finite": lambda d: d | {"initial": [1e999, 0.0]},
    "a channel that is text": lambda d: d | {"input": "pressure"},
    "a channel without a unit": lambda d: d | {"input": {"name": "pressure"}},
    "a channel with more": lambda d: d | {"input": {"name": "p", "unit": "bar", "x": 1}},
    "an unknown envelope": lambda d: d | {"rising": {"kind": "erf", "slope": 1.0, "shift": 0.0}},
    "an envelope that is a block": lambda d: d | {"rising": PI.example().to_dict()},
    "an envelope that is a list": lambda d: d | {"rising": [1.0, 2.0]},
    "an envelope with text": lambda d: d | {"rising": d["rising"] | {"slope": "steep"}},
    "an envelope that falls": lambda d: d | {"rising": d["rising"] | {"slope": -1.0}},
    "a list": lambda d: [d],
    "text": lambda d: "a model",
    "a number": lambda d: 3,
    "null": lambda d: None,
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_content_is_refused(damage: str, tmp_path: Path) -> None:
    refused(written(tmp_path / "model.json", json.dumps(DAMAGES[damage](dict(GOOD)))))


RAW: dict[str, bytes] = {
    "nothing": b"",
    "truncated": TEXT[: len(TEXT) // 2].encode(),
    "more behind it": (TEXT + TEXT).encode(),
    "NaN": TEXT.replace("9.0", "NaN").encode(),
    "Infinity": TEXT.replace("9.0", "-Infinity").encode(),
    "a number too large for a double": TEXT.replace("9.0", "1e999").encode(),
    "an integer too large for a double": TEXT.replace("9.0", "9" * 400).encode(),
    "an integer of ten thousand digits": TEXT.replace("9.0", "9" * 10000).encode(),
    "a field twice": TEXT.replace('"kind": "gpi"', '"kind": "gpi", "kind": "gpi"', 1).encode(),
    "not UTF-8": TEXT.replace("gpi", "gp\xef", 1).encode("latin-1"),
    "UTF-16": TEXT.encode("utf-16"),
    "binary": bytes(range(256)),
    "a pickle": b"\x80\x04\x95\x1d\x00\x00\x00\x00\x00\x00\x00\x8c\x05posix\x94\x8c\x06system",
    "deep lists": b"[" * 100_000,
    "deep objects": b'{"kind":' * 100_000,
    "deep and closed": b"[" * 5000 + b"]" * 5000,
}


@pytest.mark.parametrize("raw", RAW)
def test_damaged_files_are_refused(raw: str, tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    path.write_bytes(RAW[raw])
    refused(path)


def test_deeply_nested_series_is_refused(tmp_path: Path) -> None:
    part = json.dumps(PI.example().to_dict()).replace(
        '"format": "mckibben-model", "version": 1, ', ""
    )
    opened = '{"kind": "series", "parts": [' * 900
    text = '{"format": "mckibben-model", "version": 1, ' + opened[1:] + part + "]}" * 900
    refused(written(tmp_path / "model.json", text))


def test_missing_files_and_folders_are_refused(tmp_path: Path) -> None:
    assert "no such file" in refused(tmp_path / "absent.json")
    refused(tmp_path)


def test_huge_files_are_refused_before_they_are_read(tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    with path.open("wb") as file:
        file.truncate(saving.LARGEST_FILE + 1)
    assert "bytes are more than" in refused(path)


@pytest.mark.parametrize("kind", EXAMPLES)
@pytest.mark.parametrize(
    "surplus", ["__init__", "unknown", "kernel", "self", "cls", "__dataclass_self__"]
)
def test_no_block_takes_an_unknown_field(kind: str, surplus: str) -> None:
    content = EXAMPLES[kind].to_dict()
    with pytest.raises(ModelError, match="Remedy:"):
        saving.from_dict({**content, surplus: 1.0})


def test_inverses_that_had_kinds_of_their_own_still_load() -> None:
    content = PI.example().inverse().to_dict()
    assert content["kind"] == "inverse"
    assert saving.from_dict({**content, "kind": "pi-inverse"}) == PI.example().inverse()
    for kind in ("nothing-inverse", "pi-inverse-inverse", "-inverse"):
        with pytest.raises(ModelError, match="Remedy:"):
            saving.from_dict({**content, "kind": kind})


def test_nothing_is_imported_on_the_word_of_a_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "trap.py").write_text("raise SystemExit('the trap was sprung')")
    monkeypatch.syspath_prepend(tmp_path)
    for kind in ("trap", "trap:Trap", "mckibben.blocks.trap:Trap"):
        refused(written(tmp_path / "model.json", GOOD | {"kind": kind}))


def test_a_failed_write_leaves_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "model.json"
    PI.example().save(path)

    def fail(self: Path, target: Path) -> Path:
        raise OSError("the disk is full")

    with monkeypatch.context() as broken:
        broken.setattr(Path, "replace", fail)
        with pytest.raises(DataError, match="disk is full"):
            GPI.example().save(path)
    assert load(path) == PI.example()
    assert [file.name for file in tmp_path.iterdir()] == ["model.json"]


def test_saving_replaces_and_keeps_to_the_umask(tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    PI.example().save(path)
    GPI.example().save(path)
    assert load(path) == GPI.example()
    assert stat.S_IMODE(path.stat().st_mode) & 0o600 == 0o600


def test_from_dict_wants_a_mapping() -> None:
    with pytest.raises(ModelError, match="not a saved model"):
        saving.from_dict([("kind", "pi")])  # type: ignore[arg-type]


def test_a_file_that_a_windows_editor_has_saved_again_is_read(tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    block = GPI.example()
    block.save(path)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert load(path) == block
