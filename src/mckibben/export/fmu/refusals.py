"""Functions of FMI that a co-simulation unit without events, clocks and strings refuses, as C.

All that the header declares and the unit does not define: each takes its arguments and returns an error.
"""

from __future__ import annotations

import re
import textwrap

DECLARED = re.compile(r"typedef\s+(\w+)\s*\*?\s*(fmi\d\w+)TYPE\s*\(([^)]*)\)\s*;")
DEFINED = re.compile(r"^\w[\w *]*?\b(fmi\d\w+)\(", re.M)


def refusals(header: str, unit: str) -> str:
    """Return the functions that a header of function types declares and a unit's C does not define."""
    plain = re.sub(r"/\*.*?\*/", "", header, flags=re.S)
    defined = set(DEFINED.findall(unit))
    left = [found for found in DECLARED.findall(plain) if found[1] not in defined]
    prefix = left[0][1][:4]
    says = "/* What a co-simulation unit without events, clocks and strings refuses. */"
    head = f'{says}\n#include "{prefix}Functions.h"\n'
    return "\n".join([head, *(_refusal(*each) for each in left)])


def _refusal(gives: str, name: str, arguments: str) -> str:
    taken = [" ".join(argument.split()) for argument in arguments.split(",")]
    unused = [re.sub(r"\[\]$", "", argument).split()[-1].split("*")[-1] for argument in taken]
    answer = f"{name[:4]}Error" if gives.endswith("Status") else "NULL"
    lines = [f"    (void){argument};" for argument in unused]
    head = textwrap.fill(f"{gives} {name}({', '.join(taken)})", 100, subsequent_indent=8 * " ")
    return "\n".join([head, "{", *lines, f"    return {answer};", "}\n"])
