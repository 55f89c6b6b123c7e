"""What several recordings have in common is said once, and nothing of it is lost."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("nicegui")

from nicegui.testing import User

from mckibben import Recording
from mckibben.app.pages.shared_notes import own, shared
from mckibben.app.workspace import Workspace
from tests.app.test_pages import visit

COLUMNS = "columns were taken by their units"


def test_notes_that_recordings_share_stand_once(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    for name, spread in (("a", "1.5e-05"), ("b", "0.02"), ("c", "3")):
        notes = [COLUMNS, f"steps deviate by {spread} s", *["mended"] * (name == "b")]
        values = np.linspace(0.0, float(ord(name)), 20)
        run = Recording({"pressure": values, "displacement": values}, 0.1, meta={"notes": notes})
        workspace.add(run, origin="", call="", name=name)
    entries = workspace.entries()
    lots = shared(entries)
    assert [list(of) for of in lots] == [["a", "b", "c"]] * 2
    assert [own(entry, lots) for entry in entries] == [(), ("mended",), ()]

    async def look(user: User) -> None:
        await user.should_see(f"3 recordings: {COLUMNS}")
        await user.should_see("3 recordings, such as a: steps deviate by 1.5e-05 s")
        await user.should_see(marker="note-b")
        for name in "ac":
            await user.should_not_see(marker=f"note-{name}")

    visit(workspace, look)
