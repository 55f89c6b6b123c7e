"""Every malformed file gives its error, and none anything else."""

from pathlib import Path

import pytest

import mckibben
from mckibben import DataError
from tests.files.malformed import CASES, CHANNELS, Case


def test_there_are_enough_of_them() -> None:
    assert len(CASES) >= 60
    assert len({case.name for case in CASES}) == len(CASES)


@pytest.mark.filterwarnings("ignore::mckibben.DataWarning")
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_error(case: Case, tmp_path: Path) -> None:
    path = case.write(tmp_path)
    with pytest.raises(DataError) as caught:
        mckibben.read(path, channels=CHANNELS, **case.options)
    message = str(caught.value)
    assert message.startswith(str(path))
    assert case.problem in message
    assert (caught.value.channel, caught.value.row) == (case.channel, case.row)
    assert "Remedy: " in message
    assert "\n" not in message
