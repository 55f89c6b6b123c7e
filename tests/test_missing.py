"""What a block lacks is said, all of it; those of the package lack nothing."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from pydantic.dataclasses import dataclass

import mckibben.missing
from mckibben.blocks.fields import STRICT, Vector
from mckibben.blocks.memoryless.negative import Negative
from mckibben.missing import missing
from mckibben.registry import names
from tests.contracts.test_twins import WITHOUT_TWIN


@dataclass(frozen=True, config=STRICT)
class Forgetful(Negative):
    kind: ClassVar[str] = "forgetful"

    knots: Vector = (1.0, 2.0, 3.0)

    def pack(self) -> Any:
        return np.zeros(2)


def test_all_that_is_missing_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(Path(__file__).parents[1])
    found = [one for one in missing("tests.test_missing:Forgetful") if one.state == "missing"]
    assert {one.what for one in found} == {
        *("registry line", "law: it sizes agree", "law: it simulates many"),
        *("limits of single precision", "documentation", "tests"),
    }
    assert "forgetful" not in names("blocks")


@pytest.mark.parametrize("kind", names("blocks"))
def test_blocks_of_the_package_lack_nothing(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Laws and compiled C have tests of their own, on more data."""
    monkeypatch.chdir(Path(__file__).parents[1])
    monkeypatch.setattr(mckibben.missing, "LAWS", ())
    monkeypatch.setattr(mckibben.missing, "own_compiler", lambda: None)
    lacking = {found.what for found in missing(kind) if found.state == "missing"}
    assert lacking <= ({"tests"} if kind in WITHOUT_TWIN else set())
