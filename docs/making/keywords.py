"""Writes the types of the keyword arguments of operations, made from the dataclasses of their options.

Usage: python -m docs.making.keywords
"""

from __future__ import annotations

import re
from dataclasses import fields
from pathlib import Path
from typing import get_type_hints

from mckibben import options
from mckibben.system.atomic import write_text

PLACE = Path(options.__file__).with_name("keywords.py")

HEAD = '''"""Keyword arguments of operations: the fields of their options, and of reading.

Made from `mckibben.options` by ``python -m docs.making.keywords``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, TypedDict
'''

EXPORT = '''
class AnyExportKeywords(CKeywords, FMUKeywords, MJCFKeywords, total=False):
    """Of any target of `export`."""
'''

ALONE = ("ReadOptions", "ExportOptions", "COptions", "MJCFOptions", "FMUOptions")
"""Options of what reads no recordings, or is reading."""


def text() -> str:
    """Return the module."""
    kinds = [one for name, one in vars(options).items() if name.endswith("Options")]
    kinds = [one for one in kinds if isinstance(one, type)]
    return "\n".join([HEAD, *map(_typed, kinds), EXPORT])


def _typed(kind: type) -> str:
    """Return the keywords of one class of options."""
    name = kind.__name__.replace("Options", "Keywords")
    parents = [one.__name__ for one in kind.__bases__ if one is not object]
    base = ", ".join(one.replace("Options", "Keywords") for one in parents)
    base = base or ("TypedDict" if kind.__name__ in ALONE else "ReadKeywords")
    hints = get_type_hints(kind)
    inherited = {
        one.name for parent in kind.__bases__ if parent is not object for one in fields(parent)
    }
    own = [one.name for one in fields(kind) if one.name not in inherited]
    lines = [f"    {one}: {written(hints[one])}" for one in own] or ["    pass"]
    about = f'    """Of `mckibben.options.{kind.__name__}`."""\n'
    return "\n".join([f"\nclass {name}({base}, total=False):", about, *lines, ""])


def written(hint: object) -> str:
    """Return a type as text; what a path may be, a text may be."""
    shown = hint.__name__ if type(hint) is type else repr(hint)
    shown = re.sub(r"(collections\.abc|typing|pathlib)\.", "", shown).replace("'", '"')
    shown = re.sub(r"Optional\[(.*)\]", r"\1 | None", shown)
    shown = re.sub(r"\bPath\b", "str | Path", shown)
    shown = re.sub(r"tuple\[([^\[\]]*), \.\.\.\]$", r"Sequence[\1]", shown)
    return "Any" if "| Any |" in shown else shown


if __name__ == "__main__":
    write_text(PLACE, text())
