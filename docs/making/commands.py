"""The page of commands, generated from the command line: description and options of each."""

from __future__ import annotations

from collections.abc import Iterator

import click

from making.pages import MADE, plain, table, write
from mckibben.cli.main import app


def commands(group: click.Group, context: click.Context) -> Iterator[tuple[str, click.Command]]:
    """Yield every command by its full name."""
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        inner = click.Context(command, parent=context, info_name=name)
        if isinstance(command, click.Group):
            yield from commands(command, inner)
        elif command is not None and not command.hidden:
            yield inner.command_path, command


def options(command: click.Command, context: click.Context) -> list[str]:
    """Return the table of a command's options."""
    records = [
        record for one in command.params if (record := one.get_help_record(context)) is not None
    ]
    rows = [[f"`{escaped(name)}`", plain(text)] for name, text in records]
    return table(["option", "description"], rows)


def escaped(name: str) -> str:
    """Return an option, escaped for a table."""
    return name.replace("|", r"\|")


def write_commands() -> None:
    """Write the page."""
    root = click.Context(app, info_name="mckibben")
    found = list(commands(app, root))
    lines = ["# Commands", "", "```{index} !commands, !command line, !options, !CLI", "```", ""]
    lines += ["`mckibben COMMAND --help` shows the same. Nearly all commands accept `--json`."]
    lines += ["Exit codes: 0 success, 1 all models failed, 2 invalid input, 130 interrupted.", ""]
    short = [
        [f"[{path}](#{path.replace(' ', '-')})", plain(one.get_short_help_str(200))]
        for path, one in found
    ]
    lines += table(["command", "description"], short)
    for path, command in found:
        context = click.Context(command, info_name=path)
        usage = " ".join(command.collect_usage_pieces(context))
        lines += [f"## {path}", "", plain(command.help or ""), ""]
        lines += ["```text", f"{path} {usage}", "```", "", *options(command, context)]
    write(MADE / "commands.md", "\n".join(lines))
