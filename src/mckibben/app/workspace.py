"""The folder that holds all that was done: recordings, models, and what came of them."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mckibben.app import kept
from mckibben.app.caching import Cache
from mckibben.app.changing import Changing
from mckibben.app.recordings import demand_text
from mckibben.comparison.recommending import order
from mckibben.errors import MckibbenError

if TYPE_CHECKING:  # loaded when they are first used, so that the page is there at once
    from mckibben.blocks.core.block import Block
    from mckibben.control import Twin

MOST_MODELS = 500
"""Models held in memory."""


class Workspace(Changing):
    """Recordings, models, and what came of fits and closed loops, as plain files in a folder.

    Parameters, and errors, are those of `mckibben.app.folder.Folder`.
    """

    def __init__(self, folder: str | Path) -> None:
        super().__init__(folder)
        self._models: Cache[Block] = Cache(MOST_MODELS)
        self._inverses: Cache[bool] = Cache(MOST_MODELS)

    def models(self) -> list[str]:
        """Return the names of the models that can be loaded."""
        return [name for name in self.names("models") if self._is_model(name)]

    def _is_model(self, name: str) -> bool:
        with suppress(MckibbenError):
            self.model(name)
            return True
        return False

    def model(self, name: str, folder: str = "models") -> Block:
        """Return a model, or one with its band from ``banded``; it is loaded once.

        Raises
        ------
        ModelError
            If it is missing or damaged.
        """
        from mckibben.blocks.core.saving import load

        path = self.path(folder, f"{name}.json")

        def make() -> tuple[Block, int]:
            block = load(path)
            demand_text(*(c.name + c.unit for c in (*block.inputs, *block.outputs)))
            return block, 1

        return self._models.get(path, make)

    def invertible(self, name: str) -> bool:
        """Tell whether a model has an inverse, and is none itself."""

        def make() -> tuple[bool, int]:
            from mckibben.blocks.core.inverse import Inverse

            block = self.model(name)
            block.inverse()
            one = len(block.inputs) == len(block.outputs) == 1
            return one and not isinstance(block, Inverse), 1

        with suppress(MckibbenError):
            return self._inverses.get(self.path("models", f"{name}.json"), make)
        return False

    def twin(self, name: str) -> Twin:
        """Return a model as a plant, with its band where it has one.

        Where it does not know its limits, they are those recorded.

        Raises
        ------
        MckibbenError
            If it cannot be one.
        """
        from mckibben.control import Twin
        from mckibben.control.identified import known_ranges

        banded = self.path("banded", f"{name}.json").exists()
        model, limits = self.model(name, "banded" if banded else "models"), {}
        for channel in model.inputs:
            runs = [run[channel.name] for run in self.readable() if channel.name in run]
            if runs and channel.name not in known_ranges(model):
                ends = min(float(u.min()) for u in runs), max(float(u.max()) for u in runs)
                if ends[0] < ends[1]:
                    limits[channel.name] = ends
        return Twin(model, limits=limits, name=name)

    def plants(self, inverted: str) -> list[str]:
        """Return the models that a model's compensator can be tried on.

        Others first, for on its own model a compensator proves nothing.
        """
        undone = self.model(inverted)
        found = []
        for name in self.models():
            with suppress(MckibbenError):
                twin = self.twin(name)
                if twin.inputs == tuple(c.name for c in undone.inputs) and twin.outputs == tuple(
                    c.name for c in undone.outputs
                ):
                    twin.limits(twin.inputs[0])
                    found.append((twin.forward == undone, name))
        return [name for _, name in sorted(found)]

    def warm(self) -> None:
        """Read what has changed; what is read is then at hand, for pages that must not wait."""
        for entry in self.entries():
            with suppress(MckibbenError):
                self.recording(entry.name)
        for name in self.names("models"):
            self.invertible(name)

    def results(self) -> list[dict[str, Any]]:
        """Return what is known of every model fitted, in the order of the choice: not by the test."""
        found = []
        for name in self.names("results"):
            result = kept.checked(kept.Fitted, self.read_json("results", name))
            if result is not None:
                found.append(result.model_dump() | {"name": name})
        return sorted(found, key=_as_in_a_leaderboard)

    def runs(self, model: str) -> dict[str, kept.Followed]:
        """Return what is known of the closed loops with a model, by their names."""
        found = {
            name: kept.checked(kept.Followed, self.read_json("runs", name))
            for name in self.names("runs")
        }
        return {name: run for name, run in found.items() if run is not None and run.model == model}


def _as_in_a_leaderboard(result: dict[str, Any]) -> tuple[bool, bool, float, str]:
    fitted = (result["train"] or {}).get("rmse")
    return order(result["model"], result["validation_rmse"], fitted)
