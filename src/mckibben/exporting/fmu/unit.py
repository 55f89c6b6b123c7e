"""A model as a functional mock-up unit (FMU), for Simulink-like tools.

One zip: the description, the C it is built from, the library for this machine, and a page on how to
import it. The same model gives the same bytes on the same machine.

Source: FMI 2.0.4, Modelica Association.
"""

from __future__ import annotations

import hashlib
import json
import platform
import sys
import tarfile
import tempfile
import uuid
from collections.abc import Mapping, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from mckibben.blocks.base import Block
from mckibben.blocks.laws import identified_limits
from mckibben.errors import DataError, ModelError
from mckibben.exporting.c.project import described, source_files
from mckibben.exporting.folders import write_texts, zipped
from mckibben.exporting.programs import own_compiler, run
from mckibben.exporting.templating import literals, render
from mckibben.outputs import claim
from mckibben.system.atomic import replacing

HERE = Path(__file__).parent

_render = partial(render, "mckibben.exporting.fmu")

FLAGS = ("-std=c99", "-O2", "-s", "-ffp-contract=off", "-shared")
"""Of the compiler; without contraction C computes the same as Python."""

DEFAULT_STEP = 0.01
"""Suggested communication step of a model without sample time [s]."""

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
"""SI base units of the units; other units have only a name."""

PLATFORMS = {
    "linux": ("linux64", ".so"),
    "win32": ("win64", ".dll"),
    "darwin": ("darwin64", ".dylib"),
}
"""Folder and library ending of FMI 2.0, by system."""


def export_fmu(
    block: Block,
    path: str | Path,
    *,
    name: str = "model",
    sample_time: float | None = None,
    library: bool = True,
    force: bool = False,
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
    library : bool
        Whether to build the library for this machine; importers can build the sources.
    force : bool
        Whether files of the user's may be replaced; those of an earlier export are anyway.

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
    claim(path, force=force)
    files = fmu_files(block, name=name, sample_time=sample_time)
    texts = {path: text.encode() for path, text in files.items()}
    if library:
        texts |= _library(files, name)
    with replacing(path) as new:
        new.write_bytes(zipped(texts))
    return path


def fmu_files(
    block: Block, *, name: str = "model", sample_time: float | None = None
) -> dict[str, str]:
    """Return the files of an FMU except its libraries, text by path in the zip."""
    content = described(block, name=name, sample_time=sample_time, single=False)
    low, high = identified_limits(block)
    starts = np.where(np.isfinite(low) & np.isfinite(high), np.clip(0.0, low, high), 0.0)
    channels = (*content["inputs"], *content["outputs"])
    units = sorted({channel["unit"] for channel in channels})
    first_channels = f"{content['inputs'][0]['name']} to {content['outputs'][0]['name']}"
    content |= {
        "token": _token(block, content["sample_time"]),
        "description": f"{first_channels}: {', '.join(content['kinds'])}",
        "starts": literals(starts),
        "step": content["sample_time"] or DEFAULT_STEP,
        "variables": _variables(content, starts.tolist()),
        "units": [{"name": unit, "base": BASE_UNITS.get(unit)} for unit in units],
    }

    sources = {
        **{Path(path).name: text for path, text in source_files(content).items()},
        **_headers(),
        "unit_model.h": _render("unit_model.h.j2", content),
        "fmi2.c": (HERE / "c" / "fmi2.c").read_text(encoding="utf-8"),
    }
    content["unit_sources"] = sorted(source for source in sources if source.endswith(".c"))
    return {
        **{f"sources/{source}": text for source, text in sources.items()},
        "modelDescription.xml": _render("fmi2.xml.j2", content),
        "documentation/index.html": _render("index.html.j2", content),
        "resources/model.json": block.to_text(),
    }


@cache
def _headers() -> dict[str, str]:
    """Return the headers of FMI 2.0, unchanged, with the notices of their licence (BSD)."""
    with tarfile.open(HERE / "headers.tar.xz") as packed:
        parts = {name: packed.extractfile(name) for name in packed.getnames()}
        return {name: part.read().decode() for name, part in parts.items() if part}


def _token(block: Block, sample_time: float | None) -> str:
    """Return the model's unique identifier: a digest of its content."""
    digest = hashlib.sha256(json.dumps([block.to_dict(), sample_time], sort_keys=True).encode())
    return f"{{{uuid.UUID(digest.hexdigest()[:32])}}}"


def _variables(content: Mapping[str, Any], starts: Sequence[float]) -> list[dict[str, Any]]:
    """Return the channels as variables with distinct names; time and status are reserved."""
    names = {"time", "status"}
    variables = []
    channels = [("input", *each) for each in zip(content["inputs"], starts, strict=True)]
    channels += [("output", channel, 0.0) for channel in content["outputs"]]
    for causality, channel, start in channels:
        name = channel["name"]
        while name in names:
            name = f"{name}_{causality}"
        names.add(name)
        variables.append(
            {"name": name, "unit": channel["unit"], "causality": causality, "start": repr(start)}
        )
    return variables


def own_platform() -> tuple[str, str] | None:
    """Return the folder and the library ending of this machine, if FMI 2.0 has them."""
    return PLATFORMS.get(sys.platform) if platform.machine() in ("x86_64", "AMD64") else None


def _library(files: Mapping[str, str], name: str) -> dict[str, bytes]:
    """Return the library for this machine, by path in the zip."""
    platform, compiler = own_platform(), own_compiler()
    if platform is None or compiler is None:
        raise ModelError(
            "this machine cannot build the library of the FMU",
            remedy="install a C compiler, or leave the library out (`library=False`): importers can "
            "build the sources",
        )
    where, suffix = platform
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        texts = {Path(path).name: files[path] for path in files if path.startswith("sources/")}
        write_texts(folder, texts)
        sources = sorted(path.name for path in folder.glob("*.c"))
        options = [] if suffix == ".dll" else ["-fPIC"]
        command = [compiler, *FLAGS, *options, "-I.", *sources, "-lm", "-o", f"{name}{suffix}"]
        run(command, "the FMU does not compile", folder=folder)
        return {f"binaries/{where}/{name}{suffix}": (folder / f"{name}{suffix}").read_bytes()}
