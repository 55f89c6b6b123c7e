"""Every form of header that people use."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mckibben.files.headers import ALIASES, channel_of, parse, snake_case
from mckibben.files.units import SPELLINGS

FORMS = {
    "pressure_bar": ("pressure", "bar"),
    "Pressure (kPa)": ("pressure", "kPa"),
    "p [MPa]": ("pressure", "MPa"),
    "length/mm": ("length", "mm"),
    "length / mm": ("length", "mm"),
    "force N": ("force", "N"),
    "force_n": ("force", "n"),
    "time_s": ("time", "s"),
    "t (ms)": ("time", "ms"),
    "elapsed_time_min": ("time", "min"),
    "Timestamp": ("time", None),
    "valve_voltage_V": ("voltage", "V"),
    "u": ("voltage", None),
    "u1_V": ("u1", "V"),
    "y1_cm": ("y1", "cm"),
    "pressure_psi": ("pressure", "psi"),
    "pressure_kpa": ("pressure", "kpa"),
    "PRESSURE_BAR": ("pressure", "BAR"),
    "pressure_barg": ("pressure", "barg"),
    "Pressure (bar(g))": ("pressure", "bar(g)"),
    "p [psia]": ("pressure", "psia"),
    "position_mm": ("displacement", "mm"),
    "disp µm": ("displacement", "µm"),
    "Weg [mm]": ("displacement", "mm"),
    "Länge in cm": ("length", "cm"),
    "Kraft in N": ("force", "N"),
    "Druck, bar": ("pressure", "bar"),
    "load (N)": ("force", "N"),
    "load [kg]": ("load", "kg"),
    "input_V": ("input", "V"),
    "output_deg": ("output", "deg"),
    "angle°": ("angle", "°"),
    "angle (°)": ("angle", "°"),
    "temperature_C": ("temperature", "C"),
    "Temp. °C": ("temperature", "°C"),
    "velocity_mm_s": ("velocity", "mm_s"),
    "speed mm/s": ("velocity", "mm/s"),
    "velocity/(mm/s)": ("velocity", "mm/s"),
    "velocity_m/s": ("velocity", "m/s"),
    "speed_in/s": ("velocity", "in/s"),
    "flow l/min": ("flow", "l/min"),
    "flow_l/min": ("flow", "l/min"),
    "flow-l/min": ("flow", "l/min"),
    "flow_Nl/min": ("flow_nl_min", None),
    "flow Nl/min": ("flow_nl_min", None),
    "flow_l_min": ("flow_l_min", None),
    "flow_l_s": ("flow_l_s", None),
    "q_deg/s": ("q", "deg/s"),
    "q_deg_s": ("q_deg_s", None),
    "q_deg_per_s": ("q_deg_per_s", None),
    "rate_1/s": ("rate_1_s", None),
    "rate_bar/s": ("rate", "bar/s"),
    "a_m/s^2": ("a", "m/s^2"),
    "velocity_m·s^-1": ("velocity", "m·s^-1"),
    "torque_N*m": ("torque", "N*m"),
    "torque_N_m": ("torque_n_m", None),
    "torque N m": ("torque_n_m", None),
    "k_N/mm": ("k", "N/mm"),
    "gain_mm_per_bar": ("gain_mm_per_bar", None),
    "pressure_N/mm^2": ("pressure", "N/mm^2"),
    "muscle_l/mm": ("muscle_l", "mm"),
    "muscle_l_mm": ("muscle_l", "mm"),
    "muscle_F/N": ("muscle_f", "N"),
    "rise_time/ms": ("rise_time", "ms"),
    "pressure_1/bar": ("pressure_1", "bar"),
    "pressure_in/bar": ("pressure_in", "bar"),
    "pressure_in_bar": ("pressure_in", "bar"),
    "pressure_min/bar": ("pressure_min", "bar"),
    "tip_x/mm": ("tip_x", "mm"),
    "contraction_%": ("contraction", "%"),
    "contraction": ("contraction", None),
    "contraction (mm)": ("displacement", "mm"),
    "p1": ("pressure_1", None),
    "P1 [bar]": ("pressure_1", "bar"),
    "pressure1": ("pressure_1", None),
    "pressure_1": ("pressure_1", None),
    "pressure_2_bar": ("pressure_2", "bar"),
    "p0": ("pressure_0", None),
    "p0 (extensor) [bar]": ("pressure_extensor", "bar"),
    "extensor_pressure_kPa": ("pressure_extensor", "kPa"),
    "p_ext": ("pressure_extensor", None),
    "pressure_model": ("pressure_model", None),
    "displacement_model": ("displacement_model", None),
    "pressure_in": ("pressure_in", None),
    "pressure_min": ("pressure_min", None),
    "pressure_A": ("pressure_a", None),
    "pressure_mm": ("pressure", "mm"),
    "pressure [foo]": ("pressure", "foo"),
    "f [Hz]": ("f", "Hz"),
    "position (V)": ("position", "V"),
    "x": ("x", None),
    "y": ("y", None),
    "level": ("level", None),
    "TipPosition": ("tip_position", None),
    "valve pressure": ("valve_pressure", None),
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


@given(st.text(max_size=30))
def test_snake_case_is_idempotent(text: str) -> None:
    assert snake_case(snake_case(text)) == snake_case(text)
