from __future__ import annotations

import numpy as np

from mckibben.report.shown import MOST_RECORDINGS, drawn, shown
from tests.report.studies_by_hand import measured, study


def test_a_recording_with_a_held_out_part_is_shown_once_with_its_start() -> None:
    whole = measured(400)
    (one,) = shown(study((whole.slice(0, 300),), (whole,)))
    assert one.test_from == 300
    assert all(output.shape == (400,) for output in one.outputs.values())


def test_recordings_of_their_own_are_all_shown_tested_ones_first() -> None:
    train = (measured(400), measured(300, seed=2, name="second"))
    test = (measured(200, seed=1, name="third"),)
    found = shown(study(train, test))
    assert [one.recording.name for one in found] == ["third", "muscle", "second"]
    assert [one.role for one in found] == ["test", "fit", "fit"]
    assert [len(one.outputs["gpi"]) for one in found] == [200, 400, 300]


def test_alike_names_do_not_make_one_recording_part_of_another() -> None:
    long, short = measured(400), measured(300, seed=5)
    found = shown(study((short,), (long,)))
    assert [one.test_from for one in found] == [None, None]


def test_outputs_belong_to_their_recording_and_are_ranked() -> None:
    one = study((measured(400),), (measured(200, seed=1, name="other"),))
    first, second = shown(one)
    assert list(first.outputs) == [row.model for row in one.leaderboard.rows if row.block]
    np.testing.assert_array_equal(first.outputs["pi"], one.predictions["pi"][1][:, 0])
    np.testing.assert_array_equal(second.outputs["pi"], one.predictions["pi"][0][:, 0])


def test_recordings_tested_on_are_drawn_first_and_then_the_longest() -> None:
    train = tuple(measured(100 + 10 * k, seed=k, name=f"run {k}") for k in range(8))
    found = drawn(shown(study(train, (measured(100, seed=9, name="tested"),))))
    assert len(found) == MOST_RECORDINGS
    names = [one.recording.name for one in found]
    assert names == ["tested", "run 7", "run 6", "run 5", "run 4", "run 3"]
