"""Units against conversions done by hand."""

from pathlib import Path

import numpy as np
import pytest

import mckibben
from mckibben import DataError
from mckibben.files.units import SPELLINGS, Unit, convert, find

FACTORS = [
    ("kPa", "bar", 0.01),
    ("MPa", "bar", 10.0),
    ("Pa", "bar", 1e-5),
    ("mbar", "bar", 1e-3),
    ("psi", "bar", 0.0689475729),
    ("psig", "bar", 0.0689475729),
    ("atm", "bar", 1.01325),
    ("mmHg", "bar", 0.00133322387),
    ("m", "mm", 1e3),
    ("cm", "mm", 10.0),
    ("µm", "mm", 1e-3),
    ("μm", "mm", 1e-3),
    ("inch", "mm", 25.4),
    ("kN", "N", 1e3),
    ("KN", "N", 1e3),
    ("MN", "N", 1e6),
    ("mN", "N", 1e-3),
    ("Mm", "mm", 1e9),
    ("MM", "mm", 1.0),
    ("MBAR", "bar", 1e-3),
    ("mpa", "bar", 10.0),
    ("kgf", "N", 9.80665),
    ("lbf", "N", 4.4482216),
    ("ms", "s", 1e-3),
    ("min", "s", 60.0),
    ("h", "s", 3600.0),
    ("deg", "rad", np.pi / 180),
    ("°", "rad", np.pi / 180),
    ("rev", "rad", 2 * np.pi),
    ("mV", "V", 1e-3),
    ("m/s", "mm/s", 1e3),
    ("mm s^-1", "mm/s", 1.0),
    ("cm/min", "mm/s", 1 / 6),
    ("%", "", 0.01),
    ("mm/mm", "", 1.0),
    ("nm", "mm", 1e-6),
    ("㎜", "mm", 1.0),
    ("mil", "mm", 0.0254),
    ("km", "mm", 1e6),
    ("N/mm²", "bar", 10.0),
    ("kgf/cm2", "bar", 0.980665),
    ("Torr", "bar", 0.00133322368),
    ("inH2O", "bar", 0.00249088908),
    ("Nm", "N*m", 1.0),
    ("mN·m", "N*m", 1e-3),
    ("rpm", "rad/s", np.pi / 30),
    ("°/s", "rad/s", np.pi / 180),
    ("mA", "A", 1e-3),
    ("毫米", "mm", 1.0),
]


def known(text: str) -> Unit:
    unit = find(text)
    assert unit is not None
    return unit


@pytest.mark.parametrize(("text", "target", "factor"), FACTORS)
def test_factor(text: str, target: str, factor: float) -> None:
    unit = known(text)
    assert unit.target == target
    assert convert(np.array([1.0, -3.0]), unit.name, target) == pytest.approx([factor, -3 * factor])


def test_temperatures_have_an_offset() -> None:
    assert convert(np.array([300.0]), known("K").name, "degC") == pytest.approx([26.85])
    assert convert(np.array([212.0]), known("°F").name, "degC") == pytest.approx([100.0])


@pytest.mark.parametrize("target", SPELLINGS)
def test_what_is_in_the_units_of_the_package_is_not_touched(target: str) -> None:
    samples = np.array([0.1, 0.2])
    assert convert(samples, known(target).name, target) is samples


@pytest.mark.parametrize(
    ("text", "reference"),
    [
        ("barg", "gauge"),
        ("bara", "absolute"),
        ("bar abs", "absolute"),
        ("kPa(g)", "gauge"),
        ("kPaA", "absolute"),
        ("bar(a)", "absolute"),
        ("bar", None),
    ],
)
def test_reference_of_a_pressure(text: str, reference: str | None) -> None:
    assert known(text).reference == reference


@pytest.mark.parametrize(
    "text", ["foo", "NM", "9**9**9", "10^10^10", "__import__", "bar;", "a" * 1000, "(", "1e9"]
)
def test_what_is_no_unit(text: str) -> None:
    assert find(text) is None


@pytest.mark.parametrize("text", ["counts", "LSB", "px", "L/min", "J"])
def test_what_is_no_unit_of_a_channel(text: str) -> None:
    assert known(text).target is None


@pytest.mark.parametrize(
    ("header", "factor", "remedy"),
    [
        ("pressure (mPa)", 0.01, "--unit pressure=MPa"),
        ("pressure (bar)", 1e300, "--unit pressure="),
        ("pressure (kPa)", 1e300, "--unit pressure="),
        ("pressure (MPa)", 300.0, "--unit pressure="),
        ("pressure (bar)", 4.9e5, "--unit pressure=Pa"),
        ("displacement (mm)", 1e9, "--unit displacement="),
        ("displacement (km)", 1e3, "--unit displacement="),
        ("force (GN)", 1.0, "--unit force="),
        ("temperature (°C)", 1e6, "--unit temperature="),
        ("displacement_px", 1.0, "--unit displacement="),
        ("pressure_counts", 1.0, "--unit pressure="),
        ("FORCE_NM", 1.0, "--unit force="),
    ],
)
def test_units_that_cannot_be_stop(tmp_path: Path, header: str, factor: float, remedy: str) -> None:
    path = tmp_path / "run.csv"
    path.write_text(f"t_s;{header}\n" + "".join(f"{k};{factor * (1 + k / 7)}\n" for k in range(20)))
    with pytest.raises(DataError) as caught:
        mckibben.read(path)
    assert caught.value.channel == header.replace("_", " ").split()[0].lower()
    assert remedy in caught.value.remedy


@pytest.mark.parametrize(
    ("header", "cell"),
    [("pressure (mPa)", "0"), ("p [bar]", "1e-17"), ("p [Pa]", "2.5"), ("force (mN)", "1e-4")],
)
def test_nothing_rounding_and_small_values_are_read(tmp_path: Path, header: str, cell: str) -> None:
    path = tmp_path / "run.csv"
    path.write_text(f"t_s;{header}\n" + "".join(f"{k};{cell}\n" for k in range(20)))
    assert len(mckibben.read(path)[0]) == 20
