"""Every plug-in of the package, one line each: group, name, and where it lives, or a preset of one.

A plug-in is imported when it is first asked for, never before. Packages outside this one join by
entry points in the groups ``mckibben.blocks``, ``mckibben.estimators`` and so on.
"""

from __future__ import annotations

from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from typing import Any

from mckibben.errors import ModelError
from mckibben.presets import Chosen, Preset, preset

LINEAR = "mckibben.estimators.linear.models:PredictionErrorEstimator"
PROCESS = "mckibben.estimators.linear.process:ProcessModelEstimator"
FORCE_LAW = "mckibben.estimators.force.static:PolynomialForceEstimator"
MULTISTATE = "mckibben.estimators.force.multistate:MultistateEstimator"
GRID = "mckibben.estimators.preisach_type.preisach:GridEstimator"
SLIP = "mckibben.estimators.play_type.maxwell_slip:MaxwellSlipEstimator"
NARX = "mckibben.estimators.narx.polynomial:NarxPolynomialEstimator"
PLAY_RIDGE = "mckibben.estimators.coupled.play_ridge:PlayRidgeEstimator"
SDCHM = "mckibben.estimators.coupled.sdchm:SDCHMEstimator"

PLUGINS: dict[str, dict[str, str | Preset]] = {
    "blocks": {
        "activation-memory": "mckibben.blocks.force.activation_memory:ActivationMemory",
        "activation-pressure": "mckibben.blocks.force.activation_pressure:ActivationPressure",
        "adaptive": "mckibben.blocks.adaptive.adaptive:Adaptive",
        "adaptive-series": "mckibben.blocks.adaptive.adaptive_series:AdaptiveSeries",
        "affine": "mckibben.blocks.memoryless.affine:Affine",
        "air": "mckibben.blocks.dynamic.air:Air",
        "balance": "mckibben.blocks.coupled.balance:Balance",
        "band": "mckibben.blocks.bands.band:Band",
        "banded": "mckibben.blocks.bands.banded:Banded",
        "bouc-wen": "mckibben.blocks.differential.bouc_wen:BoucWen",
        "bouc-wen-oscillator": (
            "mckibben.blocks.differential.bouc_wen_oscillator:BoucWenOscillator"
        ),
        "braid-equilibrium": "mckibben.blocks.force.braid_equilibrium:BraidEquilibrium",
        "chou-hannaford": "mckibben.blocks.force.chou_hannaford:ChouHannaford",
        "contact": "mckibben.blocks.memoryless.contact:Contact",
        "coupled-memory": "mckibben.blocks.coupled.coupled_memory:CoupledMemory",
        "coupling": "mckibben.blocks.coupled.coupling:Coupling",
        "creep": "mckibben.blocks.dynamic.creep:Creep",
        "duhem": "mckibben.blocks.differential.duhem:Duhem",
        "duhem-oscillator": "mckibben.blocks.differential.duhem_oscillator:DuhemOscillator",
        "eupi": "mckibben.blocks.play_type.eupi:EUPI",
        "exponential": "mckibben.blocks.memoryless.logarithm:Exponential",
        "feedforward-feedback": "mckibben.blocks.feedback.feedforward_feedback:FeedforwardFeedback",
        "force-balance": "mckibben.blocks.coupled.force_balance:ForceBalance",
        "force-feedforward": "mckibben.blocks.force.feedforward:ForceFeedforward",
        "fuzzy-network": "mckibben.blocks.coupled.fuzzy_network:FuzzyNetwork",
        "generalized-bouc-wen": (
            "mckibben.blocks.differential.generalized_bouc_wen:GeneralizedBoucWen"
        ),
        "gpi": "mckibben.blocks.play_type.gpi:GPI",
        "inverse": "mckibben.blocks.core.inverse:Inverse",
        "krasnoselskii-pokrovskii": (
            "mckibben.blocks.preisach_type.krasnoselskii_pokrovskii:KrasnoselskiiPokrovskii"
        ),
        "load-estimate": "mckibben.blocks.coupled.load_estimate:LoadEstimate",
        "logarithm": "mckibben.blocks.memoryless.logarithm:Logarithm",
        "maxwell-slip": "mckibben.blocks.play_type.maxwell_slip:MaxwellSlip",
        "multistate-friction": "mckibben.blocks.force.multistate_friction:MultistateFriction",
        "narx-network": "mckibben.blocks.dynamic.narx_network:NarxNetwork",
        "narx-polynomial": "mckibben.blocks.dynamic.narx_polynomial:NarxPolynomial",
        "negative": "mckibben.blocks.memoryless.negative:Negative",
        "parallel": "mckibben.blocks.compose:Parallel",
        "per-channel": "mckibben.blocks.compose:PerChannel",
        "pi": "mckibben.blocks.play_type.pi:PI",
        "pid": "mckibben.blocks.feedback.pid:PIDFeedback",
        "piecewise-linear": "mckibben.blocks.memoryless.piecewise_linear:PiecewiseLinear",
        "play": "mckibben.blocks.play_type.play:Play",
        "polynomial": "mckibben.blocks.memoryless.polynomial:Polynomial",
        "polynomial-force": "mckibben.blocks.force.polynomial_force:PolynomialForce",
        "predictive": "mckibben.blocks.predictive.predictive:Predictive",
        "preisach": "mckibben.blocks.preisach_type.preisach:Preisach",
        "process-model": "mckibben.blocks.dynamic.process_model:ProcessModel",
        "rate-dependent-pi": "mckibben.blocks.play_type.rate_dependent_pi:RateDependentPI",
        "recurrent-fuzzy-network": (
            "mckibben.blocks.coupled.recurrent_fuzzy_network:RecurrentFuzzyNetwork"
        ),
        "series": "mckibben.blocks.compose:Series",
        "state-network": "mckibben.blocks.dynamic.state_network:StateNetwork",
        "tondu-lopez": "mckibben.blocks.force.tondu_lopez:TonduLopez",
        "transfer-function": "mckibben.blocks.dynamic.transfer_function:TransferFunction",
    },
    "controllers": {
        "feedforward": "mckibben.control.laws:feedforward",
        "feedforward-pid": "mckibben.control.laws:feedforward_pid",
        "observer": "mckibben.control.laws:observer",
        "pid": "mckibben.control.laws:pid",
    },
    "envelopes": {
        "exponential": "mckibben.blocks.play_type.envelopes.exponential:Exponential",
        "piecewise-linear": "mckibben.blocks.play_type.envelopes.piecewise_linear:PiecewiseLinear",
        "tanh": "mckibben.blocks.play_type.envelopes.tanh:Tanh",
    },
    "estimators": {
        "activation-memory": (
            "mckibben.estimators.force.activation_memory:ActivationMemoryEstimator"
        ),
        "activation-pressure": (
            "mckibben.estimators.force.activation_pressure:ActivationPressureEstimator"
        ),
        "air": "mckibben.estimators.dynamic.air:AirEstimator",
        "armax": preset(
            LINEAR, "ARMAX model, A y = B u + C e.", n_noise=2, effort=1.0, several=False
        ),
        "arx": preset(LINEAR, "ARX model, A y = B u + e, by linear least squares."),
        "balance": "mckibben.estimators.coupled.balance:BalanceEstimator",
        "balance-force": "mckibben.estimators.coupled.balance_force:BalanceForceEstimator",
        "bj": preset(
            LINEAR,
            "Box-Jenkins model, y = B / F u + C / D e; second order each by default.",
            shared_poles=False,
            n_noise=2,
            n_noise_poles=2,
            effort=1.0,
            several=False,
        ),
        "bouc-wen": "mckibben.estimators.differential.bouc_wen:BoucWenEstimator",
        "bouc-wen-oscillator": (
            "mckibben.estimators.differential.bouc_wen_oscillator:BoucWenOscillatorEstimator"
        ),
        "coupled-memory": preset(
            PLAY_RIDGE,
            "Lags and play operators of several muscles, with one penalty that is given.",
            alone=False,
            needs_time=True,
            lags=(0.3, 1.0, 8.0),
            ridge=1e-4,
        ),
        "coupled-pi": preset(
            SDCHM,
            "Hysteresis of every muscle and a coupling, whatever the stiffness: a baseline.",
            memory="gpi",
            n_sets=0,
            n_friction=0,
        ),
        "cpi": "mckibben.estimators.play_type.creep_pi:CreepPIEstimator",
        "duhem": "mckibben.estimators.differential.duhem:DuhemEstimator",
        "duhem-oscillator": (
            "mckibben.estimators.differential.duhem_oscillator:DuhemOscillatorEstimator"
        ),
        "eupi": "mckibben.estimators.play_type.eupi:EUPIEstimator",
        "force-bilinear": preset(FORCE_LAW, "The bilinear-quadratic law.", law="bilinear"),
        "force-chou": "mckibben.estimators.force.static:ChouHannafordEstimator",
        "force-minh": preset(
            FORCE_LAW,
            "Minh's law: cubic in length, with coefficients linear in pressure.",
            law="minh",
        ),
        "force-petrovic": preset(
            FORCE_LAW,
            "Petrovic's polynomial: quadratic in length with pressure, and without.",
            law="petrovic",
        ),
        "force-schindele": preset(
            FORCE_LAW,
            "Schindele and Aschemann's polynomials: cubic with pressure, of fourth order without.",
            law="schindele",
        ),
        "force-tondu": "mckibben.estimators.force.static:TonduLopezEstimator",
        "gbw": "mckibben.estimators.differential.generalized_bouc_wen:GeneralizedBoucWenEstimator",
        "gpi": "mckibben.estimators.play_type.gpi:GPIEstimator",
        "kp": preset(
            GRID,
            "Krasnosel'skii-Pokrovskii model by (non-negative) least squares on its operators.",
            relays="gradual",
        ),
        "maxwell-slip": preset(SLIP, "Maxwell-slip model by least squares.", asymmetric=False),
        "mms": preset(
            SLIP,
            "Modified Maxwell-slip model: the two ratios of its directions are searched.",
            asymmetric=True,
            effort=0.5,
        ),
        "mpi": "mckibben.estimators.play_type.mpi:MPIEstimator",
        "mpi-narmax": "mckibben.estimators.coupled.mpi_narmax:MPINarmaxEstimator",
        "multistate": preset(
            MULTISTATE,
            "Multistate friction with one shared element and one for each direction: "
            "eleven parameters.",
            elements="each-way",
            effort=3.0,
        ),
        "multistate-11": preset(
            MULTISTATE,
            "Multistate friction by bounded least squares from many starts, and exchange of elements.",
            elements="eleven",
        ),
        "multistate-18": preset(
            MULTISTATE,
            "Multistate friction with three elements in both directions: eighteen parameters.",
            elements="eighteen",
        ),
        "narx": NARX,
        "narx-network": "mckibben.estimators.narx.network:NarxNetworkEstimator",
        "narx-play": preset(
            NARX,
            "Polynomial NARX model with play operators among its regressors, so that it keeps its "
            "branch.",
            output_lags=1,
            input_lags=1,
            n_play=6,
            effort=0.2,
        ),
        "oe": preset(
            LINEAR,
            "Output-error model, y = B / F u + e: the best free run of its orders.",
            shared_poles=False,
            effort=0.8,
        ),
        "p1": preset(PROCESS, "One lag.", structure="P1"),
        "p1z": preset(PROCESS, "One lag and a zero.", structure="P1Z"),
        "p2": preset(PROCESS, "Two lags.", structure="P2"),
        "p2u": preset(PROCESS, "Two poles that may oscillate.", structure="P2U"),
        "p2uz": preset(PROCESS, "Two poles that may oscillate, and a zero.", structure="P2UZ"),
        "p2z": preset(PROCESS, "Two lags and a zero.", structure="P2Z"),
        "p3": preset(PROCESS, "Three lags.", structure="P3"),
        "pi": "mckibben.estimators.play_type.pi:PIEstimator",
        "play-ridge": PLAY_RIDGE,
        "preisach": preset(
            GRID, "Preisach model by (non-negative) least squares on its cells.", relays="sudden"
        ),
        "rdpi": "mckibben.estimators.play_type.rdpi:RDPIEstimator",
        "sdchm": SDCHM,
        "sdchm-published": preset(
            SDCHM,
            "SDCHM as its paper identifies it: GPI, coupling, and a network trained by particle swarm.",
            effort=25.0,
            constants=False,
            method="pso",
            ridge=1e-9,
            memory="gpi",
            memory_settings={"threshold_rule": "paper", "initial": "virgin"},
            n_friction=0,
        ),
        "state-network": "mckibben.estimators.dynamic.state_network:StateNetworkEstimator",
        "tsfnn": "mckibben.estimators.coupled.sdchm:TSFNNEstimator",
    },
    "faces": {
        "block": "mckibben.report.notebook.models:BlockFace",
        "characterization": "mckibben.report.notebook.findings:CharacterizationFace",
        "leaderboard": "mckibben.report.notebook.boards:LeaderboardFace",
        "recording": "mckibben.report.notebook.recordings:RecordingFace",
        "review": "mckibben.report.notebook.findings:ReviewFace",
        "rig": "mckibben.report.notebook.rigs:RigFace",
        "study": "mckibben.report.notebook.boards:StudyFace",
        "tracked": "mckibben.report.notebook.findings:TrackedFace",
        "validation": "mckibben.report.notebook.findings:ValidationFace",
    },
    "papers": {
        "activation-pressure": "mckibben.papers.activation_pressure.rerun:activation_pressure",
        "field-models": "mckibben.papers.field_models.rerun:field_models",
        "mpi-narmax": "mckibben.papers.mpi_narmax.rerun:mpi_narmax",
        "multistate-friction": "mckibben.papers.multistate_friction.rerun:multistate_friction",
        "sdchm": "mckibben.papers.sdchm.rerun:sdchm",
    },
    "protocols": {
        "activation-pressure": "mckibben.papers.activation_pressure.protocol:activation_pressure",
        "field-models": "mckibben.papers.field_models.protocol:field_models",
        "mpi-narmax": "mckibben.papers.mpi_narmax.protocol:mpi_narmax",
        "multistate-friction": "mckibben.papers.multistate_friction.protocol:multistate_friction",
        "sdchm": "mckibben.papers.sdchm.protocol:sdchm",
    },
    "published": {
        "activation-pressure-profile": (
            "mckibben.papers.activation_pressure.published:activation_pressure"
        ),
        "field-models-p2uz": "mckibben.papers.field_models.published:process_model",
        "field-models-pi": "mckibben.papers.field_models.published:prandtl_ishlinskii",
        "mpi-narmax-mpi": "mckibben.papers.mpi_narmax.published:modified_prandtl_ishlinskii",
        "multistate-friction": "mckibben.papers.multistate_friction.published:multistate_friction",
        "multistate-static-force": "mckibben.papers.multistate_friction.published:static_force",
        "sdchm-coupling": "mckibben.papers.sdchm.published:coupling",
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
"""Group -> name -> ``"module:attribute"``, or a preset. Adding a plug-in is one line here."""

REPLACED: dict[str, dict[str, str]] = {
    "estimators": {"force-balance": "balance", "grey-box": "balance"},
}
"""Group -> name that is gone -> name of what does its work."""


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
        successor = REPLACED.get(group, {}).get(name)
        if successor is not None:
            raise ModelError(f"the {kind} {name!r} is gone. Remedy: use {successor!r} instead.")
        raise ModelError(
            f"there is no {kind} named {name!r}. Remedy: use one of {', '.join(sorted(locations))}."
        )
    found: Any = locations[name]
    if isinstance(found, str):
        module, _, attribute = found.partition(":")
        try:
            found = getattr(import_module(module), attribute)
        except (ImportError, AttributeError, SyntaxError) as error:
            raise ModelError(
                f"{name!r} of the {group} cannot be imported: {error}. Remedy: mend "
                f"{locations[name]}, or take it out of the registry."
            ) from error
    return Chosen(name, found) if isinstance(found, Preset) else found


@cache
def _locations(group: str) -> dict[str, str | Preset]:
    outside: dict[str, str | Preset] = {
        entry.name: entry.value for entry in entry_points(group=f"mckibben.{group}")
    }
    return outside | PLUGINS[group]
