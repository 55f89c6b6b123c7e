"""What fuzzers share: attempts by number in a child process, within limits, that can be repeated."""

from __future__ import annotations

import argparse
import multiprocessing
import resource
import sys
import time
import traceback
from collections.abc import Callable
from itertools import count
from multiprocessing.connection import Connection
from pathlib import Path

Attempt = Callable[[int], None]
"""Tries what a number stands for; anything that it raises is a finding."""

LONGEST = 20.0
"""Seconds that an attempt may take."""

MEMORY = 3 * 2**30
"""Bytes of address space that attempts may take beside what is there before them."""


def main(attempt: Attempt, about: str, *, seed: Callable[[int], None]) -> int:
    """Run a fuzzer from the command line; ``seed`` is told the seed before anything is tried."""
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("--seconds", type=float, default=60.0, help="how long to try")
    parser.add_argument("--seed", type=int, default=0, help="of all that is tried")
    parser.add_argument("--case", type=int, help="try this one alone, without limits")
    chosen = parser.parse_args()
    seed(chosen.seed)
    if chosen.case is not None:
        attempt(chosen.case)
        return 0
    tried, findings = guarded(attempt, chosen.seconds)
    for place, numbers in sorted(findings.items()):
        print(f"\n{len(numbers)} of {place}")
        print(f"  again: python {Path(sys.argv[0])} --seed {chosen.seed} --case {numbers[0]}")
    print(f"\n{tried} tried, {sum(map(len, findings.values()))} findings")
    return 1 if findings else 0


def guarded(attempt: Attempt, seconds: float) -> tuple[int, dict[str, list[int]]]:
    """Attempt 0, 1, 2 and so on for some time, each within limits of time and memory.

    Returns
    -------
    tried : int
    findings : dict
        What went wrong -> the numbers of the attempts.
    """
    findings: dict[str, list[int]] = {}
    until, number = time.monotonic() + seconds, 0
    while time.monotonic() < until:
        ours, theirs = multiprocessing.Pipe()
        child = multiprocessing.get_context("fork").Process(
            target=_attempts, args=(attempt, number, until, theirs)
        )
        child.start()
        theirs.close()
        ended: str | None = None
        while ended is None:
            try:
                if ours.poll(LONGEST):
                    if wrong := ours.recv():
                        findings.setdefault(wrong, []).append(number)
                    number += 1
                else:
                    ended = f"more than {LONGEST:g} s"
            except EOFError:
                child.join()
                ended = f"the end of the process ({child.exitcode})" if child.exitcode else ""
        if ended:
            findings.setdefault(ended, []).append(number)
            number += 1
        child.kill()
        child.join()
        ours.close()
    return number, findings


def _attempts(attempt: Attempt, first: int, until: float, told: Connection) -> None:
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, used + MEMORY))
    for number in count(first):
        if time.monotonic() > until:
            return
        try:
            attempt(number)
            told.send(None)
        except Exception as error:
            frames = traceback.extract_tb(error.__traceback__)
            ours = [frame for frame in frames if "mckibben" in frame.filename] or list(frames)
            place = f"{Path(ours[-1].filename).name}:{ours[-1].lineno}"
            told.send(f"{type(error).__name__} at {place}: {error!s:.100}")
