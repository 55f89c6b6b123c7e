"""mckibben app: the workbench in the browser."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def app(
    folder: Annotated[
        Path, typer.Argument(help="Workspace: a folder that holds everything; made if missing.")
    ] = Path("workbench"),
    host: Annotated[
        str,
        typer.Option("--host", help="Address to listen on."),
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option("--port", help="Port; 0 for any free one.")] = 8750,
    token: Annotated[
        str | None,
        typer.Option("--token", help="Token to demand, 16 letters or more; made up if not given."),
    ] = None,
    show: Annotated[bool, typer.Option("--show/--no-show", help="Open a browser.")] = True,
) -> None:
    """Open the workbench: data, loops, models, compensation and code in the browser."""
    from mckibben.system.extras import demand

    demand("nicegui", "app", "the workbench")
    from mckibben.app.server import serve

    serve(folder, host=host, port=port, token=token, show=show)
