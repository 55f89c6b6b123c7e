"""The page of operations: each with its options, in Python and on the command line."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import MISSING, Field, fields
from typing import Any, get_args, get_type_hints

from making.keywords import written
from making.pages import MADE, plain, table, write
from mckibben import options
from mckibben.hints import KEYWORDS, MODULE
from mckibben.options import Option
from mckibben.workflow import OPERATIONS


def rows(kind: type) -> Iterator[list[str]]:
    """Yield name, flag, type, default and meaning of every option."""
    hints, plain_hints = get_type_hints(kind, include_extras=True), get_type_hints(kind)
    for one in fields(kind):
        option = next(each for each in get_args(hints[one.name]) if isinstance(each, Option))
        flag = option.flag or f"--{one.name.replace('_', '-')}"
        kinds = written(plain_hints[one.name]).replace("|", r"\|")
        yield [f"`{one.name}`", f"`{flag}`", f"`{kinds}`", default(one), plain(option.help)]


def default(one: Field[Any]) -> str:
    """Return the default of an option; nothing where it is none."""
    if one.default_factory is not MISSING or one.default in (None, (), ""):
        return ""
    return f"`{one.default}`"


def write_options() -> None:
    """Write the page."""
    lines = ["# Operations and their options", "", "```{index} !operations, !options, !keywords"]
    lines += [
        "```",
        "",
        "Each operation is a function of `mckibben` and a command of the same name.",
    ]
    lines += [
        "Options are keyword arguments of the function, and flags of the command. Every operation"
    ]
    lines += ["that reads recordings also has the [options of reading](#readoptions).", ""]
    lines += table(
        ["operation", "options", "what it does"],
        [
            [
                f"`{name}`",
                ""
                if one.options is None
                else f"[{one.options.__name__}](#{one.options.__name__.lower()})",
                plain((one.run.__doc__ or "").partition("\n")[0]),
            ]
            for name, one in OPERATIONS.items()
        ],
    )
    for name, kind in vars(options).items():
        if name.endswith("Options") and isinstance(kind, type):
            about = (kind.__doc__ or "").partition("\n")[0]
            lines += [f"## {name}", "", plain(about), ""]
            lines += table(["Python", "command line", "type", "default", "meaning"], [*rows(kind)])
    lines += [
        "## Names of other tools",
        "",
        "```{index} MATLAB, iddata, resid, pandas, scikit-learn",
    ]
    lines += ["```", "", "The same is in the message of the error that such a name raises.", ""]
    names = [[f"`{name}`", f"`{ours}`"] for name, ours in sorted({**MODULE, **KEYWORDS}.items())]
    lines += table(["name", "here"], names)
    write(MADE / "options.md", "\n".join(lines))
