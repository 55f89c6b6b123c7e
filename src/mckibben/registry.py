"""Registry of plug-ins, one line each: group, name, and location.

A plug-in is imported at its first use. Other packages add plug-ins by
entry points in the groups ``mckibben.blocks``, ``mckibben.estimators`` and so on.
"""

from __future__ import annotations

from difflib import get_close_matches
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from typing import Any

from mckibben.errors import ModelError
from mckibben.hints import FORMER_PLUGINS, former

PLUGINS: dict[str, dict[str, str]] = {
    "blocks": {
        "activation-memory": "mckibben.blocks.force.activation:ActivationMemory",
        "activation-pressure": "mckibben.blocks.force.activation:ActivationPressure",
        "adaptive": "mckibben.blocks.adaptive:Adaptive",
        "affine": "mckibben.blocks.memoryless:Affine",
        "air": "mckibben.blocks.dynamics.air:Air",
        "balance": "mckibben.blocks.coupled.balance:Balance",
        "band": "mckibben.blocks.bands:Band",
        "banded": "mckibben.blocks.bands:Banded",
        "bouc-wen": "mckibben.blocks.hysteresis.differential:BoucWen",
        "bouc-wen-oscillator": ("mckibben.blocks.hysteresis.oscillators:BoucWenOscillator"),
        "braid-equilibrium": "mckibben.blocks.force.braid_equilibrium:BraidEquilibrium",
        "chou-hannaford": "mckibben.blocks.force.laws:ChouHannaford",
        "contact": "mckibben.blocks.memoryless:Contact",
        "coupled-memory": "mckibben.blocks.coupled.coupled_memory:CoupledMemory",
        "coupling": "mckibben.blocks.coupled.coupling:Coupling",
        "creep": "mckibben.blocks.dynamics.creep:Creep",
        "duhem": "mckibben.blocks.hysteresis.differential:Duhem",
        "duhem-oscillator": "mckibben.blocks.hysteresis.oscillators:DuhemOscillator",
        "eupi": "mckibben.blocks.hysteresis.eupi:EUPI",
        "exponential": "mckibben.blocks.memoryless:Exponential",
        "feedforward-feedback": "mckibben.blocks.feedback:FeedforwardFeedback",
        "force-compensator": "mckibben.blocks.coupled.load_estimate:ForceCompensator",
        "force-feedforward": "mckibben.blocks.force.feedforward:ForceFeedforward",
        "fuzzy-network": "mckibben.blocks.coupled.fuzzy_network:FuzzyNetwork",
        "generalized-bouc-wen": ("mckibben.blocks.hysteresis.differential:GeneralizedBoucWen"),
        "gpi": "mckibben.blocks.hysteresis.gpi:GPI",
        "inverse": "mckibben.blocks.inverse:Inverse",
        "krasnoselskii-pokrovskii": ("mckibben.blocks.hysteresis.preisach:KrasnoselskiiPokrovskii"),
        "load-estimate": "mckibben.blocks.coupled.load_estimate:LoadEstimate",
        "logarithm": "mckibben.blocks.memoryless:Logarithm",
        "maxwell-slip": "mckibben.blocks.hysteresis.maxwell_slip:MaxwellSlip",
        "multistate-friction": "mckibben.blocks.force.multistate_friction:MultistateFriction",
        "narx-network": "mckibben.blocks.dynamics.narx:NarxNetwork",
        "narx-polynomial": "mckibben.blocks.dynamics.narx:NarxPolynomial",
        "negative": "mckibben.blocks.memoryless:Negative",
        "parallel": "mckibben.blocks.compose:Parallel",
        "per-channel": "mckibben.blocks.compose:PerChannel",
        "pi": "mckibben.blocks.hysteresis.pi:PI",
        "pid": "mckibben.blocks.feedback:PIDFeedback",
        "piecewise-linear": "mckibben.blocks.memoryless:PiecewiseLinear",
        "play": "mckibben.blocks.hysteresis.play_operators:Play",
        "polynomial": "mckibben.blocks.memoryless:Polynomial",
        "polynomial-force": "mckibben.blocks.force.laws:PolynomialForce",
        "predictive": "mckibben.blocks.predictive:Predictive",
        "preisach": "mckibben.blocks.hysteresis.preisach:Preisach",
        "process-model": "mckibben.blocks.dynamics.process_model:ProcessModel",
        "prompt": "mckibben.blocks.adaptive:Prompt",
        "rate-dependent-pi": "mckibben.blocks.hysteresis.pi:RateDependentPI",
        "recurrent-fuzzy-network": (
            "mckibben.blocks.coupled.recurrent_fuzzy_network:RecurrentFuzzyNetwork"
        ),
        "repetition": "mckibben.blocks.repetition:Repetition",
        "series": "mckibben.blocks.compose:Series",
        "state-network": "mckibben.blocks.dynamics.state_network:StateNetwork",
        "tondu-lopez": "mckibben.blocks.force.laws:TonduLopez",
        "transfer-function": "mckibben.blocks.dynamics.transfer_function:TransferFunction",
    },
    "controllers": {
        "feedforward": "mckibben.control.laws:feedforward",
        "feedforward-pid": "mckibben.control.laws:feedforward_pid",
        "observer": "mckibben.control.laws:observer",
        "pid": "mckibben.control.laws:pid",
    },
    "envelopes": {
        "exponential": "mckibben.blocks.hysteresis.envelopes:Exponential",
        "piecewise-linear": "mckibben.blocks.hysteresis.envelopes:PiecewiseLinear",
        "tanh": "mckibben.blocks.hysteresis.envelopes:Tanh",
    },
    "estimators": {
        "activation-memory": ("mckibben.estimators.force.activation:ActivationMemoryEstimator"),
        "activation-pressure": ("mckibben.estimators.force.activation:ActivationPressureEstimator"),
        "air": "mckibben.estimators.dynamics.air:AirEstimator",
        "armax": "mckibben.estimators.dynamics.linear_models:ARMAXEstimator",
        "arx": "mckibben.estimators.dynamics.linear_models:ARXEstimator",
        "balance": "mckibben.estimators.coupled.balance:BalanceEstimator",
        "balance-force": "mckibben.estimators.coupled.balance_force:BalanceForceEstimator",
        "bj": "mckibben.estimators.dynamics.linear_models:BJEstimator",
        "bouc-wen": "mckibben.estimators.hysteresis.loops:BoucWenEstimator",
        "coupled-memory": "mckibben.estimators.coupled.play_ridge:CoupledMemoryEstimator",
        "coupled-pi": "mckibben.estimators.coupled.sdchm:CoupledPIEstimator",
        "cpi": "mckibben.estimators.hysteresis.creep_pi:CreepPIEstimator",
        "duhem": "mckibben.estimators.hysteresis.loops:DuhemEstimator",
        "eupi": "mckibben.estimators.hysteresis.pi:EUPIEstimator",
        "force-bilinear": "mckibben.estimators.force.laws:BilinearForceEstimator",
        "force-chou": "mckibben.estimators.force.laws:ChouHannafordEstimator",
        "force-minh": "mckibben.estimators.force.laws:MinhForceEstimator",
        "force-petrovic": "mckibben.estimators.force.laws:PetrovicForceEstimator",
        "force-schindele": "mckibben.estimators.force.laws:SchindeleForceEstimator",
        "force-tondu": "mckibben.estimators.force.laws:TonduLopezEstimator",
        "gbw": "mckibben.estimators.hysteresis.loops:GBWEstimator",
        "gpi": "mckibben.estimators.hysteresis.gpi:GPIEstimator",
        "kp": "mckibben.estimators.hysteresis.preisach:KPEstimator",
        "maxwell-slip": "mckibben.estimators.hysteresis.loops:MaxwellSlipEstimator",
        "mms": "mckibben.estimators.hysteresis.loops:MMSEstimator",
        "mpi": "mckibben.estimators.hysteresis.mpi:MPIEstimator",
        "mpi-narmax": "mckibben.estimators.coupled.mpi_narmax:MPINarmaxEstimator",
        "multistate": "mckibben.estimators.force.multistate:EachWayMultistateEstimator",
        "multistate-11": "mckibben.estimators.force.multistate:Multistate11Estimator",
        "multistate-18": "mckibben.estimators.force.multistate:Multistate18Estimator",
        "narx": "mckibben.estimators.dynamics.narx:NarxEstimator",
        "narx-network": "mckibben.estimators.dynamics.narx:NarxNetworkEstimator",
        "narx-play": "mckibben.estimators.dynamics.narx:NarxPlayEstimator",
        "oe": "mckibben.estimators.dynamics.linear_models:OEEstimator",
        "p1": "mckibben.estimators.dynamics.process_model:P1Estimator",
        "p1z": "mckibben.estimators.dynamics.process_model:P1ZEstimator",
        "p2": "mckibben.estimators.dynamics.process_model:P2Estimator",
        "p2u": "mckibben.estimators.dynamics.process_model:P2UEstimator",
        "p2uz": "mckibben.estimators.dynamics.process_model:P2UZEstimator",
        "p2z": "mckibben.estimators.dynamics.process_model:P2ZEstimator",
        "p3": "mckibben.estimators.dynamics.process_model:P3Estimator",
        "pi": "mckibben.estimators.hysteresis.pi:PIEstimator",
        "play-ridge": "mckibben.estimators.coupled.play_ridge:PlayRidgeEstimator",
        "preisach": "mckibben.estimators.hysteresis.preisach:PreisachEstimator",
        "rdpi": "mckibben.estimators.hysteresis.mpi:RDPIEstimator",
        "sdchm": "mckibben.estimators.coupled.sdchm:SDCHMEstimator",
        "sdchm-published": "mckibben.estimators.coupled.sdchm:PublishedSDCHMEstimator",
        "state-network": "mckibben.estimators.dynamics.state_network:StateNetworkEstimator",
        "tsfnn": "mckibben.estimators.coupled.sdchm:TSFNNEstimator",
    },
    "faces": {
        "card": "mckibben.report.notebook:card",
        "lines": "mckibben.report.text:lines_of_result",
        "plot": "mckibben.report.figures:plot",
    },
    "models": {},
    "operations": {
        "simulate": "mckibben.workflow:simulate",
    },
    "papers": {
        "activation-pressure": "mckibben.papers.activation_pressure.run:run",
        "field-models": "mckibben.papers.field_models.run:run",
        "mpi-narmax": "mckibben.papers.mpi_narmax.run:run",
        "multistate-friction": "mckibben.papers.multistate_friction.run:run",
        "sdchm": "mckibben.papers.sdchm.run:run",
    },
    "protocols": {
        "activation-pressure": "mckibben.papers.activation_pressure.protocol:activation_pressure",
        "antagonistic-joint": "mckibben.rigs.protocols.joint:antagonistic_joint",
        "field-models": "mckibben.papers.field_models.protocol:field_models",
        "mpi-narmax": "mckibben.papers.mpi_narmax.protocol:mpi_narmax",
        "multistate-friction": "mckibben.papers.multistate_friction.protocol:multistate_friction",
        "sdchm": "mckibben.papers.sdchm.protocol:sdchm",
        "two-sections": "mckibben.rigs.setups.two_sections:two_sections",
    },
    "readers": {
        "resample": "mckibben.signals:resample",
        "table": "mckibben.files:read",
    },
    "setups": {
        "arm": "mckibben.rigs.setups.arm:Arm",
        "joint": "mckibben.rigs.setups.joint:Joint",
        "moving-end": "mckibben.rigs.setups.moving_end:MovingEnd",
        "test-stand": "mckibben.rigs.setups.test_stand:TestStand",
        "two-sections": "mckibben.rigs.setups.two_sections:TwoSections",
    },
    "signals": {
        "binary-steps": "mckibben.signals.steps:binary_steps",
        "chirp": "mckibben.signals.broadband:chirp",
        "constant": "mckibben.signals.loads:constant",
        "decaying-sine": "mckibben.signals.excitations:decaying_sine",
        "decaying-triangle": "mckibben.signals.excitations:decaying_triangle",
        "irregular-triangle": "mckibben.signals.excitations:irregular_triangle",
        "multisine": "mckibben.signals.broadband:multisine",
        "progressive-sine": "mckibben.signals.excitations:progressive_sine",
        "progressive-triangle": "mckibben.signals.excitations:progressive_triangle",
        "pulls": "mckibben.signals.loads:pulls",
        "ramps": "mckibben.signals.loads:ramps",
        "random-wave": "mckibben.signals.broadband:random_wave",
        "sine": "mckibben.signals.excitations:sine",
        "staircase": "mckibben.signals.steps:staircase",
        "triangle": "mckibben.signals.excitations:triangle",
    },
}
"""Group -> name -> ``"module:attribute"``. Adding a plug-in is one line here.

One of ``models`` is a block, with its estimator in the same module: that of its name, with ``Estimator``
behind.
"""

OF_MODEL = {"blocks": "", "estimators": "Estimator"}
"""Groups to which a model belongs, and the end of the name that it has there."""


def names(group: str) -> tuple[str, ...]:
    """Return the names of all plug-ins of a group, in alphabetical order.

    >>> "gpi" in names("estimators")
    True
    """
    return tuple(sorted(_locations(group)))


def load(group: str, name: str) -> Any:
    """Import and return one plug-in.

    Raises
    ------
    ModelError
        If the group has no plug-in of that name, where the text names what replaced it or lists
        those that there are, or it cannot be imported.
    """
    locations = _locations(group)
    if name not in locations:
        kind = group.removesuffix("s")
        if hint := former([group], name, FORMER_PLUGINS):
            raise ModelError(f"the {kind} {name!r} was removed", remedy=hint)
        close = get_close_matches(str(name).lower().replace("_", "-"), locations, 3, 0.65)
        raise ModelError(
            f"there is no {kind} named {name!r:.60}",
            remedy=f"use {' or '.join(close)}"
            if close
            else f"use one of {', '.join(sorted(locations))}",
        )
    module, _, attribute = locations[name].partition(":")
    try:
        return getattr(import_module(module), attribute)
    except (ImportError, AttributeError, SyntaxError) as error:
        raise ModelError(
            f"{name!r} of the {group} cannot be imported: {error}",
            remedy=f"correct {locations[name]}, or take it out of the registry",
        ) from error


@cache
def _locations(group: str) -> dict[str, str]:
    outside = {entry.name: entry.value for entry in entry_points(group=f"mckibben.{group}")}
    models = _locations("models") if group in OF_MODEL else {}
    locations = {name: f"{module}{OF_MODEL[group]}" for name, module in models.items()}
    return locations | outside | PLUGINS[group]
