"""Fuzz the served end of the wire: the C servers of all blocks, under sanitizers.

    python benchmarks/fuzz_link.py --seconds 600 --seed 1

To the servers go bytes of any kind, frames that are stuffed, checked and numbered as they should be with
anything in them, inputs within the limits of the export, ticks, and starts. A crash, an
undefined operation, a call that hangs, or an output that is not finite or beyond its limits ends it with
an error.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from fuzz_c import SAMPLE_TIME, fuzzed
from mckibben.blocks.base import Block
from mckibben.blocks.laws import examples
from mckibben.errors import ModelError
from mckibben.exporting.c.project import described, source_files
from mckibben.exporting.c.serving import Serving, limits, served, served_files

SERVING = Serving(watchdog=0.1)
WIDE = (-50.0, 50.0)
"""Limits of channels whose model knows none."""

HARNESS = """
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
{includes}

typedef struct {{
    const uint8_t *data;
    size_t left;
}} source;

static uint8_t next(source *from)
{{
    if (from->left == 0) {{
        return 0;
    }}
    from->left--;
    return *from->data++;
}}

static uint32_t crc32(const uint8_t *bytes, int n)
{{
    uint32_t crc = 0xFFFFFFFFu;
    for (int i = 0; i < n; i++) {{
        crc ^= bytes[i];
        for (int k = 0; k < 8; k++) {{
            crc = (crc >> 1) ^ (crc & 1u ? 0xEDB88320u : 0u);
        }}
    }}
    return ~crc;
}}

static uint32_t sequence;

/* Send a frame as it should be around any body. */
static void send_frame(mck_server *link, uint8_t kind, const uint8_t *body, int n)
{{
    uint8_t frame[MCK_PAYLOAD];
    uint8_t stuffed[MCK_STUFFED];
    int length = 0;
    int at = 1;
    int mark = 0;
    frame[length++] = MCK_LINK_VERSION;
    frame[length++] = kind;
    for (int i = 0; i < 4; i++) {{
        frame[length++] = link->served->fingerprint[i];
    }}
    for (int i = 0; i < 4; i++) {{
        frame[length++] = (uint8_t)(sequence >> (8 * i));
    }}
    memcpy(frame + length, body, (size_t)n);
    length += n;
    const uint32_t check = crc32(frame, length);
    for (int i = 0; i < 4; i++) {{
        frame[length++] = (uint8_t)(check >> (8 * i));
    }}
    for (int i = 0; i < length; i++) {{
        if (frame[i] == 0) {{
            stuffed[mark] = (uint8_t)(at - mark);
            mark = at;
        }} else {{
            stuffed[at] = frame[i];
        }}
        at++;
    }}
    stuffed[mark] = (uint8_t)(at - mark);
    for (int i = 0; i < at; i++) {{
        mck_server_receive(link, stuffed[i]);
    }}
    mck_server_receive(link, 0);
}}

static void drain(mck_server *link)
{{
    int n = 0;
    while (mck_server_send(link) >= 0) {{
        if (++n > 2 * MCK_STUFFED) {{
            abort();
        }}
    }}
}}

/* Numbers between limits, as the limits of the export allow. */
static void put_between(uint8_t *to, mck_real low, mck_real high, uint8_t share)
{{
    mck_real value = low + (high - low) * ((mck_real)share / (mck_real)255);
    value = value < low ? low : value > high ? high : value;
    memcpy(to, &value, sizeof value);
}}

static void set_inputs(mck_server *link, source *from)
{{
    uint8_t body[MCK_PAYLOAD] = {{0}};
    body[0] = next(from) & 1u;
    body[1] = next(from) % 4u;
    body[3] = (uint8_t)(1u + next(from) % 10u);
    for (int i = 0; i < link->served->n_inputs; i++) {{
        const mck_channel *channel = &link->served->channels[i];
        put_between(body + 7 + i * (int)sizeof(mck_real), channel->low, channel->high, next(from));
    }}
    sequence++;
    send_frame(link, 4, body, 7 + link->served->n_inputs * (int)sizeof(mck_real));
    drain(link);
}}

static void check(const mck_server *link)
{{
    for (int i = 0; i < link->served->n_outputs; i++) {{
        const mck_channel *channel = &link->served->channels[link->served->n_inputs + i];
        if (!(link->out[i] >= channel->low && link->out[i] <= channel->high)) {{
            abort();
        }}
    }}
    for (int i = 0; i < link->served->n_inputs - link->served->n_missable; i++) {{
        const mck_channel *channel = &link->served->channels[i];
        if (!(link->in[i] >= channel->low && link->in[i] <= channel->high)) {{
            abort();
        }}
    }}
}}

static void tried(mck_server *link, source *from)
{{
    sequence = 0;
    mck_server_init(link);
    while (from->left > 0) {{
        const uint8_t what = next(from);
        uint8_t bytes[ROOM];
        int n = 0;
        switch (what % 8) {{
        case 0:
            for (n = next(from); n > 0 && from->left > 0; n--) {{
                mck_server_receive(link, next(from));
            }}
            break;
        case 1:
        case 2:
            n = next(from) % ROOM;
            for (int i = 0; i < n; i++) {{
                bytes[i] = next(from);
            }}
            sequence += what % 45 == 1 ? next(from) : 1u;
            send_frame(link, next(from) % 8, bytes, n);
            break;
        case 3:
        case 4:
            set_inputs(link, from);
            break;
        case 5:
            for (n = next(from) % 16; n > 0; n--) {{
                mck_server_tick(link);
            }}
            break;
        case 6:
            drain(link);
            break;
        default:
            if (what % 80 == 7) {{
                mck_server_init(link);
            }} else {{
                (void)mck_server_send(link);
            }}
            break;
        }}
        check(link);
    }}
}}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{{
    source from = {{data, size}};
    switch (next(&from) % {count}) {{
{cases}
    }}
    return 0;
}}
"""

CASE = """    case {index}: {{
        static {name}_server server;
        {name}_server_init(&server);
        tried(&server.link, &from);
        break;
    }}"""


def servable() -> dict[str, tuple[Block, Serving]]:
    """Return all blocks that fit into frames, with limits where their model knows none."""
    found = {}
    for name, block in examples().items():
        channels = {channel.name for channel in (*block.inputs, *block.outputs)}
        try:
            limits(block, SERVING)
            serving = SERVING
        except ModelError:
            wide = dict.fromkeys(channels, WIDE)
            serving = Serving(wide, watchdog=SERVING.watchdog)
        found[name] = (block, serving)
    return found


def write_sources(folder: Path, single: bool) -> None:
    """Write servers of all blocks, and the harness."""
    includes, cases = [], []
    for index, (block, serving) in enumerate(servable().values()):
        name = f"block_{index}"
        content = described(block, name=name, sample_time=SAMPLE_TIME, single=single)
        content |= served(block, content, serving, SAMPLE_TIME)
        for path, text in {**source_files(content), **served_files(content)}.items():
            if path.startswith("src/"):
                (folder / Path(path).name).write_text(text, encoding="utf-8")
        includes.append(f'#include "{name}_server.h"')
        cases.append(CASE.format(index=index, name=name))
    (folder / "harness.c").write_text(
        HARNESS.format(includes="\n".join(includes), cases="\n".join(cases), count=len(cases))
        .replace("[ROOM]", "[MCK_PAYLOAD - 14]")
        .replace("% ROOM", "% (MCK_PAYLOAD - 14)"),
        encoding="utf-8",
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=int, default=60, help="how long to try")
    parser.add_argument("--seed", type=int, default=1, help="of all that is tried")
    parser.add_argument("--float32", action="store_true", help="servers in single precision")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        write_sources(Path(place), chosen.float32)
        return fuzzed(Path(place), chosen.seconds, chosen.seed)


if __name__ == "__main__":
    sys.exit(main())
