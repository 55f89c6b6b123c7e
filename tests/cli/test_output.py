"""Tables on the terminal: words begin at the left, numbers end at the right."""

from __future__ import annotations

import pytest

from mckibben.cli.output import print_table


def test_words_are_aligned_left_and_numbers_right(capsys: pytest.CaptureFixture[str]) -> None:
    print_table(["model", "what", "RMSE"], [["pi", "long words", "1.5"], ["mpi", "few", "12.5"]])
    lines = [line.rstrip() for line in capsys.readouterr().out.splitlines()]
    assert lines[1:] == ["pi     long words   1.5", "mpi    few         12.5"]
