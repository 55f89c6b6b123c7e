"""The tables and figures, the paper's printed numbers beside."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mckibben.arrays import Array
from mckibben.papers.mpi_narmax.found import Found
from mckibben.papers.mpi_narmax.models import (
    AS_PRINTED,
    HELD_RUNS,
    OURS,
    PLAIN,
    PULLS,
    RANDOM,
    STATUSES,
    TEST,
    THREE_RATES,
    TOLD,
    UNLOADED,
)
from mckibben.papers.mpi_narmax.protocol import HELD, HIGH, LOW
from mckibben.papers.mpi_narmax.published import (
    POLYNOMIAL,
    TURNING_POINT,
    modified_prandtl_ishlinskii,
)
from mckibben.papers.reproduction import Cell, Figure, Points, Table, thinned
from mckibben.signals import sine

PRINTED_MAE = {
    "MPI-1": (0.5675, 6.8589, 10.0609, 3.8926),
    "MPI-2": (4.6434, 0.1716, 3.2333, 3.6108),
    "MPI-3": (7.8112, 3.2266, 0.1628, 6.7443),
    "MPI-NARMAX": (0.3094, 0.2887, 0.3676, 0.9304),
}

PRINTED_RMSE = {
    "MPI-1": (0.6577, 5.4060, 6.5387, 4.4845),
    "MPI-2": (2.9424, 0.2348, 1.9331, 2.3808),
    "MPI-3": (4.5439, 1.9357, 0.2146, 3.8913),
    "MPI-NARMAX": (0.3997, 0.3887, 0.4668, 1.2138),
}
"""By status [mm], as printed."""

PRINTED_PULLS = {"MPI-1": (None, None), "MPI-NARMAX": (0.8730, 1.0913)}
"""MAE and RMSE on the training pulls [mm], as printed in Section 4.2."""


def unrepeated(found: Found) -> Table:
    """Return errors on what was learned from, and on motion that training does not repeat."""
    rows: list[tuple[Cell, ...]] = []
    for name in found.models:
        learned = TOLD[name].learned if name in TOLD else f"status {name[-1]}"
        runs = TOLD[name].runs if name in TOLD else (STATUSES[UNLOADED.index(name)],)
        errors = [found.errors(name, *where) for where in (runs, (TEST,), (RANDOM,), HELD_RUNS)]
        rows.append((name, learned, *(value for pair in errors for value in pair)))
    where = ("learned from", "status 4", "random", "voltage held")
    headings = [f"{place}, {what}" for place in where for what in ("MAE", "RMSE")]
    return Table(
        "Motion that training does not repeat [mm]",
        ("model", "runs", *headings),
        tuple(rows),
        "More records: no load at three rates, statuses 1 to 3, pulls of 100 N, and two runs in which "
        "voltage and force vary at random. Random: another such run.",
    )


def held(found: Found) -> Table:
    """Return how far the displacement swings while the voltage is held and the force is cycled."""
    rows: list[tuple[Cell, ...]] = [
        ("muscle", None, None, *(found.swing(run) for run in HELD_RUNS))
    ]
    for name in found.models:
        swings = (found.swing(run, name) for run in HELD_RUNS)
        rows.append((name, *found.errors(name, *HELD_RUNS), *swings))
    return Table(
        "Figure 3: voltage held, force cycled between 0 and 150 N [mm]",
        ("model", "MAE", "RMSE", *(f"swing at {volt:g} V" for volt in HELD)),
        tuple(rows),
        "Swing: range of the displacement over the last cycle. A model that is not told the force has "
        "none. Nothing was learned from these runs.",
    )


def by_status(found: Found) -> Iterator[Table]:
    """Yield the paper's Tables 2 and 3."""
    headings = [f"status {k}, {which}" for which in ("printed", "here") for k in range(1, 5)]
    for place, (what, printed) in enumerate((("MAE", PRINTED_MAE), ("RMSE", PRINTED_RMSE))):
        rows: list[tuple[Cell, ...]] = []
        for name in found.models:
            known: tuple[Cell, ...] = printed.get(name, (None,) * 4)
            rows.append((name, *known, *(found.errors(name, run)[place] for run in STATUSES)))
        title = f"{what} by status [mm] (its Table {2 + place})"
        last = Points(f"{what} on status 4 [mm]", ("status 4, printed", "status 4, here"))
        yield Table(title, ("model", *headings), tuple(rows), _NOTE, last)


_NOTE = (
    "MPI-k was identified on status k; models of more records learned from statuses 1 to 3, those of "
    "one record from none. Printed figures are quoted as printed: some RMSE are below their MAE, which "
    "cannot be."
)


def pulls(found: Found) -> Table:
    """Return errors on the training and test pulls."""
    rows: list[tuple[Cell, ...]] = []
    for name in ("MPI-1", *found.told):
        tested: tuple[Cell, ...] = (None, None)
        if name in PRINTED_MAE:
            tested = (PRINTED_MAE[name][3], PRINTED_RMSE[name][3])
        trained: tuple[Cell, ...] = PRINTED_PULLS.get(name, (None, None))
        rows.append(
            (name, *trained, *found.errors(name, PULLS), *tested, *found.errors(name, TEST))
        )
    headings = [
        f"{role}, {what}{which}"
        for role in ("training", "test")
        for which in (", printed", "")
        for what in ("MAE", "RMSE")
    ]
    return Table(
        "Figures 7 and 8: training pulls of 100 N, test pulls of 150 N [mm]",
        ("model", *headings),
        tuple(rows),
        "Printed in Section 4.1 for MPI alone, without load at 0.1 Hz: MAE 0.4538, RMSE 0.6120; its "
        "Table 2 prints 0.5675 and 0.6577 for that status.",
    )


def folded() -> Table:
    """Return where the printed MPI goes past the turning point of its map."""
    hysteresis, _ = modified_prandtl_ishlinskii().parts
    rows = []
    for frequency in (0.05, 0.1, 0.2, 0.22):
        time = np.arange(round(2 / frequency / 0.001)) * 0.001
        wave = sine(time, 1 / frequency, HIGH, LOW)
        b = np.asarray(hysteresis.simulate(wave, sample_time=0.001))[time.size // 2 :]
        moved = np.polyval(POLYNOMIAL, b)
        past = 100 * float(np.mean(np.abs(b) > TURNING_POINT))
        rows.append((frequency, float(b.max()), past, float(moved.min()), float(moved.max())))
    return Table(
        "Table 1: the printed MPI under its own excitation",
        ("frequency [Hz]", "largest b", "past the fold [%]", "lowest [mm]", "highest [mm]"),
        tuple(rows),
        f"Its map from b to displacement turns at b = {TURNING_POINT:.3f} and falls beyond: there the "
        "displacement falls while b rises. It was identified at 0.1 Hz.",
    )


def figures(found: Found) -> tuple[Figure, ...]:
    """Return loops, forces and closed loops."""
    shown = ("MPI-1", AS_PRINTED, THREE_RATES, OURS)

    def curves(run: str, against: str, models: Sequence[str]) -> dict[str, tuple[Array, Array]]:
        def part(values: Array) -> Array:
            return thinned(found.counted(run, values))

        x = part(found.recordings[run][against])
        drawn = {found.recordings[run].origin: (x, part(found.recordings[run]["displacement"]))}
        return drawn | {name: (x, part(found.displacements[name][run])) for name in models}

    figures = [
        Figure(f"{run}: loops", "voltage [V]", "displacement [mm]", curves(run, "voltage", shown))
        for run in (*STATUSES, PULLS)
    ]
    figures += [
        Figure(
            f"{run}: force and displacement (Figures 3, 7 and 8)",
            "force [N]",
            "displacement [mm]",
            curves(run, "force", (*shown[1:], PLAIN)),
        )
        for run in (PULLS, TEST, *HELD_RUNS)
    ]
    time = thinned(found.recordings[TEST].time)
    sensed, estimated = found.forces[TEST]
    figures.append(
        Figure(
            "Status 4: force, and its estimate",
            "time [s]",
            "force [N]",
            {"sensor": (time, thinned(sensed)), "estimated": (time, thinned(estimated))},
        )
    )
    if found.loops:
        first = next(iter(found.loops.values())).recording
        tracked = {"reference": (thinned(first.time), thinned(first["reference_displacement"]))}
        for name, loop in found.loops.items():
            y = loop.recording["displacement"]
            tracked[name] = (thinned(loop.recording.time), thinned(y))
        figures.append(Figure("Under a load", "time [s]", "displacement [mm]", tracked))
    return tuple(figures)
