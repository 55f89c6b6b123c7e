"""mckibben example: the bundled recordings, to try everything on."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from mckibben.cli.options import Force
from mckibben.cli.output import say


def example(
    folder: Annotated[Path, typer.Argument(help="Where to; made where it is missing.")] = Path(
        "examples"
    ),
    force: Force = False,
) -> None:
    """Write the bundled recordings into a folder: a virtual muscle, one run to train, one to test."""
    from mckibben import example as bundled
    from mckibben.outputs import claim
    from mckibben.system import manifest
    from mckibben.system.atomic import replacing, written

    with written(folder):
        folder.mkdir(parents=True, exist_ok=True)
    contents = {folder / path.name: path.read_bytes() for path in bundled.files()}
    for path, content in contents.items():
        claim(path, partial(manifest.holds, digests={manifest.digest(content)}), force=force)
    for path, content in contents.items():
        with replacing(path) as new:
            new.write_bytes(content)
    train, test = folder / bundled.TRAIN.name, folder / bundled.TEST.name
    say(f"Written: {len(contents)} files to {folder}. Next: mckibben study {train} --test {test}")
