"""How far parameters may go at nearly the same error."""

from __future__ import annotations

from typing import Any

import numpy as np

from mckibben import Recording
from mckibben.blocks.force.laws import PolynomialForce
from mckibben.blocks.force.multistate_friction import ELEVEN, MultistateFriction
from mckibben.estimators.core.ranges import parameter_ranges
from mckibben.registry import load


def test_ranges_of_a_linear_model_are_those_of_least_squares() -> None:
    rng = np.random.default_rng(0)
    x, p = rng.uniform(0, 5, 400), rng.uniform(0, 4, 400)
    columns = np.column_stack([p, p * x, np.ones(400), x])
    force = columns @ [50.0, 5.0, 30.0, 7.0] + 2.0 * rng.standard_normal(400)
    given = Recording({"length": x, "pressure": p, "force": force}, 0.1)
    best, (squares, *_) = np.linalg.lstsq(columns, force)[:2]
    spread = np.sqrt((1.05**2 - 1) * squares * np.diag(np.linalg.inv(columns.T @ columns)))
    # started a little off: what is nearly as good is counted from the best there is
    block = PolynomialForce(tuple(1.01 * best[:2]), tuple(best[2:]))
    found = parameter_ranges(block, given, share=0.05)
    np.testing.assert_allclose(np.log(found[:, 0]), np.log(best - spread), atol=0.01)
    np.testing.assert_allclose(np.log(found[:, 1]), np.log(best + spread), atol=0.01)


def stick() -> Recording:
    """Return slow loops through which a stiff damper cannot be seen, and one limit is not reached."""
    time = np.arange(750) * 0.02
    length = 195.0 + 5.0 * np.cos(2 * np.pi * time / 10)
    given = Recording({"length": length, "pressure": np.full(750, 4.0)}, 0.02)
    truth = MultistateFriction(
        ELEVEN,
        (*(7.0, 1e-3, 25.0, 1e-3, 30.0), *(12.0, 1e-3, 20.0), *(5.0, 1e-3, 500.0)),
        initial="virgin",
    )
    noise = 0.5 * np.random.default_rng(1).standard_normal(750)
    return given.with_channels(force=truth.simulate(given)["force"] + noise)


def test_what_the_loops_do_not_determine_is_open() -> None:
    recording = stick()
    settings: Any = {"static": None, "n_refined": 1, "n_starts": 8}
    estimator = load("estimators", "multistate-11")(input="length", output="force", **settings)
    fitted = estimator.fit(recording).model_
    k, sigma = "element 1: k [N/mm]", "element 1, lengthening: sigma [N s/mm]"
    open_ones = {fitted.parameter_names[place] for place in estimator.undetermined()}
    assert sigma in open_ones
    assert k not in open_ones
    ranges = parameter_ranges(fitted, recording).tolist()
    known = dict(zip(fitted.parameter_names, ranges, strict=True))
    assert known[k][1] < 1.2 * known[k][0]
    assert known[sigma][0] == 0.0
