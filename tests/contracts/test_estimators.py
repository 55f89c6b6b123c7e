"""What every estimator must do, whatever its inputs and outputs."""

from __future__ import annotations

import pickle
from contextlib import suppress
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.exceptions import NotFittedError

from mckibben import DataError, ModelError, Recording, registry
from mckibben import load as load_model
from mckibben.blocks.free_runs import FreeRuns
from tests.estimators.examples import CASES, KINDS, quick, recorded, resolved
from tests.estimators.examples import few_steps as few_steps  # a fixture
from tests.refusals import refused

pytestmark = [
    pytest.mark.parametrize(("name", "kind"), CASES),
    pytest.mark.filterwarnings("ignore::mckibben.errors.ModelWarning"),
]


STILL = {
    "activation-pressure": {"contractions 4", "contractions 8"},  # read off the input's extremes
    "balance-force": {"asymmetry"},  # at its bound
    "p2": {"time constants 2"},  # at its least, the sample time
    "p3": {"time constants 2", "time constants 3"},
}
"""Free numbers that do not move with the outputs of the example."""


@cache
def fitted(name: str, kind: str) -> Any:
    """Return an estimator fitted to what counts of its example, once for all that look at it."""
    return quick(name, kind).fit(recorded(kind), rows=counts(kind))


def counts(kind: str) -> list[np.ndarray]:
    """Return which samples count: all but a stretch of the last run."""
    found = [np.ones(len(run), dtype=bool) for run in recorded(kind)]
    found[-1][60:120] = False
    return found


def test_it_says_what_it_learns_from(name: str, kind: str) -> None:
    channels = resolved(kind)
    estimator_class = registry.load("estimators", name)
    settings = estimator_class.channel_settings(channels)
    assert estimator_class(**settings).get_params().items() >= settings.items()
    assert estimator_class.objection(recorded(kind), replace(channels, inputs=()))


def test_fit_repeats_and_leaves_settings_and_data_alone(name: str, kind: str) -> None:
    runs, first = recorded(kind), fitted(name, kind)
    before = [run.matrix(KINDS[kind].channels).copy() for run in runs]
    again = clone(first)
    settings = again.get_params()
    assert settings == first.get_params()
    assert again.fit(list(runs), rows=counts(kind)) is again
    assert again.get_params() == settings
    assert again.model_ == first.model_
    found, known = (
        vars(e.diagnostics_) | {"seconds": 0.0, "uncertainty": e.diagnostics_.covariance}
        for e in (again, first)
    )
    np.testing.assert_equal(found, known)
    for run, samples in zip(runs, before, strict=True):
        np.testing.assert_array_equal(run.matrix(KINDS[kind].channels), samples)


def test_the_model_is_a_block_that_saves_and_streams(name: str, kind: str, tmp_path: Path) -> None:
    model, run = fitted(name, kind).model_, recorded(kind)[-1]
    model.save(tmp_path / "model.json")
    assert load_model(tmp_path / "model.json") == model
    assert model.n_parameters == model.pack().size
    # a stream knows no output to start from, so simulate is given none either
    begun = run.slice(0, 100).select([channel.name for channel in model.inputs])
    stream = model.stream(run.sample_time)
    stepped = np.array(
        [stream.step(row).copy() for row in begun.matrix(c.name for c in model.inputs)]
    )
    np.testing.assert_array_equal(stepped, model.simulate(begun).matrix(KINDS[kind].outputs))


def test_predict_and_score_are_of_the_measured_outputs(name: str, kind: str) -> None:
    estimator, runs, outputs = fitted(name, kind), recorded(kind), KINDS[kind].outputs
    predicted = estimator.predict(runs)
    measured = [run.matrix(outputs) for run in runs]
    several = len(outputs) > 1
    assert [part.shape for part in predicted] == [
        y.shape if several else y.shape[:1] for y in measured
    ]
    np.testing.assert_array_equal(estimator.predict(runs[0]), predicted[0])
    y, z = np.concatenate(measured), np.concatenate(predicted).reshape(-1, len(outputs))
    assert estimator.score(runs) == pytest.approx(
        np.mean(1 - ((y - z) ** 2).mean(axis=0) / y.var(axis=0))
    )
    assert estimator.score(runs) > 0.3
    run, block = runs[-1], estimator.model_
    u, y = (run.matrix([c.name for c in side]) for side in (block.inputs, block.outputs))
    assert estimator.score(u, y, sample_time=run.sample_time) == estimator.score(run)
    again = pickle.loads(pickle.dumps(estimator))
    assert type(again) is type(estimator)
    np.testing.assert_array_equal(again.predict(runs[0]), predicted[0])
    with pytest.raises(NotFittedError):
        clone(estimator).predict(runs)


def test_diagnostics_say_how_good_the_fit_is(name: str, kind: str) -> None:
    estimator, outputs = fitted(name, kind), KINDS[kind].outputs
    found, n = estimator.diagnostics_, estimator.model_.n_parameters
    assert len(found.rmse_by_output) == len(outputs)
    assert found.rmse == pytest.approx(np.mean(found.rmse_by_output))
    assert 0 < found.rmse_from_rest < np.inf
    assert found.n_samples == sum(int(kept.sum()) for kept in counts(kind))
    assert len(found.standard_errors) == n
    assert found.covariance.shape == (n, n)
    np.testing.assert_array_equal(found.standard_errors, np.sqrt(np.diag(found.covariance)))
    assert set(estimator.undetermined()) <= set(range(n))


def test_what_is_fixed_is_no_parameter_and_all_else_follows_the_data(name: str, kind: str) -> None:
    """Of fits to other outputs of the same inputs, every number that is free differs, or is at a bound.

    What is fixed does not, or moves the output in no way that the free numbers do not.
    """
    runs, outputs = recorded(kind), KINDS[kind].outputs
    fits = [fitted(name, kind)]
    for share in (0.02, 0.05):
        with suppress(ModelError):  # a linear model may be unstable
            fits.append(
                quick(name, kind).fit([moved(r, outputs, share) for r in runs], rows=counts(kind))
            )
    packs = [fit.model_.pack() for fit in fits]
    first, same = packs[0], [pack for pack in packs if pack.size == packs[0].size]
    still = np.all([pack == first for pack in same], axis=0)
    fixed = list(fits[0].fixed(fits[0].model_))
    at_bounds = list(fits[0].diagnostics_.at_bounds)
    assert fits[0].diagnostics_.n_free == first.size - len(fixed) + fits[0].n_further
    if len(same) > 1:
        free = np.delete(np.arange(first.size), fixed + at_bounds)
        names = {fits[0].model_.parameter_names[k] for k in free[still[free]]}
        assert names <= STILL.get(name, set())
    if not still[fixed].all():
        whole = FreeRuns.of(fits[0].model_, runs[:1])
        slopes = whole.slopes(range(first.size))
        free = np.delete(slopes, fixed, axis=1)
        left = slopes - free @ np.linalg.lstsq(free, slopes, rcond=1e-9)[0]
        assert np.abs(left).max() < 1e-3 * np.abs(slopes).max()


def moved(run: Recording, outputs: tuple[str, ...], share: float) -> Recording:
    """Return a recording with other outputs: bent, shifted and shaken by a share of their range."""
    bent = {}
    for output in outputs:
        y, wave = run[output], np.sin(0.07 * np.arange(len(run)))
        size = np.ptp(y)
        bent[output] = y + share * (size + (y - y.min()) ** 2 / size + 0.3 * size * wave)
    return run.with_channels({output: run.units[output] for output in outputs}, **bent)


def test_an_interrupted_fit_leaves_nothing(name: str, kind: str) -> None:
    told: list[float] = []

    def impatient(share: float, best: float) -> None:
        told.append(share)
        if len(told) == 2 or share == 1.0:
            raise KeyboardInterrupt

    estimator = quick(name, kind)
    with pytest.raises(KeyboardInterrupt):
        estimator.fit(recorded(kind), progress=impatient)
    assert vars(estimator).keys() == estimator.get_params().keys()


def test_absent_channels_are_named(name: str, kind: str) -> None:
    made, first = KINDS[kind], recorded(kind)[0]
    model = fitted(name, kind).model_
    for channel in (one.name for one in (*model.inputs, *model.outputs)):
        bare = first.select([other for other in made.channels if other != channel])
        with refused(DataError, channel=channel):
            quick(name, kind).fit([*recorded(kind)[1:], bare])


def test_bad_recordings_and_settings_are_refused(name: str, kind: str) -> None:
    runs, given = recorded(kind), KINDS[kind].inputs[0]
    fit = quick(name, kind).fit
    for bad in ([], [run.slice(0, 2) for run in runs]):
        with pytest.raises(DataError):
            fit(bad)
    with refused(DataError, channel=given):
        fit([run.with_channels(**{given: np.ones(len(run))}) for run in runs])
    with refused(ModelError, parameter="seed", names=-1):
        quick(name, kind, seed=-1).fit(runs)
    assert not hasattr(quick(name, kind), "model_")


def test_outputs_that_do_not_count_are_never_looked_at(name: str, kind: str) -> None:
    def spoilt(run: Recording, kept: np.ndarray) -> Recording:
        return run.with_channels(**{c: np.where(kept, run[c], 1e3) for c in KINDS[kind].outputs})

    runs = [spoilt(run, kept) for run, kept in zip(recorded(kind), counts(kind), strict=True)]
    again = quick(name, kind).fit(runs, rows=counts(kind))
    assert again.model_ == fitted(name, kind).model_
