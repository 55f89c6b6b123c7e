"""Open the workbench: data, loops, models, compensation and code in the browser."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from mckibben.cli.parameters import command
from mckibben.options import Argument, Option


@command
def app(
    folder: Annotated[
        Path, Argument("[FOLDER]", "Workspace: a folder that holds everything; made if missing.")
    ] = Path("workbench"),
    port: Annotated[int, Option("Port; 0 for any free one.")] = 8750,
    show: Annotated[bool, Option("Open a browser.")] = True,
) -> None:
    from mckibben.system.extras import demand

    demand("nicegui", "app", "the workbench")
    from mckibben.app.main import serve

    serve(folder, port=port, show=show)
