from __future__ import annotations

import re
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mckibben.cli.leaderboards import print_leaderboard
from mckibben.comparison.row import Memory
from mckibben.report.commands import Typed, commands
from mckibben.report.wording import (
    another_inverted,
    duration,
    next_steps,
    number,
    percent,
    verdict,
    versions,
)
from tests.report.studies_by_hand import measured, models, study


@given(st.floats(-1e300, 1e300), st.integers(1, 6))
def test_numbers_keep_their_digits(value: float, digits: int) -> None:
    read = float(number(value, digits).replace("−", "-"))
    assert read == pytest.approx(value, rel=0.5000001 * 10 ** (1 - digits), abs=5e-324)


@pytest.mark.parametrize("value", [None, float("nan"), float("inf")])
def test_what_is_not_a_number_is_a_dash(value: float | None) -> None:
    assert number(value) == "–"


def test_shares_are_percentages() -> None:
    assert (percent(0.5), percent(1.0, 3), percent(None)) == ("50 %", "100 %", "–")


def test_the_verdict_names_the_model_its_error_with_unit_and_range_and_the_inverse() -> None:
    found = study()
    best = found.leaderboard.best
    assert best is not None
    assert best.test is not None
    words = " ".join(verdict(found))
    assert "Chosen by cross-validation on the training side: gpi" in words
    assert "neither fitted to nor chosen by, gpi is off by" in words
    assert f"{number(best.test.rmse)} mm" in words
    assert f"{percent(best.test.nrmse)} of the range of the test" in words
    assert "It can be inverted" in words


def test_another_model_may_be_the_one_to_invert() -> None:
    found = study()
    assert found.inverse is not None
    other = replace(found, inverse=replace(found.inverse, model="pi"))
    words = " ".join(verdict(other))
    assert (
        "gpi cannot be inverted on these data; the first after it that has one is pi, wi" in words
    )
    rows = found.leaderboard.rows
    stuck = replace(found.leaderboard, rows=(replace(rows[0], block=None), *rows[1:]))
    said = another_inverted(replace(other, leaderboard=stuck))
    assert re.match(r"gpi has no inverse; .* is pi, with [\d.]+ times its test error$", said)
    assert another_inverted(found) == ""
    none = replace(found, inverse=None)
    assert "None of the models that worked can be inverted" in " ".join(verdict(none))


def test_another_model_with_the_lowest_test_error_is_named_beside_the_choice() -> None:
    found = study()
    first, second, *others = found.leaderboard.rows
    swapped = replace(found, leaderboard=replace(found.leaderboard, rows=(second, first, *others)))
    words = verdict(swapped)[0]
    assert f": {second.model}, CV RMSE" in words
    assert f"Lowest test RMSE: {first.model}" in words


def test_models_that_tie_with_the_best_are_named(capsys: pytest.CaptureFixture[str]) -> None:
    found = study()
    rows = list(found.leaderboard.rows)
    rows[1] = replace(rows[1], difference_interval=(-0.1, 0.1))
    tied = replace(found, leaderboard=replace(found.leaderboard, rows=tuple(rows)))
    assert "Not told apart from the chosen model on this test: mpi." in " ".join(verdict(tied))
    print_leaderboard(tied.leaderboard)
    printed = capsys.readouterr().out
    assert "≈ not told apart from the chosen model on this test: the interval" in printed
    assert "See simulate --initial measured." in printed
    assert "Not told apart" not in " ".join(verdict(found))


def test_next_steps_answer_what_is_wrong() -> None:
    found = study()
    best, *others = found.leaderboard.rows
    assert best.train is not None
    assert best.test is not None
    bad = replace(
        best,
        test=replace(best.test, rmse=5.0, nrmse=0.5),
        memory=Memory(gap_ratio=0.2, n_pairs=10, hold_ratio=1.0),
    )
    worse = replace(found, leaderboard=replace(found.leaderboard, rows=(bad, *others)))
    words = " ".join(next_steps(worse))
    assert "misses something" in words
    assert "record more varied movements" in words
    assert "20 % of the recorded gap" in words
    assert "feedforward" in words
    assert len(next_steps(replace(found, inverse=None))) == 1


def test_where_none_is_recommended_those_that_beat_the_mean_on_the_test_are_named() -> None:
    found = study()
    best, second, third, *_ = found.leaderboard.rows
    astray, mean, good, other = (
        replace(row, model=name, test=None if row.test is None else replace(row.test, rmse=rmse))
        for row, name, rmse in (
            (best, best.model, 9.0),
            (second, "constant", 5.0),
            (second, second.model, 1.0),
            (third, third.model, 6.0),
        )
    )
    board = replace(found.leaderboard, rows=(astray, good, other), constant=mean)
    (step,) = next_steps(replace(found, leaderboard=board))
    assert step.startswith(
        f"On the test, {second.model} is off by 1.00 mm, the mean by 5.00 mm. But"
    )
    (step,) = next_steps(replace(found, leaderboard=replace(board, rows=(astray, other))))
    assert step.startswith("Use none of these models.")


def test_an_inverse_is_recommended_only_where_its_own_model_is_known_and_followed() -> None:
    found = study()
    assert found.inverse is not None
    other = replace(found, inverse=replace(found.inverse, model="pi"))
    assert next_steps(other)[0].startswith("Use the inverse of pi as feedforward")
    assert "expect the error of pi" in next_steps(other)[0]
    rows = tuple(
        replace(row, validation_rmse=None) if row.model == "pi" else row
        for row in found.leaderboard.rows
    )
    unvalidated = replace(other, leaderboard=replace(found.leaderboard, rows=rows))
    astray = replace(found, inverse=replace(found.inverse, error=0.3))
    for doubted, why in ((unvalidated, "no cross-validated error"), (astray, "up to 30 %")):
        assert next_steps(doubted)[0].startswith("Do not rely on the inverse")
        assert why in next_steps(doubted)[0]


def test_a_study_in_which_nothing_worked_says_what_to_do() -> None:
    empty = study(blocks={})
    assert "No model could be identified" in " ".join(verdict(empty))
    assert "reasons" in " ".join(next_steps(empty))


def test_commands_are_quoted_and_name_every_file_once() -> None:
    whole = measured(200, file="my data/run 1.csv")
    other = measured(200, seed=1, file="$(rm).csv", name="other")
    held_out = dict(commands(study((whole.slice(0, 150),), (whole,))))
    assert held_out["Repeat this study"].startswith(
        "mckibben study 'my data/run 1.csv' --input pressure --output displacement --models "
    )
    with_test = dict(commands(study((whole,), (other,))))
    assert "--test '$(rm).csv'" in with_test["Repeat this study"]
    assert with_test["Fit gpi to whole recordings"].startswith(
        "mckibben fit gpi 'my data/run 1.csv'"
    )


def test_a_study_is_repeated_as_it_was_typed() -> None:
    words = ["study", "a b.csv", "--column", "pressure=P (1)", "--zero", "displacement"]
    lines = dict(commands(study(), Typed(words, ["--column", "pressure=P (1)"])))
    assert lines["Repeat this study"] == (
        "mckibben study 'a b.csv' --column 'pressure=P (1)' --zero displacement"
    )
    assert "--column 'pressure=P (1)'" in lines["Fit gpi to whole recordings"]


def test_there_is_no_command_for_an_absent_inverse() -> None:
    lines = commands(study(inverse=False, blocks=models()))
    assert not any("inverse.json" in command for _, command in lines)


def test_durations_are_said_with_and_without_time() -> None:
    assert duration(measured(101)) == "101 samples, 1.00 s at 100 Hz"
    assert duration(measured(101, sample_time=4.0)) == "101 samples, 400 s every 4.00 s"
    assert duration(measured(101, sample_time=None)) == "101 samples, no time"


def test_versions_are_those_installed() -> None:
    from importlib.metadata import version

    assert versions()["numpy"] == version("numpy")


def test_an_unfinished_study_says_so_and_promises_nothing() -> None:
    whole = study()
    board = replace(whole.leaderboard, pending=("cpi", "kp"))
    unfinished = replace(whole, leaderboard=board, inverse=None)
    assert "so far" in verdict(unfinished)[0]
    assert "None of the models" not in " ".join(verdict(unfinished))
    (step,) = next_steps(unfinished)
    assert "cpi and kp to come" in step
    assert "cpi" in commands(unfinished)[0][1]
    empty = replace(unfinished, leaderboard=replace(board, rows=()), predictions={})
    assert verdict(empty) == ["No model is fitted yet."]
