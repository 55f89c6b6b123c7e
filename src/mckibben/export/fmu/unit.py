"""A model as a functional mock-up unit (FMU), which Simulink-like tools import.

One zip: the description, the C it is built from, libraries for the platforms that this machine can
build for, and a page on how to import it. The same model gives the same bytes on the same machine.

Source: FMI 2.0.4, Modelica Association.
"""

from __future__ import annotations

import hashlib
import json
import re
import tarfile
import tempfile
import textwrap
import uuid
import zipfile
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from mckibben.blocks.base import Block
from mckibben.blocks.laws.trial import input_limits
from mckibben.blocks.saving import to_dict, to_text
from mckibben.errors import DataError, ModelError
from mckibben.export.c.project import described, source_files
from mckibben.export.fmu.toolchains import PLATFORMS, build_library, buildable
from mckibben.export.folders import zipped
from mckibben.export.templating import literals
from mckibben.export.templating import render as rendered
from mckibben.system import ordinary
from mckibben.system.atomic import replacing, written

HERE = Path(__file__).parent

DECLARED = re.compile(r"typedef\s+(\w+)\s*\*?\s*(fmi2\w+)TYPE\s*\(([^)]*)\)\s*;")
DEFINED = re.compile(r"^\w[\w *]*?\b(fmi2\w+)\(", re.M)
"""Functions in headers, and in C."""

DEFAULT_STEP = 0.01
"""Communication step suggested where the model has no time of its own [s]."""

LARGEST_FILE = 256 * 2**20
"""Bytes; a larger FMU is not one by this package."""

BASE_UNITS: dict[str, dict[str, str] | None] = {
    "bar": {"kg": "1", "m": "-1", "s": "-2", "factor": "100000"},
    "mm": {"m": "1", "factor": "0.001"},
    "mm/s": {"m": "1", "s": "-1", "factor": "0.001"},
    "N": {"kg": "1", "m": "1", "s": "-2"},
    "V": {"kg": "1", "m": "2", "s": "-3", "A": "-1"},
    "s": {"s": "1"},
    "rad": {"rad": "1"},
    "K": {"K": "1"},
    "degC": {"K": "1", "offset": "273.15"},
    "1": {},
}
"""What units are of the SI; others are named without."""


def export_fmu(
    block: Block,
    path: str | Path,
    *,
    name: str = "model",
    sample_time: float | None = None,
    platforms: Sequence[str] | None = None,
    overwrite: bool = False,
) -> Path:
    """Write a model as an FMU for co-simulation, in double precision.

    Parameters
    ----------
    block : Block
        Any block.
    path : str or Path
        File to write, ending in ``.fmu``.
    name : str
        Of the model: a letter, then letters, digits and underscores.
    sample_time : float, optional
        Time between steps of the model [s]; needed by rate-dependent blocks.
    platforms : sequence of str, optional
        Of linux, windows and macos; default all that this machine can build for. Empty for sources
        only.
    overwrite : bool
        Whether what an export wrote there before may be replaced.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    ModelError
        If the model cannot be exported, or a library not be built.
    DataError
        If the file is in the way or cannot be written.
    """
    path = Path(path)
    if path.suffix != ".fmu":
        raise DataError("an FMU is a file that ends in .fmu", file=path, remedy="name it so")
    refuse_file(path, overwrite=overwrite)
    wanted = buildable() if platforms is None else list(platforms)
    unknown = [platform for platform in wanted if platform not in PLATFORMS]
    if unknown:
        raise ModelError(
            f"there is no platform {unknown[0]!r}. Remedy: use one of {', '.join(PLATFORMS)}."
        )
    if platforms is None and not wanted:
        raise ModelError(
            "there is no C compiler on this machine, so the FMU would hold no library. Remedy: "
            "install one, or ask for no platforms (--platforms none): importers can build the sources."
        )
    files = fmu_files(block, name=name, sample_time=sample_time)
    files |= _libraries(files, name, wanted)
    with replacing(path) as new:
        new.write_bytes(zipped(files))
    return path


def refuse_file(path: Path, *, overwrite: bool = False) -> None:
    """Refuse to write over a file; with ``overwrite``, over what is no FMU by this package.

    Raises
    ------
    DataError
        If there is one.
    """
    if not (path.exists() or path.is_symlink()):
        return
    if not overwrite:
        raise DataError("the file exists already", file=path, remedy="name another, or --overwrite")
    if not _is_own(path):
        raise DataError(
            "it was not written by an export", file=path, remedy="move it away, or name another"
        )


def _is_own(path: Path) -> bool:
    if path.is_symlink():
        return False
    try:
        with ordinary.opened(path, most=LARGEST_FILE) as file, zipfile.ZipFile(file) as archive:
            return {"resources/model.json", "sources/unit_model.h"} <= set(archive.namelist())
    except (DataError, zipfile.BadZipFile, ValueError, NotImplementedError):
        return False


def fmu_files(
    block: Block, *, name: str = "model", sample_time: float | None = None
) -> dict[str, bytes]:
    """Return the files of an FMU but for its libraries, by path in the zip."""
    content = described(block, name=name, sample_time=sample_time, single=False)
    low, high = input_limits(block)
    starts = np.where(np.isfinite(low) & np.isfinite(high), np.clip(0.0, low, high), 0.0)
    channels = (*content["inputs"], *content["outputs"])
    content |= {
        "token": _token(block, content["sample_time"]),
        "description": f"{content['inputs'][0]['name']} to {content['outputs'][0]['name']}: "
        + ", ".join(content["kinds"]),
        "starts": literals(starts),
        "step": content["sample_time"] or DEFAULT_STEP,
        "variables": _variables(content, starts.tolist()),
        "units": [
            {"name": unit, "base": BASE_UNITS.get(unit)}
            for unit in sorted({channel["unit"] for channel in channels})
        ],
    }
    unit = (HERE / "c" / "fmi2.c").read_text(encoding="utf-8")
    sources = {
        **{Path(path).name: text for path, text in source_files(content).items()},
        **_headers(),
        "unit_model.h": _render("unit_model.h.j2", content),
        "fmi2.c": unit,
        "fmi2_refused.c": refusals(_headers()["fmi2FunctionTypes.h"], unit),
    }
    content["unit_sources"] = sorted(source for source in sources if source.endswith(".c"))
    texts = {
        **{f"sources/{source}": text for source, text in sources.items()},
        "modelDescription.xml": _render("fmi2.xml.j2", content),
        "documentation/index.html": _render("index.html.j2", content),
        "resources/model.json": to_text(block),
    }
    return {path: text.encode() for path, text in texts.items()}


def refusals(header: str, unit: str) -> str:
    """Return C of the functions that a header declares and a unit does not define.

    Each takes its arguments and returns an error.
    """
    plain = re.sub(r"/\*.*?\*/", "", header, flags=re.S)
    defined = set(DEFINED.findall(unit))
    functions = [
        "/* What a co-simulation unit without derivatives and strings refuses. */",
        '#include "fmi2Functions.h"\n',
    ]
    for gives, name, arguments in DECLARED.findall(plain):
        if name not in defined:
            taken = [" ".join(argument.split()) for argument in arguments.split(",")]
            names = [re.sub(r"\[\]$", "", one).split()[-1].split("*")[-1] for one in taken]
            head = f"{gives} {name}({', '.join(taken)})"
            functions += [
                textwrap.fill(head, 100, subsequent_indent=8 * " "),
                "{",
                *(f"    (void){one};" for one in names),
                f"    return {'fmi2Error' if gives == 'fmi2Status' else 'NULL'};",
                "}\n",
            ]
    return "\n".join(functions)


@cache
def _headers() -> dict[str, str]:
    """Return the headers of FMI 2.0, unchanged, with the notices of their licence (BSD)."""
    with tarfile.open(HERE / "headers.tar.xz") as packed:
        parts = {name: packed.extractfile(name) for name in packed.getnames()}
        return {name: part.read().decode() for name, part in parts.items() if part}


def _token(block: Block, sample_time: float | None) -> str:
    """Return what tells this model from others: a digest of what it is."""
    digest = hashlib.sha256(json.dumps([to_dict(block), sample_time], sort_keys=True).encode())
    return f"{{{uuid.UUID(digest.hexdigest()[:32])}}}"


def _variables(content: Mapping[str, Any], starts: Sequence[float]) -> list[dict[str, Any]]:
    """Return the channels as variables, all names different; time and status are taken."""
    taken = {"time", "status"}
    variables = []
    rest = [0.0] * len(content["outputs"])
    kinds = [("input", channel) for channel in content["inputs"]]
    kinds += [("output", channel) for channel in content["outputs"]]
    for (causality, channel), start in zip(kinds, [*starts, *rest], strict=True):
        name = channel["name"]
        while name in taken:
            name = f"{name}_{causality}"
        taken.add(name)
        variables.append(
            {"name": name, "unit": channel["unit"], "causality": causality, "start": repr(start)}
        )
    return variables


def _libraries(files: Mapping[str, bytes], name: str, platforms: Sequence[str]) -> dict[str, bytes]:
    """Return the library for each platform, by path in the zip."""
    built: dict[str, bytes] = {}
    if not platforms:
        return built
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        for path, content in files.items():
            if path.startswith("sources/"):
                with written(folder):
                    (folder / Path(path).name).write_bytes(content)
        sources = sorted(path.name for path in folder.glob("*.c"))
        for platform in platforms:
            out = folder / f"{name}{PLATFORMS[platform].suffix}"
            build_library(platform, folder, sources, out)
            built[f"binaries/{PLATFORMS[platform].folder}/{out.name}"] = out.read_bytes()
            out.unlink()
    return built


def _render(template: str, content: Mapping[str, Any]) -> str:
    return rendered("mckibben.export.fmu", template, content)
