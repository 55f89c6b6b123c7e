"""What a page chooses from the recordings and results that are there: sides, models, what hinders."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mckibben import Recording
from mckibben.app.desk import Desk
from mckibben.app.jobs import Jobs
from mckibben.app.kept import Step
from mckibben.app.loads import load_in
from mckibben.app.offering import offered, sides
from mckibben.app.pages import apart
from mckibben.app.together import obstacle, sample_times
from mckibben.app.workspace import Workspace
from tests.app.simulated import desk_of, filled, swung, workspace_of
from tests.report.studies_by_hand import hung, two_muscles


def models_of(desk: Desk) -> set[str]:
    return {offer.model for _, offers in offered(desk).groups for offer in offers}


# -- sides ---------------------------------------------------------------------------------------


def test_a_channel_is_on_one_side(tmp_path: Path) -> None:
    desk = desk_of(filled(tmp_path))
    assert (desk.inputs, desk.outputs) == (("pressure",), ("displacement",))
    desk.choose("outputs", ["pressure"])
    assert (desk.inputs, desk.outputs) == (("displacement",), ("pressure",))
    desk.choose("inputs", ["displacement", "pressure"])
    assert (desk.inputs, desk.outputs) == (("displacement",), ("pressure",))


def test_a_dead_load_is_given_beside_and_never_an_input(tmp_path: Path) -> None:
    workspace = workspace_of(tmp_path, hung10=hung(10.0), hung20=hung(20.0))
    desk = desk_of(workspace)
    asked_for = {"input": "pressure", "output": "displacement", "load": "force"}
    for inputs in (["pressure"], ["pressure", "force"]):
        desk.choose("inputs", inputs)
        assert desk.channels == asked_for
        assert desk.looked_at() == (("pressure", "displacement"),)
    assert {"balance"} <= models_of(desk)
    assert "pi" not in models_of(desk)
    desk.choose("inputs", ["force"])
    assert desk.channels == {"input": "force", "output": "displacement"}
    desk.choose("inputs", ["pressure"])
    workspace.set_role(["hung20"], "test")  # what a load does cannot be learned from one
    assert desk.channels == {"input": "pressure", "output": "displacement"}


def test_a_force_that_varies_is_given_where_it_is_chosen(tmp_path: Path) -> None:
    run = swung(10.0)
    desk = desk_of(workspace_of(tmp_path, run=run.with_channels(force=10.0 + np.sin(run.time))))
    assert desk.channels == {"input": "pressure", "output": "displacement"}
    desk.choose("inputs", ["pressure", "force"])
    assert desk.channels["load"] == "force"


def test_at_a_held_length_force_is_the_output_and_pressure_stands_beside(tmp_path: Path) -> None:
    pressure = swung(10.0)["pressure"]
    held = {"pressure": pressure, "displacement": np.full(600, 10.0), "force": 100 * pressure}
    desk = desk_of(workspace_of(tmp_path, held=Recording(held, 0.1)))
    assert desk.channels["output"] == "force"
    assert sides(desk).endswith("pressure")


def test_models_are_offered_by_need_with_reasons_for_the_others(tmp_path: Path) -> None:
    desk = desk_of(filled(tmp_path / "one"))
    found = offered(desk)
    assert {"pi", "gpi", "cpi", "balance"} <= set(found.start) <= models_of(desk)
    assert len(models_of(desk)) + len(found.against) == 51
    assert all(found.against.values())
    several = desk_of(workspace_of(tmp_path / "two", run=two_muscles(5.0)))
    assert several.inputs == ("pressure_1", "pressure_2")
    assert several.channels["output"] == ["displacement_1", "displacement_2"]
    assert {"balance", "play-ridge", "arx"} <= models_of(several)
    assert not {"pi", "gpi", "coupled-pi"} & models_of(several)
    alone = Recording({"pressure": np.sin(np.arange(200))}, 0.1)
    workspace = workspace_of(tmp_path / "alone", run=alone)
    both = Desk(workspace, Jobs(workspace), inputs=("pressure",), outputs=("pressure",))
    assert models_of(both) == set()


def test_where_a_force_drives_what_is_made_for_it_is_offered_first(tmp_path: Path) -> None:
    run = swung(10.0)
    driven = {"force": run["pressure"], "displacement": run["displacement"]}
    desk = desk_of(workspace_of(tmp_path, driven=Recording(driven, 0.1)))
    desk.choose("inputs", ["force"])
    assert "bouc-wen-oscillator" in offered(desk).start


# -- results -------------------------------------------------------------------------------------


def test_results_are_of_the_channels_chosen_and_stale_ones_are_not_kept_chosen(
    tmp_path: Path,
) -> None:
    workspace = filled(tmp_path)
    figures = {"rmse": 0.5}
    for name, output in (("mine", "displacement"), ("other", "force")):
        result = {"status": "ok", "model": "pi", "input": "pressure", "output": output}
        workspace.write_json("results", name, result | {"test": figures, "train": figures})
    desk = Desk(workspace, Jobs(workspace))
    assert [result["name"] for result in desk.results()] == ["mine"]
    desk.outputs = ("force",)
    assert [result["name"] for result in desk.results()] == ["other"]
    seen = {"old": "another", "new": workspace.data(), "older": "another"}
    for name, of in seen.items():
        workspace.write_json("results", name, {"status": "ok", "model": "pi", "data": of})
    assert desk.model_to_show("old", ["new", "old"]) == "new"
    assert desk.model_to_show("own", ["new", "own"]) == "own"  # of which nothing is known
    assert desk.model_to_show("gone", ["new", "old"]) == "new"
    assert desk.model_to_show("old", ["older", "old"]) == "old"


# -- recordings that do not go together ----------------------------------------------------------


def test_sample_times_are_brought_to_one_as_one_change(tmp_path: Path) -> None:
    workspace = Workspace(tmp_path)
    for name, step in (("slow", 0.0169), ("fast", 0.0168)):
        time = np.arange(400) * step
        channels = {"pressure": 2 + np.sin(time), "displacement": np.cos(time)}
        workspace.add(Recording(channels, step), origin="a test", call="", name=name)
    desk = desk_of(workspace)
    times = sample_times(desk)
    assert times == pytest.approx((0.0168, 0.0169))
    assert times is not None
    assert obstacle(desk)
    assert models_of(desk) == set()
    wanted = apart.common(times)
    workspace.edit_each(["fast"], "all resampled", Step(do="resample", sample_time=wanted))
    assert workspace.recording("fast").sample_time == wanted
    assert sample_times(desk) is None
    assert obstacle(desk) == ""
    assert workspace.undo() == "all resampled"
    assert sample_times(desk) == times


def test_what_keeps_models_from_being_fitted_is_named(tmp_path: Path) -> None:
    time = np.arange(400) * 0.05
    channels = {"pressure": 2 + np.sin(time), "x": np.cos(time), "angle": np.sin(time)}
    units = {"pressure": "bar", "x": "mm", "angle": "rad"}
    desk = Desk(workspace := workspace_of(tmp_path), Jobs(workspace))
    assert obstacle(desk) == ""
    workspace.add(Recording(channels, 0.05, units=units), origin="", call="", name="one")
    assert "displacement" in obstacle(desk)
    desk.outputs = ("x", "angle")
    assert all(unit in obstacle(desk) for unit in ("mm", "rad"))
    desk.outputs = ("x",)
    assert obstacle(desk) == ""
    assert models_of(desk)


# -- loads in names ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "force"),
    [
        ("sample2_load200g", 1.96133),
        ("Load_10.04kg_run3", 98.458766),
        ("150N-load", 150.0),
        ("mass 0.5 kg", 4.903325),
        *((name, None) for name in ("run_200g", "load200", "load0g", "load20mm", "load2Nm")),
        *((name, None) for name in ("load2N_load3N", "unload")),
    ],
)
def test_loads_are_read_in_newtons(name: str, force: float | None) -> None:
    load = load_in(name)
    assert (None if load is None else load.force) == pytest.approx(force)


# -- small things --------------------------------------------------------------------------------
