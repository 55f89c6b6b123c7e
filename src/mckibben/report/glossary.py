"""The glossary: terms that reports, the workbench and the documentation use, each defined once."""

from __future__ import annotations

CHANNELS = {
    "pressure": "gauge pressure in the muscle [bar]",
    "displacement": "shortening, positive when the muscle contracts [mm]",
    "length": "length of the muscle [mm]; decreases as displacement increases",
    "contraction": "shortening over rest length",
    "force": "pull of the muscle, or load on it [N]",
    "scheduling input": "input that the inverse does not compute: a load, the pressure of an extensor",
}
"""Signals."""

MUSCLES = {
    "braid angle": "angle between braid and axis at rest [rad]",
    "extensor": "muscle that lengthens with pressure; as a backbone, it determines an arm's stiffness",
    "creep": "motion at constant pressure and load",
    "relaxation": "decay of the force at constant length; at constant load it appears as creep",
    "slack": "state of a muscle that is longer than the distance between its ends",
    "coupling": "motion of a muscle caused by the pressures of its neighbours",
    "friction growth": "share of the friction at the highest pressure that grows with pressure: 0 for "
    "constant friction, 1 for friction proportional to pressure",
    "line damping": "damping at rest by air flow between pressure sensor and muscle [N s/mm]",
    "tare": "whether displacement is zero at the start of each recording",
}
"""Muscles and their physics."""

HYSTERESIS = {
    "play operator": "follows its input with a dead zone of twice its threshold",
    "stop operator": "spring in series with Coulomb friction: elastic up to a limit, then slips",
    "threshold": "half the dead zone of an operator, in the unit of the input",
    "weight": "factor of an operator in a sum",
    "envelope": "curve that a generalized operator follows while its input rises, or falls",
    "minor loop": "loop between turning points inside the largest ones",
    "wiping-out": "property of models whose memory is erased by a larger loop",
    "congruency": "property of models whose loops between the same inputs have the same shape",
    "nonlocal memory": "dependence of the future on past turning points, not only on the present state",
}
"""Hysteresis operators and their properties."""

MODELS = {
    "block": "model that runs: an immutable set of parameters with dynamics",
    "estimator": "identifies a block from recordings",
    "compensator": "inverse of a model: desired motion in, pressure out",
    "reachable set": "outputs that an inverse can reach from any state",
    "initial state": "memory before the first sample: from the first measured output, `first_sample` "
    "(the input has only risen), `virgin`, or given",
    "dead time": "constant delay of the output; it has no causal inverse",
    "preview": "time by which a compensator receives its reference early, to cancel dead time",
    "rig": "virtual experiment, whose physics is independent of the models",
    "balance": "model of a muscle as an equilibrium of pressure force, load, elasticity, friction and "
    "relaxation",
    "SDCHM, SDIHC": "stiffness-dependent coupled hysteresis model, and its inverse compensator",
    "GPI, MPI, RDPI, EUPI": "generalized, modified, rate-dependent, and extended unparallel "
    "Prandtl–Ishlinskii model",
    "MPI–NARMAX": "modified Prandtl–Ishlinskii model in a recurrent fuzzy network with a force input",
    "FMU": "functional mock-up unit: a model in a standard format that simulators import",
}
"""Models and their use."""

COMPARISON = {
    "free-run simulation": "simulation from inputs only; no measured output after the first sample",
    "one-step prediction": "prediction from measured past outputs; its errors are smaller",
    "CV RMSE": "geometric mean of errors on parts of the training data left out; it selects the model",
    "validation RMSE": "root-mean-square error on data left out of a fit; it selects the model",
    "fit RMSE": "root-mean-square error on the fitted data",
    "test RMSE": "root-mean-square error on the test data, which are not used in the selection",
    "95 % interval": "confidence interval of the value to its left",
    "minus the chosen’s": "95 % interval of the difference in test RMSE from the chosen model",
    "rank": "order by test RMSE; not used in the selection",
    "inverse": "kind of inverse: exact, solved numerically, or none",
    "worst": "largest absolute error on the test data",
    "R²": "share of the variance of the test output that the model explains",
    "width reproduced": "modelled over measured loop width: 100 % is exact, 0 is no hysteresis",
    "width held": "share of the modelled loop width that remains after a long hold",
    "parameters": "number of identified parameters",
    "fit time": "duration of the fit",
    "step": "duration of one sample in simulation",
}
"""Comparison of models; the columns of a leaderboard."""

SECTIONS = {
    "Signals": CHANNELS,
    "Muscles": MUSCLES,
    "Hysteresis": HYSTERESIS,
    "Models": MODELS,
    "Comparison": COMPARISON,
}
"""All terms by subject."""

COLUMNS = {heading.casefold(): text for heading, text in COMPARISON.items()}


def definition(heading: str) -> str:
    """Return the definition of a leaderboard's column, which may include a unit; empty if there is none.

    >>> definition("Width reproduced [%]")
    'modelled over measured loop width: 100 % is exact, 0 is no hysteresis'
    """
    name = heading.partition(" [")[0].partition(" of ")[0]
    return COLUMNS.get(name.casefold(), "")
