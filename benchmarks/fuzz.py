"""Fuzz the step functions of all exported blocks with raw bytes as inputs, under sanitizers.

    python benchmarks/fuzz.py --seconds 600

Wants clang with libFuzzer and its sanitizers. The first byte chooses the block; the rest is taken as
numbers of any kind, NaN, infinity and denormals included. A crash, an undefined operation, a step
that hangs, or an output that is not finite ends it with an error.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from mckibben.export.c.project import described, source_files
from mckibben.registry import load, names

SAMPLE_TIME = 0.01

HARNESS = """
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
{includes}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{{
    if (size < 1) {{
        return 0;
    }}
    const uint8_t which = data[0];
    data++;
    size--;
    switch (which % {count}) {{
{cases}
    }}
    return 0;
}}
"""

CASE = """    case {index}: {{
        static {name}_model model;
        mck_real in[{n_in}];
        mck_real out[{n_out}];
        {name}_init(&model);
        for (size_t at = 0; at + sizeof in <= size; at += sizeof in) {{
            memcpy(in, data + at, sizeof in);
            (void){name}_step(&model, in, out);
            for (int j = 0; j < {n_out}; j++) {{
                if (!isfinite(out[j])) {{
                    abort();
                }}
            }}
        }}
        break;
    }}"""


def write_sources(folder: Path, single: bool) -> None:
    """Write all blocks and the harness."""
    includes, cases = [], []
    for index, kind in enumerate(names("blocks")):
        block, name = load("blocks", kind).example(), f"block_{index}"
        content = described(block, name=name, sample_time=SAMPLE_TIME, single=single)
        for path, text in source_files(content).items():
            (folder / Path(path).name).write_text(text, encoding="utf-8")
        includes.append(f'#include "{name}.h"')
        sizes = {"n_in": len(block.inputs), "n_out": len(block.outputs)}
        cases.append(CASE.format(index=index, name=name, **sizes))
    (folder / "harness.c").write_text(
        HARNESS.format(includes="\n".join(includes), cases="\n".join(cases), count=len(cases)),
        encoding="utf-8",
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=int, default=600)
    parser.add_argument("--float32", action="store_true")
    chosen = parser.parse_args()
    clang = shutil.which("clang")
    if clang is None:
        print("clang is not on this machine: install clang and libclang-rt-14-dev", file=sys.stderr)
        return 2
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        write_sources(folder, chosen.float32)
        sanitizers = "-fsanitize=fuzzer,address,undefined,float-cast-overflow"
        sources = sorted(map(str, folder.glob("*.c")))
        subprocess.run(
            [
                *(clang, "-std=c99", "-O1", "-g", sanitizers, "-fno-sanitize-recover=all"),
                *(*sources, "-lm", "-o", str(folder / "fuzz")),
            ],
            check=True,
        )
        (folder / "corpus").mkdir()
        found = subprocess.run(
            [
                *(str(folder / "fuzz"), str(folder / "corpus"), "-max_len=2048", "-timeout=10"),
                *(f"-max_total_time={chosen.seconds}", "-print_final_stats=1", "-seed=1"),
            ],
            cwd=folder,
            check=False,
        )
    return found.returncode


if __name__ == "__main__":
    sys.exit(main())
