"""Before fitting: what recordings cannot tell, each with the run that would."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from mckibben.blocks.bands.banded import inside
from mckibben.comparison.shared_rows import without_copies
from mckibben.errors import DataError
from mckibben.excitation.coupling import coupling
from mckibben.excitation.gap import Gap, listing
from mckibben.excitation.holds import holds
from mckibben.excitation.loads import loads
from mckibben.excitation.ranges import ranges
from mckibben.excitation.repeats import repeats
from mckibben.excitation.reversals import reversals
from mckibben.excitation.sampling import sampling
from mckibben.excitation.seen import Seen, seen
from mckibben.excitation.speeds import speeds
from mckibben.recording import Recording, listed
from mckibben.system.threads import one_blas_thread

if TYPE_CHECKING:
    from mckibben.blocks.base import Block
    from mckibben.comparison.channels import Names

FEWEST = 10
"""Samples of a recording."""

CHECKS: tuple[Callable[[Seen], Iterator[Gap]], ...] = (
    coupling,
    reversals,
    speeds,
    holds,
    ranges,
    loads,
    sampling,
    repeats,
)


def untold(
    recordings: Recording | Sequence[Recording],
    inputs: Names = None,
    outputs: Names = None,
    model: Block | None = None,
    *,
    tests: Sequence[Recording] = (),
) -> tuple[Gap, ...]:
    """Return what recordings cannot tell of a muscle, most important first.

    From the data alone: speeds, holds, reversals, loads, how muscles move together, range, sampling,
    repeats. With a model, also from how its output moves with every parameter: which of them these
    recordings leave undetermined, or determine only together with another.

    Parameters
    ----------
    recordings : Recording or sequence of Recording
        What a model is to be fitted to.
    inputs, outputs : str or sequence of str, optional
        Channels; default those of pressures and displacements, or of pressure, length and force.
    model : Block, optional
        Fitted to the recordings, or known of a like muscle.
    tests : sequence of Recording
        What the model is to be tested on.

    Returns
    -------
    tuple of Gap
        Empty where the recordings tell it all.

    Raises
    ------
    DataError
        On no recordings, absent channels, or fewer than ten samples.

    Examples
    --------
    >>> import numpy as np
    >>> from mckibben import Recording
    >>> from mckibben.signals import triangle
    >>> pressure = triangle(np.arange(4001) / 100, period=10.0, peaks=4.0)
    >>> run = Recording({"pressure": pressure, "displacement": 3 * pressure}, 0.01)
    >>> print(untold([run])[0].sentence)
    Rate dependence cannot be told: 8 branches run at 0.8 bar/s, where they are of like size.
    """
    every = listed(recordings)
    if not every:
        raise DataError("there are no recordings to judge", remedy="give at least one")
    driven, given = channels(every, inputs, outputs)
    for recording in every:
        if len(recording) < FEWEST:
            raise DataError(
                f"{len(recording)} samples tell nothing",
                file=recording.source,
                remedy=f"give recordings of {FEWEST} samples or more",
            )
    kept = without_copies(every, driven, given)
    with one_blas_thread():
        facts = seen(kept, driven, given, listed(tests))
        gaps = [*_still(facts), *(one for check in CHECKS for one in _merged(check(facts)))]
        if model is not None:
            from mckibben.excitation.parameters import parameters

            gaps += parameters(kept, inside(model), facts=facts)
    return tuple(sorted(gaps, key=lambda gap: -gap.severity))


def channels(
    recordings: Sequence[Recording], inputs: Names, outputs: Names
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return what drives and what is to be modelled.

    Raises
    ------
    DataError
        If a recording lacks one of them.
    """
    from mckibben.comparison.channels import channels_of

    found = channels_of(recordings, inputs, outputs, None)
    driven, given = found.inputs, found.outputs
    first = recordings[0]
    if (
        inputs is None
        and driven == ("pressure",)
        and "pressure" not in first
        and "voltage" in first
    ):
        driven = ("voltage",)
    if outputs is None and given == ("displacement",) and _held(recordings, "displacement"):
        given = tuple(name for name in ("force", "length") if name in first)[:1] or given
        if inputs is None and given == ("force",) and "length" in first:
            driven = (*driven, "length")
    if inputs is None and given == ("force",) and "pressure" not in driven and "pressure" in first:
        driven = ("pressure", *driven)  # which models of force by length find by themselves
    for recording in recordings:
        if absent := [name for name in (*driven, *given) if name not in recording]:
            raise DataError(
                f"it is not among its channels, {', '.join(recording.channels)}",
                file=recording.source,
                channel=absent[0],
                remedy="name them with --input and --output, or give recordings with the same channels",
            )
    return driven, given


def _held(recordings: Sequence[Recording], name: str) -> bool:
    """Tell whether a channel is absent, or held in every recording while force moves."""
    if name not in recordings[0]:
        return True
    held = all(name in one and np.ptp(one[name]) == 0 for one in recordings)
    return held and all("force" in one and np.ptp(one["force"]) > 0 for one in recordings)


def _merged(gaps: Iterable[Gap]) -> Iterator[Gap]:
    """Give the worst of gaps of the same name, which then names the channels of the others."""
    groups: dict[str, list[Gap]] = {}
    for gap in gaps:
        groups.setdefault(gap.what, []).append(gap)
    for worst, *others in (
        sorted(group, key=lambda gap: -gap.severity) for group in groups.values()
    ):
        names = tuple(name for gap in others for name in gap.channels)
        said = f"{worst.sentence} So it is with {listing(names)}." if names else worst.sentence
        yield replace(worst, sentence=said, channels=(*worst.channels, *names))


def _still(facts: Seen) -> list[Gap]:
    still = [name for name in facts.outputs if not facts.scales[name].moves]
    if not still and facts.moving:
        return []
    names = still or list(facts.inputs)
    return [
        Gap(
            "still",
            f"Nothing can be told of {listing(names)}: "
            f"{'it does' if len(names) == 1 else 'they do'} not move.",
            "Record while the inputs cycle over their range.",
            "every model",
            1.0,
        )
    ]
