"""Work for jobs in tests."""

from __future__ import annotations

import os
import time
from collections.abc import Callable

from mckibben.app.workspace import Workspace
from mckibben.errors import ModelError

Tell = Callable[..., None]


def count(workspace: Workspace, tell: Tell, *, to: int) -> str:
    tell(0.5, "half")
    workspace.write("runs", f"count-{to}", {"to": to})
    return str(to)


def refuse(workspace: Workspace, tell: Tell) -> str:
    raise ModelError("it cannot be", remedy="use `gaps=split`")


def die(workspace: Workspace, tell: Tell) -> str:
    os._exit(3)


def sleep(workspace: Workspace, tell: Tell, *, mark: str) -> str:
    workspace.write("runs", mark, {"pid": os.getpid()})
    time.sleep(600)
    return ""


def fit(workspace: Workspace, tell: Tell, *, name: str, model: str) -> str:
    from mckibben import workflow

    data = workspace.digest()
    train, test = workspace.with_role("train"), workspace.with_role("test")
    board = workflow.compare(train, test, models=(model,), jobs=1, progress=tell)
    (row,) = board.rows
    assert row.block is not None
    sides = {"input": board.input, "output": board.output, "unit": board.unit, "data": data}
    workspace.save_model(name, row.block, row.to_dict() | sides)
    return "fitted"
