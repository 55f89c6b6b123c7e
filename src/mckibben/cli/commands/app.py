"""Open the workbench: data, loops, models, compensation and code in the browser."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from mckibben.cli.parameters import Argument, command
from mckibben.options import Option


@command
def app(
    folder: Annotated[
        Path, Argument("[FOLDER]", "Workspace: a folder that holds everything; made if missing.")
    ] = Path("workbench"),
    host: Annotated[str, Option("Address to listen on.")] = "127.0.0.1",
    port: Annotated[int, Option("Port; 0 for any free one.")] = 8750,
    show: Annotated[bool, Option("Open a browser.")] = True,
) -> None:
    from mckibben.app.server import serve
    from mckibben.system.extras import demand

    demand("nicegui", "app", "the workbench")
    serve(folder, host=host, port=port, show=show)
