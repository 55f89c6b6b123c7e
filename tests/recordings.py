"""Where measured recordings lie that are not ours to pass on; tests of them are skipped without."""

from __future__ import annotations

import os
from pathlib import Path

MEASURED = Path(os.environ.get("MCKIBBEN_DATA", Path(__file__).parents[2] / "shared" / "data"))
