"""Every form of header that people use."""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mckibben.files.names import CHANNELS, ROLES, words_of
from mckibben.files.reading import columns_of
from mckibben.files.units import RARE, SPELLINGS
from tests.files.made import refused

pytestmark = pytest.mark.filterwarnings("ignore::mckibben.DataWarning")

FORMS = {
    "pressure_bar": ("pressure", "bar"), "Pressure (kPa)": ("pressure", "kPa"),
    "force N": ("force", "N"), "Timestamp": ("time", ""), "valve_voltage_V": ("voltage", "V"),
    "u": ("voltage", ""), "y1_cm": ("displacement_1", "cm"), "PRESSURE_BAR": ("pressure", "BAR"),
    "Weg [mm]": ("displacement", "mm"), "Länge in cm": ("length", "cm"),
    "load (N)": ("force", "N"), "load [kg]": ("load", "kg"), "input_V": ("voltage", "V"),
    "temperature_C": ("temperature", "C"), "x": ("x", ""), "TipPosition": ("tip_position", ""),
    "position (V)": ("position", "V"),
    # languages
    "圧力 (kPa)": ("pressure", "kPa"), "圧力２（ｋＰａ）": ("pressure_2", "kPa"),
    "变形量/mm": ("displacement", "mm"), "变位（ｍｍ）": ("变位", "mm"),
    "時間[秒]": ("time", "秒"), "目標変位 (mm)": ("reference_displacement", "mm"),
    "设定压力": ("command_pressure", ""), "consigne pression (bar)": ("command_pressure", "bar"),
    "ref_mm": ("reference_displacement", "mm"), "p_cmd_kPa": ("command_pressure", "kPa"),
    "regulator_cmd_bar": ("command_pressure", "bar"), "valve_cmd": ("valve_cmd", ""),
    "setpoint": ("reference_displacement", ""), "目標圧力": ("command_pressure", ""),
    # references of pressures
    "pressure_barg": ("pressure", "barg"), "Pressure (bar(g))": ("pressure", "bar(g)"),
    "p [psia]": ("pressure", "psia"), "pressure kPa abs": ("pressure", "kPa abs"),
    "Druck kPaA": ("pressure", "kPaA"), "pressure_bar_abs": ("pressure", "bar_abs"),
    "p_abs [bar]": ("pressure", "bar abs"), "gauge pressure (kPa)": ("pressure", "kPa gauge"),
    "absolute pressure [barg]": ("absolute_pressure", "barg"), "p_abs": ("p_abs", ""),
    # units of several parts
    "velocity_mm_s": ("velocity", "mm_s"), "velocity/(mm/s)": ("velocity", "mm/s"),
    "speed_in/s": ("velocity", "in/s"), "velocity_m·s^-1": ("velocity", "m·s^-1"),
    "flow_l/min": ("flow", "l/min"), "flow_Nl/min": ("flow_nl_min", ""),
    "flow_l_min": ("flow_l_min", ""), "q_deg/s": ("q", "deg/s"), "q_deg_s": ("q", "deg_s"),
    "rate_1/s": ("rate_1_s", ""), "rate_bar/s": ("rate", "bar/s"), "torque_N*m": ("torque", "N*m"),
    "torque_N_m": ("torque", "N_m"), "k_N/mm": ("k", "N/mm"),
    "gain_mm_per_bar": ("gain_mm_per_bar", ""), "pressure_N/mm^2": ("pressure", "N/mm^2"),
    "p_kgf/cm2": ("pressure", "kgf/cm2"),
    # names that end like units, and units that do not suit
    "muscle_l/mm": ("muscle_l", "mm"), "muscle_l_mm": ("muscle_l", "mm"),
    "pressure_1/bar": ("pressure_1", "bar"), "pressure_in/bar": ("pressure_in", "bar"),
    "pressure_in": ("pressure_in", ""), "pressure_A": ("pressure_a", ""),
    "pressure_mm": ("pressure", "mm"), "pressure [foo]": ("pressure", "foo"),
    "displacement_nm": ("displacement", "nm"), "DISPLACEMENT_NM": ("displacement", "NM"),
    "displacement_amp": ("displacement", "amp"), "pressure_counts": ("pressure", "counts"),
    "loop_count": ("loop_count", ""), "force_kg": ("force", "kg"),
    "pressure_mmHg": ("pressure", "mmHg"), "contraction_%": ("contraction", "%"),
    "contraction [1]": ("contraction", "1"), "contraction (mm)": ("displacement", "mm"),
    # numbers of several alike, and what is about a channel
    "p1": ("pressure_1", ""), "P1 [bar]": ("pressure_1", "bar"),
    "pressure_2_bar": ("pressure_2", "bar"), "p0": ("pressure_0", ""),
    "current (1)": ("current_1", ""), "current [2]": ("current_2", ""),
    "pos (2) [mm]": ("displacement_2", "mm"), "pos [mm] (2)": ("displacement_2", "mm"),
    "target pos (1)": ("reference_displacement_1", ""),
    "p0 (extensor) [bar]": ("pressure_extensor", "bar"),
    "extensor_pressure_kPa": ("pressure_extensor", "kPa"),
    "p_flex [bar]": ("pressure_flexor", "bar"),
    "Druck Strecker [bar]": ("pressure_extensor", "bar"),
    "屈筋圧力［MPa］": ("pressure_flexor", "MPa"),
    "pressure_model": ("pressure_model", ""), "pressure_variance": ("variance_of_pressure", ""),
}  # fmt: skip


def seen(folder: Path, *headers: str) -> list[tuple[str, str]]:
    """Return what channel and unit columns have, each the only one of a file but for a counter."""
    path, found = folder / "a.parquet", []
    for header in headers:
        pq.write_table(pa.table({header: range(12), "counter": range(12)}), path)
        first = columns_of(path)[0]
        found.append((first.channel, first.unit))
    return found


@pytest.mark.parametrize("header", FORMS)
def test_form(tmp_path: Path, header: str) -> None:
    assert seen(tmp_path, header) == [FORMS[header]]


def test_every_word_in_any_case_is_its_channel(tmp_path: Path) -> None:
    for word, channel in words_of(CHANNELS).items():
        forms = {word, word.upper(), word.capitalize(), word.replace("_", " ")}
        assert {found for found, _ in seen(tmp_path, *forms)} == {channel}


def test_no_word_has_two_meanings() -> None:
    words = [
        (word, meaning)
        for names in (CHANNELS, ROLES)
        for meaning, languages in names.items()
        for word in " ".join(languages.values()).split()
    ]
    assert len({word for word, _ in words}) == len(set(words))


@pytest.mark.parametrize("form", ["{} ({})", "{} [{}]", "{}/{}", "{} in {}"])
def test_every_spelling_of_a_unit_is_found_in_every_form(tmp_path: Path, form: str) -> None:
    texts = [
        text for known in (SPELLINGS, RARE) for units in known.values() for text in units.values()
    ]
    spellings = [spelling for spelling in " ".join(texts).split() if spelling != "1"]
    found = seen(tmp_path, *(form.format("some thing", spelling) for spelling in spellings))
    assert [unit for _, unit in found] == spellings  # but 1, the number of one of several alike


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.text(max_size=30))
def test_any_text_is_some_header(tmp_path: Path, text: str) -> None:
    assert seen(tmp_path, text)


@pytest.mark.parametrize("ending", ["mmH2O", "V", "kgcm2", "qux", "oz", "mba"])
def test_an_unknown_ending_is_asked_about(tmp_path: Path, ending: str) -> None:
    path = tmp_path / "run.csv"
    rows = [f"{k / 50},{2.5 + k % 7 / 3},{k % 9}" for k in range(100)]
    path.write_text("\n".join([f"time_s,pressure_{ending},displacement_mm", *rows]))
    error = refused(path, channels=["pressure"], columns={"pressure": f"pressure_{ending}"})
    assert error.channel == "pressure"
    assert "units[pressure]=" in error.remedy or "calibration" in error.remedy
