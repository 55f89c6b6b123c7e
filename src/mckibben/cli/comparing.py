"""What compare and study are asked alike, and how both begin."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mckibben.cli.options import (
    AllowEarly,
    AllowShared,
    Dask,
    Force,
    Inputs,
    Jobs,
    Json,
    Load,
    Models,
    Outputs,
    Quick,
    Reading,
    Samples,
    Seed,
    Settings,
    Test,
    chosen_models,
)
from mckibben.cli.output import progress_bar

if TYPE_CHECKING:
    from mckibben.outputs import Results
    from mckibben.recording import Recording


@dataclass(frozen=True)
class Asked:
    """Data, models, and how to work."""

    test: Test = None
    input: Inputs = None
    output: Outputs = None
    load: Load = None
    models: Models = "all"
    quick: Quick = False
    settings: Settings = None
    seed: Seed = 0
    jobs: Jobs = None
    dask: Dask = None
    samples: Samples = None
    allow_shared: AllowShared = False
    allow_early: AllowEarly = False
    force: Force = False
    as_json: Json = False

    def begin(
        self,
        files: Sequence[Path],
        reading: Reading,
        folder: Path | None,
        written: Callable[[Sequence[str]], Iterable[str]],
        beside: Sequence[Path] = (),
    ) -> Begun:
        """Check what is asked, claim what will be written by the models' names, and read the files."""
        from mckibben import registry
        from mckibben.comparison.offered import settings_of_all
        from mckibben.files.sources import expanded
        from mckibben.outputs import Results
        from mckibben.system import workers

        if self.jobs != 1 and self.dask is None:
            workers.prepare()
        models = chosen_models(self.models, self.quick)
        names = registry.names("estimators") if isinstance(models, str) else models
        settings = settings_of_all(names, self.settings) if self.settings else {}
        sorted_files = expanded(list(files), self.test or [])
        results = None
        if folder is not None:
            inputs = [*beside, *(file for some in sorted_files for file in some)]
            results = Results(folder, inputs=inputs, force=self.force)
            results.claim(list(written(names)))
        train, checks, tests = reading.read_all(sorted_files, self.input, self.output, self.load)
        given = {
            "inputs": self.input,
            "outputs": self.output,
            "load": self.load,
            "validation": checks,
            "models": models,
            "settings": settings,
            "seed": self.seed,
            "jobs": self.jobs,
            "most_samples": self.samples,
            "allow_shared": self.allow_shared,
            "allow_early": self.allow_early,
            "folder": folder,
            "clear": False,
        }
        return Begun((train, tests), given, results)

    @contextmanager
    def telling(self, what: str) -> Iterator[Callable[[float, str], None]]:
        """Work, on the cluster where one is named, and tell how far it is."""
        from mckibben.comparison.backends import on_cluster

        with on_cluster(self.dask), progress_bar(what, plainly=True) as tell:
            yield tell


@dataclass(frozen=True)
class Begun:
    """What a comparison starts from.

    Parameters
    ----------
    recordings : (list of Recording, list of Recording)
        To fit, and to test on.
    given : dict
        What else `mckibben.compare` and `mckibben.study` are given.
    results : Results or None
        Where they are written.
    """

    recordings: tuple[list[Recording], list[Recording]]
    given: dict[str, Any]
    results: Results | None

    @property
    def every(self) -> list[Recording]:
        """All recordings read."""
        train, tests = self.recordings
        return [*train, *self.given["validation"], *tests]
