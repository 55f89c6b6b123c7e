from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mckibben.errors import DataError
from mckibben.report import printed, subjects
from mckibben.report.drawing import Curve, Drawing, Panel
from tests.report.studies_by_hand import measured

SIGNATURES = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}


def drawing(name: str = "a") -> Drawing:
    x = np.linspace(0, 1, 20)
    return Drawing((Panel(name, name, (Curve(x, x**2, name, "series-1"),), name),))


@pytest.mark.parametrize("kind", list(SIGNATURES))
def test_every_format_is_written_alike_twice(tmp_path: Path, kind: str) -> None:
    first, second = tmp_path / f"first.{kind}", tmp_path / f"second.{kind}"
    for path in (first, second):
        printed.save(drawing(), path)
    assert first.read_bytes() == second.read_bytes()
    assert first.read_bytes().startswith(SIGNATURES[kind])


@pytest.mark.parametrize("name", ["$x^", "_hidden", "a\nb", "<b>&", r"\frac", "{}", "%s"])
def test_names_are_drawn_as_they_are(tmp_path: Path, name: str) -> None:
    printed.save(drawing(name), tmp_path / "figure.svg")
    figure = printed.drawn(drawing(name))
    legend = figure.axes[0].get_legend()
    assert legend is not None
    assert [entry.get_text().strip() for entry in legend.get_texts()] == [name.replace("\n", " ")]


def test_resolution_and_width_are_those_of_print(tmp_path: Path) -> None:
    from PIL import Image

    printed.save(drawing(), tmp_path / "figure.png")
    with Image.open(tmp_path / "figure.png") as image:
        assert image.width == round(printed.COLUMN * printed.RESOLUTION)


@pytest.mark.parametrize("name", ["figure.jpg", "figure", "figure.png.txt"])
def test_other_formats_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(DataError, match=r"Remedy: name it \.png, \.svg or \.pdf"):
        printed.save(drawing(), tmp_path / name)


def test_an_absent_folder_is_named(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="folder does not exist"):
        printed.save(drawing(), tmp_path / "nowhere" / "figure.png")


def test_a_failure_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "figure.png"
    path.write_bytes(b"before")
    monkeypatch.setattr(printed, "drawn", lambda _: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        printed.save(drawing(), path)
    assert path.read_bytes() == b"before"
    assert list(tmp_path.iterdir()) == [path]


def test_no_global_state_is_left(tmp_path: Path) -> None:
    from matplotlib import rcParams

    before = dict(rcParams)
    printed.save(drawing(), tmp_path / "figure.png")
    assert dict(rcParams) == before


def test_every_colour_is_defined_for_print() -> None:
    recordings = [measured(50, seed=k, name=f"run {k}") for k in range(6)]
    used = {"measured", "input"}
    for some in (recordings, recordings[:1]):
        for panel in subjects.loop(some, "pressure", "displacement").panels:
            used |= {curve.colour for curve in panel.curves}
    assert used == set(printed.COLOURS)
