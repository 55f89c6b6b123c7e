"""Every plug-in of the package, one line each: group, name, and where it lives.

A plug-in is imported when it is first asked for, never before. Packages outside this one join by
entry points in the groups ``mckibben.blocks``, ``mckibben.estimators`` and so on.
"""

from __future__ import annotations

from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from typing import Any

from mckibben.errors import ModelError

PLUGINS: dict[str, dict[str, str]] = {
    "blocks": {
        "activation-memory": "mckibben.blocks.force.activation_memory:ActivationMemory",
        "activation-pressure": "mckibben.blocks.force.activation_pressure:ActivationPressure",
        "affine": "mckibben.blocks.affine:Affine",
        "bouc-wen": "mckibben.blocks.differential.bouc_wen:BoucWen",
        "bouc-wen-inverse": "mckibben.blocks.differential.bouc_wen:BoucWenInverse",
        "braid-equilibrium": "mckibben.blocks.braid_equilibrium:BraidEquilibrium",
        "braid-equilibrium-inverse": "mckibben.blocks.braid_equilibrium:BraidEquilibriumInverse",
        "chou-hannaford": "mckibben.blocks.force.chou_hannaford:ChouHannaford",
        "coupled-memory": "mckibben.blocks.coupled_memory:CoupledMemory",
        "coupling": "mckibben.blocks.coupling:Coupling",
        "creep": "mckibben.blocks.creep:Creep",
        "creep-inverse": "mckibben.blocks.creep:CreepInverse",
        "duhem": "mckibben.blocks.differential.duhem:Duhem",
        "duhem-inverse": "mckibben.blocks.differential.duhem:DuhemInverse",
        "eupi": "mckibben.blocks.eupi:EUPI",
        "eupi-inverse": "mckibben.blocks.eupi:EUPIInverse",
        "exponential": "mckibben.blocks.logarithm:Exponential",
        "feedforward-feedback": "mckibben.blocks.feedforward_feedback:FeedforwardFeedback",
        "force-balance": "mckibben.blocks.force_balance:ForceBalance",
        "force-balance-inverse": "mckibben.blocks.force_balance:ForceBalanceInverse",
        "force-feedforward": "mckibben.blocks.force.feedforward:ForceFeedforward",
        "fuzzy-network": "mckibben.blocks.fuzzy_network:FuzzyNetwork",
        "fuzzy-network-inverse": "mckibben.blocks.fuzzy_network:FuzzyNetworkInverse",
        "generalized-bouc-wen": (
            "mckibben.blocks.differential.generalized_bouc_wen:GeneralizedBoucWen"
        ),
        "generalized-bouc-wen-inverse": (
            "mckibben.blocks.differential.generalized_bouc_wen:GeneralizedBoucWenInverse"
        ),
        "gpi": "mckibben.blocks.gpi:GPI",
        "gpi-inverse": "mckibben.blocks.gpi:GPIInverse",
        "krasnoselskii-pokrovskii": (
            "mckibben.blocks.krasnoselskii_pokrovskii:KrasnoselskiiPokrovskii"
        ),
        "krasnoselskii-pokrovskii-inverse": (
            "mckibben.blocks.krasnoselskii_pokrovskii:KrasnoselskiiPokrovskiiInverse"
        ),
        "logarithm": "mckibben.blocks.logarithm:Logarithm",
        "maxwell-slip": "mckibben.blocks.maxwell_slip:MaxwellSlip",
        "maxwell-slip-inverse": "mckibben.blocks.maxwell_slip:MaxwellSlipInverse",
        "multistate-friction": "mckibben.blocks.force.multistate_friction:MultistateFriction",
        "narx-network": "mckibben.blocks.dynamic.narx_network:NarxNetwork",
        "narx-polynomial": "mckibben.blocks.dynamic.narx_polynomial:NarxPolynomial",
        "negative": "mckibben.blocks.negative:Negative",
        "parallel": "mckibben.blocks.compose:Parallel",
        "per-channel": "mckibben.blocks.compose:PerChannel",
        "pi": "mckibben.blocks.pi:PI",
        "pi-inverse": "mckibben.blocks.pi:PIInverse",
        "pid": "mckibben.blocks.pid:PIDFeedback",
        "piecewise-linear": "mckibben.blocks.piecewise_linear:PiecewiseLinear",
        "play": "mckibben.blocks.play:Play",
        "polynomial": "mckibben.blocks.polynomial:Polynomial",
        "polynomial-force": "mckibben.blocks.force.polynomial_force:PolynomialForce",
        "polynomial-inverse": "mckibben.blocks.polynomial:PolynomialInverse",
        "preisach": "mckibben.blocks.preisach:Preisach",
        "preisach-inverse": "mckibben.blocks.preisach:PreisachInverse",
        "process-model": "mckibben.blocks.dynamic.process_model:ProcessModel",
        "rate-dependent-pi": "mckibben.blocks.rate_dependent_pi:RateDependentPI",
        "rate-dependent-pi-inverse": "mckibben.blocks.rate_dependent_pi:RateDependentPIInverse",
        "recurrent-fuzzy-network": (
            "mckibben.blocks.recurrent_fuzzy_network:RecurrentFuzzyNetwork"
        ),
        "series": "mckibben.blocks.compose:Series",
        "tondu-lopez": "mckibben.blocks.force.tondu_lopez:TonduLopez",
        "transfer-function": "mckibben.blocks.dynamic.transfer_function:TransferFunction",
    },
    "coupled": {
        "coupled-memory": "mckibben.estimators.coupled.memory:CoupledMemoryEstimator",
        "coupled-pi": "mckibben.estimators.coupled.sdchm:CoupledPIEstimator",
        "force-balance": "mckibben.estimators.coupled.force_balance:ForceBalanceEstimator",
        "mpi-narmax": "mckibben.estimators.coupled.mpi_narmax:MPINarmaxEstimator",
        "sdchm": "mckibben.estimators.coupled.sdchm:SDCHMEstimator",
        "sdchm-published": "mckibben.estimators.coupled.sdchm:PublishedSDCHMEstimator",
        "tsfnn": "mckibben.estimators.coupled.sdchm:TSFNNEstimator",
    },
    "envelopes": {
        "exponential": "mckibben.blocks.envelopes.exponential:Exponential",
        "piecewise-linear": "mckibben.blocks.envelopes.piecewise_linear:PiecewiseLinear",
        "tanh": "mckibben.blocks.envelopes.tanh:Tanh",
    },
    "estimators": {
        "activation-memory": (
            "mckibben.estimators.force.activation_memory:ActivationMemoryEstimator"
        ),
        "activation-pressure": (
            "mckibben.estimators.force.activation_pressure:ActivationPressureEstimator"
        ),
        "armax": "mckibben.estimators.linear.models:ARMAXEstimator",
        "arx": "mckibben.estimators.linear.models:ARXEstimator",
        "bj": "mckibben.estimators.linear.models:BoxJenkinsEstimator",
        "bouc-wen": "mckibben.estimators.bouc_wen:BoucWenEstimator",
        "cpi": "mckibben.estimators.creep_pi:CreepPIEstimator",
        "duhem": "mckibben.estimators.duhem:DuhemEstimator",
        "eupi": "mckibben.estimators.eupi:EUPIEstimator",
        "force-bilinear": "mckibben.estimators.force.static:BilinearForceEstimator",
        "force-chou": "mckibben.estimators.force.static:ChouHannafordEstimator",
        "force-minh": "mckibben.estimators.force.static:MinhForceEstimator",
        "force-petrovic": "mckibben.estimators.force.static:PetrovicForceEstimator",
        "force-schindele": "mckibben.estimators.force.static:SchindeleForceEstimator",
        "force-tondu": "mckibben.estimators.force.static:TonduLopezEstimator",
        "gbw": "mckibben.estimators.generalized_bouc_wen:GeneralizedBoucWenEstimator",
        "gpi": "mckibben.estimators.gpi:GPIEstimator",
        "grey-box": "mckibben.estimators.grey_box:GreyBoxEstimator",
        "kp": "mckibben.estimators.preisach:KrasnoselskiiPokrovskiiEstimator",
        "maxwell-slip": "mckibben.estimators.maxwell_slip:MaxwellSlipEstimator",
        "mms": "mckibben.estimators.maxwell_slip:ModifiedMaxwellSlipEstimator",
        "mpi": "mckibben.estimators.mpi:MPIEstimator",
        "multistate": "mckibben.estimators.force.multistate:MultistateEachWayEstimator",
        "multistate-11": "mckibben.estimators.force.multistate:MultistateEstimator",
        "multistate-18": "mckibben.estimators.force.multistate:MultistateEighteenEstimator",
        "narx": "mckibben.estimators.narx.polynomial:NarxPolynomialEstimator",
        "narx-network": "mckibben.estimators.narx.network:NarxNetworkEstimator",
        "narx-play": "mckibben.estimators.narx.polynomial:NarxPlayEstimator",
        "oe": "mckibben.estimators.linear.models:OutputErrorEstimator",
        "p1": "mckibben.estimators.linear.process:P1Estimator",
        "p1z": "mckibben.estimators.linear.process:P1ZEstimator",
        "p2": "mckibben.estimators.linear.process:P2Estimator",
        "p2u": "mckibben.estimators.linear.process:P2UEstimator",
        "p2uz": "mckibben.estimators.linear.process:P2UZEstimator",
        "p2z": "mckibben.estimators.linear.process:P2ZEstimator",
        "p3": "mckibben.estimators.linear.process:P3Estimator",
        "pi": "mckibben.estimators.pi:PIEstimator",
        "preisach": "mckibben.estimators.preisach:PreisachEstimator",
        "rdpi": "mckibben.estimators.rdpi:RDPIEstimator",
    },
    "papers": {
        "activation-pressure": "mckibben.papers.activation_pressure:activation_pressure",
        "field-models": "mckibben.papers.field_models:field_models",
        "mpi-narmax": "mckibben.papers.mpi_narmax:mpi_narmax",
        "multistate-friction": "mckibben.papers.multistate_friction:multistate_friction",
        "sdchm": "mckibben.papers.sdchm:sdchm",
    },
    "protocols": {
        "activation-pressure": "mckibben.signals.protocols.activation_pressure:activation_pressure",
        "field-models": "mckibben.signals.protocols.field_models:field_models",
        "mpi-narmax": "mckibben.signals.protocols.mpi_narmax:mpi_narmax",
        "multistate": "mckibben.signals.protocols.multistate:multistate",
        "sdchm": "mckibben.signals.protocols.sdchm:sdchm",
    },
    "published": {
        "activation-pressure-profile": (
            "mckibben.blocks.published.activation_pressure:activation_pressure"
        ),
        "field-models-p2uz": "mckibben.blocks.published.field_models:process_model",
        "field-models-pi": "mckibben.blocks.published.field_models:prandtl_ishlinskii",
        "mpi-narmax-mpi": "mckibben.blocks.published.mpi_narmax:modified_prandtl_ishlinskii",
        "multistate-friction": "mckibben.blocks.published.multistate:multistate_friction",
        "multistate-static-force": "mckibben.blocks.published.multistate:static_force",
        "sdchm-coupling": "mckibben.blocks.published.coupling:coupling",
    },
    "setups": {
        "arm": "mckibben.rigs.setups.arm:Arm",
        "moving-end": "mckibben.rigs.setups.moving_end:MovingEnd",
        "test-stand": "mckibben.rigs.setups.test_stand:TestStand",
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
        "random-steps": "mckibben.signals.steps:random_steps",
        "random-wave": "mckibben.signals.broadband:random_wave",
        "sine": "mckibben.signals.excitations:sine",
        "staircase": "mckibben.signals.steps:staircase",
        "triangle": "mckibben.signals.excitations:triangle",
    },
}
"""Group -> name -> ``"module:attribute"``. Adding a plug-in is one line here."""


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
        If the group has no plug-in of that name; the text lists those it has.
    """
    locations = _locations(group)
    if name not in locations:
        raise ModelError(
            f"there is no {group[:-1] if group.endswith('s') else group} named {name!r}. "
            f"Remedy: use one of {', '.join(sorted(locations))}."
        )
    module, _, attribute = locations[name].partition(":")
    return getattr(import_module(module), attribute)


@cache
def _locations(group: str) -> dict[str, str]:
    outside = {entry.name: entry.value for entry in entry_points(group=f"mckibben.{group}")}
    return outside | PLUGINS[group]
