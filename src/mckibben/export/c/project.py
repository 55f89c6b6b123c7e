"""A model as a folder of C99 that compiles as it is: on a PC, a microcontroller, Arduino, MATLAB."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mckibben.blocks.base import Block
from mckibben.blocks.fields import Channel
from mckibben.blocks.kernels import in_scratch
from mckibben.blocks.saving import to_text
from mckibben.errors import ModelError
from mckibben.export.c.literals import literal, rows
from mckibben.export.c.parts import check_single
from mckibben.export.c.rounding import warn_of_rounding
from mckibben.export.c.serving import Serving, served, served_files
from mckibben.export.c.translator import Translation
from mckibben.export.c.vectors import Vectors, vectors
from mckibben.export.c.wiring import Call, Wiring
from mckibben.export.folders import refuse_folder, write_folder
from mckibben.export.naming import identifier, macros, said
from mckibben.export.templating import render as rendered

TOLERANCES = {False: "1e-9", True: "1e-4"}
"""Of the self-test, relative to the range: in double and in single precision."""

SHARED = Path(__file__).parent / "server" / "mck.h"
"""What all C of a model shares."""

LONGEST_STEP = 1e6
"""Time between steps of an exported model [s]."""


def export_c(
    block: Block,
    folder: str | Path,
    *,
    name: str = "model",
    sample_time: float | None = None,
    single: bool = False,
    overwrite: bool = False,
    serving: Serving | None = None,
) -> Path:
    """Write a model as a folder of C99, with a self-test whose vectors Python computed.

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
    overwrite : bool
        Whether a folder that an export wrote before may be replaced.
    serving : Serving, optional
        Add a server that answers over a wire, within these settings; see `mckibben.link`.

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
    refuse_folder(folder, overwrite=overwrite)
    files = c_files(block, name=name, sample_time=sample_time, single=single, serving=serving)
    write_folder(folder, {path: text.encode() for path, text in files.items()}, overwrite=overwrite)
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
        content |= served(block, content, serving, sample_time or own_time(block))
    tests = vectors(block, content["sample_time"], single=single)
    content |= test_content(tests, single=single)
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
        "model.json": to_text(block),
    }


def test_content(tests: Vectors, *, single: bool) -> dict[str, Any]:
    """Return test vectors as the templates write them."""
    return {
        "tolerance": TOLERANCES[single],
        "n_samples": len(tests.inputs),
        "input_rows": [_row(row, single) for row in tests.inputs],
        "output_rows": [_row(row, single) for row in tests.outputs],
        "ranges": _row(tests.ranges, single),
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
    """Return all that the templates say of a model."""
    from mckibben import __version__

    identifier(name)
    step = checked_sample_time(block, sample_time)
    wiring = Wiring(block, step)
    if single:
        for call in wiring.calls:
            check_single(call.part.block)
            warn_of_rounding(call.part.block, step)
    own = (f"{name}_{end}" for end in ("init", "reset", "step", "model"))
    translation = Translation(single=single, taken=own)
    if name.lower().startswith("mck"):
        raise ModelError(f"{name!r} is the package's own name. Remedy: give another --name.")
    inputs, outputs = _told(block.inputs), _told(block.outputs)
    cost, size = wiring.cost, 4 if single else 8
    n_numbers = max(wiring.n_numbers, 1)
    calls = [_call(call, index, translation) for index, call in enumerate(wiring.calls)]
    first = 0
    for told in calls:
        told["first_coefficient"] = first
        told["adjusted"] = f"self->coefficients + {first}"
        first += max(told["n_coefficients"], 1)
    order = {id(call): told for call, told in zip(wiring.calls, calls, strict=True)}
    constants = sum(call.part.coefficients.size for call in wiring.calls)
    return {
        "name": name,
        "version": __version__,
        "single": single,
        "bytes": size,
        "sample_time": step,
        "step_words": f"{step!r} s" if step else "sample",
        "period": round(1e6 * (step or 0.01)),
        "inputs": inputs,
        "outputs": outputs,
        "constants": _constants(inputs, outputs, step),
        "calls": calls,
        "kinds": [call["kind"] for call in calls],
        "steps": [order[id(item)] if isinstance(item, Call) else item for item in wiring.steps],
        "stateful": [call for call in calls if call["n_states"]],
        "given": wiring.outputs,
        "n_needed": len(inputs) - block.n_missable,
        "n_signals": wiring.n_signals,
        "n_numbers": n_numbers,
        "n_coefficients": first,
        "adjustable": False,
        "n_states": sum(call["n_states"] for call in calls),
        "starts": _starts(wiring.calls),
        "kernels": translation.text(),
        "zero": "0.0f" if single else "0.0",
        "shared": (SHARED,),
        "sources": [f"{name}.c"],
        "ram": size * (n_numbers + len(outputs)) + size,
        "flash": size * constants + 32 * len(calls),
        "usual": cost.usual,
        "worst": cost.worst,
    }


def checked_sample_time(block: Block, sample_time: float | None) -> float | None:
    """Return the time between steps of a model; None where it has none.

    Raises
    ------
    ModelError
        If it is missing, not positive, or not the block's own.
    """
    step = own_time(block) if sample_time is None and block.rate_dependent else sample_time
    if step is not None and not 0 < step <= LONGEST_STEP:
        raise ModelError(
            f"the sample time is {step}. Remedy: give a positive time in seconds, at most "
            f"{LONGEST_STEP:g}."
        )
    if not block.rate_dependent:
        return None
    if step is None:
        raise ModelError(
            f"{block.kind!r} depends on the rate. Remedy: give the time between steps, "
            "--sample-time SECONDS."
        )
    block.check_time(step)
    return step


def own_time(block: Block) -> float | None:
    """Return the sample time that a block, or a part of it, is bound to."""
    if block.sample_time is not None:
        return block.sample_time
    for part in getattr(block, "parts", ()):
        step = own_time(part)
        if step is not None:
            return step
    return None


def _call(call: Call, index: int, translation: Translation) -> dict[str, Any]:
    part, block, single = call.part, call.part.block, translation.single
    name, state = f"coefficients_{index}", ("state", block.n_states)
    numbers, sample = (name, part.coefficients.size), ("x", len(block.inputs))
    outputs = (f"signals + {call.first_output}", len(block.outputs))
    calls: list[str] = []
    # a state that is given is copied, and has no start
    for kernel in part.kernels[: 1 if part.state is not None else 2]:
        scratch = [(f"state + {block.n_states}", block.n_scratch)] * in_scratch(kernel)
        end = (str(int(part.virgin)), 0) if calls else outputs
        calls.append(translation.add(kernel).call(numbers, state, *scratch, sample, end))
    given = ", ".join(said(channel.name) for channel in block.inputs)
    gives = ", ".join(said(channel.name) for channel in block.outputs)
    return {
        "index": index,
        "kind": block.title,
        "words": f"{block.title}: {given} to {gives}",
        "step": calls[0],
        "start": calls[-1],
        "numbers": name,
        "reads": any(name in text for text in calls),
        "n_numbers": block.n_states + block.n_scratch,
        "inputs": call.inputs,
        "first_state": call.first_state,
        "first_output": call.first_output,
        "n_coefficients": part.coefficients.size,
        "n_states": block.n_states,
        "n_inputs": len(block.inputs),
        "n_outputs": len(block.outputs),
        "rows": rows(part.coefficients, single=single) or ["0"],
        "state_rows": [] if part.state is None else rows(part.state, single=single),
    }


def _starts(calls: list[Call]) -> str:
    """Return how the memory of parts starts, in words."""
    parts = [call.part for call in calls if call.part.block.n_states]
    words = [
        "as the model gives it"
        if part.state is not None
        else "at rest, whatever its inputs"
        if part.virgin
        else "from its inputs"
        for part in parts
    ]
    return " or ".join(dict.fromkeys(words or ["from its inputs"]))


def _told(channels: tuple[Channel, ...]) -> list[dict[str, str]]:
    return [{"name": said(channel.name), "unit": said(channel.unit) or "1"} for channel in channels]


def _constants(
    inputs: list[dict[str, str]], outputs: list[dict[str, str]], step: float | None
) -> list[tuple[str, str, str]]:
    told: list[tuple[str, str, str]] = [
        ("N_INPUTS", str(len(inputs)), ""),
        ("N_OUTPUTS", str(len(outputs)), ""),
    ]
    for way, channels in (("IN", inputs), ("OUT", outputs)):
        endings = macros([channel["name"] for channel in channels])
        told += [
            (f"{way}_{ending}", str(place), channels[place]["unit"])
            for place, ending in enumerate(endings)
        ]
    return [*told, ("SAMPLE_TIME", repr(step), "s")] if step else told


def _row(values: Any, single: bool) -> str:
    return ", ".join(literal(float(value), single=single) for value in values)


def render(template: str, content: Mapping[str, Any]) -> str:
    """Return a template of this folder filled in."""
    return rendered("mckibben.export.c", template, content)
