"""A compensator as the source of a ROS 2 package, with a plug-in for ros2_control.

The controller is a few dozen lines round the exported C, which are the same for every model; what
differs are names and numbers. It is written for Jazzy and later.
"""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path

import numpy as np

from mckibben.blocks.base import Block
from mckibben.errors import ModelError
from mckibben.exporting.c.project import described, source_files
from mckibben.exporting.folders import write_folder
from mckibben.exporting.templating import render

USUAL = (0.0, 6.0)
"""Lowest and highest pressure [bar] of a compensator that knows none."""


def export_ros2(
    block: Block,
    folder: str | Path,
    *,
    name: str = "muscle",
    sample_time: float | None = None,
    force: bool = False,
) -> Path:
    """Write a compensator as a package of ROS 2, to be built by colcon.

    Parameters
    ----------
    block : Block
        Whose outputs are pressures. References are its driven inputs; what schedules it, or is
        measured, comes from state interfaces.
    folder : str or Path
        To write; must not exist, or be empty.
    name : str
        Of the package, and of the C functions: small letters, digits and underscores.
    sample_time : float, optional
        Time between steps [s]; needed by rate-dependent blocks, and then the controller's period.
    force : bool
        Whether files of the user's may be replaced; those of an earlier export are anyway.

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    ModelError
        If the name will not do, the block gives no pressures, or it has no C.
    DataError
        If the folder is in the way or cannot be written.
    """
    folder = Path(folder)
    files = ros2_files(block, name=name, sample_time=sample_time)
    write_folder(folder, files, force=force)
    return folder


def ros2_files(
    block: Block, *, name: str = "muscle", sample_time: float | None = None
) -> dict[str, str]:
    """Return the files of `export_ros2`, text by path in the folder."""
    if not re.fullmatch(r"[a-z](_?[a-z0-9])+", name):
        raise ModelError(
            f"{name!r:.60} cannot name a package of ROS 2",
            parameter="name",
            remedy="give `name` small letters, digits and single underscores, starting with "
            "a letter",
        )
    if any(channel.unit != "bar" for channel in block.outputs):
        raise ModelError(
            f"{block.title!r} gives {block.outputs[0].name}, not pressures",
            remedy="export the compensator, `inverse`",
        )
    n_driven = len(block.inputs) - len(block.scheduling)
    content = described(block, name=name, sample_time=sample_time, single=False)
    references = content["inputs"][:n_driven]
    low, high = np.where(np.isfinite(block.known_outputs), block.known_outputs, USUAL).T
    handles = [re.sub(r"[^a-z0-9_]+", "_", each["name"].lower()) for each in references]
    content |= {
        "references": references,
        "handles": [
            each if handles.count(each) == 1 else f"{each}_{k}"
            for k, each in enumerate(handles, start=1)
        ],
        "measured": content["inputs"][n_driven:],
        "lowest": min(float(low.min()), 0.0),
        "highest": float(high.max()),
        "class_name": "".join(word.capitalize() for word in name.split("_")) + "Controller",
    }

    filled = partial(render, "mckibben.exporting.ros2", content=content)
    return {
        **{f"c/{Path(path).name}": text for path, text in source_files(content).items()},
        "package.xml": filled("package.xml.j2"),
        "CMakeLists.txt": filled("CMakeLists.txt.j2"),
        f"{name}.xml": filled("plugin.xml.j2"),
        f"include/{name}/{name}_controller.hpp": filled("controller.hpp.j2"),
        f"src/{name}_controller.cpp": filled("controller.cpp.j2"),
        f"config/{name}.yaml": filled("config.yaml.j2"),
        "README.md": filled("README.md.j2"),
        "model.json": block.to_text(),
    }
