"""Remedies of errors of reading: each set of options is tried before it is offered."""

from __future__ import annotations

import copy
import re
import warnings
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from mckibben.errors import DataError
from mckibben.files.headers import unit_of
from mckibben.files.notices import noted
from mckibben.files.request import Request
from mckibben.options import merged

STEPS = 3
"""Remedies that a reading may need, one after the other."""

Named = Mapping[str, str]
"""Header of a column -> the channel that it is read as."""

Attempt = Callable[[Request], Named]
"""Reads with a request; raises a `DataError` where that fails."""


def offering(error: DataError, request: Request, before: Named, attempt: Attempt) -> DataError:
    """Return an error with those of its options with which a reading succeeds, in their order.

    Nothing else may change: columns that the options do not name are the channels that they are
    ``before``, if standard ones. Where an option leads to another question that has a single answer,
    that is added to it. Where none succeeds, those are offered that lead to an error of another kind
    without options: what is wrong then has to be mended in the file.
    """
    if not error.options:
        return error

    def works(changed: Request) -> bool:
        after = attempt(changed)
        meant = {*changed.columns, *changed.units, *changed.columns.values()}
        for header, channel in before.items():
            standard = unit_of(channel) is not None and not meant & {header, channel}
            if standard and after.get(header) != channel:
                return False
        return True

    outcomes = list(_outcomes(error, request, works, STEPS))
    successes = [options for options, end in outcomes if end is None]
    offered = copy.copy(error)
    led: list[Mapping[str, Any]] = []
    for options in successes or [options for options, _ in outcomes]:
        led += [options] if options not in led else []
    allowed = [options for options in led if None not in options.values()]  # what was stated stays
    offered.options = tuple(allowed or led)
    return offered


def _outcomes(
    error: DataError, request: Request, works: Callable[[Request], bool], steps: int
) -> Iterator[tuple[Mapping[str, Any], DataError | None]]:
    """Yield the options of an error that lead on, each with the error that remains, or None."""
    each = [*reversed(error.options)]
    while each:
        options = each.pop()
        try:
            changed = request.changed(options)
            with warnings.catch_warnings(), noted():
                warnings.simplefilter("ignore")
                nothing_else = works(changed)
        except DataError as further:
            if alike := _answered(options, further):
                each.append(merged(options, alike))
            elif (further.channel, further.problem) == (error.channel, error.problem):
                pass
            elif not further.options:
                yield options, further
            elif steps > 1:
                later = list(_outcomes(further, changed, works, steps - 1))
                answers = [more for more, end in later if end is None]
                if answers:
                    yield merged(options, answers[0]) if len(answers) == 1 else options, None
                elif later:
                    yield options, later[0][1]
            continue
        if nothing_else:
            yield options, None


def _answered(options: Mapping[str, Any], further: DataError) -> Mapping[str, Any]:
    """Return the unit of a channel for one numbered alike that is asked for next; empty if it is not."""

    def base(channel: str | None) -> str:
        return re.sub(r"_?\d+$", "", channel or "")

    units = options.get("units", {})
    alike = {unit for name, unit in units.items() if base(name) == base(further.channel)}
    answers = [option for option in further.options if {*option} == {"units"}]
    alike_answers = (option for option in answers if {*option["units"].values()} == alike)
    return {} if further.channel in units else next(alike_answers, {})
