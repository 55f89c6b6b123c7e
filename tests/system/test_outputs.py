"""A folder holds one run; files of the user's stay."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from mckibben import PI, Recording, write
from mckibben.errors import DataError
from mckibben.outputs import MAKER, RUN, UNFINISHED, claim, results_in

EARLIER = {"a.json": "1", "old.csv": "1", "models/one.json": "1", "gone/all.json": "1"}
LATER = {"a.json": "2", "new.html": "2", "models/one.json": "2", "models/two.json": "2"}
MINE = {"notes.txt": "mine", "models/mine.json": "mine"}


def run(folder: Path, files: dict[str, str], force: bool = False) -> None:
    with results_in(folder, files, force=force) as results:
        assert results is not None
        for name, text in files.items():
            results.write_text(name, text)
        results.commit()


def held(folder: Path) -> dict[str, str]:
    """Return the files of a folder but those of a run that is not complete, and the list of them."""
    paths = [path for path in folder.rglob("*") if path.is_file()]
    texts = {path.relative_to(folder).as_posix(): path.read_text() for path in paths}
    return {n: t for n, t in texts.items() if n != RUN and not n.startswith(UNFINISHED)}


def put(folder: Path, files: dict[str, str]) -> None:
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)


@contextmanager
def unchanged(folder: Path) -> Iterator[None]:
    before = held(folder)
    yield
    assert held(folder) == before


@pytest.mark.parametrize("name", ["a.json", "models/one.json", RUN])
@pytest.mark.parametrize("how", ["another's", "changed since", "a link", "a folder"])
def test_a_file_of_the_user_s_is_not_replaced(tmp_path: Path, name: str, how: str) -> None:
    folder = tmp_path / "out"
    path = folder / name
    if how != "another's":
        run(folder, EARLIER)
        path.unlink()
    if how == "a link":
        path.symlink_to(tmp_path / "elsewhere")
    elif how == "a folder":
        path.mkdir(parents=True)
    else:
        put(folder, {name: "mine"})
    with unchanged(folder), pytest.raises(DataError) as caught:
        run(folder, LATER)
    assert caught.value.file == path
    if how != "a folder":
        run(folder, LATER, force=True)
        assert held(folder).items() >= LATER.items()


def test_a_file_that_is_changed_while_the_run_goes_is_not_replaced(tmp_path: Path) -> None:
    run(tmp_path, EARLIER)
    with results_in(tmp_path, LATER) as results:
        assert results is not None
        results.write_text("a.json", "new")
        put(tmp_path, {"a.json": "mine"})
        with pytest.raises(DataError):
            results.commit()
    assert held(tmp_path) == EARLIER | {"a.json": "mine"}


def test_results_that_were_changed_are_not_removed(tmp_path: Path) -> None:
    run(tmp_path, EARLIER)
    put(tmp_path, {"old.csv": "mine"})
    run(tmp_path, LATER)
    assert held(tmp_path) == LATER | {"old.csv": "mine"}


@pytest.mark.parametrize("name", ["models", UNFINISHED, f"{UNFINISHED}/new"])
def test_links_and_folders_that_lead_elsewhere_are_refused(tmp_path: Path, name: str) -> None:
    put(tmp_path / "elsewhere", {"new/two.json": "mine", "two.json": "mine", "lock": ""})
    folder = tmp_path / "out"
    (folder / name).parent.mkdir(parents=True)
    (folder / name).symlink_to(tmp_path / "elsewhere")
    with unchanged(tmp_path / "elsewhere"), pytest.raises(DataError):
        run(folder, LATER, force=True)


def test_nothing_elsewhere_and_no_input_is_removed(tmp_path: Path) -> None:
    out = tmp_path / "out"
    run(out, EARLIER)
    put(tmp_path, {"mine": "1", "elsewhere/one.json": "1"})
    listed = (out / RUN).read_text()
    (out / RUN).write_text(listed.replace("gone/all.json", "../mine"))
    (out / "models" / "one.json").unlink()
    (out / "models").rmdir()
    (out / "models").symlink_to(tmp_path / "elsewhere")
    with results_in(out, ["a.json"], inputs=[out / "old.csv"]) as results:
        assert results is not None
        results.write_text("a.json", "2")
        results.commit()
    assert held(tmp_path).items() >= {"mine": "1", "elsewhere/one.json": "1"}.items()
    assert (out / "old.csv").exists()


def test_a_folder_of_the_user_s_named_as_ours_is_not_emptied(tmp_path: Path) -> None:
    put(tmp_path, {f"{UNFINISHED}/new/thesis.tex": "mine"})
    with pytest.raises(DataError):
        run(tmp_path, LATER)
    assert (tmp_path / UNFINISHED / "new" / "thesis.tex").read_text() == "mine"


def test_results_of_another_operation_stay(tmp_path: Path) -> None:
    run(tmp_path, EARLIER)
    with pytest.raises(DataError), results_in(tmp_path, ["new"], kind="check"):
        pass
    assert held(tmp_path) == EARLIER
    with results_in(tmp_path, ["new"], kind="check", force=True) as results:
        assert results is not None
        results.write_text("new", "1")
        results.commit()
    assert held(tmp_path) == {"new": "1"}


def test_one_process_writes_to_a_folder(tmp_path: Path) -> None:
    other = "import sys, pathlib; from mckibben.outputs import results_in\n"
    other += "with results_in(sys.argv[1], ['a']): pass"
    command = [sys.executable, "-c", other, str(tmp_path)]
    with results_in(tmp_path, ["a"]):
        refused = subprocess.run(command, capture_output=True, text=True, check=False)
    assert "DataError" in refused.stderr
    subprocess.run(command, check=True)


def test_what_was_stopped_is_found_and_then_done_anew(tmp_path: Path) -> None:
    run(tmp_path, EARLIER)
    with pytest.raises(KeyboardInterrupt), results_in(tmp_path, LATER) as results:  # noqa: PT012
        assert results is not None
        results.write_text("a.json", "half")
        raise KeyboardInterrupt
    assert (tmp_path / UNFINISHED / "new" / "a.json").read_text() == "half"
    assert held(tmp_path) == EARLIER
    run(tmp_path, LATER)
    assert held(tmp_path) == LATER
    with pytest.raises(DataError), results_in(tmp_path / "refused", ["x/../../y"]):
        pass
    assert not (tmp_path / "refused").exists()


def test_single_files_are_ours_by_what_is_in_them(tmp_path: Path) -> None:
    PI((0.0,), (1.0,)).save(tmp_path / "model.json")
    made = Recording({"pressure": np.linspace(0.0, 1.0, 3)}, 0.1)
    write(made, tmp_path / "run.csv")
    put(tmp_path, {"figure.svg": f"<svg>{MAKER}</svg>", "empty.json": ""})
    for name in ("model.json", "run.csv", "figure.svg", "empty.json", "new.csv"):
        claim(tmp_path / name)
    put(tmp_path, {"other.json": "{}", "other.svg": "<svg/>", "other.csv": "a\n1\n"})
    (tmp_path / "run.csv").write_text((tmp_path / "run.csv").read_text() + "9,9\n")
    (tmp_path / "link.json").symlink_to(tmp_path / "model.json")
    for name in ("other.json", "other.svg", "other.csv", "run.csv", "link.json"):
        with pytest.raises(DataError):
            claim(tmp_path / name)
        claim(tmp_path / name, force=True)
    put(tmp_path, {"new.csv-metadata.json": "mine"})
    with pytest.raises(DataError):  # the description that would be beside it
        claim(tmp_path / "new.csv")
    with pytest.raises(DataError):
        claim(tmp_path / "model.json", inputs=[tmp_path / "model.json"], force=True)
