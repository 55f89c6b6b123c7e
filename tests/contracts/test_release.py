"""What is published: whole, small, and nothing else; one version everywhere."""

from __future__ import annotations

import re
import shutil
import zipfile
from pathlib import Path

import pytest

from tests import release
from tests.release import ROOT, ReleaseError

pytestmark = pytest.mark.long


def test_the_archives_hold_the_package_and_nothing_else(tmp_path: Path) -> None:
    wheel, source = release.build(tmp_path)
    release.look_through(wheel, source)
    with zipfile.ZipFile(wheel, "a") as archive:
        archive.writestr("tests/__init__.py", "")
    with pytest.raises(ReleaseError, match=r"tests/__init__\.py"):
        release.look_through(wheel, source)


def copied(folder: Path) -> Path:
    for name in (*release.VERSION_LINES, "CHANGELOG.md"):
        (folder / name).parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / name, folder / name)
    return folder


def test_the_version_is_one_everywhere(tmp_path: Path) -> None:
    assert release.agreed_version(ROOT)
    root = copied(tmp_path)
    (root / "CITATION.cff").write_text("version: 0.0.1\n")
    with pytest.raises(ReleaseError, match=r"CITATION\.cff") as caught:
        release.agreed_version(root)
    assert "0.0.1" in str(caught.value)


def test_a_new_version_is_set_everywhere(tmp_path: Path) -> None:
    root = copied(tmp_path)
    changes = root / "CHANGELOG.md"
    changes.write_text(
        changes.read_text().replace("## Unreleased\n", "## Unreleased\n\n- More.\n", 1)
    )
    release.set_version(root, "97.0.0rc1")
    assert release.agreed_version(root) == "97.0.0rc1"
    assert changes.read_text().index("## 97.0.0rc1 (2") < changes.read_text().index("- More.")
    with pytest.raises(ReleaseError):
        release.set_version(root, "98.0.0")
    for bad in ("98", "v98.0.0", "98.0.0; rm"):
        with pytest.raises(ReleaseError, match=re.escape(bad)):
            release.set_version(root, bad)


def test_the_main_job_is_the_readmes() -> None:
    assert [line[0] for line in release.main_job()] == ["example", "study"]
