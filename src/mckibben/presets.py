"""Presets: a class with some of its settings fixed, under a separate name.

A published variant, or a structure, is a choice of settings and no class: ``preset(...)`` defines it
next to the class, and a line of the registry, or an entry point of another package, names it.
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass, fields
from functools import update_wrapper
from types import MethodType
from typing import Any


@dataclass(frozen=True)
class Preset:
    """A class, its description with these settings, and the settings; see `preset`."""

    of: type
    about: str
    chosen: Mapping[str, Any]


def preset(of: type, about: str, **chosen: Any) -> Preset:
    """Return a class with some of its settings fixed.

    Parameters
    ----------
    of : type
        The class.
    about : str
        What it is, in one line.
    **chosen
        Settings, the fields of the class, that others may override; or attributes of the class, such
        as its ``title``, that are different with them.
    """
    return Preset(of, about, chosen)


class Chosen:
    """A preset with its class: calling it creates an object of the class.

    Other attributes are those of the class; class methods have the preset for their class.

    Parameters
    ----------
    name : str
        Of the preset.
    given : Preset
    """

    def __init__(self, name: str, given: Preset) -> None:
        self.of: Any = given.of
        update_wrapper(self, self.of, updated=())
        documented = (self.of.__doc__ or "").partition("\n")
        self.__doc__ = "".join((given.about, *documented[1:]))
        known = {field.name: copy(field) for field in fields(self.of)}
        self.settings = {key: value for key, value in given.chosen.items() if key in known}
        for key, value in self.settings.items():
            known[key].default = value
        self.__dataclass_fields__ = known
        self._name = name
        self._attributes = {key: value for key, value in given.chosen.items() if key not in known}

    def __call__(self, **settings: Any) -> Any:
        """Return an object of the class with the preset's settings, or others.

        Raises
        ------
        TypeError
            On a name that is no setting.
        """
        unknown = sorted(settings.keys() - self.__dataclass_fields__.keys())
        if unknown:
            raise TypeError(
                f"{self._name!r} has no setting {unknown[0]!r}: "
                f"use one of {', '.join(sorted(self.__dataclass_fields__))}."
            )
        return self.of(**self.settings | settings)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):  # asked for before there is anything, or by copying
            raise AttributeError(name)
        if name in self._attributes:
            return self._attributes[name]
        found = getattr(self.of, name)
        return MethodType(found.__func__, self) if isinstance(found, MethodType) else found

    def __repr__(self) -> str:
        return f"{self._name}: {self.of.__name__} with {self.settings}"
