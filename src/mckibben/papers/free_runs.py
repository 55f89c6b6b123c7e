"""Free runs of models over recordings: each once, and what the models warn of."""

from __future__ import annotations

import warnings
from collections.abc import Mapping

from mckibben.blocks.base import Block
from mckibben.errors import ModelWarning
from mckibben.recording import Recording


class FreeRuns:
    """What models give over recordings.

    Parameters
    ----------
    models : mapping of str to Block
        Models by name.

    Attributes
    ----------
    warned : list of str
        What models warned of so far.
    """

    def __init__(self, models: Mapping[str, Block]) -> None:
        self._models = models
        self._found: dict[tuple[str, int], tuple[Recording, Recording]] = {}
        self.warned: list[str] = []

    def __call__(self, name: str, recording: Recording) -> Recording:
        """Return what a model gives over a recording, run at the first call only."""
        key = name, id(recording)
        if key not in self._found:
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always", ModelWarning)
                found = self._models[name].simulate(recording)
            self.warned += [f"{name} on {recording.name}: {warning.message}." for warning in caught]
            self._found[key] = (
                recording,
                found,
            )  # the recording is kept, so that its id stays its own
        return self._found[key][1]
