"""Models that cannot be: each is refused with a `ModelError` that names what is wrong with it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mckibben import (
    EUPI,
    GPI,
    PI,
    Affine,
    Channel,
    ModelError,
    Parallel,
    PerChannel,
    PiecewiseLinear,
    Play,
    Polynomial,
    RateDependentPI,
    Series,
)
from mckibben.blocks.adaptive.adaptive import Adaptive
from mckibben.blocks.adaptive.adaptive_series import AdaptiveSeries, adaptive
from mckibben.blocks.core.fields import DISPLACEMENT
from mckibben.blocks.coupled.balance import Balance
from mckibben.blocks.coupled.coupling import Coupling
from mckibben.blocks.coupled.load_estimate import LoadEstimate
from mckibben.blocks.differential.bouc_wen import BoucWen
from mckibben.blocks.differential.bouc_wen_oscillator import BoucWenOscillator
from mckibben.blocks.differential.duhem_oscillator import DuhemOscillator
from mckibben.blocks.differential.generalized_bouc_wen import GeneralizedBoucWen
from mckibben.blocks.dynamic.air import Air
from mckibben.blocks.dynamic.creep import Creep
from mckibben.blocks.dynamic.narx_polynomial import NarxPolynomial
from mckibben.blocks.dynamic.process_model import ProcessModel
from mckibben.blocks.dynamic.state_network import StateNetwork
from mckibben.blocks.dynamic.transfer_function import TransferFunction
from mckibben.blocks.force.feedforward import ForceFeedforward
from mckibben.blocks.force.tondu_lopez import TonduLopez
from mckibben.blocks.play_type.envelopes.exponential import Exponential
from mckibben.blocks.play_type.envelopes.piecewise_linear import PiecewiseLinear as Lines
from mckibben.blocks.play_type.envelopes.tanh import Tanh
from mckibben.blocks.predictive.predictive import Predictive
from mckibben.blocks.preisach_type.preisach import Preisach
from mckibben.registry import load

Make = Callable[[], object]

OPEN, SHORT = (0.0, 5.0), (-1.0, 1.0)
U = np.linspace(0.0, 5.0, 10)
PAIR = tuple(Channel(f"displacement_{k}", "mm") for k in (1, 2))
BALANCE, AIR, STATES = Balance.example(), Air.example(), StateNetwork.example()
ARM = replace(BALANCE, pressure_range=(0.0, 6.0))
CREEP = TransferFunction.example()
CREEPING = Series((*Series.example().parts, Creep.example()))
FORCES = (*BALANCE.scheduled, Channel("force_2", "N"))


def published(name: str) -> Any:
    return load("published", name)()


NO_MODEL: dict[str, tuple[Make, str]] = {
    "play: negative threshold": (lambda: Play(-0.1), "thresholds.*'play'"),
    "pi: no operators": (lambda: PI((), ()), "'pi'"),
    "pi: other numbers": (lambda: PI((0.0,), (1.0, 2.0)), "weights"),
    "pi: one threshold twice": (lambda: PI((0.0, 0.0), (1.0, 1.0)), "thresholds"),
    "pi: falling thresholds": (lambda: PI((1.0, 0.5), (1.0, 1.0)), "thresholds"),
    "pi: no range": (lambda: PI((0.0,), (1.0,), input_range=(5.0, 5.0)), "5"),
    "eupi: slope 0": (lambda: eupi(falling_slope=0.0), "falling_slope.*'eupi'"),
    "eupi: slope below 0": (lambda: eupi(falling_slope=-1.0), "falling_slope.*'eupi'"),
    "eupi: threshold below 0": (lambda: eupi(falling_threshold=-0.1), "falling_threshold.*'eupi'"),
    "preisach: few weights": (lambda: Preisach(Preisach.example().levels, (1.0,)), "15"),
    "lines: one knot": (lambda: PiecewiseLinear((0.0,), (0.0,)), "piecewise-linear"),
    "lines: other numbers": (lambda: PiecewiseLinear((0.0, 1.0), (0.0,)), "piecewise-linear"),
    "lines: one knot twice": (lambda: PiecewiseLinear((0.0, 0.0), OPEN), "piecewise-linear"),
    "lines: flat": (lambda: PiecewiseLinear((0.0, 1.0), (1.0, 1.0)), "piecewise-linear"),
    "bouc-wen: exponent": (lambda: change(BoucWen, exponent=3), "exponent"),
    "bouc-wen: runs away": (
        lambda: change(GeneralizedBoucWen, shape=(0.5, 0.5, 0.1, 0.0, 0.0)),
        "shape",
    ),
    "duhem: one knot": (lambda: duhem((1.0,), (1.0,), (0.0,)), "knots"),
    "duhem: one knot twice": (lambda: duhem((1.0, 2.0), (1.0, 2.0), (1.0, 1.0)), "knots"),
    "duhem: other numbers": (lambda: duhem((1.0, 2.0), (1.0,), (0.0, 1.0)), "knots"),
    "states: few rows": (lambda: replace(STATES, linear=((0.0, 1.0),)), "rows"),
    "states: short rows": (lambda: replace(STATES, hidden=((1.0, 0.0, 0.0),)), "rows"),
    "states: no readout": (lambda: replace(STATES, readout=((1.0,), (1.0,))), "rows"),
    "states: no units": (lambda: replace(STATES, hidden=()), "rows"),
    "air: ambient above supply": (lambda: replace(AIR, ambient=7.0), "7"),
    "air: negative gain": (lambda: replace(AIR, gain=-1.0), "gain.*'air'"),
    "coupling: no gains": (lambda: Coupling((), PAIR, PAIR), "'coupling'"),
    "coupling: narrow": (lambda: Coupling(((1.0,), (1.0,)), PAIR, PAIR), "'coupling'"),
    "coupling: few": (lambda: Coupling(((1.0, 2.0),), PAIR, PAIR), "'coupling'"),
    "series: misfit": (lambda: Series((PerChannel.example(), PI.example())), r"2 .*1"),
    "parallel: misfit": (lambda: Parallel((PI.example(), Affine(1.0))), "'affine'"),
    "per-channel: repeated": (
        lambda: PerChannel((PI.example(), EUPI.example())),
        "pressure, pressure",
    ),
    "per-channel: pairs": (lambda: PerChannel((PerChannel.example(),)), "'per-channel'.*2"),
    "series: no parts": (lambda: Series(()), "'series'"),
    "parallel: no parts": (lambda: Parallel(()), "'parallel'"),
    "per-channel: no parts": (lambda: PerChannel(()), "'per-channel'"),
    "series: a number": (lambda: Series((3,)), r"parts\.0"),  # type: ignore[arg-type]
    "load estimate: no loads": (
        lambda: LoadEstimate(replace(BALANCE, loads=((), ()), scheduled=FORCES[:1])),
        "load",
    ),
    "load estimate: two alike": (
        lambda: LoadEstimate(replace(BALANCE, loads=((1.0, 1.0), (0.5, 0.5)), scheduled=FORCES)),
        "",
    ),
    "load estimate: its own": (lambda: LoadEstimate.of(LoadEstimate.example()), ""),
    "feedforward: law": (lambda: ForceFeedforward(TonduLopez.example()), "'tondu-lopez'"),
    "predictive: no range": (
        lambda: Predictive(replace(PI.example(), input_range=None).inverse()),
        "pressure_range",
    ),
    "predictive: a model": (lambda: Predictive(PI.example()), "'pi'"),
    "predictive: an arm": (lambda: Predictive(ARM.inverse(), pressure_range=OPEN), "'predictive'"),
    "predictive: volumes": (lambda: Predictive(ARM, volumes=(1.0,)), "volumes"),
    "predictive: total": (
        lambda: Predictive(ARM, pressure_range=(1.0, 2.0), total_limit=1.5),
        "total_limit",
    ),
    "adaptive: a balance": (lambda: Adaptive(BALANCE, 20.0, 0.02), "'balance'"),
    "adaptive: several channels": (lambda: adaptive(PerChannel.example(), 20.0), "'per-channel'"),
    "adaptive: creep": (lambda: adaptive(Creep.example(), 10.0), "'creep'"),
    "adaptive: itself": (lambda: adaptive(Adaptive.example(), 20.0, 0.02), "'pi-adaptive'"),
    "adaptive: no part": (lambda: AdaptiveSeries(Series((Creep.example(),)), 10.0, 0.1), "0 parts"),
    "adaptive: memory": (lambda: replace(Adaptive.example(), memory=(0.0, 1.0, 2.0)), "3"),
}

BALANCES: list[tuple[dict[str, Any], str]] = [
    ({"friction": ((3.0, -1.5), (2.5, 2.0))}, "friction"),
    ({"relaxation": ((1.0, -0.6), (0.8, 0.5))}, "relaxation"),
    ({"damping": (-0.1, 0.0)}, "damping"),
    ({"walls": (0.0, -0.1)}, "walls"),
    ({"bladders": (4.0, -5.0)}, "bladders"),
    ({"pushes": (-4.0, 5.0)}, "pushes"),
    ({"pushes": (4.0,)}, "pushes.*2"),
    ({"bladders": ()}, "bladders.*2"),
    ({"mass": (-4.0, 5.0)}, "mass"),
    ({"mass": (0.1, 0.1), "pushes": (4.0, 5.0), "bladders": (1.0, 1.0)}, "mass and pushes"),
    ({"grip": -0.5}, "grip"),
    ({"limits": (0.0, 2.0)}, "limits"),
    ({"lags": (0.8, -1.0)}, "lags"),
    ({"areas": ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0))}, "areas"),
    ({"springs": ((1.0,), (1.0,))}, "springs.*2 rows of 6"),
    ({"friction": ((1.0,), (1.0,))}, "friction.*2 rows of 2"),
    ({"elasticity": ((1.0,), (1.0, 2.0))}, "elasticity.*2 rows of 1"),
    ({"areas": ((), ())}, "areas.*2 rows of 1"),
    ({"loads": ((1.0,),)}, "loads.*2 rows of 1"),
    ({"damping": (0.1,)}, "damping.*2"),
    ({"mass": (0.1,)}, "mass.*2"),
    ({"given": (Channel("pressure", "bar"),)}, "given.*2"),
    ({"hull": ((0.0, 50.0), (50.0, 0.0))}, "hull"),
    ({"driven": (Channel("force", "N"),) * 2}, "name"),
]

NO_INVERSE: dict[str, tuple[Any, str]] = {
    "play": (Play(0.5), "'play'"),
    "pi: threshold": (PI((0.1, 0.5), (1.0, 1.0)), r"0\.1"),
    "pi: weights add up to 0": (PI((0.0, 0.5), (1.0, -1.0)), "weights 0 to 1"),
    "pi: falls at first": (PI((0.0, 0.5), (-1.0, 3.0)), "weights 0 to 0"),
    "gpi: threshold": (GPI((0.1, 0.2), (1.0, 1.0), *Tanh.examples(), OPEN), r"0\.1"),
    "gpi: weights": (GPI((0.0, 0.2), (1.0, -2.0), *Tanh.examples(), OPEN), "weights 0 to 1.*-1"),
    **{
        f"gpi: crossed {rising.kind}": (
            GPI((0.0, 0.1), (1.0, 1.0), rising, falling, OPEN),
            "envelope",
        )
        for rising, falling in (
            (Tanh(0.5, -1.0, 0.1), Tanh(0.5, -1.0, 0.0)),
            (Exponential(0.4, 0.1), Exponential(0.3, 0.1)),
            (Lines(OPEN, (0.0, 1.0)), Lines((0.0, 2.0, 5.0), (0.0, 0.3, 1.0))),
        )
    },
    **{
        f"eupi: {weights}, {polynomial}": (
            EUPI((0.0, 0.5), weights, 1.0, 1.0, polynomial, 0.0, OPEN),
            "'eupi'",
        )
        for weights, polynomial in (
            ((1.0, -0.5), (1.0, 0.0, 0.0)),
            ((0.0, 1.0), (0.0, 0.0, 0.0)),
            ((0.0, 1.0), (1.0, -0.2, 0.0)),
        )
    },
    "rate-dependent-pi: range": (RateDependentPI((0.0,), (0.0,), (1.0,)), "input range"),
    "rate-dependent-pi: weights": (
        RateDependentPI((0.0,), (0.0,), (-1.0,), input_range=OPEN),
        "-1",
    ),
    "preisach": (Preisach.example().unpack([0.0] * 15 + [1.0]), "diagonal"),
    "polynomial: range": (Polynomial((0.0, 1.0)), "input range"),
    **{
        f"polynomial: {c}": (Polynomial(c, input_range=SHORT), "'polynomial'")
        for c in ((0.0, 0.0, 1.0), (0.0, -1.0), (3.0,), (0.0, 0.1, 0.0, -1.0))
    },
    "affine": (Affine(0.0), "gain 0"),
    "bouc-wen": (replace(BoucWen.example(), weight=-50.0), "'bouc-wen'"),
    "series": (Series((PI.example(), Play(0.1, input=DISPLACEMENT))), "'play'"),
    "transfer function: late": (replace(CREEP, numerator=(0.0, 1.0)), "'transfer-function'"),
    "transfer function: unstable": (replace(CREEP, numerator=(1.0, -2.0)), "'transfer-function'"),
    "process model": (published("field-models-p2uz"), "P2UZ"),
    "narx": (NarxPolynomial.example(), "'narx-polynomial'"),
    "coupling": (Coupling(((1.0, 1.0), (1.0, 1.0)), PAIR, PAIR), "singular"),
    "force": (published("multistate-static-force"), "ForceFeedforward"),
    "friction": (published("multistate-friction"), "ForceFeedforward"),
    "mpi-narmax": (published("mpi-narmax-mpi"), "inverse"),
}

NO_RUN: dict[str, tuple[Make, str]] = {
    "other states": (lambda: Play(0.5).simulate(U, initial=[0.0, 0.0]), "1 states"),
    "an unknown start": (
        lambda: Play(0.5).simulate(U, initial="fresh"),  # type: ignore[arg-type]
        "'fresh'",
    ),
    "no virgin": (
        lambda: RateDependentPI.example().inverse().simulate(U, initial="virgin", sample_time=0.1),
        "virgin",
    ),
    "no time in an array": (lambda: rated().simulate(U), "sample time"),
    "no time in a stream": (lambda: rated().stream(), "sample time"),
    "no time for a part": (lambda: Series((rated(),)).simulate(U), "sample time"),
    "another time, transfer function": (lambda: CREEP.simulate(U, sample_time=0.02), "0.01 s"),
    "another time, narx": (
        lambda: NarxPolynomial.example().simulate(U, sample_time=0.02),
        "0.01 s",
    ),
    "too late": (
        lambda: ProcessModel(2.0, (0.3,), delay=5.0).simulate(U, sample_time=0.01),
        "254",
    ),
    "too late, air": (
        lambda: replace(AIR, dead_time=2.55).simulate([1.0], sample_time=0.01),
        "255",
    ),
    "too fast, states": (lambda: STATES.simulate(U, sample_time=1.0), "2 substep"),
    "too fast, oscillator": (
        lambda: BoucWenOscillator(2.0, 0.01, 50.0, 50.0, 0.8, -1.1).simulate(U, sample_time=0.2),
        "10 substep",
    ),
    "coupling, diverges": (
        lambda: Coupling(((1.0, 1.5), (1.5, 1.0)), PAIR, PAIR).jacobi([1.0, 2.0]),
        r"1\.5",
    ),
    "not linear": (lambda: PI.example().to_scipy(0.01), "'pi'"),
    "not linear, series": (
        lambda: Series((PI.example(), Creep.example())).to_scipy(0.01),
        "linear",
    ),
    "linear but for its delay": (
        lambda: ProcessModel(1.0, (0.1,), None, None, 0.05).to_scipy(),
        "sample time",
    ),
}


def change(cls: Any, **fields: Any) -> Any:
    return replace(cls.example(), **fields)


def eupi(**fields: float) -> EUPI:
    return change(EUPI, **fields)


def duhem(*curves: Any) -> DuhemOscillator:
    return DuhemOscillator(2.0, 0.01, 50.0, *curves)


def rated() -> RateDependentPI:
    return RateDependentPI.example()


def refused(make: Make, about: str) -> None:
    with pytest.raises(ModelError, match=f"(?s){about}") as error:
        make()
    assert "Remedy: " in str(error.value)


@pytest.mark.parametrize("what", NO_MODEL)
def test_what_is_no_model_is_refused(what: str) -> None:
    refused(*NO_MODEL[what])


@pytest.mark.parametrize("model", [PI.example(), CREEPING], ids=["pi", "series"])
@pytest.mark.parametrize(
    ("time", "noise", "about"),
    [(20.0, 1e-300, "e-300"), (20.0, 1e160, "160"), (1e-9, 0.02, "e-09"), (1e12, 0.02, "12")],
)
def test_what_nothing_can_be_learnt_from_is_refused(
    model: Any, time: float, noise: float, about: str
) -> None:
    refused(lambda: adaptive(model, time, noise), about)


@pytest.mark.parametrize(("fields", "about"), BALANCES)
def test_what_is_no_balance_is_refused(fields: dict[str, Any], about: str) -> None:
    refused(lambda: replace(BALANCE, **fields), about)


@pytest.mark.parametrize("what", NO_INVERSE)
def test_what_has_no_inverse_is_refused_one(what: str) -> None:
    block, about = NO_INVERSE[what]
    refused(block.inverse, about)


@pytest.mark.parametrize("what", NO_RUN)
def test_what_cannot_run_is_refused(what: str) -> None:
    refused(*NO_RUN[what])
