"""A model as a folder of portable C99: for a PC, a microcontroller, Arduino, MATLAB."""

from __future__ import annotations

import re
import warnings
from collections.abc import Mapping
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from mckibben.blocks.base import Block
from mckibben.blocks.fields import Channel
from mckibben.blocks.kernels import in_scratch
from mckibben.blocks.laws import identified_limits, wander
from mckibben.errors import ModelError, ModelWarning, require
from mckibben.exporting.c.serving import Serving, served, served_files
from mckibben.exporting.c.translator import Translation
from mckibben.exporting.c.wiring import Call, Wiring
from mckibben.exporting.folders import write_folder
from mckibben.exporting.naming import identifier, macros, said
from mckibben.exporting.templating import literals, rows
from mckibben.exporting.templating import render as rendered

render = partial(rendered, "mckibben.exporting.c")
"""Fills in a template of this folder."""

TOLERANCES = {False: "1e-9", True: "1e-4"}
"""Of the self-test, relative to the range: in double and in single precision."""

SHARED = Path(__file__).parent / "server" / "mck.h"
"""Files shared by the C code of all models."""

LEAST_RELATIVE_SPAN, LEAST_SPAN = 1e-4, 1e-9
"""Smallest range of an output in the self-test: relative to its size, and added to that in its unit."""

SAMPLES_PER_TURN = 400
"""Mean number of samples between turning points of the inputs on which precisions are compared."""

FLASH_PER_CALL = 32
"""Estimate of the constants that a call of a kernel takes beside its coefficients [bytes]."""

LONGEST_STEP = 1e6
"""Largest sample time of an exported model [s]."""

PACE, TURNS = 9, 24
"""Samples between turning points of the test inputs, and their number."""

NOTICED = 5e-5
"""Error of a filter in single precision, relative to its output range, above which a warning is
issued.
"""

SAMPLES, MOST_PRODUCTS = 100_000, 30_000_000
"""Number of samples of that test; fewer for filters with very many states."""


def export_c(
    block: Block,
    folder: str | Path,
    *,
    name: str = "model",
    sample_time: float | None = None,
    single: bool = False,
    force: bool = False,
    serving: Serving | None = None,
) -> Path:
    """Write a model as a folder of C99, with a self-test against vectors from Python.

    The same model gives the same bytes.

    Parameters
    ----------
    block : Block
        Any block: a model, an inverse, a controller, a composition.
    folder : str or Path
        To write; must not exist, or be empty.
    name : str
        Prefix of functions and files: a letter, then letters, digits and underscores.
    sample_time : float, optional
        Time between steps [s], positive; needed by rate-dependent blocks.
    single : bool
        Single instead of double precision.
    force : bool
        Whether files of the user's may be replaced; those of an earlier export are anyway.
    serving : Serving, optional
        Add a server that answers over a serial line, within these settings; see `mckibben.link`.

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    ModelError
        If the name will not do, the sample time is missing or wrong, or a part has no C.
    DataError
        If the folder is in the way or cannot be written.
    """
    folder = Path(folder)
    files = c_files(block, name=name, sample_time=sample_time, single=single, serving=serving)
    write_folder(folder, files, force=force)
    return folder


def c_files(
    block: Block,
    *,
    name: str = "model",
    sample_time: float | None = None,
    single: bool = False,
    serving: Serving | None = None,
) -> dict[str, str]:
    """Return the files of `export_c`, text by path in the folder."""
    content = described(block, name=name, sample_time=sample_time, single=single)
    if serving is not None:
        content |= served(block, content, serving, sample_time or block.sample_time)
    content |= vectors(block, content["sample_time"], single=single)
    return {
        **source_files(content),
        **(served_files(content) if serving is not None else {}),
        "CMakeLists.txt": render("CMakeLists.txt.j2", content),
        "README.md": render("README.md.j2", content),
        "library.properties": render("library.properties.j2", content),
        f"examples/{name}/{name}.ino": render("sketch.ino.j2", content),
        f"matlab/{name}_mex.c": render("mex.c.j2", content),
        "matlab/build.m": render("build.m.j2", content),
        f"test/{name}_selftest.c": render("selftest.c.j2", content),
        "model.json": block.to_text(),
    }


def vectors(block: Block, sample_time: float | None, *, single: bool = False) -> dict[str, Any]:
    """Return test vectors: inputs within the model's range, and Python's outputs.

    Inputs have minor loops and holds; single precision can hold them where it is asked for.

    Raises
    ------
    ModelError
        If the model's outputs are not finite on them.
    """
    inputs = wander(*identified_limits(block), np.random.default_rng(0), PACE, TURNS)
    if single:
        inputs = inputs.astype(np.float32).astype(np.float64)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        outputs = block.simulate(inputs, sample_time=sample_time)
    if not np.isfinite(outputs).all():
        raise ModelError(
            f"{block.kind!r} gives outputs that are not finite on inputs within its range",
            remedy="identify it again, or give it an input range",
        )
    least = LEAST_RELATIVE_SPAN * np.abs(outputs).max(axis=0) + LEAST_SPAN
    ranges = np.maximum(np.ptp(outputs, axis=0), least)
    return {
        "expected": outputs,
        "spans": ranges,
        "tolerance": TOLERANCES[single],
        "n_samples": len(inputs),
        "input_rows": [literals(row, single=single) for row in inputs],
        "output_rows": [literals(row, single=single) for row in outputs],
        "ranges": literals(ranges, single=single),
    }


def source_files(content: Mapping[str, Any]) -> dict[str, str]:
    """Return the C of a model, and of the server if it is served, text by path."""
    name, shared = content["name"], content["shared"]
    texts = {path.name: path.read_text(encoding="utf-8") for path in shared}
    functions = re.findall(r"^\w[\w ]*\b\*?(mck_\w+)\(.*;", "".join(texts.values()), flags=re.M)
    exported = {**content, "functions": sorted(set(functions))}
    return {
        f"src/{name}.h": render("model.h.j2", content),
        f"src/{name}.c": render("model.c.j2", content),
        "src/mck_config.h": render("mck_config.h.j2", exported),
        **{f"src/{file}": text for file, text in texts.items()},
    }


def described(
    block: Block, *, name: str, sample_time: float | None, single: bool
) -> dict[str, Any]:
    """Return the values for the templates of a model."""
    from mckibben import __version__

    identifier(name)
    step = checked_sample_time(block, sample_time)
    wiring = Wiring(block, step)
    if single:
        for call in wiring.calls:
            check_single(call.block, step)
    names = (f"{name}_{end}" for end in ("init", "reset", "step", "model"))
    translation, index = Translation(single=single, taken=names), count()
    steps = [
        _call(each, next(index), translation) if isinstance(each, Call) else each
        for each in wiring.steps
    ]
    calls = [each for each in steps if isinstance(each, dict)]
    inputs, outputs = _channel_entries(block.inputs), _channel_entries(block.outputs)
    size, n_numbers = 4 if single else 8, max(wiring.memory_size, 1)
    n_coefficients = sum(call.coefficients.size for call in wiring.calls)
    return {
        "name": name,
        "version": __version__,
        "single": single,
        "bytes": size,
        "sample_time": step,
        "step_words": f"{step!r} s" if step else "sample",
        "period": round(1e6 * step) if step else 0,
        "inputs": inputs,
        "outputs": outputs,
        "macros": _macros(inputs, outputs, step),
        "calls": calls,
        "kinds": [call.block.title for call in wiring.calls],
        "steps": steps,
        "given": wiring.outputs,
        "n_needed": len(inputs) - block.n_missable,
        "bound_rows": [literals(ends, single=single) for ends in block.input_bounds],
        "bounds": [[f"{end:.6g}" for end in ends] for ends in block.input_bounds],
        "clip_places": wiring.clip_counts,
        "clip_counts": [f"numbers[{i}]" for i in wiring.clip_counts],
        "n_signals": wiring.n_signals,
        "n_numbers": n_numbers,
        "n_memory": wiring.memory_size,
        "starts": _starts(wiring.calls),
        "kernels": translation.text(),
        "zero": "0.0f" if single else "0.0",
        "shared": (SHARED,),
        "sources": [f"{name}.c"],
        "ram": size * (n_numbers + len(inputs) + len(outputs)) + size,
        "flash": size * (n_coefficients + 2 * len(inputs)) + FLASH_PER_CALL * len(calls),
    }


def check_single(block: Block, sample_time: float | None) -> None:
    """Raise an error for values that single precision cannot hold, and warn of inaccurate filters.

    Raises
    ------
    ModelError
        If two knots, levels or thresholds that follow one another become one.
    """
    for name, places in block.strictly_increasing():
        if np.any(np.diff(np.array(places, dtype=np.float32)) <= 0) and np.all(np.diff(places) > 0):
            raise ModelError(
                f"{name} of {block.title!r} are too close for single precision",
                remedy="export in double precision, or identify with fewer of them",
            )
    if block.filters and hasattr(block, "kernel"):
        _warn_of_rounding(block, sample_time)


def _warn_of_rounding(block: Block, sample_time: float | None) -> None:
    """Compare the same kernel in single and double precision."""
    rng = np.random.default_rng(0)
    samples = min(SAMPLES, MOST_PRODUCTS // max(block.n_states, 1))
    inputs = wander(
        *identified_limits(block), rng, SAMPLES_PER_TURN, samples // SAMPLES_PER_TURN
    ).astype(np.float32)
    single, double = (_run(block, inputs.astype(kind), sample_time) for kind in (np.float32, float))
    off = float(np.abs(single - double).max() / max(np.ptp(double), 1e-300))
    if not off <= NOTICED:
        warnings.warn(
            f"in single precision {block.kind!r} is off by about {off:.1g} of its range: its poles are "
            "slow for this sample time. Export it in double precision, or with a longer sample time",
            ModelWarning,
            stacklevel=2,
        )


def _run(block: Block, inputs: np.ndarray, sample_time: float | None) -> np.ndarray:
    kind = inputs.dtype
    state = block.initial_state(inputs[0].astype(np.float64), sample_time=sample_time).astype(kind)
    outputs = np.empty((len(inputs), 1), dtype=kind)
    block.kernel.batch(block.coefficients(sample_time).astype(kind), state, inputs, outputs)
    return outputs.astype(np.float64)


def checked_sample_time(block: Block, sample_time: float | None) -> float | None:
    """Return the sample time of a model; None if it has none.

    Raises
    ------
    ModelError
        If it is missing, not positive, or not the block's own.
    """
    step = block.sample_time if sample_time is None and block.rate_dependent else sample_time
    possible = step is None or 0 < step <= LONGEST_STEP
    require(possible, "sample_time", step, f"a positive time, at most {LONGEST_STEP:g} s")
    if not block.rate_dependent:
        return None
    if step is None:
        raise ModelError(
            f"{block.kind!r} depends on the rate",
            parameter="sample_time",
            remedy="give the time between steps, `sample_time=SECONDS`",
        )
    block.check_time(step)
    return step


def _call(call: Call, index: int, translation: Translation) -> dict[str, Any]:
    """Return the template values of a block call."""
    block, single, name = call.block, translation.single, f"coefficients_{index}"
    numbers, state = (name, call.coefficients.size), ("state", block.n_states)
    sample, outputs = (
        ("x", len(block.inputs)),
        (f"signals + {call.first_output}", len(block.outputs)),
    )
    texts: list[str] = []
    # a state that is given is copied, and has no start
    for kernel in block.c_kernels[: 1 if call.state is not None else 2]:
        scratch = [(f"state + {block.n_states}", block.n_scratch)] * in_scratch(kernel)
        end = (str(int(block.start == "virgin")), 0) if texts else outputs
        texts.append(translation.add(kernel).call(numbers, state, *scratch, sample, end))
    arguments = ", ".join(said(channel.name) for channel in block.inputs)
    gives = ", ".join(said(channel.name) for channel in block.outputs)
    return {
        "index": index,
        "words": f"{block.title}: {arguments} to {gives}",
        "step": texts[0],
        "start": texts[-1],
        "reads": any(name in text for text in texts),
        "n_numbers": block.n_states + block.n_scratch,
        "inputs": call.inputs,
        "first_state": call.first_state,
        "n_states": block.n_states,
        "rows": rows(call.coefficients, single=single) or ["0"],
        "state_rows": [] if call.state is None else rows(call.state, single=single),
    }


def _starts(calls: list[Call]) -> str:
    """Return a description of the start states of blocks."""
    words = [
        "as the model gives it"
        if call.state is not None
        else "at rest, whatever its inputs"
        if call.block.start == "virgin"
        else "from its inputs"
        for call in calls
        if call.block.n_states
    ]
    return " or ".join(dict.fromkeys(words or ["from its inputs"]))


def _channel_entries(channels: tuple[Channel, ...]) -> list[dict[str, str]]:
    return [{"name": said(channel.name), "unit": said(channel.unit) or "1"} for channel in channels]


def _macros(
    inputs: list[dict[str, str]], outputs: list[dict[str, str]], step: float | None
) -> list[tuple[str, str, str]]:
    """Return the name, value and unit of every macro of a header, without the model's prefix."""
    entries: list[tuple[str, str, str]] = [
        ("N_INPUTS", str(len(inputs)), ""),
        ("N_OUTPUTS", str(len(outputs)), ""),
    ]
    for way, channels in (("IN", inputs), ("OUT", outputs)):
        endings = macros([channel["name"] for channel in channels])
        entries += [
            (f"{way}_{ending}", str(k), channels[k]["unit"]) for k, ending in enumerate(endings)
        ]
    return [*entries, ("SAMPLE_TIME", repr(step), "s")] if step else entries
