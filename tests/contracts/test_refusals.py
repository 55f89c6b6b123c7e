"""Models that cannot be: each is refused with a `ModelError` that names what is wrong with it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mckibben import PI, Channel, ModelError, PerChannel, Play, Series
from mckibben.blocks.adaptive import adaptive
from mckibben.blocks.coupled.coupling import Coupling
from mckibben.blocks.dynamics.process_model import ProcessModel
from mckibben.blocks.fields import DISPLACEMENT
from mckibben.blocks.hysteresis.envelopes import Exponential, Tanh
from mckibben.blocks.hysteresis.envelopes import PiecewiseLinear as Lines
from mckibben.papers.paper import printed
from mckibben.registry import load

Make = Callable[[], object]

OPEN = (0.0, 5.0)
U = np.linspace(0.0, 5.0, 10)
PAIR = tuple(Channel(f"displacement_{k}", "mm") for k in (1, 2))


def example(kind: str, **fields: Any) -> Any:
    """Return the example of a kind, some of its fields changed."""
    return replace(load("blocks", kind).example(), **fields)


BALANCE = example("balance")
ARM = replace(BALANCE, pressure_range=(0.0, 6.0))

NO_MODEL: list[tuple[str, dict[str, Any], str]] = [
    ("play", {"threshold": -0.1}, "threshold.*'play'"),
    ("pi", {"thresholds": (), "weights": ()}, "'pi'"),
    ("pi", {"weights": (1.0, 2.0)}, "weights"),
    ("pi", {"thresholds": (0.0, 0.0, 1.0, 2.0)}, "thresholds"),
    ("pi", {"input_range": (5.0, 5.0)}, "5"),
    ("eupi", {"falling_slope": 0.0}, "falling_slope.*'eupi'"),
    ("eupi", {"falling_threshold": -0.1}, "falling_threshold.*'eupi'"),
    ("preisach", {"weights": (1.0,)}, "15"),
    ("piecewise-linear", {"knots": (0.0, 0.0), "values": OPEN}, "piecewise-linear"),
    ("piecewise-linear", {"knots": OPEN, "values": (1.0, 1.0)}, "piecewise-linear"),
    ("bouc-wen", {"exponent": 3}, "exponent"),
    ("generalized-bouc-wen", {"shape": (0.5, 0.5, 0.1, 0.0, 0.0)}, "shape"),
    ("duhem-oscillator", {"rising": OPEN, "falling": OPEN, "knots": (1.0, 1.0)}, "knots"),
    ("state-network", {"linear": ((0.0, 1.0),)}, "rows"),
    ("state-network", {"readout": ((1.0,), (1.0,))}, "rows"),
    ("air", {"ambient": 7.0}, "7"),
    ("air", {"gain": -1.0}, "gain.*'air'"),
    ("coupling", {"gains": ((1.0,), (1.0,)), "driven": PAIR, "given": PAIR}, "'coupling'"),
    ("series", {"parts": (example("per-channel"), PI.example())}, r"2 .*1"),
    ("series", {"parts": ()}, "'series'"),
    ("series", {"parts": (3,)}, r"parts\.0"),
    (
        "parallel",
        {"parts": (PI.example(), replace(PI.example(), output=Channel("displacement", "N")))},
        "displacement",
    ),
    ("per-channel", {"parts": (PI.example(), example("eupi"))}, "pressure, pressure"),
    (
        "load-estimate",
        {"forward": replace(BALANCE, loads=((), ()), scheduled=BALANCE.scheduled[:1])},
        "load",
    ),
    ("force-feedforward", {"law": example("tondu-lopez")}, "'tondu-lopez'"),
    ("force-compensator", {"forward": PI.example()}, "load"),
    ("force-compensator", {"forward": example("load-estimate")}, "held"),
    (
        "predictive",
        {"compensator": example("pi", input_range=None).inverse(), "pressure_range": None},
        "pressure_range",
    ),
    ("predictive", {"compensator": ARM.inverse(), "pressure_range": OPEN}, "'predictive'"),
    ("adaptive", {"memory": (0.0, 1.0, 2.0)}, "3"),
    ("balance", {"friction": ((3.0, -1.5), (2.5, 2.0))}, "friction"),
    ("balance", {"relaxation": ((1.0, -0.6), (0.8, 0.5))}, "relaxation"),
    ("balance", {"damping": (-0.1, 0.0)}, "damping"),
    ("balance", {"damping": (0.1,)}, "damping.*2"),
    ("balance", {"walls": (0.0, -0.1)}, "walls"),
    ("balance", {"bladders": (4.0, -5.0)}, "bladders"),
    ("balance", {"mass": (-4.0, 5.0)}, "mass"),
    ("balance", {"mass": (0.1, 0.1)}, "mass and pushes"),
    ("balance", {"friction_growth": -0.5}, "friction_growth"),
    ("balance", {"lags": (0.8, -1.0)}, "lags"),
    ("balance", {"areas": ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0))}, "areas"),
    ("balance", {"springs": ((1.0,), (1.0,))}, "springs.*2 rows of 6"),
    ("balance", {"hull": ((0.0, 50.0), (50.0, 0.0))}, "hull"),
    ("balance", {"driven": (Channel("force", "N"),) * 2}, "name"),
]

CROSSED = {
    "tanh": (Tanh(0.5, -1.0, 0.1), Tanh(0.5, -1.0, 0.0)),
    "exponential": (Exponential(0.4, 0.1), Exponential(0.3, 0.1)),
    "lines": (Lines(OPEN, (0.0, 1.0)), Lines((0.0, 2.0, 5.0), (0.0, 0.3, 1.0))),
}

NO_INVERSE: dict[str, tuple[Any, str]] = {
    "play": (Play(0.5), "'play'"),
    "pi: threshold": (PI((0.1, 0.5), (1.0, 1.0)), r"0\.1"),
    "pi: weights add up to 0": (PI((0.0, 0.5), (1.0, -1.0)), "weights 0 to 1"),
    "gpi: weights": (example("gpi", weights=(1.0, -2.0, 1.0, 1.0)), "weights 0 to 1.*-1"),
    **{
        f"gpi: crossed {name}": (example("gpi", rising=rising, falling=falling), "envelope")
        for name, (rising, falling) in CROSSED.items()
    },
    **{
        f"eupi: {weights}, {polynomial}": (
            example("eupi", thresholds=(0.0, 0.5), weights=weights, polynomial=polynomial),
            "'eupi'",
        )
        for weights, polynomial in (
            ((1.0, -0.5), (1.0, 0.0, 0.0)),
            ((0.0, 1.0), (0.0, 0.0, 0.0)),
            ((0.0, 1.0), (1.0, -0.2, 0.0)),
        )
    },
    "rate-dependent-pi: range": (example("rate-dependent-pi", input_range=None), "input range"),
    "rate-dependent-pi: weights": (
        load("blocks", "rate-dependent-pi")((0.0,), (0.0,), (-1.0,), input_range=OPEN),
        "-1",
    ),
    "preisach": (example("preisach").unpack([0.0] * 15 + [1.0]), "diagonal"),
    "polynomial: range": (example("polynomial", input_range=None), "input range"),
    **{
        f"polynomial: {c}": (
            load("blocks", "polynomial")(c, input_range=(-1.0, 1.0)),
            "'polynomial'",
        )
        for c in ((0.0, 0.0, 1.0), (0.0, -1.0), (3.0,), (0.0, 0.1, 0.0, -1.0))
    },
    "affine": (example("affine", gain=0.0), "gain 0"),
    "bouc-wen": (example("bouc-wen", weight=-50.0), "'bouc-wen'"),
    "series": (Series((PI.example(), Play(0.1, input=DISPLACEMENT))), "'play'"),
    "transfer function": (
        example("transfer-function", numerator=(0.0, 1.0)),
        "'transfer-function'",
    ),
    "process model": (printed("field-models-p2uz"), "P2UZ"),
    "narx": (example("narx-polynomial"), "'narx-polynomial'"),
    "coupling": (Coupling(((1.0, 1.0), (1.0, 1.0)), PAIR, PAIR), "singular"),
    "force": (printed("multistate-static-force"), "ForceFeedforward"),
    "mpi-narmax": (printed("mpi-narmax-mpi"), "inverse"),
}

RATED = example("rate-dependent-pi")

OTHERS: dict[str, tuple[Make, str]] = {
    "other states": (lambda: Play(0.5).simulate(U, initial=[0.0, 0.0]), "1 states"),
    "an unknown start": (
        lambda: Play(0.5).simulate(U, initial="fresh"),  # type: ignore[arg-type]
        "'fresh'",
    ),
    "no time in an array": (lambda: RATED.simulate(U), "sample time"),
    "no time for a part": (lambda: Series((RATED,)).simulate(U), "sample time"),
    "another time": (
        lambda: example("transfer-function").simulate(U, sample_time=0.02),
        "0.01 s",
    ),
    "too late": (
        lambda: ProcessModel(2.0, (0.3,), delay=5.0).simulate(U, sample_time=0.01),
        "254",
    ),
    "too fast": (lambda: example("state-network").simulate(U, sample_time=1.0), "2 substep"),
    "learns several channels": (lambda: adaptive(PerChannel.example(), 20.0), "'per-channel'"),
    "learns creep alone": (lambda: adaptive(example("creep"), 10.0), "'creep'"),
    "learns a learner": (lambda: adaptive(example("adaptive"), 20.0, 0.02), "'pi-adaptive'"),
    "noise of nothing": (lambda: adaptive(PI.example(), 20.0, 1e-300), "e-300"),
    "noise of all": (lambda: adaptive(PI.example(), 20.0, 1e160), "160"),
    "learns at once": (lambda: adaptive(PI.example(), 1e-9, 0.02), "e-09"),
    "learns never": (lambda: adaptive(Series.example(), 1e12, 0.02), "12"),
}


def refused(make: Make, about: str) -> None:
    with pytest.raises(ModelError, match=f"(?s){about}") as error:
        make()
    assert "Remedy: " in str(error.value)


@pytest.mark.parametrize(("kind", "fields", "about"), NO_MODEL)
def test_what_is_no_model_is_refused(kind: str, fields: dict[str, Any], about: str) -> None:
    refused(lambda: example(kind, **fields), about)


@pytest.mark.parametrize("what", NO_INVERSE)
def test_what_has_no_inverse_is_refused_one(what: str) -> None:
    block, about = NO_INVERSE[what]
    refused(block.inverse, about)


@pytest.mark.parametrize("what", OTHERS)
def test_what_cannot_run_or_learn_is_refused(what: str) -> None:
    refused(*OTHERS[what])
