from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mckibben.blocks.core.fields import Channel
from mckibben.blocks.coupled.coupling import Coupling
from mckibben.blocks.play_type.gpi import GPI
from mckibben.errors import DataError, ModelError
from mckibben.recording import Recording
from mckibben.report import printed
from mckibben.report.drawing import Drawing
from mckibben.report.figures import (
    FIGURES,
    MODEL_KINDS,
    RECORDING_KINDS,
    plot_model,
    plot_recording,
)
from tests.report.studies_by_hand import measured, study

CHANNELS = ("pressure", "displacement")
FORMATS = ("png", "svg", "pdf")


@pytest.mark.parametrize("name", list(FIGURES))
def test_every_figure_of_a_study_is_written_alike_twice(tmp_path: Path, name: str) -> None:
    paths = [tmp_path / f"{k}.svg" for k in range(2)]
    for path in paths:
        printed.save(FIGURES[name](study()), path)
    assert paths[0].read_bytes() == paths[1].read_bytes()


@pytest.mark.parametrize("ending", FORMATS)
@pytest.mark.parametrize("kind", RECORDING_KINDS)
def test_recordings_are_drawn_in_every_format(tmp_path: Path, kind: str, ending: str) -> None:
    recordings = [measured(200, sample_time=None), measured(100, sample_time=None, name="second")]
    path = tmp_path / f"figure.{ending}"
    plot_recording(recordings, *CHANNELS, kind, path)
    assert path.stat().st_size > 1000


@pytest.mark.parametrize("ending", FORMATS)
@pytest.mark.parametrize("kind", MODEL_KINDS)
def test_models_are_drawn_in_every_format(tmp_path: Path, kind: str, ending: str) -> None:
    path = tmp_path / f"figure.{ending}"
    plot_model(GPI.example(), [measured(200), measured(100, seed=1)], kind, path)
    assert path.stat().st_size > 1000


def test_many_recordings_are_named_where_they_are_not_drawn(tmp_path: Path) -> None:
    many = [measured(60, seed=k, name=f"run {k}") for k in range(8)]
    plot_model(GPI.example(), many, "fit", tmp_path / "figure.pdf")
    printed.save(FIGURES["loops"](study(tuple(many[:4]), tuple(many[4:]))), tmp_path / "loops.pdf")


def test_a_model_is_drawn_over_an_input_that_moves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[Drawing] = []
    monkeypatch.setattr(printed, "save", lambda drawing, path: drawn.append(drawing))
    wave = np.sin(np.arange(100) / 5)
    pressures = [(wave, 0 * wave), (0 * wave, wave), (wave, wave**2)]
    names = ("pressure_1", "pressure_2", "displacement")
    runs = [
        Recording(dict(zip(names, (one, two, one + 2 * two), strict=True)), 0.1)
        for one, two in pressures
    ]
    driven = (Channel("pressure_1", "bar"), Channel("pressure_2", "bar"))
    block = Coupling(((1.0,), (2.0,)), driven, (Channel("displacement", "mm"),))
    plot_model(block, runs, "loops", tmp_path / "figure.pdf")
    found = [panel.x_label.partition(" ")[0] for panel in drawn[0].panels]
    assert found == ["pressure_1", "pressure_2", "pressure_2"]


def test_unknown_kinds_list_the_known_ones(tmp_path: Path) -> None:
    path = tmp_path / "figure.png"
    with pytest.raises(ModelError, match="time, loop"):
        plot_recording([measured(50)], *CHANNELS, "pie", path)
    with pytest.raises(ModelError, match="fit, loops, residuals, weights"):
        plot_model(GPI.example(), [measured(50)], "time", path)
    assert not path.exists()


def test_absent_channels_are_named(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="force"):
        plot_recording([measured(50)], "pressure", "force", "time", tmp_path / "figure.png")


def test_a_study_without_inverse_says_so(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="no model of this study has an inverse"):
        printed.save(FIGURES["inverse"](study(inverse=False)), tmp_path / "figure.png")


@pytest.mark.parametrize("name", ["leaderboard", "fit", "loops", "residuals", "weights"])
def test_a_study_in_which_nothing_worked_draws_no_empty_figure(tmp_path: Path, name: str) -> None:
    with pytest.raises(ModelError, match="Remedy"):
        printed.save(FIGURES[name](study(blocks={})), tmp_path / "figure.png")
    assert list(tmp_path.iterdir()) == []
