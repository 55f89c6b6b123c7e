"""Flags and arguments of commands, from the annotations of a function and of its options."""

from __future__ import annotations

import shlex
import sys
import types
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, fields, is_dataclass
from inspect import Parameter, cleandoc, signature
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import click

from mckibben import printing
from mckibben.errors import DataError, in_terms_of, python_operation, python_parameter
from mckibben.options import FILES, TEST, Argument, Option, is_mapping, parsed

COMMANDS = (
    *("study", "characterize", "fit", "compare", "check", "calibrate", "simulate", "invert"),
    *("track", "learn", "review", "plan", "plot", "reproduce", "measured", "info"),
    *("link", "example", "export", "rig", "muscles", "app"),
)
"""Commands: operations of `mckibben.workflow`, or modules of `mckibben.cli.commands` of that name."""

_flags: dict[str, str] = {}
"""Flags of the running command, by parameter name."""


class Command(click.Command):
    """A command whose flags are named in errors."""

    def make_context(
        self,
        info_name: str | None,
        args: list[str],
        parent: click.Context | None = None,
        **more: Any,
    ) -> click.Context:
        """Store the arguments as typed; refuse one given twice that may be given once."""
        _flags.clear()
        for param in self.params:
            if isinstance(param, click.Option) and param.name:
                _flags[param.name] = max(param.opts, key=len)
                spelled = [word for word in args if word.partition("=")[0] in param.opts]
                if len(spelled) > 1 and not param.multiple and not param.is_flag:
                    raise click.UsageError(f"{spelled[0]} is given {len(spelled)} times.")
        return super().make_context(info_name, args, parent, **more)


def as_flag(name: str, key: str | None = None, value: str | None = None) -> str:
    """Return a parameter in an error as a flag of the running command, or as Python."""
    flag = _flags.get(name) or _flags.get(f"{name}s")
    if flag is None:
        return python_parameter(name, key, value)
    word = value if key is None else f"{key}={value or 'VALUE'}"
    return flag if word is None else f"{flag} {shlex.quote(word)}"


def as_command(name: str) -> str:
    """Return an operation in an error as a command, or as Python."""
    return f"mckibben {name}" if name in COMMANDS else python_operation(name)


def as_note(text: str) -> str:
    """Return a note in one line, with parameters as flags."""
    return in_terms_of(" ".join(text.split()), as_flag, as_command)


Files = Annotated[tuple[Path, ...], FILES]
Test = Annotated[tuple[Path, ...], TEST]
Quick = Annotated[bool, Option("Models that take seconds; same as --models quick.")]
Force = Annotated[bool, Option("Replace files that mckibben did not write, except inputs.")]
Json = Annotated[bool, Option("Print the result as JSON on standard output.", flag="--json")]


def named_models(models: str | Sequence[str], quick: bool) -> str | Sequence[str]:
    """Return the named models, or the quick choice where none are named."""
    return "quick" if quick and models == "all" else models


def typed_command() -> str:
    """Return the command line as it was typed."""
    return printing.command(["mckibben", *sys.argv[1:]])


def command(run: Callable[..., int | None]) -> click.Command:
    """Return a command that calls a function, whose parameters are arguments and flags.

    Parameters that are dataclasses are asked for field by field. The help is the docstring of the
    function, or of its module where it has none. What the function returns is the exit code.
    """
    hints = get_type_hints(run, include_extras=True)
    parameters = {
        name: (hints[name], parameter.default)
        for name, parameter in signature(run).parameters.items()
    }
    text = run.__doc__ or sys.modules[run.__module__].__doc__ or ""
    return command_of(run.__name__.strip("_").replace("_", "-"), text, run, parameters)


def command_of(
    name: str, text: str, run: Callable[..., int | None], parameters: Mapping[str, tuple[Any, Any]]
) -> click.Command:
    """Return a command that calls a function with parameters of some types and defaults."""
    groups: dict[str, Any] = {
        key: hint for key, (hint, _) in parameters.items() if is_dataclass(hint)
    }
    declared: list[click.Parameter] = []
    for key, (hint, default) in parameters.items():
        if key in groups:
            hints = get_type_hints(hint, include_extras=True)
            declared += [
                parameter_of(item.name, hints[item.name], _default(item)) for item in fields(hint)
            ]
        else:
            declared.append(parameter_of(key, hint, default))

    def call(**values: Any) -> int | None:
        for key, group in groups.items():
            values[key] = group(**{item.name: values.pop(item.name) for item in fields(group)})
        return run(**values)

    return Command(name, callback=call, params=declared, help=cleandoc(text))


def _default(field: Any) -> Any:
    if field.default is not MISSING:
        return field.default
    return MISSING if field.default_factory is MISSING else field.default_factory()


def parameter_of(name: str, hint: Any, default: Any) -> click.Parameter:
    """Return the argument or flag of one parameter."""
    kind, *extras = get_args(hint) if get_origin(hint) is Annotated else (hint,)
    declaration = next(
        (extra for extra in extras if isinstance(extra, Option | Argument)), Option("")
    )
    required = default is Parameter.empty or default is MISSING
    kind, repeated, width = _unwrapped(kind)
    if isinstance(declaration, Argument):
        return click.Argument(
            [name],
            type=_click_type(kind),
            metavar=declaration.metavar,
            required=required,
            nargs=-1 if repeated else 1,
            **({} if required or repeated else {"default": default}),  # None would count as given
        )
    flags = [name, *_spellings(name, declaration.flag)]
    if kind is bool:
        flag_on = flags[1]
        spelling = f"{flag_on}/--no-{flag_on[2:]}" if default is True else flag_on
        return click.Option(
            [name, spelling], is_flag=True, default=bool(default), help=declaration.help
        )
    is_map = kind is Mapping
    return click.Option(
        flags,
        type=str if declaration.parse or is_map else _click_type(kind),
        metavar=declaration.metavar or None,
        help=declaration.help,
        required=required,
        multiple=(repeated and declaration.parse is None) or is_map,
        nargs=width if declaration.parse is None else 1,
        show_default=_is_plain(default, declaration),
        callback=_parsed(name, declaration, is_map, default),
        **({"default": default} if _is_plain(default, declaration) else {}),
    )


def _spellings(name: str, flag: str) -> list[str]:
    if flag == "-o":
        return ["-o", "--out"]
    return [flag or f"--{name.replace('_', '-')}"]


def _unwrapped(kind: Any) -> tuple[Any, bool, int]:
    """Return the type of one value, whether it may be repeated, and its number of words."""
    if get_origin(kind) in (Union, types.UnionType):
        members = [item for item in get_args(kind) if item not in (type(None), Any)]
        kind = next((item for item in members if get_origin(item) is Sequence), members[0])
    if get_origin(kind) in (list, tuple, Sequence):
        items = get_args(kind)
        if get_origin(kind) is tuple and items[-1] is not Ellipsis:
            return items[0], False, len(items)
        return items[0], True, 1
    if is_mapping(kind):
        return Mapping, False, 1
    return kind, False, 1


def _click_type(kind: Any) -> Any:
    if get_origin(kind) is Literal:
        return click.Choice(get_args(kind))
    if kind is Path:
        return click.Path(path_type=Path)
    return kind if kind in (int, float, str) else str


def _is_plain(default: Any, option: Option) -> bool:
    """Return whether a default is shown as it would be typed."""
    return isinstance(default, int | float | str | Path) and default != "" and not option.parse


def _parsed(name: str, option: Option, mapping: bool, default: Any) -> Callable[..., Any]:
    """Return the parser of an option's words."""

    def value(context: click.Context, parameter: click.Parameter, words: Any) -> Any:
        del context
        if words is None or words == ():
            return None if default is Parameter.empty else default
        if option.parse is None:
            return words
        if not mapping:
            return parsed(option, words, name)
        pairs = [parsed(option, text, name) for text in words]
        if len(merged := dict(pairs)) < len(pairs):
            twice = next(key for key, _ in pairs if [k for k, _ in pairs].count(key) > 1)
            raise DataError("it is given twice", parameter=name, channel=twice, remedy="give one")
        return merged

    return value
