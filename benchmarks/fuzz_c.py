"""Fuzz the step functions of all exported blocks with raw bytes as inputs, under sanitizers.

    python benchmarks/fuzz_c.py --seconds 600 --seed 1

The first byte chooses the block; the rest is taken as numbers of any kind, NaN, infinity and denormals
included. A crash, an undefined operation, a step that hangs, or an output that is not finite ends it
with an error. With clang and libFuzzer, the bytes look for new ways through the code; with any other C
compiler they are random, and sanitizers watch where it has them.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from mckibben.blocks.laws import examples
from mckibben.exporting.c.project import described, source_files
from mckibben.exporting.programs import own_compiler

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

RANDOM = """
#include <stdio.h>
#include <time.h>

/* Bytes by chance, whole odd numbers among them: what to do without libFuzzer. */
int main(int argc, char **argv)
{
    static const mck_real odd[] = {
        NAN, INFINITY, -INFINITY, 0.0, -0.0, 1.0, -1.0, 2.5, 5.0, 1e-300, 5e-324, 1e30, 1e154, 1e308,
    };
    const double seconds = argc > 1 ? atof(argv[1]) : 60.0;
    uint64_t now = argc > 2 ? strtoull(argv[2], NULL, 10) : 1;
    long tried = 0;
    for (const time_t until = time(NULL) + (time_t)seconds; time(NULL) < until; tried++) {
        uint8_t data[1 + 2048];
        for (size_t at = 0; at < sizeof data; at++) {
            now = now * 6364136223846793005u + 1442695040888963407u;
            data[at] = (uint8_t)(now >> 56);
        }
        const unsigned share = data[1] % 8; /* of eight numbers, those that are odd or usual */
        for (size_t at = 1; at + sizeof(mck_real) <= sizeof data; at += sizeof(mck_real)) {
            const unsigned which = data[at];
            if (which % 8 < share) {
                const mck_real usual = (mck_real)data[at + 1] / (mck_real)51;
                const mck_real number = which & 8 ? usual : odd[data[at + 1] % 14];
                memcpy(data + at, &number, sizeof number);
            }
        }
        (void)LLVMFuzzerTestOneInput(data, sizeof data);
    }
    printf("%ld tried\\n", tried);
    return 0;
}
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
    for index, block in enumerate(examples().values()):
        name = f"block_{index}"
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


FLAGS = ("-std=c99", "-O1", "-g", "-fno-sanitize-recover=all", "-w")
WATCHED = "-fsanitize=address,undefined,float-cast-overflow"


def built(folder: Path, compiler: str, *options: str) -> bool:
    """Compile the harness, and tell whether the compiler can."""
    sources = sorted(map(str, folder.glob("*.c")))
    command = [compiler, *FLAGS, *options, *sources, "-lm", "-o", str(folder / "fuzz")]
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


def fuzzed(folder: Path, seconds: int, seed: int) -> int:
    """Fuzz with the best that this machine has, and return what the fuzzer does."""
    clang, compiler = shutil.which("clang"), own_compiler()
    if clang and built(folder, clang, WATCHED, "-fsanitize=fuzzer"):
        (folder / "corpus").mkdir()
        options = [
            "corpus",
            "-verbosity=0",
            "-max_len=2048",
            "-timeout=10",
            f"-max_total_time={seconds}",
        ]
        command = [*options, "-print_final_stats=1", f"-seed={seed}"]
    elif compiler is None:
        print("there is no C compiler on this machine: install gcc or clang", file=sys.stderr)
        return 2
    else:
        with (folder / "harness.c").open("a") as file:
            file.write(RANDOM)
        if not built(folder, compiler, WATCHED) and not built(folder, compiler):
            print("the exported C does not compile", file=sys.stderr)
            return 1
        command = [str(seconds), str(seed)]
    limit = seconds + 120  # a step that hangs
    return subprocess.run(
        [str(folder / "fuzz"), *command], cwd=folder, check=False, timeout=limit
    ).returncode


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--float32", action="store_true")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        write_sources(Path(place), chosen.float32)
        return fuzzed(Path(place), chosen.seconds, chosen.seed)


if __name__ == "__main__":
    sys.exit(main())
