"""Exported C: instructions per step of inverses on an emulated Arm Cortex-M4F."""

import re
import sys
from pathlib import Path

from matplotlib.figure import Figure

SHOWN = {
    "pi-inverse": "Prandtl-Ishlinskii",
    "gpi-inverse": "generalized\nPrandtl-Ishlinskii",
    "preisach-inverse": "Preisach",
    "maxwell-slip-inverse": "Maxwell-slip",
    "bouc-wen-inverse": "Bouc-Wen",
    "balance": "force balance",
}
TABLE = Path("docs/deploy/microcontroller.md")  # by benchmarks/microcontroller.py
CODE = """static muscle_model model;

void timer_interrupt(void)
{
    const mck_real in[1] = {desired_mm};
    mck_real out[1];
    muscle_step(&model, in, out);
    set_pressure_bar(out[0]);
}"""

rows = re.findall(r"^\| `([\w-]+)` \| ([\d ]+) \|", TABLE.read_text(encoding="utf-8"), flags=re.M)
steps = {name: int(count.replace(" ", "")) for name, count in rows}
figure = Figure(figsize=(8, 3.2), layout="constrained")
code, bars = figure.subplots(1, 2)
code.text(0, 0.5, CODE, family="monospace", va="center", fontsize=8.5)
code.axis("off")
counts = [steps[kind] for kind in SHOWN]
bars.bar_label(bars.barh(list(SHOWN.values()), counts), padding=3)
bars.invert_yaxis()
bars.set(xlabel="instructions per step", xlim=(0, 1.2 * max(counts)))
figure.savefig(sys.argv[1], dpi=150)
