"""The folder that holds all that was done: recordings, models, and what came of them."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mckibben.app import kept
from mckibben.app.caching import Cache
from mckibben.app.changing import Changing
from mckibben.app.forms import inverse_of
from mckibben.app.recordings import demand_text
from mckibben.comparison.choosing import order
from mckibben.errors import MckibbenError
from mckibben.numerals import numeral

if TYPE_CHECKING:  # loaded when they are first used, so that the page is there at once
    from mckibben.blocks.bands import Band
    from mckibben.blocks.base import Block
    from mckibben.control import Twin

MOST_MODELS = 500
"""Models held in memory."""

WEAKER = 1.2
"""Times the validation RMSE of the model inverted, above which a plant predicts worse."""


class Workspace(Changing):
    """Recordings, models, and what came of fits and closed loops, as plain files in a folder.

    Parameters, and errors, are those of `mckibben.app.folder.Folder`.
    """

    def __init__(self, folder: str | Path) -> None:
        super().__init__(folder)
        self._models: Cache[Block] = Cache(MOST_MODELS)
        self._inverses: Cache[bool] = Cache(MOST_MODELS)
        self._rigs: Cache[list[str]] = Cache(MOST_MODELS)
        self.ticked: list[str] | None = None  # models to fit, kept for pages that are loaded again

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
        from mckibben.blocks.saving import load

        path = self.path(folder, f"{name}.json")

        def make() -> tuple[Block, int]:
            block = load(path)
            demand_text(*(c.name + c.unit for c in (*block.inputs, *block.outputs)))
            return block, 1

        return self._models.get(path, make)

    def invertible(self, name: str) -> bool:
        """Tell whether a model has a compensator, and is none itself."""

        def make() -> tuple[bool, int]:
            inverse_of(self.model(name))
            return True, 1

        with suppress(MckibbenError):
            return self._inverses.get(self.path("models", f"{name}.json"), make)
        return False

    def ranked(self) -> list[str]:
        """Return the models in the order of the choice.

        Those not fitted here come after the rest, and those that are not recommended last.
        """
        known = self.models()
        refused = {row["name"]: bool(row["not_recommended"]) for row in self.results()}
        names = [
            *(name for name in refused if name in known),
            *(n for n in known if n not in refused),
        ]
        return sorted(names, key=lambda name: refused.get(name, False))

    def to_invert(self) -> list[str]:
        """Return the models that have a compensator, in the order of `ranked`."""
        return [name for name in self.ranked() if self.invertible(name)]

    def band(self, name: str) -> Band | None:
        """Return the band of a model, or None where it has none."""
        from mckibben.blocks.bands import Banded

        if self.path("banded", f"{name}.json").exists():
            with suppress(MckibbenError):
                block = self.model(name, "banded")
                return block.band if isinstance(block, Banded) else None
        return None

    def twin(self, name: str) -> Twin:
        """Return a model as a plant, with its band where it has one.

        Where it does not know its limits, they are those recorded.

        Raises
        ------
        MckibbenError
            If it cannot be one.
        """
        from mckibben.control import Twin

        folder, limits = self.twin_of(name)
        return Twin(self.model(name, folder), limits=limits, name=name)

    def twin_of(self, name: str) -> tuple[str, dict[str, tuple[float, float]]]:
        """Return the folder of the model that is a plant, and limits that it does not know itself."""
        from mckibben.control.identified import known_ranges

        folder = "banded" if self.path("banded", f"{name}.json").exists() else "models"
        model, limits = self.model(name, folder), {}
        for channel in model.inputs:
            runs = [run[channel.name] for run in self.readable() if channel.name in run]
            if runs and channel.name not in known_ranges(model):
                ends = min(float(u.min()) for u in runs), max(float(u.max()) for u in runs)
                if ends[0] < ends[1]:
                    limits[channel.name] = ends
        return folder, limits

    def plants(self, inverted: str) -> list[str]:
        """Return the models that a model's compensator can be tried on, in the order of the choice.

        Others first, for on its own model a compensator proves nothing; of these, those that predict at
        all, then as well; then models that know time, for on those that do not, feedback is better than
        it will be.
        """
        idle, weak = self.idle(), self.weaker(inverted)
        undone = self.model(inverted)
        inputs, outputs = ({c.name for c in ends} for ends in (undone.inputs, undone.outputs))
        found = []
        for place, name in enumerate(self.ranked()):
            with suppress(MckibbenError):
                twin = self.twin(name)
                if set(twin.inputs) == inputs and set(twin.outputs) == outputs:
                    for each in inputs.difference(undone.scheduling):
                        twin.limits(each)
                    itself, timed = twin.forward == undone, twin.forward.rate_dependent
                    doubts = itself, name in idle, name in weak, not timed
                    found.append((*doubts, place, name))
        return [name for *_, name in sorted(found)]

    def weaker(self, inverted: str) -> dict[str, str]:
        """Return the models that predict worse than one that is inverted, and by how much, in words."""
        rows = {row["name"]: row for row in self.results() if row["validation_rmse"]}
        ours = rows.get(inverted)
        return {
            name: f"{name} predicts worse than {inverted}: its validation RMSE is {_rmse(row)}, not "
            f"{_rmse(ours)}. Loops on it say little of your muscle."
            for name, row in rows.items()
            if ours
            and (row["unit"], row["data"]) == (ours["unit"], ours["data"])
            and row["validation_rmse"] > WEAKER * ours["validation_rmse"]
        }

    def idle(self) -> set[str]:
        """Return the models that predict no better than a mean where nothing was fitted."""
        found = set()
        for row in self.results():
            least = ((row["constant"] or {}).get("test") or {}).get("rmse")
            tested = (row["test"] or {}).get("rmse")
            worse = tested is not None and least is not None and not tested < least
            if worse or (row["skill_least"] is not None and not row["skill_least"] > 0):
                found.add(row["name"])
        return found

    def test_errors(self) -> dict[str, str]:
        """Return the test error of every model that has been tested, in words."""
        tested = [row for row in self.results() if (row["test"] or {}).get("rmse") is not None]
        return {row["name"]: f"test RMSE {_rmse(row, test=True)}" for row in tested}

    def same(self, inverted: str, plant: str) -> bool:
        """Tell whether a plant is the very model that a compensator undoes."""
        from mckibben.control.suiting import of_itself

        return of_itself(self.model(inverted), self.twin(plant))

    def cached_rigs(self, model: str, look: Callable[[], list[str]]) -> list[str]:
        """Return the virtual rigs of a model's size; they are looked for once, as that takes seconds."""
        return self._rigs.get(self.path("models", f"{model}.json"), lambda: (look(), 1))

    def warm(self) -> None:
        """Read what has changed; what is read is then at hand, for pages that must not wait."""
        for entry in self.entries():
            with suppress(MckibbenError):
                self.recording(entry.name)
        self.data()
        for name in self.names("models"):
            self.invertible(name)

    def results(self) -> list[dict[str, Any]]:
        """Return what is known of every model fitted, in the order of the choice: not by the test.

        Those fitted and tested on recordings as they are now come first, and are ``"current"``.
        """
        found, data = [], self.data()
        for name in self.names("results"):
            result = kept.checked(kept.Fitted, self.read_json("results", name))
            if result is not None:
                current = result.data in ("", data)
                found.append(result.model_dump() | {"name": name, "current": current})
        return sorted(found, key=_as_in_a_leaderboard)

    def runs(self, model: str) -> dict[str, kept.Followed]:
        """Return what is known of the closed loops with a model, by their names."""
        found = {
            name: kept.checked(kept.Followed, self.read_json("runs", name))
            for name in self.names("runs")
        }
        return {name: run for name, run in found.items() if run is not None and run.model == model}

    def reviews(self) -> dict[str, kept.Reviewed]:
        """Return what logs of the real rig said, by their names, newest last."""
        return self._all("reviews", kept.Reviewed)

    def estimates(self) -> dict[str, kept.Estimated]:
        """Return estimates of force, by their names, newest last."""
        return self._all("forces", kept.Estimated)

    def _all(self, kind: str, of: type[kept.Any_]) -> dict[str, kept.Any_]:
        paths = {name: self.path(kind, f"{name}.json") for name in self.names(kind)}
        order = sorted(paths, key=lambda name: paths[name].stat().st_mtime_ns)
        found = {name: kept.checked(of, self.read_json(kind, name)) for name in order}
        return {name: one for name, one in found.items() if one is not None}


def _rmse(result: dict[str, Any], test: bool = False) -> str:
    value = result["test"]["rmse"] if test else result["validation_rmse"]
    return f"{numeral(value, 3)} {result['unit']}"


def _as_in_a_leaderboard(result: dict[str, Any]) -> tuple[Any, ...]:
    fitted = (result["train"] or {}).get("rmse")
    ranked = order(result["model"], result["validation_rmse"], fitted, result["skill_least"])
    return not result["current"], *ranked
