"""A model as a functional mock-up unit (FMU), which Simulink-like tools import.

One zip: the description, the C it is built from, libraries for the platforms that this machine can
build for, and a page on how to import it. The same model gives the same bytes on the same machine.

Source: FMI 2.0.4 and 3.0.1, Modelica Association.
"""

from __future__ import annotations

import hashlib
import json
import tarfile
import tempfile
import zipfile
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, Literal

import numpy as np

from mckibben.blocks.base import Block
from mckibben.blocks.laws.trial import input_limits
from mckibben.blocks.saving import to_dict, to_text
from mckibben.errors import DataError, ModelError
from mckibben.export.c.literals import literal
from mckibben.export.c.project import described, source_files
from mckibben.export.fmu.refusals import refusals
from mckibben.export.fmu.toolchains import PLATFORMS, build_library, buildable
from mckibben.export.folders import zipped
from mckibben.export.templating import render as rendered
from mckibben.system import ordinary
from mckibben.system.atomic import replacing, written

Version = Literal["2.0", "3.0"]

HERE = Path(__file__).parent

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
    version: Version = "2.0",
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
    version : {"2.0", "3.0"}
        Of the interface.
    sample_time : float, optional
        Time between steps of the model [s]; needed by rate-dependent blocks.
    platforms : sequence of str, optional
        Of linux, windows, macos, macos-arm and linux-arm; default all that this machine can build
        for. Empty for sources only.
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
    offered = [name for name in buildable() if version == "3.0" or PLATFORMS[name].fmi2]
    wanted = offered if platforms is None else list(platforms)
    unknown = [platform for platform in wanted if platform not in PLATFORMS]
    if unknown:
        raise ModelError(
            f"there is no platform {unknown[0]!r}. Remedy: use one of {', '.join(PLATFORMS)}."
        )
    nameless = [name for name in wanted if version == "2.0" and not PLATFORMS[name].fmi2]
    if nameless:
        raise ModelError(
            f"FMI 2.0 has no name for {nameless[0]}. Remedy: ask for FMI 3.0, or other platforms."
        )
    if platforms is None and not wanted:
        raise ModelError(
            "there is no C compiler on this machine, so the FMU would hold no library. Remedy: "
            "install one, or ask for no platforms (--platforms none): importers can build the sources."
        )
    files = fmu_files(block, name=name, version=version, sample_time=sample_time)
    files |= _libraries(files, name, version, wanted)
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
    block: Block,
    *,
    name: str = "model",
    version: Version = "2.0",
    sample_time: float | None = None,
) -> dict[str, bytes]:
    """Return the files of an FMU but for its libraries, by path in the zip."""
    content = described(block, name=name, sample_time=sample_time, single=False)
    low, high = input_limits(block)
    starts = np.where(np.isfinite(low) & np.isfinite(high), np.clip(0.0, low, high), 0.0)
    content |= {
        "fmi": version,
        "token": _token(block, content["sample_time"], version),
        "description": f"{content['inputs'][0]['name']} to {content['outputs'][0]['name']}: "
        + ", ".join(content["kinds"]),
        "starts": ", ".join(literal(float(start)) for start in starts),
        "step": content["sample_time"] or DEFAULT_STEP,
        "variables": _variables(content, starts.tolist()),
        "units": _units(content, version),
    }
    digit = version[0]
    sources = {Path(path).name: text for path, text in source_files(content).items()}
    sources["unit_model.h"] = _render("unit_model.h.j2", content)
    ours = [HERE / "c" / f"{stem}" for stem in ("unit.h", "unit.c", f"fmi{digit}.c")]
    sources |= {path.name: path.read_text(encoding="utf-8") for path in ours}
    sources |= {name: text for name, text in _headers().items() if name.startswith(f"fmi{digit}")}
    own, types = sources[f"fmi{digit}.c"], sources[f"fmi{digit}FunctionTypes.h"]
    sources[f"fmi{digit}_refused.c"] = refusals(types, own)
    content["unit_sources"] = sorted(source for source in sources if source.endswith(".c"))
    texts = {f"sources/{source}": text for source, text in sources.items()}
    texts["modelDescription.xml"] = _render(f"fmi{digit}.xml.j2", content)
    texts["documentation/index.html"] = _render("index.html.j2", content)
    texts["resources/model.json"] = to_text(block)
    if version == "3.0":
        texts["sources/buildDescription.xml"] = _render("build.xml.j2", content)
    return {path: text.encode() for path, text in texts.items()}


@cache
def _headers() -> dict[str, str]:
    """Return the headers of FMI 2.0 and 3.0, unchanged, with the notices of their licence (BSD)."""
    with tarfile.open(HERE / "headers.tar.xz") as packed:
        parts = {name: packed.extractfile(name) for name in packed.getnames()}
        return {name: part.read().decode() for name, part in parts.items() if part}


def _token(block: Block, sample_time: float | None, version: str) -> str:
    """Return what tells this model from others: a digest of what it is."""
    what = json.dumps([to_dict(block), sample_time, version], sort_keys=True)
    digest = hashlib.sha256(what.encode()).hexdigest()
    cuts = [digest[:8], digest[8:12], digest[12:16], digest[16:20], digest[20:32]]
    return "{" + "-".join(cuts) + "}"


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


def _units(content: Mapping[str, Any], version: str) -> list[dict[str, Any]]:
    named = {channel["unit"] for channel in (*content["inputs"], *content["outputs"])}
    if version == "3.0":
        named.add("s")
    return [{"name": unit, "base": BASE_UNITS.get(unit)} for unit in sorted(named)]


def _libraries(
    files: Mapping[str, bytes], name: str, version: Version, platforms: Sequence[str]
) -> dict[str, bytes]:
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
        for platform in (PLATFORMS[key] for key in platforms):
            where = platform.fmi2 if version == "2.0" else platform.fmi3
            if where:
                out = folder / f"{name}{platform.suffix}"
                build_library(platform.name, folder, sources, out)
                built[f"binaries/{where}/{out.name}"] = out.read_bytes()
                out.unlink()
    return built


def _render(template: str, content: Mapping[str, Any]) -> str:
    return rendered("mckibben.export.fmu", template, content)
