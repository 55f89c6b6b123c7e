"""Exporters refuse what the files could not hold, and leave nothing behind."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mckibben import Block, ModelError, ModelWarning, Series
from mckibben.exporting import export_c
from tests.export.building import SAMPLE_TIME
from tests.export.models import example
from tests.refusals import refused


def exported(block: Block, folder: Path, **settings: Any) -> Path:
    return export_c(block, folder, sample_time=SAMPLE_TIME, **settings)


@pytest.mark.parametrize("start", [(1000.0, 1.0), (0.0, 1.0), (1.5, 1.0), (-3.0, 1.0), (1.0, 0.5)])
def test_a_memory_that_points_outside_is_refused(
    start: tuple[float, float], tmp_path: Path
) -> None:
    block = replace(example("preisach"), initial=(*start, *[0.0] * 130))
    for one in (block, block.inverse()):
        with refused(
            ModelError,
            parameter="initial",
            names=int(start[0]) if start[0] == int(start[0]) else start[0],
        ):
            exported(one, tmp_path / "c")
    assert not (tmp_path / "c").exists()


def test_a_series_that_would_start_otherwise_is_refused(tmp_path: Path) -> None:
    lagging, last = example("process-model"), example("pi")
    with refused(ModelError, parameter="initial", names="'first_sample'"):
        exported(Series((replace(lagging, initial="virgin"), last)), tmp_path / "c")
    exported(Series((replace(lagging, initial="first_sample"), last)), tmp_path / "c")


def test_places_too_close_for_single_precision_are_refused(tmp_path: Path) -> None:
    block = type(example("piecewise-linear"))((0.0, 1.0, 1.0 + 1e-9, 2.0), (0.0, 1.0, 1.5, 2.0))
    with pytest.raises(ModelError):
        exported(block, tmp_path / "single", single=True)
    exported(block, tmp_path / "double")


def test_poles_too_slow_for_single_precision_are_a_warning(tmp_path: Path) -> None:
    poles = np.poly([0.999, 0.998])
    block = type(example("transfer-function"))(
        (0.0, float(poles.sum())), tuple(poles[1:].tolist()), SAMPLE_TIME
    )
    with pytest.warns(ModelWarning):
        exported(block, tmp_path / "single", single=True)
    exported(block, tmp_path / "double")
