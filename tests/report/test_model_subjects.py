from __future__ import annotations

import numpy as np
import pytest

from mckibben.blocks.compose import Parallel, Series
from mckibben.blocks.core.block import Block
from mckibben.blocks.laws.examples import examples
from mckibben.blocks.memoryless.piecewise_linear import PiecewiseLinear
from mckibben.blocks.play_type.gpi import GPI
from mckibben.blocks.play_type.pi import PI
from mckibben.blocks.play_type.play import Play
from mckibben.blocks.play_type.rate_dependent_pi import RateDependentPI
from mckibben.errors import ModelError
from mckibben.report import interactive, model_subjects
from tests.report.studies_by_hand import models, study

LINE = Play.example()


def test_only_models_that_worked_are_ranked() -> None:
    (panel,) = model_subjects.leaderboard(study().leaderboard).panels
    assert panel.categories == tuple(models())
    tested = panel.curves[-1]
    assert tested.interval is not None
    assert np.all(tested.interval[0] < tested.x)
    assert np.all(tested.x < tested.interval[1])


def test_nothing_to_rank_is_said() -> None:
    with pytest.raises(ModelError, match="no model worked"):
        model_subjects.leaderboard(study(blocks={}).leaderboard)


def test_sums_of_operators_are_found_however_nested() -> None:
    pi, gpi = PI.example(), GPI.example()
    nested = Series((Parallel((pi, LINE)), PiecewiseLinear.example()))
    assert list(model_subjects.operator_sums(nested)) == [pi]
    assert list(model_subjects.operator_sums(gpi.inverse())) == [gpi]
    assert list(model_subjects.operator_sums(LINE)) == []


@pytest.mark.parametrize(("name", "block"), examples().items())
def test_any_model_is_drawn_or_refused(name: str, block: Block) -> None:
    if list(model_subjects.operator_sums(block)):
        interactive.plots(model_subjects.weights({name: block}))
    else:
        with pytest.raises(ModelError, match="Remedy"):
            model_subjects.weights({name: block})


def test_weights_stand_over_their_thresholds_with_their_units() -> None:
    drawing = model_subjects.weights(models())
    titles = [panel.title for panel in drawing.panels]
    assert titles == ["gpi", "mpi: pi", "rdpi", "rdpi, per rate", "pi"]
    gpi, mpi, _, rated, _ = drawing.panels
    assert gpi.x_label == "threshold on the envelopes"
    assert mpi.x_label == "threshold [bar]"
    np.testing.assert_array_equal(gpi.curves[0].y, GPI.example().weights)
    np.testing.assert_array_equal(rated.curves[0].y, RateDependentPI.example().rate_weights)


def test_more_weights_than_fit_are_counted() -> None:
    drawing = model_subjects.weights({f"model {k}": PI.example() for k in range(9)})
    assert len(drawing.panels) == 6
    assert drawing.note == "3 more are not shown."


def test_a_model_without_weights_is_refused_with_a_remedy() -> None:
    with pytest.raises(ModelError, match="Remedy"):
        model_subjects.weights({"play": LINE})


def test_the_inverse_check_shows_its_own_error() -> None:
    check = study().inverse
    assert check is not None
    following, error, given = model_subjects.inverse_check(check).panels
    assert following.y_label == "displacement [mm]"
    assert given.y_label == "pressure [bar]"
    np.testing.assert_array_equal(error.curves[0].y, check.output - check.reference)
