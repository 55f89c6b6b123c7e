"""The site of the documentation: built without warnings, whole and offline."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from mckibben import registry

pytestmark = pytest.mark.long

pytest.importorskip("sphinx")
pytest.importorskip("furo")
pytest.importorskip("myst_parser")

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the site."""
    into = tmp_path_factory.mktemp("site") / "html"
    done = subprocess.run(
        [sys.executable, "docs/build.py", "--into", str(into)],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT / "src")},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return into


def test_every_model_has_a_page_with_its_equations(site: Path) -> None:
    index = (site / "_generated" / "models" / "index.html").read_text(encoding="utf-8")
    for model in registry.names("estimators"):
        text = (site / "_generated" / "models" / f"{model}.html").read_text(encoding="utf-8")
        assert "<math" in text, model
        assert f'href="{model}.html"' in index
        for part in ("Equations", "Parameters", "Settings", "How to fit it"):
            assert f">{part}<" in text, (model, part)


def test_nothing_is_asked_of_the_internet(site: Path) -> None:
    loaded = r"<(?:script|link|img|iframe)[^>]*(?:src|href)=\"(?:https?:)?//[^\"]*"
    for ending, asked in (("html", loaded), ("css", r"url\(['\"]?(?:https?:)?//")):
        for path in site.rglob(f"*.{ending}"):
            assert not re.findall(asked, path.read_text(encoding="utf-8")), path.name
