"""Every form of header that people use."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mckibben.files.headers import ALIASES, channel_of, parse
from mckibben.files.units import SPELLINGS

FORMS = {
    "pressure_bar": ("pressure", "bar"),
    "Pressure (kPa)": ("pressure", "kPa"),
    "p [MPa]": ("pressure", "MPa"),
    "length/mm": ("length", "mm"),
    "force N": ("force", "N"),
    "time_s": ("time", "s"),
    "t (ms)": ("time", "ms"),
    "Timestamp": ("time", None),
    "valve_voltage_V": ("voltage", "V"),
    "u": ("voltage", None),
    "y1_cm": ("y1", "cm"),
    "PRESSURE_BAR": ("pressure", "BAR"),
    "pressure_barg": ("pressure", "barg"),
    "Pressure (bar(g))": ("pressure", "bar(g)"),
    "p [psia]": ("pressure", "psia"),
    "position_mm": ("displacement", "mm"),
    "Weg [mm]": ("displacement", "mm"),
    "Länge in cm": ("length", "cm"),
    "Kraft in N": ("force", "N"),
    "load (N)": ("force", "N"),
    "load [kg]": ("load", "kg"),
    "input_V": ("input", "V"),
    "angle (°)": ("angle", "°"),
    "temperature_C": ("temperature", "C"),
    "velocity_mm_s": ("velocity", "mm_s"),
    "velocity/(mm/s)": ("velocity", "mm/s"),
    "speed_in/s": ("velocity", "in/s"),
    "flow_l/min": ("flow", "l/min"),
    "flow_Nl/min": ("flow_nl_min", None),
    "flow_l_min": ("flow_l_min", None),
    "q_deg/s": ("q", "deg/s"),
    "q_deg_s": ("q_deg_s", None),
    "rate_1/s": ("rate_1_s", None),
    "rate_bar/s": ("rate", "bar/s"),
    "velocity_m·s^-1": ("velocity", "m·s^-1"),
    "torque_N*m": ("torque", "N*m"),
    "torque_N_m": ("torque_n_m", None),
    "k_N/mm": ("k", "N/mm"),
    "gain_mm_per_bar": ("gain_mm_per_bar", None),
    "pressure_N/mm^2": ("pressure", "N/mm^2"),
    "muscle_l/mm": ("muscle_l", "mm"),
    "muscle_l_mm": ("muscle_l", "mm"),
    "rise_time/ms": ("rise_time", "ms"),
    "pressure_1/bar": ("pressure_1", "bar"),
    "pressure_in/bar": ("pressure_in", "bar"),
    "contraction_%": ("contraction", "%"),
    "contraction": ("contraction", None),
    "contraction (mm)": ("displacement", "mm"),
    "p1": ("pressure_1", None),
    "P1 [bar]": ("pressure_1", "bar"),
    "pressure_1": ("pressure_1", None),
    "pressure_2_bar": ("pressure_2", "bar"),
    "p0": ("pressure_0", None),
    "p0 (extensor) [bar]": ("pressure_extensor", "bar"),
    "extensor_pressure_kPa": ("pressure_extensor", "kPa"),
    "pressure_model": ("pressure_model", None),
    "pressure_in": ("pressure_in", None),
    "pressure_A": ("pressure_a", None),
    "pressure_mm": ("pressure", "mm"),
    "pressure [foo]": ("pressure", "foo"),
    "f [Hz]": ("f", "Hz"),
    "position (V)": ("position", "V"),
    "x": ("x", None),
    "TipPosition": ("tip_position", None),
}


@pytest.mark.parametrize("text", FORMS)
def test_form(text: str) -> None:
    header = parse(text)
    assert (channel_of(header), header.unit) == FORMS[text]


@pytest.mark.parametrize("channel", ALIASES)
def test_every_alias_in_any_case_is_its_channel(channel: str) -> None:
    for alias in ALIASES[channel].split():
        for text in (alias, alias.upper(), alias.capitalize(), alias.replace("_", " ")):
            assert channel_of(parse(text)) == channel


@pytest.mark.parametrize("form", ["{} ({})", "{} [{}]", "{}/{}", "{} in {}"])
@pytest.mark.parametrize("unit", SPELLINGS)
def test_every_spelling_of_a_unit_is_found_in_every_form(form: str, unit: str) -> None:
    for spellings in SPELLINGS[unit].values():
        for spelling in filter(None, spellings.split(" ")):
            header = parse(form.format("some thing", spelling))
            assert (header.name, header.unit) == ("some thing", spelling)


@given(st.text(max_size=30))
def test_any_text_is_some_header(text: str) -> None:
    header = parse(text)
    assert isinstance(channel_of(header), str)
