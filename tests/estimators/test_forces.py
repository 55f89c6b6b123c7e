"""Forces: parameters recovered, hysteresis extracted, characteristic points found."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from mckibben import DataError, Recording, study
from mckibben.blocks.force.activation import ActivationPressure
from mckibben.blocks.force.feedforward import compensator
from mckibben.blocks.force.laws import ChouHannaford, TonduLopez
from mckibben.blocks.force.multistate_friction import EACH_WAY, ELEVEN, MultistateFriction
from mckibben.estimators.coupled.balance_force import BalanceForceEstimator
from mckibben.estimators.force.activation import ActivationPressureEstimator
from mckibben.estimators.force.laws import (
    ChouHannafordEstimator,
    PolynomialForceEstimator,
    TonduLopezEstimator,
)
from mckibben.estimators.force.multistate import MultistateEstimator, extract_hysteresis
from mckibben.papers.paper import printed
from tests.estimators.test_balance import recording
from tests.refusals import refused

TRUTH = MultistateFriction(
    EACH_WAY,
    (*(7.0, 5e-3, 52.0, 5e-3, 90.0), *(12.0, 5e-3, 38.0), *(9.0, 5e-3, 60.0)),
    initial="virgin",
)


def isometric(law: Any, noise: float = 0.5) -> list[Recording]:
    rng = np.random.default_rng(0)
    runs = []
    for length in np.linspace(184.0, 200.0, 6):
        pressure = np.linspace(0.5, 6.0, 200)
        given = Recording({"length": np.full(200, length), "pressure": pressure}, 0.1)
        force = law.simulate(given)["force"]
        runs.append(given.with_channels(force=force + noise * rng.standard_normal(200)))
    return runs


def isobaric(pressure: float = 4.0, noise: float = 0.5) -> Recording:
    time = np.arange(2500) * 0.02
    length = 192.5 + 7.5 * np.cos(0.35 * time) * (1 - 0.3 * np.sin(0.05 * time))
    rng = np.random.default_rng(1)
    given = Recording({"length": length, "pressure": np.full(2500, pressure)}, 0.02)
    friction = TRUTH.simulate(given)["force"]
    static = printed("multistate-static-force").simulate(given)["force"]
    force = static + friction + noise * rng.standard_normal(2500)
    return given.with_channels(force=force)


def test_static_laws_recover_their_own_forces() -> None:
    law = printed("multistate-static-force")
    fit: Any = PolynomialForceEstimator(law="bilinear").fit(isometric(law))
    assert fit.diagnostics_.rmse < 0.55
    lengths = np.array([185.0, 199.0])
    for ours, theirs in zip(fit.model_.terms(lengths), law.terms(lengths), strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1.0)
    chou = ChouHannaford(260.0, 1.6, -3.0)
    fit = ChouHannafordEstimator().fit(isometric(chou))
    np.testing.assert_allclose(fit.model_.pack()[:2], chou.pack()[:2], rtol=0.02)
    tondu = TonduLopez(200.0, 10.0, 0.42, (0.3, 0.8), (0.5, 1.1), -5.0)
    again = TonduLopezEstimator(rest_length=200.0, diameter=10.0).fit(isometric(tondu))
    assert again.diagnostics_.rmse < 0.55


def test_chou_hannaford_recovers_thread_and_turns() -> None:
    from mckibben.blocks.force.laws import ChouHannaford

    truth = ChouHannaford(260.0, 1.6, -3.0)
    fit: Any = ChouHannafordEstimator().fit(isometric(truth))
    np.testing.assert_allclose(fit.model_.pack()[:2], truth.pack()[:2], rtol=0.02)


def test_friction_is_recovered_to_the_noise() -> None:
    (left,) = extract_hysteresis(isobaric(), printed("multistate-static-force"))
    fit: Any = MultistateEstimator(output="force_hysteresis", static=None, elements="each-way").fit(
        left
    )
    assert fit.diagnostics_.rmse < 0.6
    table, truth = fit.model_.table(), TRUTH.table()
    # what lengthening feels from the bottom on, and shortening from the top on, is determined
    assert table[:, 2].sum() == pytest.approx(truth[:, 2].sum(), rel=0.05)


def test_more_parameters_of_friction_are_never_worse() -> None:
    from mckibben.estimators.force.multistate import Multistate11Estimator, Multistate18Estimator

    # springs that motion unloads, which no element with an F_c in both directions is
    model = MultistateFriction(ELEVEN, printed("multistate-friction").values, initial="virgin")
    given = isobaric()
    one = given.with_channels(force=model.simulate(given)["force"])
    kinds = Multistate11Estimator, Multistate18Estimator
    few: dict[str, Any] = {"static": None, "n_starts": 8, "n_refined": 2}
    eleven, eighteen = (kind(**few).fit(one).diagnostics_.rmse for kind in kinds)
    assert eighteen <= eleven


def test_a_released_element_has_no_force_where_it_is_inactive() -> None:
    element = MultistateFriction(("shortening-released",), (10.0, 0.01, 50.0), initial="virgin")
    length = np.concatenate([np.linspace(0.0, -8.0, 100), np.linspace(-8.0, 0.0, 100)])
    force = element.simulate(Recording({"length": length, "pressure": 0 * length}, 0.02))["force"]
    assert force[99] == pytest.approx(-50.0, rel=1e-6)
    assert np.abs(force[101:]).max() < 1e-6


def sines(frequency: float, force: float) -> Recording:
    time = np.arange(1200) * 0.005
    contraction = 0.1 - 0.03 * np.cos(2 * np.pi * frequency * time)
    given = Recording({"contraction": contraction, "force": np.full(1200, force)}, 0.005)
    model = printed("activation-pressure-profile")
    assert isinstance(model, ActivationPressure)
    model = replace(model, frequency=frequency)
    return given.with_channels(pressure=model.simulate(given)["pressure"])


def test_activation_pressure_finds_the_published_profile_again() -> None:
    runs = [sines(w, f) for w in (0.5, 1.0, 2.0) for f in (0.0, 100.0, 200.0, 300.0)]
    fit: Any = ActivationPressureEstimator(rate_time_constant=0.0).fit(runs)
    for run, frequency in ((runs[0], 0.5), (runs[-1], 2.0)):
        told = replace(fit.model_, frequency=frequency)
        error = told.simulate(run)["pressure"] - run["pressure"]
        assert np.abs(error).max() < 0.1 * np.ptp(run["pressure"])
    assert fit.model_.gamma[0] / fit.model_.gamma[1] == pytest.approx(0.267 / 0.667, rel=0.3)


def test_a_muscle_that_never_moves_has_no_characteristic_points() -> None:
    still = sines(1.0, 100.0)
    still = still.with_channels(contraction=np.full(len(still), 0.1))
    with refused(DataError, channel="contraction", names=100):
        ActivationPressureEstimator(frequency=1.0).fit([sines(1.0, 0.0), still])


class TestBalanceForce:
    """A balance asked for its load, as a model of force."""

    @staticmethod
    def moved(seed: int) -> Recording:
        """A muscle with friction under a load, both at random."""
        run = recording(seed)
        return run.with_channels({"length": "mm"}, length=150.0 - run["displacement"])

    def test_force_is_recovered_where_a_static_law_leaves_the_loop(self) -> None:
        runs, other = [self.moved(1), self.moved(2)], self.moved(3)
        fit: Any = BalanceForceEstimator(input="length").fit(runs)
        error = np.std(fit.predict([other])[0] - other["force"])
        law: Any = PolynomialForceEstimator(law="bilinear").fit(runs)
        left = np.std(law.predict([other])[0] - other["force"])
        assert error < 0.3 * left
        assert [c.name for c in fit.fitted.inputs] == ["length", "pressure"]

    def test_length_and_displacement_tell_the_same(self) -> None:
        runs = isometric(printed("multistate-static-force"))
        runs = [
            r.with_channels({"displacement": "mm"}, displacement=200.0 - r["length"]) for r in runs
        ]
        forces = [
            BalanceForceEstimator(input=name).fit(runs).predict(runs)
            for name in ("length", "displacement")
        ]
        np.testing.assert_allclose(np.concatenate(forces[0]), np.concatenate(forces[1]), atol=1e-6)


class TestSlack:
    """Force of a muscle that is held so short that it goes slack below a pressure, as a rope does."""

    @staticmethod
    def held(length: float, seed: int) -> Recording:
        rng = np.random.default_rng(seed)
        levels = np.append(0.0, rng.uniform(0.0, 6.0, 12))
        pressure = np.interp(np.arange(1200), np.linspace(0, 1199, 13), levels)
        contraction = 130.0 - length
        force = np.maximum(pressure * (75.0 - 2.0 * contraction) - 60.0 - 10.0 * contraction, 0.0)
        channels = {"pressure": pressure, "length": np.full(1200, length)}
        return Recording(channels | {"force": force + 0.3 * rng.standard_normal(1200)}, 0.05)

    def test_a_muscle_that_rubber_pulls_goes_slack(self) -> None:
        train = [self.held(130.0 - x, place) for place, x in enumerate((0.0, 4.0, 8.0, 12.0))]
        test = [self.held(130.0 - x, 10 + place) for place, x in enumerate((2.0, 6.0, 10.0))]
        fit: Any = BalanceForceEstimator(input="length").fit(train)
        for found, run in zip(fit.predict(test), test, strict=True):
            assert np.std(found - run["force"]) < 0.01 * np.ptp(run["force"])
            assert found.min() > -1.0


class TestHeldLengths:
    """Force of a muscle that is held at lengths, by a play of pressure that its contraction widens."""

    LENGTHS = (200.0, 194.0, 188.0, 180.0)

    @classmethod
    def run(cls, length: float, noise: float, seed: int) -> Recording:
        rng = np.random.default_rng(seed)
        peaks = rng.uniform(0.3, 5.5, 12)
        pressure = np.interp(np.arange(1200), np.linspace(0, 1199, 13), np.append(0.0, peaks))
        contraction, play, force = 200.0 - length, 0.0, []
        for p in pressure:
            width = (0.05 + 0.03 * p) * (1.0 + 0.02 * contraction)
            play = min(max(play, p - width), p + width)
            force.append(play * (120.0 - 2.4 * contraction) - 2.0 * contraction)
        channels = {
            "pressure": pressure,
            "length": length + noise * rng.standard_normal(1200),
            "force": np.array(force) + 0.3 * rng.standard_normal(1200),
        }
        return Recording(channels, 0.02, meta={"name": f"{length:g} mm, {seed}"})

    @classmethod
    @cache
    def fitted(cls, noise: float) -> tuple[Any, list[Recording]]:
        train = [cls.run(length, noise, place) for place, length in enumerate(cls.LENGTHS)]
        test = [cls.run(length, noise, 10 + place) for place, length in enumerate((197.0, 184.0))]
        return BalanceForceEstimator(input="length").fit(train), test

    @pytest.mark.parametrize("noise", [0.0, 0.01, 0.05])
    def test_noise_of_the_length_leaves_the_friction(self, noise: float) -> None:
        fit, test = self.fitted(noise)
        found = [one - run["force"] for one, run in zip(fit.predict(test), test, strict=True)]
        law: Any = PolynomialForceEstimator(law="petrovic").fit(
            [self.run(length, noise, place) for place, length in enumerate(self.LENGTHS)]
        )
        static = [one - run["force"] for one, run in zip(law.predict(test), test, strict=True)]
        assert np.std(np.concatenate(found)) < 0.4 * np.std(np.concatenate(static))

    def test_the_compensator_is_exact(self) -> None:
        fit, (run, _) = self.fitted(0.01)
        inverse = compensator(fit.model_)
        assert [c.name for c in inverse.inputs] == ["force", "length"]
        assert inverse.forward_model == fit.model_
        run = run.with_channels(pressure=0.9 * run["pressure"])  # within what was recorded
        moving = run.with_channels(length=190.0 + 6.0 * np.sin(np.arange(len(run)) / 90.0))
        for one in (run, moving):
            force = fit.model_.simulate(one.select(["length", "pressure"]))["force"]
            asked = one.with_channels(force=force).select(["force", "length"])
            given = one.with_channels(pressure=inverse.simulate(asked)["pressure"])
            again = fit.model_.simulate(given.select(["length", "pressure"]))["force"]
            assert np.abs(again - force).max() <= 1e-9 * np.ptp(force)

    def test_a_study_chooses_and_inverts_it(self) -> None:
        _, test = self.fitted(0.01)
        train = [self.run(length, 0.01, place) for place, length in enumerate(self.LENGTHS)]
        found = study(train, test, models="balance-force,force-petrovic")
        board, made = found.leaderboard, found.inverse
        assert (board.inputs, board.outputs, board.loads) == (
            ("pressure",),
            ("force",),
            ("length",),
        )
        assert board.best is not None
        assert made is not None
        assert board.best.model == made.model == "balance-force"
        assert made.check.error <= 1e-9
        assert made.following_error < 0.5 * made.static_error


def test_elements_of_one_kind_are_ordered_by_strength() -> None:
    friction = MultistateFriction(
        ("shortening", "shared", "shortening"),
        (1.0, 0.1, 5.0, 2.0, 0.2, 6.0, 0.3, 7.0, 3.0, 0.4, 8.0),
    )
    ordered, order = friction.by_strength()
    assert ordered.values == (3.0, 0.4, 8.0, 2.0, 0.2, 6.0, 0.3, 7.0, 1.0, 0.1, 5.0)
    assert [friction.values[place] for place in order] == list(ordered.values)
    run = isobaric()
    ours, theirs = (each.simulate(run)["force"] for each in (friction, ordered))
    np.testing.assert_allclose(ours, theirs, atol=1e-9)


def test_a_scaled_law_is_printed_by_the_length_itself() -> None:
    law: Any = (
        PolynomialForceEstimator(law="bilinear")
        .fit(isometric(printed("multistate-static-force")))
        .model_
    )
    plain = law.unscaled()
    assert plain.scale == 1.0 != law.scale
    lengths = np.linspace(184.0, 200.0, 9)
    for ours, theirs in zip(plain.terms(lengths), law.terms(lengths), strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-8)


def test_the_printed_swarm_comes_to_where_least_squares_comes() -> None:
    from mckibben.estimators.force.activation import ActivationPressureEstimator

    runs = [sines(frequency, force) for frequency in (0.5, 2.0) for force in (0.0, 100.0, 300.0)]
    least, swarm = (
        ActivationPressureEstimator(method=method).fit(runs).diagnostics_.rmse
        for method in ("ls", "pso")
    )
    assert swarm == pytest.approx(least, rel=0.01, abs=1e-4)
