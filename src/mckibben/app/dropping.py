"""Where files are dropped: as large as is taken, and again as often as one likes."""

from __future__ import annotations

from typing import Any

from nicegui import ui

from mckibben.app.desk import tell
from mckibben.app.guard import LARGEST_UPLOAD, TOO_LARGE

ALREADY = "A file of this name and size is in the list already: take it off with its cross first."


def drop_zone(label: str, **options: Any) -> Any:
    """Return an uploader that forgets what has come, so that a file may be dropped anew.

    Parameters
    ----------
    label : str
    **options
        Of `nicegui.ui.upload`.
    """
    zone = ui.upload(label=label, auto_upload=True, max_file_size=LARGEST_UPLOAD, **options)
    # not reset, which would break off what is dropped meanwhile
    zone.on("finish", lambda: zone.run_method("removeUploadedFiles"))
    zone.on(
        "rejected",
        lambda event: tell(ALREADY if set(event.args) == {"duplicate"} else TOO_LARGE),
        js_handler="(files) => emit(files.map((one) => one.failedPropValidation))",
    )
    return zone
