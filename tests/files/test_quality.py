"""Choosing columns; missing samples, their codes, wraps; units."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mckibben
from mckibben import DataError
from mckibben.registry import load
from tests.files.made import Cells, one, place, put, refused, several
from tests.refusals import mentions

N = 400
K = np.arange(N)
T = K / 50
P = 2.5 - 2.5 * np.cos(2 * np.pi * T / 4)
Y = 6 * P + 2


def table(folder: Path, header: str, *columns: Cells) -> Path:
    """Write columns beside the times, by default a pressure and a length."""
    return put(folder / "run.csv", f"t_s,{header}", T, *(columns or (P, Y)))


def changed(samples: Any, at: Any, to: object) -> Any:
    """Return samples of which some are another cell."""
    other = samples.copy()
    other[at] = to
    return other


@pytest.mark.parametrize("name", ["P2 [kPa]", "P2", "p2", "p2 [KPA]"])
def test_a_column_is_found_by_header_or_name(tmp_path: Path, name: str) -> None:
    recording = one(table(tmp_path, "P1 [kPa],P2 [kPa]"), columns={"pressure": name})
    assert recording["pressure"] == pytest.approx(Y / 100)
    assert list(recording.channels) == ["pressure_1", "pressure"]


def test_a_mapped_column_goes_before_an_alias(tmp_path: Path) -> None:
    path = table(tmp_path, "position_mm,x_mm,displacement_mm", Y, P, Y)
    recording = one(path, columns={"displacement": "x_mm"})
    assert recording["displacement"].tolist() == P.tolist()
    assert recording["position"].tolist() == Y.tolist()
    assert recording.meta["ignored_columns"] == ["displacement_mm"]


# Samples that were not measured ---------------------------------------------------------------

WORDS = ["OVER", "ERR", "0x1F", "1.2.3", "2.5 kPa", "#DIV/0!", "n.d."]
MISSING = ["", "-", "--", "---", "NaN", "nan", "NAN", "NA", "N/A", "n/a", "#N/A", "null", "NULL"]
MISSING += ["None", "inf", "-inf", "∞", "+∞", "-∞", "OL", "OVLD"]


@pytest.mark.parametrize(
    ("cell", "at"), [(c, k) for c in WORDS for k in (0, 7, N - 1)] + [(c, 7) for c in MISSING]
)
@pytest.mark.parametrize("header", ["t_s,pressure_bar,x_mm", "count,pressure_bar,force_N"])
def test_a_cell_without_a_number_is_refused_by_its_row(
    tmp_path: Path, cell: str, at: int, header: str
) -> None:
    path = put(tmp_path / "a.csv", header, T, changed(P.astype(object), at, cell), Y)
    for channels in (None, ["pressure"]):
        error = refused(path, channels=channels)
        assert (error.channel, error.row) == ("pressure", at + 2)
        assert (cell if cell in WORDS else "1 of 400") in error.problem
        assert cell in WORDS or "gaps=interpolate" in error.remedy


@pytest.mark.parametrize("rows", [[0, 1], [N - 1], [0, N - 2, N - 1]])
def test_rows_before_a_channel_begins_and_after_it_ends_are_cut_off(
    tmp_path: Path, rows: list[int]
) -> None:
    path = put(
        tmp_path / "a.csv", "t_s,pressure_bar,displacement_mm", T, changed(P, rows, np.nan), Y
    )
    recording = one(path)
    assert recording["pressure"].tolist() == np.delete(P, rows).tolist()
    assert recording["displacement"].tolist() == np.delete(Y, rows).tolist()
    assert any("cut" in note for note in recording.notes)
    assert "bridged" not in recording.meta


def test_other_columns_with_such_cells_are_left_out(tmp_path: Path) -> None:
    path = table(tmp_path, "a,b", changed(P.astype(object), 7, "n.d."), Y)
    recording = one(path)
    assert list(recording.channels) == ["b"]
    assert any("'n.d.'" in note for note in recording.notes)
    assert place(path, channels=["a"]) == ("a", 9)


@pytest.mark.parametrize("timed", [True, False])
def test_missing_samples_split(tmp_path: Path, timed: bool) -> None:
    columns = changed(P, 15, np.nan), changed(Y, [16, 20], np.nan)
    path = put(tmp_path / "run.csv", "pressure_bar,force_N", *columns)
    if timed:
        path = table(tmp_path, "pressure_bar,force_N", *columns)
    first, second = several(path, gaps="split", rate=None if timed else 50)
    assert first["pressure"].tolist() == P[:15].tolist()
    assert second["force"].tolist() == Y[21:].tolist()
    assert second.start_time == pytest.approx(T[21])
    assert (first.name, second.name) == ("run[1]", "run[2]")
    assert any(mentions(note, (1, 3)) for note in first.notes)


@pytest.mark.parametrize("code", [-9999.0, 99999.0, 32767.0, 9.91e37, -9.9e37])
@pytest.mark.parametrize("length", [1, 3, 40])
def test_codes_are_missing_samples(tmp_path: Path, code: float, length: int) -> None:
    holes = slice(100, 100 + length)
    path = table(tmp_path, "pressure_bar,displacement_mm", P, changed(Y, holes, code))
    assert place(path) == ("displacement", 102)
    recording = one(path, gaps="interpolate")
    expected = np.interp(K, np.delete(K, holes), np.delete(Y, holes))
    assert recording["displacement"] == pytest.approx(expected)
    assert recording.bridged.nonzero()[0].tolist() == K[holes].tolist()
    assert len(several(path, gaps="split")) == 2


@pytest.mark.parametrize(
    ("header", "columns", "row"),
    [
        ("p_bar,length_mm", (P, changed(Y + 40, [50, 51, 200, 201, 202], 0.0)), 52),
        ("pressure_mbar,x_mm", (changed(400 * P + 20, [70, 150], -999.0), Y), 72),
    ],
    ids=["zeros", "codes"],
)
def test_zeros_and_codes_are_refused(tmp_path: Path, header: str, columns: Any, row: int) -> None:
    error = refused(table(tmp_path, header, *columns))
    assert str(error.channel) in header
    assert error.row == row


@pytest.mark.parametrize("bits", [8, 16])
def test_a_counter_that_wraps_goes_on(tmp_path: Path, bits: int) -> None:
    counts = np.rint(Y / 30 * 2.5 * 2**bits)
    path = table(tmp_path, "p_bar,displacement_um", P, counts % 2**bits)
    whole = one(path)
    assert whole["displacement"] == pytest.approx((counts - counts[0] + counts[0] % 2**bits) / 1000)
    assert any("raw" in note for note in whole.notes)
    assert one(path, raw=True)["displacement"].max() < 2**bits / 1000


ON = (K + 25) % 50 < 42
MOVED = np.where(ON, 20.0, 3.0) + 0.01 * np.random.default_rng(0).standard_normal(N)
NOISY = np.where(ON, 4 + MOVED / 100, 0.0)
LEGITIMATE: dict[str, tuple[str, *tuple[Cells, ...]]] = {
    "steps": ("p_bar,displacement_mm", P, 2.0 * ((K // 50) % 2) + (K // 100)),
    "a limit at zero": ("p_bar,displacement_mm", P, np.maximum(P - 2.0, 0.0)),
    "zero at first": ("p_bar,displacement_mm", P, np.where(T < 1, 0.0, Y)),
    "two levels": ("p_bar,displacement_mm", P, np.where(T % 2 < 1, 0.0, 9999.0)),
    "three levels": ("p_bar,force_gf", P, np.array([200.0, 500.0, 999.0])[K * 3 // N]),
    "a status": ("p_bar,x_mm,status", P, Y, np.where(T < 1, 0, 999)),
    "8 bits": ("p_bar,displacement_um", P, np.minimum(np.rint(Y / 30 * 640), 2**8 - 1)),
    "16 bits": ("p_bar,displacement_um", P, np.minimum(np.rint(Y / 30 * 163840), 2**16 - 1)),
}


@pytest.mark.parametrize("name", LEGITIMATE)
def test_what_was_measured_is_read(tmp_path: Path, name: str) -> None:
    recording = one(table(tmp_path, *LEGITIMATE[name]))
    assert recording.n_samples == N
    assert not recording.bridged.any()


def test_zeros_that_were_measured_are_read_raw(tmp_path: Path) -> None:
    path = table(tmp_path, "pressure_bar,displacement_mm", NOISY, MOVED)
    assert "`raw`" in refused(path).remedy
    recording = one(path, raw=True)
    assert recording["pressure"] == pytest.approx(NOISY)
    assert recording["displacement"] == pytest.approx(MOVED)


@pytest.mark.parametrize("jitter", [0.0, 0.05])
def test_lost_rows_do_not_change_the_sample_time(tmp_path: Path, jitter: float) -> None:
    time = T + jitter * 0.02 * np.random.default_rng(0).standard_normal(N)
    kept = np.delete(K, [50, 51, 200, 310])
    cells = "\n".join(f"{time[k]:.6f},{P[k]:.4f},{Y[k]:.4f}" for k in kept)
    path = tmp_path / "run.csv"
    path.write_text(f"time_s,pressure_bar,displacement_mm\n{cells}\n")
    assert one(path, gaps="interpolate").sample_time == pytest.approx(T[1] - T[0], rel=1e-4)


def test_bridged_samples_are_not_fitted(tmp_path: Path) -> None:
    y = changed(Y, slice(150, 190), np.nan)
    path = table(tmp_path, "pressure_bar,displacement_mm", P, y)
    recording = one(path, gaps="interpolate")
    wrong = recording.with_channels(displacement=np.where(recording.bridged, 99.0, Y))
    block = load("estimators", "pi")().fit(wrong.slice(20, N)).model_
    assert block.simulate(recording)["displacement"][-50:] == pytest.approx(Y[-50:], abs=0.1)


# Units and calibrations -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("row", "toml"), [("s,kPa,mm", ""), ("", '[channels.pressure]\nunit="kPa"\n')]
)
def test_units_that_contradict_each_other_are_refused(tmp_path: Path, row: str, toml: str) -> None:
    path = table(tmp_path, f"pressure_bar,displacement_mm\n{row}".rstrip(), P, Y)
    if toml:
        path.with_name("channels.toml").write_text(toml)
    assert refused(path).channel == "pressure"
    assert one(path, units={"pressure": "bar"})["pressure"] == pytest.approx(P)


@pytest.mark.parametrize("after", ["_cm_filtered", " cm 1", "_ft_1", "_adc", "_raw", "_x_inc"])
def test_a_unit_within_a_header_is_never_replaced_by_the_default(
    tmp_path: Path, after: str
) -> None:
    named = {"displacement": f"displacement{after}"}
    path = table(tmp_path, f"pressure_bar,displacement{after}")
    assert refused(path, columns=named).channel == "displacement"
    recording = one(path, columns=named, units={"displacement": "cm"})
    assert recording["displacement"] == pytest.approx(10 * Y)


ABSOLUTE = ["bara", "psia", "kPa abs", "bar(a)", "kPaA", "bar abs"]


@pytest.mark.parametrize("unit", [*ABSOLUTE, "barg", "kPa(g)"])
def test_absolute_pressure_is_noted_and_never_mixed(tmp_path: Path, unit: str) -> None:
    absolute = unit in ABSOLUTE
    recording = one(table(tmp_path, f"p [{unit}],displacement_mm", P + 1, Y))
    assert recording.meta["pressure_reference"]["pressure"] == ("absolute" if absolute else "gauge")
    assert any("absolute" in note for note in recording.notes) == absolute
    if absolute:
        gauge = one(table(tmp_path, "p [barg],displacement_mm"))
        with pytest.raises(DataError) as caught:
            mckibben.compare(recording, gauge, models=["pi"], jobs=1)
        assert caught.value.channel == "pressure"


def test_what_is_calibrated_again_is_neither_absolute_nor_calibrated_twice(tmp_path: Path) -> None:
    path = table(tmp_path, "p [bara],displacement_mm", P + 1, Y)
    again = path.with_name("again.csv")
    mckibben.write(one(path, calibration={"displacement": (2.0, 0.0)}), again)
    found = one(again, calibration={"pressure": (1.0, -1.0)}, units={"pressure": "bar"})
    assert found["pressure"] == pytest.approx(P)
    assert found["displacement"] == pytest.approx(2 * Y)
    assert "pressure" not in found.meta["pressure_reference"]
    assert set(found.meta["calibration"]) == {"pressure", "displacement"}


def test_flaws_of_columns_not_asked_for_do_not_matter(tmp_path: Path) -> None:
    header = "pressure_bar,displacement_mm,force_parsec,force 2_N,force_2_N"
    path = table(tmp_path, header, P, Y, P, P, P)
    assert refused(path).channel in ("force", "force_2")
    asked = one(path, columns={"pressure": "pressure", "displacement": "displacement"})
    assert asked["displacement"].tolist() == Y.tolist()
