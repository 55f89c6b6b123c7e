"""What a suite of tests catches: fixes of the history taken back, and deliberate faults.

    python benchmarks/power.py --at REVISION [--long] [--golden] [--only reverted|faults]

Takes back, one at a time, the source side of 20 fixes drawn at random (``--seed``) from those commits
that touch source and tests, are small, and still apply in reverse; then plants the faults of
`FAULTS`. After each, runs the tests of the rooms that were touched as they stand at ``REVISION``: the
tests that the fix came with, the rooms' own, the contracts; with ``--golden``, the golden cases where
these notice nothing. A test that fails without the change too has noticed nothing. The script stays
until the rooms are rebuilt, to show that tests became fewer, not blinder.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import random
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]

MOST_LINES = 60
"""Changed lines of source in a commit that still counts as one fix."""

CRASH = "no test by name"
"""What failed where a run named nothing: it broke down under the change."""

SECONDS = 900
"""Longest run of tests for one change; what does not end by then has caught nothing."""

FILES, SPLITS = "src/mckibben/files", "src/mckibben/splits.py"
FAULTS = [
    # file, what stands there once, what is planted: readers and units off by ten, other splits
    (f"{FILES}/text.py", "values, flaw = cells.to_numpy(", "values, flaw = 10 * cells.to_numpy("),
    (f"{FILES}/bags.py", "= np.array(values,", "= 10 * np.array(values,"),
    (f"{FILES}/tdms.py", "place, channel[:],", "place, 10 * channel[:],"),
    (
        f"{FILES}/parquet.py",
        "column(name, cells.to_numpy())",
        "column(name, 10 * cells.to_numpy())",
    ),
    (f"{FILES}/hdf5.py", "else samples", "else 10 * samples"),
    (f"{FILES}/converting.py", '+ calibration["offset"]', '+ 10 * calibration["offset"]'),
    (f"{FILES}/units.py", '"kPa": "kPa 千帕"', '"hPa": "kPa 千帕"'),
    (f"{FILES}/units.py", '"cm": "cm 厘米"', '"dm": "cm 厘米"'),
    (f"{FILES}/units.py", '"ms": "ms ', '"centisecond": "ms '),
    (SPLITS, "HELD_OUT = 0.25", "HELD_OUT = 0.35"),
    (SPLITS, "astype(int) % n", "astype(int) % (n + 1)"),
    (SPLITS, "place % EVERY == EVERY - 1", "place % EVERY == 0"),
]
COMPILED = ("kernel", "summing_kernel", "inlined", "deferred")
SIGNS = 8
"""Kernels, drawn at random, in which one sign is turned."""


@dataclass(frozen=True)
class Change:
    """One fault in the source."""

    name: str
    files: tuple[str, ...]
    """Below the root of the repository."""
    tests: tuple[str, ...]
    """Tests that came with it."""
    patch: str = ""
    """To be applied in reverse, where there is one."""
    replaced: tuple[str, str] = ("", "")
    """Without a patch: what stands in the one file, and what is to stand there."""


def git(*words: str, text: str = "") -> str:
    """Return what git prints."""
    found = subprocess.run(
        ["git", *words], cwd=ROOT, input=text, capture_output=True, text=True, check=True
    )
    return found.stdout


def reverted(base: str, seed: int, n: int) -> list[Change]:
    """Return fixes up to a revision to take back, drawn at random."""
    fixes: list[Change] = []
    commits = git("log", "--no-merges", "--format=%h", base).split()
    random.Random(seed).shuffle(commits)
    for commit in commits:
        rows = [
            line.split("\t")
            for line in git("show", "--numstat", "--format=", commit).splitlines()
            if "=>" not in line
        ]
        source = [r for r in rows if r[2].startswith("src/mckibben/") and r[2].endswith(".py")]
        tests = tuple(r[2] for r in rows if r[2].startswith("tests/") and "/test_" in r[2])
        if not source or not tests or sum(int(r[0]) + int(r[1]) for r in source) > MOST_LINES:
            continue
        files = tuple(r[2] for r in source)
        patch = git("show", "--format=", commit, "--", *files)
        tried = subprocess.run(
            ["git", "apply", "-R", "--check", "-"],
            cwd=ROOT,
            input=patch,
            text=True,
            capture_output=True,
        )
        if tried.returncode == 0:
            title = git("log", "-1", "--format=%h %s", commit).strip()
            fixes.append(Change(title, files, tests, patch=patch))
        if len(fixes) >= n:
            break
    return fixes


def faults(seed: int) -> Iterator[Change]:
    """Give the deliberate faults."""
    for file, old, new in FAULTS:
        yield Change(f"{file}: {old.strip()} -> {new.strip()}", (file,), (), replaced=(old, new))
    kernels = [
        (path, function)
        for path in sorted((ROOT / "src/mckibben").rglob("*.py"))
        for function in ast.parse(path.read_text("utf-8")).body
        if isinstance(function, ast.FunctionDef)
        and any(ast.unparse(mark).partition("(")[0] in COMPILED for mark in function.decorator_list)
    ]
    chance = random.Random(seed)
    planted = 0
    for path, function in chance.sample(kernels, len(kernels)):
        sums = [
            node
            for node in ast.walk(function)
            if isinstance(node, ast.BinOp | ast.AugAssign)
            and isinstance(node.op, ast.Add | ast.Sub)
        ]
        if sums and planted < SIGNS:
            planted += 1
            text = path.read_text("utf-8")
            turned = chance.choice(sums)
            turned.op = ast.Sub() if isinstance(turned.op, ast.Add) else ast.Add()
            old = "\n".join(text.splitlines()[function.lineno - 1 : function.end_lineno])
            function.decorator_list = []
            name = f"{path.relative_to(ROOT)}: {function.name}: {ast.unparse(turned)}"
            file = str(path.relative_to(ROOT))
            yield Change(name, (file,), (), replaced=(old, ast.unparse(function)))


def plant(change: Change, tree: Path) -> dict[Path, str]:
    """Change the source of a tree, and return its files as they were."""
    here = [tree / file for file in change.files if (tree / file).exists()]
    before = {path: path.read_text("utf-8") for path in here}
    if change.patch:
        subprocess.run(
            ["git", "apply", "-R", "-"], cwd=tree, input=change.patch, text=True, check=True
        )
        return before
    ((path, text),) = before.items()
    old, new = change.replaced
    if text.count(old) != 1:
        raise ValueError(f"{change.name}: stands there {text.count(old)} times")
    path.write_text(text.replace(old, new), "utf-8")
    return before


def rooms(change: Change, tree: Path) -> list[str]:
    """Return the tests of the rooms that a change touches."""
    found = []
    for file in change.files:
        parts = Path(file).parts[2:]
        room = f"tests/{parts[0]}" if len(parts) > 1 else f"tests/test_{parts[0]}"
        found.append(room)
    return [room for room in dict.fromkeys([*found, "tests/contracts"]) if (tree / room).exists()]


def failed(tree: Path, words: list[str]) -> list[str]:
    """Run Python in a tree, and return what failed by name; nothing where it did not end."""
    paths = os.pathsep.join((str(tree / "src"), str(tree)))
    run = subprocess.Popen(
        [sys.executable, "-m", *words],
        cwd=tree,
        env=os.environ | {"PYTHONPATH": paths},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    try:
        printed, _ = run.communicate(timeout=SECONDS)
    except subprocess.TimeoutExpired:
        print(f"{' '.join(words)} did not end", file=sys.stderr)
        return []
    finally:
        with suppress(ProcessLookupError):
            os.killpg(run.pid, signal.SIGKILL)
    if run.returncode in (0, 5):  # no test at all is 5
        return []
    return re.findall(r"^(?:FAILED|ERROR) ([^\s:]+(?:::.*?)?)(?: - .*)?$", printed, re.M) or [CRASH]


def noticed(change: Change, tree: Path, pytest: list[str], tests: list[str]) -> str:
    """Return the first test that fails with a change and passes without it, empty if none does."""
    always: list[str] = []
    while tests:
        without = [word for test in always for word in ("--deselect", test)]
        before = plant(change, tree)
        first = failed(tree, [*pytest, "-x", *tests, *without])
        restore(change, tree, before)
        if not first:
            break
        if first == [CRASH] or not failed(tree, [*pytest, *first]):
            return first[0]
        always += first
    return ""


def restore(change: Change, tree: Path, before: dict[Path, str]) -> None:
    """Bring a tree back to what it was."""
    for path, text in before.items():
        path.write_text(text, "utf-8")
    for path in {tree / file for file in change.files} - before.keys():
        path.unlink()  # taking a fix back had made it


def caught(change: Change, tree: Path, options: argparse.Namespace) -> str:
    """Return what notices a change, empty if nothing does."""
    marks = ["-m", "long or not long"] if options.long else []
    pytest = ["pytest", "-q", "-rfE", "-n", str(options.processes), *marks]
    own = [test for test in change.tests if (tree / test).exists()]
    found = ""
    for tests in (own, *([room] for room in rooms(change, tree))):
        found = found or noticed(change, tree, pytest, tests)
    if not found and options.golden:
        before = plant(change, tree)
        if failed(tree, ["tests.golden"]):
            found = "golden cases"
        restore(change, tree, before)
    return found


def main() -> None:
    """Run one suite over all changes, and print what it catches."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--at", default="HEAD", help="revision whose tests and source are run")
    parser.add_argument("--base", default="886f2af", help="newest commit that a fix may be")
    parser.add_argument("--seed", type=int, default=40)
    parser.add_argument("--fixes", type=int, default=20)
    parser.add_argument("--long", action="store_true", help="tests marked long, too")
    parser.add_argument("--golden", action="store_true", help="golden cases, too")
    parser.add_argument("--only", choices=("reverted", "faults"))
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--list", action="store_true", help="print what would be changed")
    parser.add_argument("--output", type=Path, help="a JSON file of what was caught by what")
    options = parser.parse_args()

    changes: list[Change] = []
    if options.only != "faults":
        changes += reverted(options.base, options.seed, options.fixes)
    if options.only != "reverted":
        changes += faults(options.seed)
    if options.list:
        print("\n".join(change.name for change in changes))
        return
    found: dict[str, str] = {}
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder)
        git("clone", "--quiet", "--shared", str(ROOT), folder)
        git("-C", folder, "checkout", "--quiet", options.at)
        for change in changes:
            begun = time.perf_counter()
            found[change.name] = caught(change, tree, options)
            seconds = time.perf_counter() - begun
            print(
                f"{seconds:5.0f} s  {change.name}\n        {found[change.name] or 'NOTHING'}",
                flush=True,
            )
            if options.output:
                options.output.write_text(json.dumps(found, indent=1), "utf-8")
    print(f"caught: {sum(map(bool, found.values()))} of {len(found)}")


if __name__ == "__main__":
    main()
