"""What the recordings of a workspace are taken for, and the models that have a place on them."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

from mckibben import registry
from mckibben.app.desk import Desk
from mckibben.app.together import obstacle
from mckibben.comparison.channels import DRIVING, FORCE, Channels, any_moves
from mckibben.comparison.offered import Need, ability, declared, full_name, needs, objections
from mckibben.comparison.splits import held_out
from mckibben.errors import DataError
from mckibben.estimators.core.estimator import InverseKind
from mckibben.estimators.coupled.base import schedules
from mckibben.recording import Recording

FOLDS = 6
"""Fits of a model: one, and those of its cross-validation."""

LEAST = 2000
"""Samples below which a fit gets no quicker."""


@dataclass(frozen=True)
class Offer:
    """A model that has a place on the recordings.

    Parameters
    ----------
    model, title : str
        Short and full name.
    can : str
        What it represents.
    usual : bool
        Whether it is ticked at first.
    caution : str or None
        Why it is good only near its training.
    inverse : {"exact", "exact where stable", "solved", "none"}
        How it is inverted.
    needs_time : bool
    seconds : float
        About how long it takes to fit and cross-validate it to these recordings.
    """

    model: str
    title: str
    can: str
    usual: bool
    caution: str | None
    inverse: InverseKind
    needs_time: bool
    seconds: float


@dataclass(frozen=True)
class Offered:
    """The models of a workspace.

    Parameters
    ----------
    recognised : str
        What the recordings are taken for, in a sentence.
    groups : list of (Need, list of Offer)
        What has a place, by what it is for.
    against : dict of str to str
        The others, by full name, and why not.
    """

    recognised: str
    groups: list[tuple[Need, list[Offer]]]
    against: dict[str, str]

    @property
    def start(self) -> list[str]:
        """The models that are ticked at first."""
        return [offer.model for _, found in self.groups for offer in found if offer.usual]


def offered(desk: Desk) -> Offered:
    """Return the models that have a place on the channels chosen, by need."""
    if hindered := obstacle(desk):
        return Offered(hindered, [], {})
    used = desk.workspace.used()
    names, recordings = registry.names("estimators"), list(used.values())
    channels = desk.sides
    against = objections(names, recordings, channels) if recordings else {}
    roles = {entry.name: entry.role for entry in desk.workspace.entries()}
    train = [run for name, run in used.items() if roles.get(name) == "train"]
    if train:  # of what is fitted to, there may be too little
        against = (
            objections(names, _fitted(train, "test" in roles.values(), channels), channels)
            | against
        )
    work = max(sum(map(len, train)), LEAST) * len(channels.inputs) * len(channels.outputs)
    groups = [
        (need, [_offer(model, work) for model in need.models if model not in against])
        for need in needs()
    ]
    groups = [(need, offers) for need, offers in groups if offers]
    return Offered(
        _recognised(desk, len(names) - len(against)) if recordings else "",
        groups,
        {full_name(model): reason for model, reason in against.items()},
    )


def _fitted(train: list[Recording], tested: bool, channels: Channels) -> list[Recording]:
    """Return what models are fitted to where, without recordings to test on, some are held out."""
    with suppress(DataError):  # too little to hold anything out: the fit will say so
        return train if tested else list(held_out(train, channels).train)
    return train


def _offer(model: str, work: int) -> Offer:
    estimator = declared(model)
    return Offer(
        model,
        full_name(model),
        ability(model),
        estimator.quick,
        estimator.caution,
        estimator.inverse_kind,
        estimator.needs_time,
        estimator.effort * work / 10_000 * FOLDS,
    )


def _recognised(desk: Desk, n_models: int) -> str:
    models = "model has" if n_models == 1 else "models have"
    return f"{sides(desk)}: {n_models} {models} a place on these data."


def sides(desk: Desk) -> str:
    """Return in words what is modelled, of what, and what becomes of the other channels."""
    used = desk.workspace.readable()
    channels = desk.sides
    said = [_counted("input", channels.inputs), _counted("output", channels.outputs)]
    told = channels.scheduled(used)
    named = (*channels.inputs, *channels.outputs)
    others = set(desk.workspace.channels()).difference(named)
    if told:
        loads = channels.scheduling is not None
        said.append(f"given beside: {', '.join(told)}{', a load, never commanded' * loads}")
    elif desk.outputs == (FORCE,) and (driving := others.intersection(DRIVING)):
        said.append(f"given beside: {', '.join(sorted(driving))}")  # which balance-force takes
    elif loads_known := [name for name in schedules(used, named) if any_moves(used, (name,))]:
        said.append(f"given to models that take a load: {', '.join(loads_known)}")
    elif others:
        said.append(f"not used: {', '.join(sorted(others))}")
    timeless = sum(run.sample_time is None for run in used)
    if timeless:
        said.append(f"{timeless} of {len(used)} without time")
    return "; ".join(said)


def _counted(word: str, names: tuple[str, ...]) -> str:
    many = "" if len(names) == 1 else "s"
    return f"{len(names)} {word}{many} ({', '.join(names)})"
