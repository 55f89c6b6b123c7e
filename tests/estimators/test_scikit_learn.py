"""Estimators under scikit-learn: its checks, searches, scorers and pipelines."""

from __future__ import annotations

import os
import subprocess
import sys
from functools import partialmethod
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from sklearn.metrics import get_scorer, r2_score
from sklearn.model_selection import (
    GridSearchCV,
    KFold,
    cross_val_predict,
    cross_val_score,
    cross_validate,
    permutation_test_score,
)
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler
from sklearn.utils.estimator_checks import check_estimator

from mckibben import DataError, PIEstimator, Recording
from mckibben.arrays import Array
from mckibben.estimators.core.arguments import Outputs
from mckibben.estimators.coupled.play_ridge import PlayRidgeEstimator
from mckibben.registry import load
from tests.estimators.examples import CASES, KINDS, quick, recorded
from tests.estimators.examples import few_steps as few_steps  # a fixture
from tests.refusals import refused

# -- its checks ------------------------------------------------------------------------------------

SEQUENCE = "an output depends on the samples before it, and one sample is no sequence"
COLUMN = "a model of one input takes it as an array of shape (n,), too"
OUTPUT = "an output of shape (n, 1) is what it is, and nothing is converted"
SECOND = "the check takes the second column of its array, which has one"
INDEXES = "the check indexes the columns of its array, which it made one-dimensional"
UNSTABLE = "an output that alternates has an unstable model, which is refused"
ANY_NUMBER = "the number of inputs is that of the columns: one of shape (n,)"
WORDS = "an array of fewer columns than inputs is refused, in the words of another check"

OF_SEQUENCES = {"check_methods_subset_invariance": SEQUENCE}
WITH_MEMORY = OF_SEQUENCES | {"check_methods_sample_order_invariance": SEQUENCE}
OF_ONE_INPUT = {
    "check_fit1d": COLUMN,
    "check_fit2d_predict1d": COLUMN,
    "check_supervised_y_2d": OUTPUT,
}
OF_ONE_COLUMN = WITH_MEMORY | OF_ONE_INPUT | {"check_n_features_in_after_fitting": SECOND}

REFUSED: dict[str, dict[str, str]] = {
    **dict.fromkeys(("gpi", "kp", "maxwell-slip", "preisach"), OF_ONE_COLUMN),
    "arx": OF_ONE_COLUMN | {"check_estimators_dtypes": UNSTABLE},
    "force-bilinear": OF_SEQUENCES
    | {"check_supervised_y_2d": OUTPUT, "check_fit2d_1feature": WORDS},
}
"""Checks that estimators are not to pass on as many columns as they have inputs, and why."""


def check(estimator: Any, expected: dict[str, str]) -> list[dict[str, Any]]:
    """Return the results of the checks; those expected to fail do."""
    found = check_estimator(estimator, expected_failed_checks=expected, on_skip=None)
    assert {one["check_name"] for one in found if one["status"] == "xfail"} == set(expected)
    assert len(found) > 50
    return list(found)


@pytest.mark.parametrize(
    "name",
    [name if name == "gpi" else pytest.param(name, marks=pytest.mark.long) for name in REFUSED],
)
@pytest.mark.filterwarnings("ignore")
def test_checks_of_scikit_learn_hold_on_its_inputs(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def own(estimator: Any, X: Any, *_: Any, **__: Any) -> Any:
        return X[:, : 1 + len(estimator.input_settings)]

    monkeypatch.setattr("sklearn.utils.estimator_checks._enforce_estimator_tags_X", own)
    made = load("estimators", name)
    if made.needs_time:  # which the checks do not have
        monkeypatch.setattr(made, "fit", partialmethod(made.fit, sample_time=0.1))
    check(quick(name), REFUSED[name])


@pytest.mark.filterwarnings("ignore")
def test_checks_of_scikit_learn_hold_on_any_number_of_inputs(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # the checks have 20 samples at most
    monkeypatch.setattr("mckibben.estimators.coupled.base.FEWEST_IN_A_ROW", 2)
    check(
        PlayRidgeEstimator(thresholds=(0.1,), degree=1), WITH_MEMORY | {"check_fit1d": ANY_NUMBER}
    )


@pytest.mark.filterwarnings("ignore")
def test_of_one_input_the_other_failures_are_in_the_checks_themselves() -> None:
    """Their authors index columns where the tag says that an array has none."""
    theirs = dict.fromkeys(
        (
            "check_dict_unchanged",
            "check_dont_overwrite_parameters",
            "check_dtype_object",
            "check_estimator_sparse_array",
            "check_f_contiguous_array_estimator",
            "check_fit2d_1feature",
            "check_fit2d_1sample",
            "check_fit2d_predict1d",
            "check_methods_sample_order_invariance",
            "check_methods_subset_invariance",
            "check_n_features_in",
            "check_n_features_in_after_fitting",
            "check_regressors_no_decision_function",
        ),
        INDEXES,
    )
    ours = {"check_fit1d": COLUMN, "check_supervised_y_2d": OUTPUT}
    for one in check(quick("gpi"), theirs | ours):
        if one["check_name"] in theirs:
            assert isinstance(one["exception"], IndexError | ValueError)
            assert "mckibben" not in files_of(one["exception"])


def files_of(error: BaseException) -> str:
    """Return the files of the functions that an error went through, this one's left out."""
    found, trace = [], error.__traceback__
    while trace is not None:
        found.append(trace.tb_frame.f_code.co_filename)
        trace = trace.tb_next
    return " ".join(found)


# -- recordings, of one estimator of each kind -----------------------------------------------------

FIRST = {kind: name for name, kind in reversed(CASES)}
ONE_OF_EACH = pytest.mark.parametrize(
    ("name", "kind"), [(name, kind) for kind, name in FIRST.items()]
)
SCORERS = ("r2", "neg_root_mean_squared_error", "neg_mean_absolute_error", "explained_variance")


@ONE_OF_EACH
def test_scikit_learn_validates_searches_and_scores(name: str, kind: str) -> None:
    runs, estimator = list(recorded(kind)), quick(name, kind)
    first = np.arange(len(runs)) < len(runs) // 2
    fold = [(np.flatnonzero(~first), np.flatnonzero(first))]
    measured = estimator.measured(runs)
    known = {"cv": fold, "error_score": "raise"}
    (plain,) = cross_val_score(estimator, runs, **known)
    search = GridSearchCV(estimator, {"seed": [0]}, scoring=SCORERS, refit=False, **known)
    found = search.fit(runs, measured).cv_results_
    assert found["mean_test_r2"] == pytest.approx([plain])
    assert cross_val_score(estimator, runs, measured, **known) == pytest.approx([plain])

    fitted = estimator.fit([run for run, left in zip(runs, first, strict=True) if not left])
    left = [run for run, left in zip(runs, first, strict=True) if left]
    y, predicted = (np.concatenate(f(left)) for f in (fitted.measured, fitted.predict))
    np.testing.assert_array_equal(
        y.reshape(len(y), -1), np.concatenate([run.matrix(KINDS[kind].outputs) for run in left])
    )
    for scorer in SCORERS:
        score = get_scorer(scorer)
        expected = score._sign * score._score_func(y, predicted)
        assert found[f"mean_test_{scorer}"] == pytest.approx([expected])


U = 2.5 + 2.5 * np.sin(np.arange(1500) / 20) * np.linspace(1.0, 0.3, 1500)
Y = 3.0 * U + np.roll(U, 5)


def run(start: int, stop: int) -> Recording:
    return Recording({"pressure": U[start:stop], "displacement": Y[start:stop]}, 0.07)


RUNS = [run(0, 400), run(400, 700), run(700, 1200), run(1200, 1500)]
PI = PIEstimator(n_operators=3)
TWO = ("pressure_1", "pressure_2")


def test_predictions_of_folds_are_in_the_order_of_the_recordings() -> None:
    fold = KFold(2, shuffle=True, random_state=0)
    found = cross_val_predict(PI, RUNS, cv=fold)
    assert [part.shape for part in found] == [(len(run),) for run in RUNS]
    for train, test in fold.split(RUNS):
        fitted = PI.fit([RUNS[place] for place in train])
        for place in test:
            np.testing.assert_array_equal(found[place], fitted.predict(RUNS[place]))


def test_pipelines_take_recordings_and_arrays() -> None:
    cut = FunctionTransformer(lambda runs: [run.slice(0, 250) for run in runs])
    grid = {"piestimator__n_operators": [2, 3]}
    search = GridSearchCV(make_pipeline(cut, PIEstimator()), grid, cv=2, error_score="raise")
    search.fit(RUNS)
    short = [run.slice(0, 250) for run in RUNS]
    (expected,) = (
        GridSearchCV(PIEstimator(), {"n_operators": [3]}, cv=2)
        .fit(short)
        .cv_results_["mean_test_score"]
    )
    assert search.cv_results_["mean_test_score"][1] == pytest.approx(expected)
    scaled = make_pipeline(StandardScaler(), PIEstimator()).fit(U[:, None], Y)
    assert scaled.predict(U[:, None]).shape == Y.shape
    assert scaled.score(U[:, None], Y) > 0.99


def test_outputs_given_take_the_place_of_those_recorded() -> None:
    other = [2.0 * run["displacement"] for run in RUNS]
    changed = [run.with_channels(displacement=y) for run, y in zip(RUNS, other, strict=True)]
    model = PI.fit(changed).model_
    assert PI.fit(RUNS, other).model_ == model
    assert PI.fit(RUNS[0], other[0]).model_ == PI.fit(changed[0]).model_
    assert PI.fit(changed).score(RUNS, other) > 0.99
    for wrong in (other[:2], [y[:-1] for y in other]):
        with pytest.raises(DataError):
            PI.fit(RUNS, wrong)
    *_, p = permutation_test_score(
        PI, short := RUNS[1::2], PI.measured(short), cv=2, n_permutations=9
    )
    assert p > 0


def test_outputs_are_one_array_and_a_sequence() -> None:
    arrays: tuple[Array, ...] = tuple(np.linspace(0.0, 1.0, n) for n in (3, 5, 2))
    found = Outputs(arrays)
    assert (len(found), found.shape) == (3, (3,))
    assert found[-1] is arrays[-1]
    assert [len(part) for part in found] == [3, 5, 2]
    for selected in (found[1:], found[[1, 2]], found[np.array([False, True, True]), ...]):
        assert isinstance(selected, Outputs)
        assert [len(part) for part in selected] == [5, 2]
    whole = np.concatenate(arrays)
    np.testing.assert_array_equal(np.asarray(found), whole)
    np.testing.assert_array_equal(np.concatenate(found), whole)
    assert np.mean(found) == whole.mean()
    joined: Any = np.concatenate([found[1:], found[:1]])
    assert [len(part) for part in joined] == [5, 2, 3]
    with pytest.raises(TypeError):
        np.vstack([found, found])


# -- arrays and frames -----------------------------------------------------------------------------


@pytest.mark.parametrize("scoring", [*SCORERS, "neg_max_error"])
def test_arrays_are_scored_by_name(scoring: str) -> None:
    estimator, fold = quick("rdpi"), KFold(3)
    found = cross_validate(
        estimator,
        U[:, None],
        Y,
        cv=fold,
        scoring=scoring,
        params={"sample_time": 0.07},
        error_score="raise",
    )["test_score"]
    train, test = next(fold.split(U))
    fitted = estimator.fit(U[train], Y[train], sample_time=0.07)
    assert found[0] == get_scorer(scoring)(fitted, U[test], Y[test])
    at_rest = fitted.model_.simulate(U[test], sample_time=0.07)
    np.testing.assert_array_equal(fitted.predict(U[test, None]), at_rest)
    assert fitted.n_features_in_ == 1


def test_columns_are_the_inputs_and_outputs() -> None:
    X = np.column_stack([U, np.roll(U, 40)])
    both = np.column_stack([Y, Y + X[:, 1]])
    estimator = PlayRidgeEstimator()
    for y in (Y, both):
        fitted = estimator.fit(X, y, sample_time=0.07)
        assert fitted.predict(X).shape == y.shape
        assert fitted.n_features_in_ == 2
        assert r2_score(y, fitted.predict(X)) > 0.9
    for wrong in (X[:, 0], X[:, :1], np.hstack([X, X]), X[np.newaxis]):
        for use in (estimator.predict, lambda wrong: estimator.score(wrong, both)):
            with pytest.raises(DataError):
                use(wrong)
    wrongly: Any = ((X, Y), (U, both), (X[np.newaxis], Y), (U, Y[:-1]), (U[:0], Y[:0]), (U, None))
    for pair in wrongly:
        with pytest.raises(DataError):
            PIEstimator().fit(*pair)


def test_columns_of_frames_are_found_by_their_names() -> None:
    X = np.column_stack([U, np.roll(U, 40)])
    frame = pd.DataFrame(X, columns=list(TWO)).assign(other=1.0, time=0.07 * np.arange(len(U)))
    estimator = PlayRidgeEstimator(input=TWO, output=("displacement",))
    expected = estimator.fit(X, Y, sample_time=0.07).model_
    swapped = frame[["time", "other", *reversed(TWO)]]
    assert estimator.fit(swapped, Y).model_ == expected
    assert estimator.fit(swapped, pd.DataFrame({"other": U, "displacement": Y})).model_ == expected
    untimed = swapped.drop(columns="time")
    assert estimator.fit(untimed, Y, sample_time=0.07).model_ == expected
    np.testing.assert_array_equal(estimator.predict(untimed), estimator.predict(X))
    assert estimator.score(untimed, Y) == estimator.score(swapped, Y) == estimator.score(X, Y)
    np.testing.assert_array_equal(
        estimator.predict(swapped), estimator.predict(X, sample_time=0.07)
    )
    assert estimator.fit(pd.DataFrame(X), pd.Series(Y), sample_time=0.07).model_ == expected
    for wrong in (frame.drop(columns=TWO[0]), frame.rename(columns={TWO[0]: "pressure_9"})):
        with refused(DataError, channel=TWO[0]):
            estimator.fit(wrong, Y)
    with refused(DataError, parameter="sample_time"):
        estimator.fit(frame, Y, sample_time=0.1)


@pytest.mark.parametrize(
    "bad",
    [
        np.where(np.arange(U.size) == 7, np.nan, U),
        np.ma.MaskedArray(U, mask=np.arange(U.size) == 7),  # type: ignore[no-untyped-call]
        U + 0j,
        pd.to_datetime(U, unit="s"),
        np.array(["a"] * U.size),
    ],
)
def test_arrays_that_are_no_numbers_are_refused(bad: Any) -> None:
    with pytest.raises(ValueError):
        PIEstimator().fit(bad, Y)
    with pytest.raises(ValueError):
        PIEstimator().fit(U, bad)
    with pytest.raises(ValueError):
        PIEstimator().fit(U, Y).predict(bad)


def test_arrays_need_no_scikit_learn(tmp_path: Path) -> None:
    code = """
import sys
import numpy as np
from mckibben import PIEstimator
sys.modules["sklearn"] = None
u = np.sin(np.arange(300) / 20)
estimator = PIEstimator(n_operators=2)
try:
    estimator.predict(u)
except AttributeError:
    print(estimator.fit(u, 2 * u).predict(u).shape)
"""
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, env=os.environ, capture_output=True, text=True
    )
    assert done.stdout == "(300,)\n", done.stderr
