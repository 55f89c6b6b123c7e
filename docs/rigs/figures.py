"""Draw what the virtual rigs do the way the papers draw theirs, one picture a rig.

Run: python docs/rigs/figures.py FOLDER
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from calibration import last_cycle, recorded, static_force
from matplotlib.figure import Figure

from mckibben.papers.activation_pressure import protocol as activation


def soft_arm(figure: Figure) -> None:
    """Loops of the twelve patterns (the paper's Figure 4), and the effect of p0 (Figure 5)."""
    runs = recorded("sdchm", lambda name: name.startswith(("coupling", "stiffness")))
    axes: Any = figure.subplots(5, 3)
    for row, pattern in zip(axes, ("1", "2", "3", "123"), strict=False):
        cycle = last_cycle(runs[f"coupling-drive-{pattern}"], 50.0)
        for k, panel in enumerate(row, start=1):
            driver = k if pattern == "123" else int(pattern)
            panel.plot(cycle[f"pressure_{driver}"], cycle[f"displacement_{k}"], lw=0.8)
            panel.set(xlabel=f"p{driver} [bar]", ylabel=f"y{k} [mm]", title=f"driven: {pattern}")
    for k, panel in enumerate(axes[4], start=1):
        for p0 in (0.0, 0.5, 1.0, 2.5):
            cycle = last_cycle(runs[f"stiffness-p0-{p0:.1f}"], 50.0)
            panel.plot(cycle["pressure_1"], cycle[f"displacement_{k}"], lw=0.8, label=f"p0 {p0:g}")
        panel.set(xlabel="p1 [bar]", ylabel=f"y{k} [mm]")
        panel.legend(fontsize=7)


def hanging(figure: Figure) -> None:
    """Pressures and displacements against time, and their loops (the paper's Figure 2)."""
    axes: Any = figure.subplots(3, 2)
    for column, (name, recording) in zip(axes.T, recorded("field-models").items(), strict=True):
        column[0].plot(recording.time, recording["pressure"], lw=0.8)
        column[0].set(title=name, ylabel="pressure [bar]")
        column[1].plot(recording.time, recording["displacement"], lw=0.8)
        column[1].set(xlabel="time [s]", ylabel="displacement [mm]")
        column[2].plot(recording["pressure"], recording["displacement"], lw=0.6)
        column[2].set(xlabel="pressure [bar]", ylabel="displacement [mm]")


def test_stand(figure: Figure) -> None:
    """Isobaric force, isometric force, and the hysteresis at 4 bar (Figures 2, 3 and 6)."""
    runs = recorded("multistate-friction")
    axes: Any = figure.subplots(1, 3)
    for name, recording in runs.items():
        if name.startswith("isometric"):
            axes[1].plot(recording["pressure"], recording["force"], lw=0.8, label=name[10:])
        elif name != "isobaric-minor-loops":
            axes[0].plot(recording["length"], recording["force"], lw=0.8, label=name[9:])
    for name in ("isobaric-4bar", "isobaric-minor-loops"):
        recording = runs[name]
        extracted = recording["force"] - static_force(recording["length"], 4.0)
        axes[2].plot(recording["length"], extracted, lw=0.6, label=name[9:])
    axes[0].set(xlabel="length [mm]", ylabel="force [N]", title="isobaric")
    axes[1].set(xlabel="pressure [bar]", ylabel="force [N]", title="isometric")
    axes[2].set(xlabel="length [mm]", ylabel="force less static law [N]", title="hysteresis, 4 bar")
    for panel in axes:
        panel.legend(fontsize=7)


def rail(figure: Figure) -> None:
    """Loops at three frequencies, under loads (Figures 1 and 2), and force-displacement (Figure 3)."""
    runs = recorded("mpi-narmax")
    axes: Any = figure.subplots(2, 3)
    for f in (0.05, 0.1, 0.2):
        free = last_cycle(runs[f"free-{f:g}Hz"], 1 / f)
        axes[0, 0].plot(free["voltage"], free["displacement"], lw=0.8, label=f"{f:g} Hz")
    for panel, f in zip((axes[0, 1], axes[0, 2], axes[1, 0]), (0.05, 0.1, 0.2), strict=True):
        for load in ("hand", "weight", "free"):
            run = runs[f"{load}-{f:g}Hz"]
            panel.plot(run["voltage"], run["displacement"], lw=0.6, label=load)
        panel.set_title(f"{f:g} Hz")
    for volt in (2, 4, 6, 8, 10):
        held = last_cycle(runs[f"held-{volt}V"], 20.0)
        axes[1, 1].plot(held["displacement"], held["force"], lw=0.6, label=f"{volt} V")
    status = runs["status-4"]
    axes[1, 2].plot(status.time, status["displacement"], lw=0.6, label="displacement [mm]")
    axes[1, 2].plot(status.time, status["force"] / 10, lw=0.6, label="force [10 N]")
    for panel in axes.flat:
        panel.legend(fontsize=7)
        panel.set(xlabel="voltage [V]", ylabel="displacement [mm]")
    axes[1, 1].set(xlabel="displacement [mm]", ylabel="force [N]")
    axes[1, 2].set(xlabel="time [s]", ylabel="status 4")


def mckibben(figure: Figure) -> None:
    """Pressure against contraction at every force and frequency (Figures 3 and 12), random waves."""
    runs = recorded("activation-pressure")
    axes: Any = figure.subplots(2, 4)
    for panel, force in zip(axes.flat, activation.FORCES, strict=False):
        slow = runs[f"static-{force:.0f}N"]
        panel.plot(slow["displacement"] / 530, slow["pressure"], "k", lw=0.5, label="slow")
        for frequency in activation.FREQUENCIES:
            cycle = last_cycle(runs[f"sine-{force:.0f}N-{frequency:.1f}Hz"], 1 / frequency)
            contraction = cycle["displacement"] / 530
            panel.plot(contraction, cycle["pressure"], lw=0.8, label=f"{frequency:g} Hz")
        panel.set(title=f"{force:.0f} N", xlabel="contraction", ylabel="pressure [bar]")
        panel.legend(fontsize=6)
    random = runs["random-150N-1.0Hz"]
    axes[1, 3].plot(random["displacement"] / 530, random["pressure"], lw=0.5)
    axes[1, 3].set(title="random wave, 150 N, 1 Hz", xlabel="contraction")


PICTURES: Mapping[str, tuple[Callable[[Figure], None], tuple[float, float]]] = {
    "soft-arm": (soft_arm, (11, 15)),
    "mas20-hanging": (hanging, (11, 10)),
    "mas10-test-stand": (test_stand, (15, 5)),
    "rail": (rail, (14, 9)),
    "mckibben-530": (mckibben, (16, 8)),
}


def main() -> None:
    """Draw all pictures into the folder given."""
    if len(sys.argv) != 2:
        sys.exit("Usage: python docs/rigs/figures.py FOLDER")
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    mpl.rcParams.update({"axes.grid": True, "grid.alpha": 0.3, "font.size": 8})
    for name, (draw, size) in PICTURES.items():
        figure = Figure(figsize=size, layout="constrained")
        draw(figure)
        figure.suptitle(name)
        figure.savefig(folder / f"{name}.png", dpi=np.round(110))
        print(folder / f"{name}.png")


if __name__ == "__main__":
    main()
