"""mckibben muscles: identified muscles, from which others can be begun."""

from __future__ import annotations

from typing import Annotated

import typer

from mckibben.cli.options import Json
from mckibben.cli.output import print_json, say

app = typer.Typer(
    name="muscles",
    help="Identified muscles: list, show. fit balance --prior begins from them.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
)


@app.command("list")
def list_muscles(as_json: Json = False) -> None:
    """List the identified muscles, what they are and where their recordings come from."""
    from mckibben import muscles

    found = muscles.list()
    if as_json:
        print_json(
            {
                muscle.name: {
                    "title": muscle.title,
                    "virtual": muscle.virtual,
                    "source": muscle.source,
                    "licence": muscle.licence,
                    "sheet": muscle.sheet.model_dump(exclude_none=True),
                }
                for muscle in found
            }
        )
        return
    for muscle in found:
        say(f"{muscle.name}: {muscle.title}")
        say(f"  {muscle.source}")


@app.command()
def show(
    name: Annotated[
        str, typer.Argument(metavar="MUSCLE", help="Name of a muscle, or its file (.toml).")
    ],
    as_json: Json = False,
) -> None:
    """Show a muscle's data sheet, conditions, balance and its uncertainty, as the text of its file."""
    from mckibben import muscles
    from mckibben.blocks.saving import to_dict

    muscle = muscles.load(name)
    if not as_json:
        say(muscles.described(muscle), end="")
        return
    print_json(
        {
            "name": muscle.name,
            "title": muscle.title,
            "virtual": muscle.virtual,
            "source": muscle.source,
            "licence": muscle.licence,
            "sheet": muscle.sheet.model_dump(exclude_none=True),
            "conditions": muscle.conditions.model_dump(exclude_none=True),
            "balance": to_dict(muscle.balance),
        }
    )
