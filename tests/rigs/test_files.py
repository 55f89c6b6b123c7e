"""Rigs as files: round trips, and everything that may be wrong with them."""

from __future__ import annotations

import tempfile
import tomllib
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mckibben import DataError
from mckibben.rigs import describe, load_rig, rig_from_data_sheet, rig_names, save_rig
from mckibben.rigs.data_sheet import _loop_width
from mckibben.system.ordinary import DESCRIPTION


@pytest.mark.parametrize("name", rig_names())
def test_a_saved_rig_is_equal(name: str, tmp_path: Path) -> None:
    rig = load_rig(name)
    assert rig.name == name
    save_rig(rig, tmp_path / "copy.toml")
    assert load_rig(tmp_path / "copy.toml") == rig


@pytest.mark.parametrize("name", rig_names())
def test_a_description_names_every_parameter_with_its_meaning(name: str) -> None:
    text = describe(load_rig(name))
    written = tomllib.loads(text)
    assert set(load_rig(name).model_dump()) <= set(written)
    for line in text.splitlines():
        plain = not line or line.startswith(("[", "setup", "format", "name", "title", "source"))
        assert plain or "#" in line, line


def test_an_unknown_rig_lists_the_known_ones() -> None:
    with pytest.raises(DataError, match=r"no rig 'mas30'.*mas20-hanging.*\.toml"):
        load_rig("mas30")


WRONG: dict[str, list[tuple[object, str]]] = {
    "muscle.braid_angle": [(90.0, "at most 80"), (5.0, "at least 10"), (60.0, "below 54.7")],
    "muscle.length": [(0.0, "at least 10"), (-200.0, "at least 10"), ("long", "length at rest")],
    "muscle.c10": [(-1.0, "at least 0"), (float("nan"), "Mooney"), (float("inf"), "Mooney")],
    "muscle.wall": [(15.0, "fills the diameter"), (0.0, "above 0")],
    "muscle.friction.stiffness": [((-1.0,) * 6, "presliding"), ((1.0,), "one number an element")],
    "muscle.friction.contracting": [((float("nan"),) * 6, "resists contraction")],
    "muscle.creep.time": [((0.0, 1.0), "fades")],
    "air.valve_time": [(0.0, "at least 0.001")],
    "air.polytropic": [(2.0, "at most 1.4")],
    "payload": [(-1.0, "at least 0"), ("heavy", "mass hanging")],
    "sample_time": [(0.0, "above 0"), (None, "time between two samples")],
    "integration_step": [(0.1, "at most 0.005")],
    "start.pressure": [(7.0, "not within its range 0 to 6"), (float("nan"), "start")],
    "start.voltage": [(1.0, "'voltage' is no input")],
    "range.pressure.low": [(6.0, "high 6 is not above low 6")],
    "sensor": [({}, "there is none"), ({"smell": {}}, "'smell' cannot be measured")],
    "range": [({}, "none for the input 'pressure'"), ({"pressure": {}}, "highest")],
    "version": [(0, "at least 1"), (1.5, "integer")],
    "name": [("Mas 20", "short name"), ("", "short name")],
}


@pytest.mark.parametrize(
    ("path", "value", "match"),
    [(path, value, match) for path, cases in WRONG.items() for value, match in cases],
)
def test_impossible_parameters_are_refused_by_name(path: str, value: object, match: str) -> None:
    with pytest.raises(DataError) as refused:
        load_rig("mas20-hanging").changed({path: value})
    text = str(refused.value)
    assert match in text
    assert "Remedy:" in text


@pytest.mark.parametrize("path", ["mass", "muscle.colour", "muscle.length.unit", "a.b.c"])
def test_unknown_parameters_are_refused(path: str) -> None:
    with pytest.raises(DataError, match=r"has no parameter .*mckibben rig show mas20-hanging"):
        load_rig("mas20-hanging").changed({path: 1.0})


GOOD = describe(load_rig("mas20-hanging"))


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("", "does not begin with format"),
        ("time,pressure\n0,1\n", "not TOML"),
        (GOOD[: len(GOOD) // 2], "missing|not TOML"),
        (GOOD.replace("format_version = 1", "format_version = 9"), "format_version is 9"),
        (GOOD.replace('setup = "moving-end"', 'setup = "rocket"'), "setup is 'rocket'.*moving-end"),
        (GOOD.replace("wall =", "wal ="), "'muscle.wal'|'muscle.wall' is missing"),
        (GOOD + "\n[engine]\npower = 3\n", "no parameter 'engine'"),
        (GOOD.replace("length = 200.0", "length = nan"), "muscle.length"),
        (GOOD.replace("length = 200.0", 'length = "200 mm"'), "muscle.length.*length at rest"),
    ],
)
def test_a_wrong_file_is_refused_by_name(text: str, match: str, tmp_path: Path) -> None:
    file = tmp_path / "rig.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(DataError, match=match) as refused:
        load_rig(file)
    assert str(file) in str(refused.value)


def test_binary_huge_and_missing_files_are_refused(tmp_path: Path) -> None:
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00" * 50)
    with pytest.raises(DataError, match="not text"):
        load_rig(tmp_path / "binary.toml")
    (tmp_path / "huge.toml").write_bytes(b"#" * (DESCRIPTION + 1))
    with pytest.raises(DataError, match="bytes are more than"):
        load_rig(tmp_path / "huge.toml")
    with pytest.raises(DataError, match="no such file"):
        load_rig(tmp_path / "missing.toml")
    (tmp_path / "deep.toml").write_text("a = " + "[" * 5000, encoding="utf-8")
    with pytest.raises(DataError, match="not TOML"):
        load_rig(tmp_path / "deep.toml")


@settings(max_examples=80, deadline=None)
@given(st.binary(max_size=200), st.integers(0, len(GOOD) - 1))
def test_damaged_files_never_do_worse_than_a_refusal(junk: bytes, place: int) -> None:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "rig.toml"
        whole = GOOD.encode()
        file.write_bytes(whole[:place] + junk + whole[place + len(junk) :])
        with suppress(DataError):
            load_rig(file)


def test_a_rig_file_must_be_named_toml_and_is_not_lost(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"ends in \.toml"):
        save_rig(load_rig("rail"), tmp_path / "rail.json")


def test_a_data_sheet_makes_a_rig_with_its_numbers() -> None:
    rig = rig_from_data_sheet(
        name="dmsp-20",
        diameter=20.0,
        length=300.0,
        max_pressure=6.0,
        max_force=1500.0,
        max_contraction=0.25,
        payload=5.0,
        loop_width=0.2,
    )
    assert _loop_width(rig) == pytest.approx(0.2, abs=0.005)
    muscle = rig.muscle.record()[0]
    at_rest = 0.1 * 6.0 * muscle["area"] * (muscle["a"] - muscle["b"])
    assert at_rest == pytest.approx(1500.0)


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"diameter": -1.0}, "diameter is -1"),
        ({"max_force": 20.0}, "braid angle of .* degrees.*pull some"),
        ({"max_contraction": 0.5}, "more than the braid allows.*below 0."),
        ({"loop_width": 0.9}, "from 0.05 to 0.5"),
        ({"length": float("nan")}, "length is nan"),
    ],
)
def test_numbers_that_no_muscle_has_are_refused(change: dict[str, float], match: str) -> None:
    sheet = {
        "diameter": 20.0,
        "length": 200.0,
        "max_pressure": 6.0,
        "max_force": 1500.0,
        "max_contraction": 0.25,
    }
    with pytest.raises(DataError, match=match):
        rig_from_data_sheet(name="mine", **(sheet | change))
