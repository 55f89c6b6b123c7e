"""The bundled recordings: two runs of the virtual rig `mas20-hanging`, of the protocol `field-models`.

``mckibben rig record field-models -o FOLDER`` records them anew, to the bit.
"""

from __future__ import annotations

from pathlib import Path

FOLDER = Path(__file__).parent

TRAIN, TEST = FOLDER / "decaying-triangle.csv", FOLDER / "irregular-triangle.csv"
"""A recording to fit models to, and one to test them on: pressure [bar], displacement [mm]."""


def files() -> list[Path]:
    """Return the recordings, their descriptions, and ``protocol.json`` with their roles."""
    return sorted(path for path in FOLDER.iterdir() if path.suffix in (".csv", ".json"))
