"""Compare golden cases with what is stored: ``python -m tests.golden [PATTERN ...]``."""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from fnmatch import fnmatchcase
from multiprocessing import get_context
from pathlib import Path

from tests.golden.case import Case, Leaf, flat
from tests.golden.compare import Moved, moved
from tests.golden.rooms import all_cases
from tests.golden.stored import Stored, load, machine, names, save

Answer = tuple[dict[str, Leaf] | None, str, float]
"""Leaves, or None and what was raised; seconds."""


def answer(case: Case) -> Answer:
    """Run a case in a folder of its own."""
    begun = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            leaves = flat(case.run(Path(folder).resolve()))
        except Exception:  # whatever it is, it is not the stored answer
            return None, traceback.format_exc(), time.perf_counter() - begun
    return leaves, "", time.perf_counter() - begun


def answer_by_name(name: str) -> Answer:
    """Run a case in another process, where functions made on the way are not at hand."""
    return answer(all_cases()[name])


def verdict(case: Case, given: Answer, here: str) -> tuple[str, list[Moved], str]:
    """Return in one word how a case stands, what moved, and what to say of it."""
    leaves, raised, _ = given
    stored = load(case.name)
    if stored is None:
        return "new", [], "nothing is stored of it"
    if leaves is None:
        return "raised", [], raised
    rows = moved(case, stored, leaves, here)
    return ("moved" if rows else "same"), rows, ""


def chosen(patterns: list[str], slow: bool) -> list[Case]:
    """Return the cases that patterns name; else those that are not slow, or those that are."""
    cases = all_cases()
    if not patterns:
        return [case for case in cases.values() if case.slow == slow]
    for pattern in patterns:
        if not any(fnmatchcase(name, pattern) for name in cases):
            sys.exit(f"no case is called {pattern}; --list shows them, room/* is all of a room")
    return [c for c in cases.values() if any(fnmatchcase(c.name, p) for p in patterns)]


def run(cases: list[Case], processes: int) -> Iterator[tuple[Case, Answer]]:
    """Answer cases, in several processes, each as it is ready."""
    if processes <= 1:
        for case in cases:
            yield case, answer(case)
        return
    from tests.golden.__main__ import answer_by_name as by_name  # not that of "__main__"

    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        asked = {pool.submit(by_name, case.name): case for case in cases}
        for ready in as_completed(asked):
            yield asked[ready], ready.result()


def table(rows: list[Moved]) -> None:
    """Print what moved."""
    if not rows:
        return
    heads = ("case", "value", "stored", "found", "moved by", "tolerance")
    cells = [
        (
            row.case,
            row.leaf,
            row.expected,
            row.found,
            "-" if row.by is None else f"{row.by:.3g}",
            "kind" if row.tolerance is None else f"{row.tolerance:g}" if row.tolerance else "equal",
        )
        for row in rows
    ]
    widths = [max(len(line[i]) for line in (heads, *cells)) for i in range(len(heads))]
    for line in (heads, *cells):
        print("  ".join(word.ljust(width) for word, width in zip(line, widths, strict=True)))


def main() -> int:
    """Compare, or accept one case; return 0 where nothing moved."""
    parser = argparse.ArgumentParser(prog="python -m tests.golden", description=__doc__)
    parser.add_argument("patterns", nargs="*", help="cases by name, * for any; all where none")
    parser.add_argument("--update", metavar="NAME", help="accept what one case answers now")
    parser.add_argument("--new", action="store_true", help="store all of which nothing is stored")
    parser.add_argument("--because", default="", help="why; stored beside the case")
    parser.add_argument(
        "--slow", action="store_true", help="those that take long, instead of all others"
    )
    parser.add_argument("--list", action="store_true", help="print the names of cases")
    parser.add_argument("--processes", type=int, default=2, help="at the same time")
    parser.add_argument("--most", type=int, default=12, help="rows printed of one case")
    options = parser.parse_args()
    if options.list:
        print("\n".join(all_cases()))
        return 0
    if options.update and options.update not in all_cases():
        sys.exit(f"no case is called {options.update}; --list shows them")
    if options.update:
        return update([all_cases()[options.update]], options.because)
    cases = chosen(options.patterns, options.slow)
    if options.new:
        new = [case for case in cases if load(case.name) is None]
        return update(new, options.because, options.processes)
    here, began = machine(), time.perf_counter()
    skipped = [case for case in cases if not case.possible or _elsewhere(case, here)]
    counts: dict[str, int] = {"skipped": len(skipped)}
    rows: list[Moved] = []
    slowest: list[tuple[float, str]] = []
    for case, given in run([c for c in cases if c not in skipped], options.processes):
        word, changed, remark = verdict(case, given, here)
        counts[word] = counts.get(word, 0) + 1
        slowest.append((given[2], case.name))
        rows += changed[: options.most]
        if len(changed) > options.most:
            print(f"{case.name}: {len(changed) - options.most} more values moved")
        if word in ("new", "raised"):
            print(f"{case.name}: {word}: {remark}")
    table(rows)
    if skipped:
        listed = ", ".join(case.name for case in skipped)
        print(f"skipped, as what they need, or their kind of machine, is not here: {listed}")
    if not options.patterns and (left := names() - all_cases().keys()):
        counts["stored without a case"] = len(left)
        print(f"stored without a case: {', '.join(sorted(left))}")
    slowest.sort(reverse=True)
    print("slowest: " + ", ".join(f"{name} {seconds:.1f} s" for seconds, name in slowest[:5]))
    said = ", ".join(f"{n} {word}" for word, n in counts.items() if n)
    print(f"{len(cases)} golden cases in {time.perf_counter() - began:.0f} s: {said}")
    good = counts.get("same", 0)
    failed = sum(counts.values()) - good - len(skipped)
    print(f"golden: {good} passed, {failed} failed, {len(skipped)} skipped")
    return int(failed > 0)


def _elsewhere(case: Case, here: str) -> bool:
    """Tell whether a case is compared on another kind of machine alone."""
    stored = load(case.name) if case.one_machine else None
    return stored is not None and stored.machine != here


def update(cases: list[Case], because: str, processes: int = 1) -> int:
    """Store what cases answer now, with a reason."""
    if not because:
        sys.exit('say why: --because "..."')
    refused = 0
    for case, given in run([case for case in cases if case.possible], processes):
        table(verdict(case, given, machine())[1])
        if given[0] is None:
            print(f"{case.name}: {given[1]}")
            refused += 1
        else:
            save(case.name, case.call, Stored(given[0], because, machine()))
            print(f"{case.name}: stored")
    for case in cases:
        if not case.possible:
            print(f"{case.name}: not stored, as what it needs is not here")
    return int(refused > 0)


if __name__ == "__main__":
    sys.exit(main())
