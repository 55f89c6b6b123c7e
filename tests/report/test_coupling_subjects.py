from __future__ import annotations

import numpy as np

from mckibben.recording import Recording
from mckibben.report import coupling_subjects


def arm(shared: bool = False) -> Recording:
    rng = np.random.default_rng(0)
    a, b = rng.uniform(0, 2, (2, 400))
    b = a if shared else b
    names = ("u1", "u2", "y1", "y2")
    values = (a, b, 3 * a, 5 * b + a)
    units = dict(zip(names, ("bar", "bar", "mm", "mm"), strict=True))
    return Recording(dict(zip(names, values, strict=True)), 0.01, units)


def test_effects_are_those_of_inputs_over_their_ranges() -> None:
    found = coupling_subjects.coupling([arm()], ("u1", "u2"), ("y1", "y2"))
    np.testing.assert_allclose(found.effects, [[6, 0], [2, 10]], atol=0.1)
    assert found.own("y2") == "u2"
    assert len(coupling_subjects.matrix(arm(), found).panels) == 4


def held(channel: str) -> Recording:
    """Return the arm with an input that rests."""
    values = {name: arm()[name] for name in arm().channels}
    return Recording(values | {channel: np.zeros(400)}, 0.01, arm().units)


def test_an_output_is_drawn_over_an_input_that_moves_where_it_is_drawn() -> None:
    runs = [held("u1"), held("u2")]
    found = coupling_subjects.coupling(runs, ("u1", "u2"), ("y1", "y2"))
    assert found.pairs(runs) == (("u1", "y1"), ("u2", "y2"))
    assert found.pairs(runs[:1]) == (("u2", "y1"), ("u2", "y2"))
    assert found.pairs(runs[1:]) == (("u1", "y1"), ("u1", "y2"))
    colours = [panel.curves[0].colour for panel in coupling_subjects.matrix(runs[1], found).panels]
    assert colours == ["series-1", "input", "series-1", "input"]
    most = coupling_subjects.coupling([arm()], ("u1", "u2"), ("y2",))
    assert most.pairs([arm()]) == (("u2", "y2"),)
    assert most.pairs([held("u2")]) == (("u1", "y2"),)


def test_where_the_input_is_held_what_else_drives_is_drawn_over() -> None:
    wave = np.sin(np.arange(100) / 5)
    values = {"displacement": np.zeros(100), "pressure": wave, "force": 3 * wave}
    found = coupling_subjects.coupling([Recording(values, 0.1)], ("displacement",), ("force",))
    assert found.pairs([Recording(values, 0.1)]) == (("pressure", "force"),)
    rest = Recording(values | {"pressure": np.zeros(100)}, 0.1)
    assert found.pairs([rest]) == (("displacement", "force"),)


def test_inputs_that_move_together_have_no_effects_of_their_own() -> None:
    found = coupling_subjects.coupling([arm(shared=True)], ("u1", "u2"), ("y1", "y2"))
    assert np.isnan(found.effects).all()


def test_a_loop_is_coloured_by_a_third_channel() -> None:
    panel = coupling_subjects.loop_by([arm()], "u1", "y2", "u2").panels[0]
    assert len(panel.curves) == 5
    assert panel.x_label == "u1 [bar]"


def test_loops_under_loads_that_are_held_are_one_picture() -> None:
    wave = np.sin(np.arange(100) / 5)
    runs = [
        Recording({"pressure": wave, "displacement": wave - load, "force": np.full(100, load)}, 0.1)
        for load in (0.0, 10.0, 20.0)
    ]
    (panel,) = coupling_subjects.loop_by(runs, "pressure", "displacement", "force").panels
    assert [curve.name for curve in panel.curves] == ["force 0 N", "force 10 N", "force 20 N"]
    for curve, load in zip(panel.curves, (0.0, 10.0, 20.0), strict=True):
        np.testing.assert_allclose(curve.y, curve.x - load)


def test_what_moves_what_is_said_most_first() -> None:
    first, second = coupling_subjects.coupling([arm()], ("u1", "u2"), ("y1", "y2")).sentences
    assert first.startswith("u1 moves y1 by 5.9")
    assert second.startswith("u2 moves y2 by ")
    assert ", u1 by 1.99 mm; 0 % of its variance is bent" in second
    together = coupling_subjects.coupling([arm(shared=True)], ("u1", "u2"), ("y1",))
    assert together.sentences == ("What moves y1 cannot be told: inputs move together.",)


def test_the_recording_in_which_all_inputs_move_is_drawn() -> None:
    wave = np.sin(np.arange(100) / 5)
    runs = [
        Recording({"pressure_1": a * wave, "pressure_2": b * wave, "displacement_1": wave}, 0.1)
        for a, b in ((3.0, 0.0), (1.0, 2.0), (0.5, 3.0))
    ]
    assert coupling_subjects.fullest(runs, ["pressure_1", "pressure_2"]) is runs[1]
