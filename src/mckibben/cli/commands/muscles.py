"""List and show the library of identified muscles, which are priors of fit balance --prior."""

from __future__ import annotations

from typing import Annotated

import click

from mckibben.cli.output import say, show
from mckibben.cli.parameters import Json, command
from mckibben.options import Argument


@command
def list_(as_json: Json = False) -> None:
    """List the identified muscles, what they are and where their recordings come from."""
    from mckibben import muscles

    library = muscles.list()
    lines = [f"{muscle.name}: {muscle.title}\n  {muscle.source}" for muscle in library]
    show({muscle.name: muscle.summary() for muscle in library}, lambda: lines, as_json)


@command
def show_(
    name: Annotated[str, Argument("MUSCLE", "Name of a muscle, or its file (.toml).")],
    as_json: Json = False,
) -> None:
    """Show a muscle's data sheet, conditions, balance and its uncertainty, as the text of its file."""
    from mckibben import muscles

    muscle = muscles.load(name)
    if as_json:
        show(muscle, list, True)
    else:
        say(muscles.described(muscle), end="")


muscles = click.Group(
    "muscles", help=__doc__, commands={one.name or "": one for one in (list_, show_)}
)
