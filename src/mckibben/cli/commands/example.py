"""Write example recordings of a virtual muscle into a folder: one to train, one to test."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from mckibben import printing
from mckibben.cli.output import say
from mckibben.cli.parameters import Force, command
from mckibben.options import Argument


@command
def example(
    folder: Annotated[Path, Argument("[FOLDER]", "Made where it is missing.")] = Path("examples"),
    force: Force = False,
) -> None:
    from mckibben import example as bundled

    count = bundled.copy_to(folder, force=force)
    train, test = folder / bundled.TRAIN.name, folder / bundled.TEST.name
    following = printing.command(["mckibben", "study", train, "--test", test])
    say(f"Written: {count} files to {printing.printable(folder)}. Next: {following}")
