"""Options that go together, given to a command as one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import MISSING, fields, is_dataclass
from enum import Enum
from functools import wraps
from inspect import Parameter, Signature, signature
from typing import Any, get_type_hints


def spread(command: Callable[..., None]) -> Callable[..., None]:
    """Return a command whose parameters that are dataclasses are asked for field by field.

    Every field is an option under its own name; the command gets them as the object they make.
    """
    hints = get_type_hints(command, include_extras=True)
    groups: dict[str, Any] = {name: hint for name, hint in hints.items() if is_dataclass(hint)}
    asked: list[Parameter] = []
    for name, parameter in signature(command).parameters.items():
        if name not in groups:
            asked.append(parameter.replace(annotation=hints[name]))
            continue
        own = get_type_hints(groups[name], include_extras=True)
        for field in fields(groups[name]):
            default = Parameter.empty if field.default is MISSING else field.default
            asked.append(
                Parameter(
                    field.name, Parameter.KEYWORD_ONLY, default=default, annotation=own[field.name]
                )
            )
    asked.sort(key=lambda parameter: parameter.kind)

    @wraps(command)
    def run(**given: Any) -> None:
        for name, group in groups.items():
            given[name] = group(**{field.name: given.pop(field.name) for field in fields(group)})
        command(**given)

    found: Any = run
    found.__signature__ = Signature(asked)
    found.__annotations__ = {one.name: one.annotation for one in asked}
    return run


def typed(group: Any) -> list[str]:
    """Return a group of options as it is typed: what is not by default.

    >>> from mckibben.cli.options import Reading
    >>> typed(Reading(column=["pressure=P1"], rate=100.0))
    ['--column', 'pressure=P1', '--rate', '100.0']
    """
    own = get_type_hints(type(group), include_extras=True)
    words: list[str] = []
    for field in fields(group):
        value = getattr(group, field.name)
        if value == field.default:
            continue
        asked = own[field.name].__metadata__[0]
        option = next(word for word in (asked.default, *asked.param_decls) if str(word)[:2] == "--")
        for one in value if isinstance(value, list) else [value]:
            told = one.value if isinstance(one, Enum) else one
            words += [option] if told is True else [option, str(told)]
    return words
