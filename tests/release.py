"""Make a release and check it: ``python -m tests.release [VERSION]``.

With a version, the project, its citation, conda recipe and changelog are brought to it first. Then
the wheel and the source archive are built into `dist`, looked through, and tried as somebody would who
has nothing else: the wheel alone in an empty environment, away from the repository, runs the README's
main job. Nothing is uploaded; what is left to do is printed. See docs/releasing.md.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tarfile
import tempfile
import time
import venv
import zipfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
DIST = ROOT / "dist"

LARGEST = 1_600_000
"""Bytes of a wheel, or of a source archive."""

ROOM = 450
"""Megabytes of an environment with the wheel, without bytecode, pip and setuptools."""

ALONGSIDE = {"pyproject.toml", "README.md", "LICENSE", "CHANGELOG.md", "CITATION.cff", ".gitignore"}
"""What a source archive has beside the package."""

VERSION_LINES = {
    "pyproject.toml": 'version = "{}"',
    "CITATION.cff": "version: {}",
    "recipe/recipe.yaml": '  version: "{}"',
}
"""Lines that name the version, by file."""

VERSION = re.compile(r"\d+\.\d+\.\d+((a|b|rc)\d+)?")


class ReleaseError(Exception):
    """What stands against a release."""


def main(words: list[str]) -> None:
    """Make the release, or say what stands against it."""
    try:
        if len(words) > 1:
            raise ReleaseError(f"one version, not {' '.join(words)}")
        if words:
            set_version(ROOT, words[0])
        version = agreed_version(ROOT)
        refuse_uncommitted()
        for old in DIST.glob("mckibben-*"):
            old.unlink()
        wheel, source = build(DIST)
        look_through(wheel, source)
        said = try_alone(wheel)
    except (ReleaseError, subprocess.CalledProcessError) as error:
        sys.exit(f"no release: {error}")
    print(f"{wheel.name} {wheel.stat().st_size} bytes, {source.name} {source.stat().st_size} bytes")
    print(said)
    print(f"To publish: git commit and git tag v{version}, push both, then twine upload dist/*")


def set_version(root: Path, version: str) -> None:
    """Bring all files that name the version to a new one, and what is unreleased under it."""
    if not VERSION.fullmatch(version):
        raise ReleaseError(f"{version!r} is no version such as 1.2.0 or 1.2.0rc1")
    changes = (root / "CHANGELOG.md").read_text(encoding="utf-8")
    if not re.search(r"^## Unreleased\n\n(?!##)\S", changes, re.M):
        raise ReleaseError("CHANGELOG.md has nothing under '## Unreleased'")
    today = time.strftime("%Y-%m-%d")
    dated = changes.replace("## Unreleased\n", f"## Unreleased\n\n## {version} ({today})\n", 1)
    (root / "CHANGELOG.md").write_text(dated, encoding="utf-8")
    for name, line in VERSION_LINES.items():
        text = (root / name).read_text(encoding="utf-8")
        text = version_pattern(line).sub(line.format(version), text, count=1)
        (root / name).write_text(text, encoding="utf-8")


def version_pattern(line: str) -> re.Pattern[str]:
    """Return what finds a line that names the version."""
    return re.compile("^" + re.escape(line).replace(r"\{\}", "(.*?)") + "$", re.M)


def agreed_version(root: Path) -> str:
    """Return the version that the project, its citation and its changelog agree on."""
    patterns = {name: version_pattern(line) for name, line in VERSION_LINES.items()}
    patterns["CHANGELOG.md"] = re.compile(r"^## (\d\S*)", re.M)
    found = {}
    for name, pattern in patterns.items():
        match = pattern.search((root / name).read_text(encoding="utf-8"))
        found[name] = match.group(1) if match else "none"
    if len(set(found.values())) > 1:
        told = ", ".join(f"{name} says {version}" for name, version in found.items())
        raise ReleaseError(f"the versions differ: {told}. Give one: python -m tests.release 1.2.0")
    return found["pyproject.toml"]


def refuse_uncommitted() -> None:
    """Refuse to release what no commit holds, but for the files that name the version."""
    named = {*VERSION_LINES, "CHANGELOG.md"}
    told = run("git", "status", "--porcelain", within=ROOT).splitlines()
    if left := [line[3:] for line in told if line[3:] not in named]:
        raise ReleaseError(f"these are in no commit: {', '.join(left[:5])}")


def build(folder: Path) -> tuple[Path, Path]:
    """Build the wheel and the source archive into a folder, and check them as the index will."""
    run(sys.executable, "-m", "hatchling", "build", "-d", str(folder), within=ROOT)
    (wheel,), (source,) = folder.glob("*.whl"), folder.glob("*.tar.gz")
    run(sys.executable, "-m", "twine", "check", "--strict", str(wheel), str(source))
    return wheel, source


def look_through(wheel: Path, source: Path) -> None:
    """Refuse archives that are too large, lack a file, or hold anything else."""
    told = run("git", "ls-files", "src/mckibben", within=ROOT).splitlines()
    package = {name.removeprefix("src/") for name in told}
    with zipfile.ZipFile(wheel) as archive:
        held = {name for name in archive.namelist() if ".dist-info/" not in name}
    refuse_differences(wheel, held, package)
    with tarfile.open(source) as archive:
        held = {name.partition("/")[2] for name in archive.getnames()}
    refuse_differences(source, held, {*told, *ALONGSIDE, "PKG-INFO"})
    for path in (wheel, source):
        if path.stat().st_size > LARGEST:
            raise ReleaseError(f"{path.name} has {path.stat().st_size} bytes, of {LARGEST}")


def refuse_differences(path: Path, held: set[str], wanted: set[str]) -> None:
    """Refuse an archive that holds too much or too little."""
    for word, names in (("lacks", wanted - held), ("should not hold", held - wanted)):
        if names:
            raise ReleaseError(f"{path.name} {word} {', '.join(sorted(names)[:5])}")


def try_alone(wheel: Path) -> str:
    """Run the README's main job from the wheel alone, and return how large what it needs is."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        venv.create(folder / "env", with_pip=True)
        python = folder / "env" / "bin" / "python"
        before = megabytes(folder / "env")  # pip's
        run(str(python), "-m", "pip", "install", "--quiet", "--no-compile", str(wheel))
        size = megabytes(folder / "env") - before
        if size > ROOM:
            raise ReleaseError(f"its environment takes {size:.0f} MB, of {ROOM}")
        started = time.perf_counter()
        for line in main_job():
            run(str(python), "-m", "mckibben", *line, within=folder)
        if not (folder / "study" / "report.html").is_file():
            raise ReleaseError("the README's main job wrote no report")
        took = time.perf_counter() - started
    return f"environment {size:.0f} MB; the README's main job, nothing compiled yet: {took:.0f} s"


def main_job() -> list[list[str]]:
    """Return the commands of the package of the README's main job."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    block = text.partition("<!-- study -->")[2].partition("```bash")[2].partition("```")[0]
    found = re.findall(r"(?:^|\s)(?:\S*/)?mckibben +([^&\n]+)", block)
    if not found:
        raise ReleaseError("the README's main job calls no command of the package")
    return [words.split() for words in found]


def megabytes(folder: Path) -> float:
    """Return the room that files take on the disk."""
    files = (path for path in folder.rglob("*") if path.is_file())
    return sum(path.stat().st_blocks * 512 for path in files) / 2**20


def run(*command: str, within: Path | None = None) -> str:
    """Run a command, and return what it prints; show what it said where it fails."""
    alone = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(
        command, cwd=within, env=alone, capture_output=True, text=True, check=False
    )
    if done.returncode:
        sys.stderr.write(done.stdout + done.stderr)
    done.check_returncode()
    return done.stdout


if __name__ == "__main__":
    main(sys.argv[1:])
