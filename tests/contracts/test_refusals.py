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
from tests.refusals import refused

Make = Callable[[], object]

Fields = dict[str, Any]
"""What `refused` asks of the error."""

OPEN = (0.0, 5.0)
U = np.linspace(0.0, 5.0, 10)
PAIR = tuple(Channel(f"displacement_{k}", "mm") for k in (1, 2))


def example(kind: str, **fields: Any) -> Any:
    """Return the example of a kind, some of its fields changed."""
    return replace(load("blocks", kind).example(), **fields)


BALANCE = example("balance")
ARM = replace(BALANCE, pressure_range=(0.0, 6.0))

NO_MODEL: list[tuple[str, dict[str, Any], Fields]] = [
    ("play", {"threshold": -0.1}, {"parameter": "threshold", "names": "'play'"}),
    ("pi", {"thresholds": (), "weights": ()}, {"parameter": "thresholds", "names": "'pi'"}),
    ("pi", {"weights": (1.0, 2.0)}, {"parameter": "weights", "names": ("'pi'", 4, 2)}),
    ("pi", {"thresholds": (0.0, 0.0, 1.0, 2.0)}, {"parameter": "thresholds"}),
    ("pi", {"input_range": (5.0, 5.0)}, {"parameter": "input_range"}),
    ("eupi", {"falling_slope": 0.0}, {"parameter": "falling_slope", "names": "'eupi'"}),
    ("eupi", {"falling_threshold": -0.1}, {"parameter": "falling_threshold", "names": "'eupi'"}),
    ("preisach", {"weights": (1.0,)}, {"names": (1, 15)}),
    (
        "piecewise-linear",
        {"knots": (0.0, 0.0), "values": OPEN},
        {"parameter": "knots", "names": "'piecewise-linear'"},
    ),
    (
        "piecewise-linear",
        {"knots": OPEN, "values": (1.0, 1.0)},
        {"parameter": "values", "names": "'piecewise-linear'"},
    ),
    ("bouc-wen", {"exponent": 3}, {"parameter": "exponent", "names": ("'bouc-wen'", 3)}),
    ("generalized-bouc-wen", {"shape": (0.5, 0.5, 0.1, 0.0, 0.0)}, {"parameter": "shape"}),
    (
        "duhem-oscillator",
        {"rising": OPEN, "falling": OPEN, "knots": (1.0, 1.0)},
        {"parameter": "knots"},
    ),
    ("state-network", {"linear": ((0.0, 1.0),)}, {"names": "'state-network'"}),
    ("state-network", {"readout": ((1.0,), (1.0,))}, {"names": "'state-network'"}),
    ("air", {"ambient": 7.0}, {"parameter": "supply", "names": 7}),
    ("air", {"gain": -1.0}, {"parameter": "gain", "names": "'air'"}),
    (
        "coupling",
        {"gains": ((1.0,), (1.0,)), "driven": PAIR, "given": PAIR},
        {"parameter": "gains", "names": "'coupling'"},
    ),
    (
        "series",
        {"parts": (example("per-channel"), PI.example())},
        {"parameter": "parts", "names": (2, 1)},
    ),
    ("series", {"parts": ()}, {"parameter": "parts", "names": "'series'"}),
    ("series", {"parts": (3,)}, {"parameter": "parts.0"}),
    (
        "parallel",
        {"parts": (PI.example(), replace(PI.example(), output=Channel("displacement", "N")))},
        {"channel": "displacement"},
    ),
    (
        "per-channel",
        {"parts": (PI.example(), example("eupi"))},
        {"names": ("'per-channel'", "pressure")},
    ),
    (
        "load-estimate",
        {"forward": replace(BALANCE, loads=((), ()), scheduled=BALANCE.scheduled[:1])},
        {"names": "load"},
    ),
    ("force-feedforward", {"law": example("tondu-lopez")}, {"names": "'tondu-lopez'"}),
    ("force-compensator", {"forward": PI.example()}, {"names": "load"}),
    ("force-compensator", {"forward": example("load-estimate")}, {"names": "held"}),
    (
        "predictive",
        {"compensator": example("pi", input_range=None).inverse(), "pressure_range": None},
        {"names": "pressure_range"},
    ),
    (
        "predictive",
        {"compensator": ARM.inverse(), "pressure_range": OPEN},
        {"names": "'predictive'"},
    ),
    ("adaptive", {"memory": (0.0, 1.0, 2.0)}, {"parameter": "memory", "names": 3}),
    ("balance", {"friction": ((3.0, -1.5), (2.5, 2.0))}, {"parameter": "friction"}),
    ("balance", {"relaxation": ((1.0, -0.6), (0.8, 0.5))}, {"parameter": "relaxation"}),
    ("balance", {"damping": (-0.1, 0.0)}, {"parameter": "damping"}),
    ("balance", {"damping": (0.1,)}, {"parameter": "damping", "names": (1, 2)}),
    ("balance", {"walls": (0.0, -0.1)}, {"parameter": "walls"}),
    ("balance", {"bladders": (4.0, -5.0)}, {"parameter": "bladders"}),
    ("balance", {"mass": (-4.0, 5.0)}, {"parameter": "mass"}),
    ("balance", {"mass": (0.1, 0.1)}, {"parameter": "mass", "names": "pushes"}),
    ("balance", {"friction_growth": -0.5}, {"parameter": "friction_growth"}),
    ("balance", {"lags": (0.8, -1.0)}, {"parameter": "lags"}),
    ("balance", {"areas": ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0))}, {"parameter": "areas"}),
    ("balance", {"springs": ((1.0,), (1.0,))}, {"parameter": "springs", "names": (2, 6)}),
    ("balance", {"hull": ((0.0, 50.0), (50.0, 0.0))}, {"parameter": "hull"}),
    ("balance", {"driven": (Channel("force", "N"),) * 2}, {"names": ("'balance'", "force")}),
]

CROSSED = {
    "tanh": (Tanh(0.5, -1.0, 0.1), Tanh(0.5, -1.0, 0.0)),
    "exponential": (Exponential(0.4, 0.1), Exponential(0.3, 0.1)),
    "lines": (Lines(OPEN, (0.0, 1.0)), Lines((0.0, 2.0, 5.0), (0.0, 0.3, 1.0))),
}

NO_INVERSE: dict[str, tuple[Any, Fields]] = {
    "play": (Play(0.5), {"names": "'play'"}),
    "pi: threshold": (PI((0.1, 0.5), (1.0, 1.0)), {"names": 0.1}),
    "pi: weights add up to 0": (PI((0.0, 0.5), (1.0, -1.0)), {"names": ("'pi'", 0, 1)}),
    "gpi: weights": (example("gpi", weights=(1.0, -2.0, 1.0, 1.0)), {"names": ("'gpi'", 0, 1, -1)}),
    **{
        f"gpi: crossed {name}": (
            example("gpi", rising=rising, falling=falling),
            {"names": ("'gpi'", "bar")},
        )
        for name, (rising, falling) in CROSSED.items()
    },
    **{
        f"eupi: {weights}, {polynomial}": (
            example("eupi", thresholds=(0.0, 0.5), weights=weights, polynomial=polynomial),
            {"names": "'eupi'"},
        )
        for weights, polynomial in (
            ((1.0, -0.5), (1.0, 0.0, 0.0)),
            ((0.0, 1.0), (0.0, 0.0, 0.0)),
            ((0.0, 1.0), (1.0, -0.2, 0.0)),
        )
    },
    "rate-dependent-pi: range": (
        example("rate-dependent-pi", input_range=None),
        {"parameter": "input_range"},
    ),
    "rate-dependent-pi: weights": (
        load("blocks", "rate-dependent-pi")((0.0,), (0.0,), (-1.0,), input_range=OPEN),
        {"names": -1},
    ),
    "preisach": (
        example("preisach").unpack([0.0] * 15 + [1.0]),
        {"names": ("'preisach'", "diagonal")},
    ),
    "polynomial: range": (example("polynomial", input_range=None), {"parameter": "input_range"}),
    **{
        f"polynomial: {c}": (
            load("blocks", "polynomial")(c, input_range=(-1.0, 1.0)),
            {"names": "'polynomial'"},
        )
        for c in ((0.0, 0.0, 1.0), (0.0, -1.0), (3.0,), (0.0, 0.1, 0.0, -1.0))
    },
    "affine": (example("affine", gain=0.0), {"names": ("'affine'", 0)}),
    "bouc-wen": (example("bouc-wen", weight=-50.0), {"names": "'bouc-wen'"}),
    "series": (Series((PI.example(), Play(0.1, input=DISPLACEMENT))), {"names": "'play'"}),
    "transfer function": (
        example("transfer-function", numerator=(0.0, 1.0)),
        {"names": "'transfer-function'"},
    ),
    "process model": (printed("field-models-p2uz"), {"names": "P2UZ"}),
    "narx": (example("narx-polynomial"), {"names": "'narx-polynomial'"}),
    "coupling": (Coupling(((1.0, 1.0), (1.0, 1.0)), PAIR, PAIR), {"names": "singular"}),
    "force": (printed("multistate-static-force"), {"names": "ForceFeedforward"}),
    "mpi-narmax": (
        printed("mpi-narmax-mpi"),
        {"parameter": "input_range", "names": "'polynomial'"},
    ),
}

RATED = example("rate-dependent-pi")

NOISE, TIMES = ("2.6e-08", "2.6e+04"), (0.001, "1e+09")
"""Limits of the noise of the example of PI, in its unit, and of the time constant of what learns [s]."""

OTHERS: dict[str, tuple[Make, Fields]] = {
    "other states": (
        lambda: Play(0.5).simulate(U, initial=[0.0, 0.0]),
        {"parameter": "initial", "names": 1},
    ),
    "an unknown start": (
        lambda: Play(0.5).simulate(U, initial="fresh"),  # type: ignore[arg-type]
        {"parameter": "initial", "names": "'fresh'"},
    ),
    "no time in an array": (lambda: RATED.simulate(U), {"parameter": "sample_time"}),
    "no time for a part": (lambda: Series((RATED,)).simulate(U), {"parameter": "sample_time"}),
    "another time": (
        lambda: example("transfer-function").simulate(U, sample_time=0.02),
        {"parameter": "sample_time", "names": 0.01},
    ),
    "too late": (
        lambda: ProcessModel(2.0, (0.3,), delay=5.0).simulate(U, sample_time=0.01),
        {"names": (5, 500, 254)},
    ),
    "too fast": (
        lambda: example("state-network").simulate(U, sample_time=1.0),
        {"names": ("'state-network'", 2)},
    ),
    "learns several channels": (
        lambda: adaptive(PerChannel.example(), 20.0),
        {"names": "'per-channel'"},
    ),
    "learns creep alone": (lambda: adaptive(example("creep"), 10.0), {"names": "'creep'"}),
    "learns a learner": (
        lambda: adaptive(example("adaptive"), 20.0, 0.02),
        {"names": "'pi-adaptive'"},
    ),
    "noise of nothing": (
        lambda: adaptive(PI.example(), 20.0, 1e-300),
        {"parameter": "noise", "names": NOISE},
    ),
    "noise of all": (
        lambda: adaptive(PI.example(), 20.0, 1e160),
        {"parameter": "noise", "names": NOISE},
    ),
    "learns at once": (
        lambda: adaptive(PI.example(), 1e-9, 0.02),
        {"parameter": "time", "names": TIMES},
    ),
    "learns never": (
        lambda: adaptive(Series.example(), 1e12, 0.02),
        {"parameter": "time", "names": TIMES},
    ),
}


@pytest.mark.parametrize(("kind", "fields", "told"), NO_MODEL)
def test_what_is_no_model_is_refused(kind: str, fields: dict[str, Any], told: Fields) -> None:
    with refused(ModelError, **told):
        example(kind, **fields)


@pytest.mark.parametrize("what", NO_INVERSE)
def test_what_has_no_inverse_is_refused_one(what: str) -> None:
    block, told = NO_INVERSE[what]
    with refused(ModelError, **told):
        block.inverse()


@pytest.mark.parametrize("what", OTHERS)
def test_what_cannot_run_or_learn_is_refused(what: str) -> None:
    make, told = OTHERS[what]
    with refused(ModelError, **told):
        make()
