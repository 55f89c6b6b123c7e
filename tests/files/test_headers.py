"""Every form of header that people use."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mckibben.files.headers import channel_of, parse
from mckibben.files.names import CHANNELS, ROLES, words_of
from mckibben.files.units import RARE, SPELLINGS

FORMS = {
    "pressure_bar": ("pressure", "bar"), "Pressure (kPa)": ("pressure", "kPa"),
    "p [MPa]": ("pressure", "MPa"), "length/mm": ("length", "mm"), "force N": ("force", "N"),
    "t (ms)": ("time", "ms"), "Timestamp": ("time", None), "valve_voltage_V": ("voltage", "V"),
    "u": ("voltage", None), "y1_cm": ("y1", "cm"), "PRESSURE_BAR": ("pressure", "BAR"),
    "Weg [mm]": ("displacement", "mm"), "Länge in cm": ("length", "cm"),
    "load (N)": ("force", "N"), "load [kg]": ("load", "kg"), "input_V": ("input", "V"),
    "angle (°)": ("angle", "°"), "temperature_C": ("temperature", "C"), "x": ("x", None),
    "TipPosition": ("tip_position", None), "f [Hz]": ("f", "Hz"),
    "position (V)": ("position", "V"),
    # languages
    "圧力 (kPa)": ("pressure", "kPa"), "圧力２（ｋＰａ）": ("pressure_2", "kPa"),
    "变形量/mm": ("displacement", "mm"), "变位（ｍｍ）": ("变位", "mm"),
    "時間[秒]": ("time", "秒"), "目標変位 (mm)": ("reference_displacement", "mm"),
    "设定压力": ("command_pressure", None), "힘 (N)": ("force", "N"),
    "pression [bar]": ("pressure", "bar"), "forza N": ("force", "N"),
    "spostamento_mm": ("displacement", "mm"), "tiempo (s)": ("time", "s"),
    "posição_cm": ("displacement", "cm"), "consigne pression (bar)": ("command_pressure", "bar"),
    "ref_mm": ("reference_displacement", "mm"), "p_cmd_kPa": ("command_pressure", "kPa"),
    "setpoint": ("reference_displacement", None), "目標圧力": ("command_pressure", None),
    # references of pressures
    "pressure_barg": ("pressure", "barg"), "Pressure (bar(g))": ("pressure", "bar(g)"),
    "p [psia]": ("pressure", "psia"), "pressure kPa abs": ("pressure", "kPa abs"),
    "Druck kPaA": ("pressure", "kPaA"), "pressure_bar_abs": ("pressure", "bar_abs"),
    "p_abs [bar]": ("pressure", "bar abs"), "gauge pressure (kPa)": ("pressure", "kPa gauge"),
    "absolute pressure [barg]": ("absolute_pressure", "barg"), "p_abs": ("p_abs", None),
    # units of several parts
    "velocity_mm_s": ("velocity", "mm_s"), "velocity/(mm/s)": ("velocity", "mm/s"),
    "speed_in/s": ("velocity", "in/s"), "velocity_m·s^-1": ("velocity", "m·s^-1"),
    "flow_l/min": ("flow", "l/min"), "flow_Nl/min": ("flow_nl_min", None),
    "flow_l_min": ("flow_l_min", None), "q_deg/s": ("q", "deg/s"), "q_deg_s": ("q", "deg_s"),
    "rate_1/s": ("rate_1_s", None), "rate_bar/s": ("rate", "bar/s"),
    "torque_N*m": ("torque", "N*m"), "torque_N_m": ("torque", "N_m"),
    "Drehmoment [mN·m]": ("torque", "mN·m"), "k_N/mm": ("k", "N/mm"),
    "gain_mm_per_bar": ("gain_mm_per_bar", None), "pressure_N/mm^2": ("pressure", "N/mm^2"),
    "p_kgf/cm2": ("pressure", "kgf/cm2"),
    # names that end like units, and units that do not suit
    "muscle_l/mm": ("muscle_l", "mm"), "muscle_l_mm": ("muscle_l", "mm"),
    "rise_time/ms": ("rise_time", "ms"), "pressure_1/bar": ("pressure_1", "bar"),
    "pressure_in/bar": ("pressure_in", "bar"), "pressure_in": ("pressure_in", None),
    "pressure_A": ("pressure_a", None), "pressure_mm": ("pressure", "mm"),
    "pressure [foo]": ("pressure", "foo"), "displacement_nm": ("displacement", "nm"),
    "DISPLACEMENT_NM": ("displacement", "NM"), "displacement_amp": ("displacement", "amp"),
    "pressure_counts": ("pressure", "counts"), "loop_count": ("loop_count", None),
    "force_kg": ("force", "kg"), "pressure_mmHg": ("pressure", "mmHg"),
    "contraction_%": ("contraction", "%"), "contraction [1]": ("contraction", "1"),
    "contraction (mm)": ("displacement", "mm"),
    # numbers of several alike, and what is about a channel
    "p1": ("pressure_1", None), "P1 [bar]": ("pressure_1", "bar"),
    "pressure_2_bar": ("pressure_2", "bar"), "p0": ("pressure_0", None),
    "current (1)": ("current_1", None), "current [2]": ("current_2", None),
    "pos (2) [mm]": ("displacement_2", "mm"), "pos [mm] (2)": ("displacement_2", "mm"),
    "target pos (1)": ("reference_displacement_1", None),
    "p0 (extensor) [bar]": ("pressure_extensor", "bar"),
    "extensor_pressure_kPa": ("pressure_extensor", "kPa"),
    "pressure_model": ("pressure_model", None),
    "pressure_variance": ("variance_of_pressure", None),
}  # fmt: skip


@pytest.mark.parametrize("text", FORMS)
def test_form(text: str) -> None:
    header = parse(text)
    assert (channel_of(header), header.unit) == FORMS[text]


def test_every_word_in_any_case_is_its_channel() -> None:
    for word, channel in words_of(CHANNELS).items():
        for text in (word, word.upper(), word.capitalize(), word.replace("_", " ")):
            assert channel_of(parse(text)) == channel


def test_no_word_has_two_meanings() -> None:
    words = [
        (word, meaning)
        for table in (CHANNELS, ROLES)
        for meaning, languages in table.items()
        for word in " ".join(languages.values()).split()
    ]
    assert len({word for word, _ in words}) == len(set(words))


@pytest.mark.parametrize("form", ["{} ({})", "{} [{}]", "{}/{}", "{} in {}"])
@pytest.mark.parametrize("table", [SPELLINGS, RARE])
def test_every_spelling_of_a_unit_is_found_in_every_form(
    form: str, table: dict[str, dict[str, str]]
) -> None:
    for spelling in " ".join(" ".join(units.values()) for units in table.values()).split():
        if spelling != "1":  # which is the number of one of several alike, in brackets
            header = parse(form.format("some thing", spelling))
            assert (header.name, header.unit) == ("some thing", spelling)


@given(st.text(max_size=30))
def test_any_text_is_some_header(text: str) -> None:
    assert isinstance(channel_of(parse(text)), str)
