"""The server in C does what its twin in Python does, whatever comes."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mckibben.link.framing import Frame, Reader
from tests.link.serving import SERVING, Compiled, exported, twin
from tests.link.twin import Twin
from tests.tools import needs

NUMBERS = st.one_of(st.floats(0, 6), st.floats(0, 6), st.floats())


@st.composite
def bodies(draw: st.DrawFn, kind: int) -> bytes:
    """Return what a frame of a kind may say, mostly as it should be."""
    if draw(st.integers(0, 11)) == 7:
        return draw(st.binary(max_size=40))
    if kind == 3:
        print_ = bytes(8) if draw(st.integers(0, 5)) == 3 else bytes.fromhex(exported()[0])
        return print_ + struct.pack("<BI", draw(st.integers(0, 2)), draw(st.integers(0, 6)))
    if kind == 4:
        return struct.pack("<d", draw(NUMBERS))
    if kind == 2:
        return bytes([draw(st.integers(0, 3))])
    if kind == 6:
        return struct.pack("<H", draw(st.integers(0, 3)))
    if kind == 7:
        return struct.pack("<HB", draw(st.integers(0, 3)), draw(st.integers(0, 3)))
    return b""


@st.composite
def doings(draw: st.DrawFn) -> tuple[str, bytes | int]:
    """Return what happens next: mostly a frame, whose numbers are those ahead of the last ones."""
    what = draw(
        st.sampled_from(["frame"] * 8 + ["again"] * 2 + ["tick"] * 4 + ["bytes", "switch on"])
    )
    if what == "frame":
        kind = draw(st.sampled_from([3, 3, 4, 4, 4, 4, *range(13)]))
        ahead = draw(st.sampled_from([1] * 8 + [0, 2, 2**31, 2**32 - 1]))
        session = int(kind == 3) + draw(st.sampled_from([0] * 8 + [1, 65536, 2**31]))
        return what, Frame(kind, session, ahead, draw(bodies(kind))).packed()
    return what, draw(st.binary(max_size=300)) if what == "bytes" else draw(st.integers(1, 4))


def sent_by(server: Twin | Compiled, most: int) -> Iterator[int]:
    for _ in range(most):
        if (byte := server.send()) < 0:
            return
        yield byte


@needs("cc")
@settings(max_examples=120)
@given(st.lists(doings(), min_size=10, max_size=30))
def test_c_answers_as_the_twin_does(told: list[tuple[str, bytes | int]]) -> None:
    servers: list[Twin | Compiled] = [own := twin(), Compiled()]
    own.fingerprint = bytes.fromhex(exported()[0])
    opening = Frame(3, 1, 0, own.fingerprint + struct.pack("<BI", len(told) % 2, 5)).packed()
    sequence, last = 0, opening
    for what, how in [("frame", opening), *told]:
        if what == "frame" and isinstance(how, bytes):
            (frame,) = Reader().feed(how)
            sequence = (sequence + frame.sequence) % 2**32
            session = (own.session + frame.session) % 2**32
            how = last = replace(frame, session=session, sequence=sequence).packed()
        elif what == "again":
            how = last
        sent = []
        for server in servers:
            if isinstance(how, bytes):
                for byte in how:
                    server.receive(byte)
            elif what == "switch on":
                server.switch_on()
            elif what == "tick":
                for _ in range(how):
                    server.tick()
            # what is told by itself may stay, and the next answer then waits behind it
            sent.append(list(sent_by(server, 40 if what == "tick" else 600)))
        assert sent[0] == sent[1]
        np.testing.assert_array_equal(servers[0].outputs, servers[1].outputs)
        (low, high) = SERVING.limits["displacement"]
        assert low <= servers[1].outputs[0] <= high


@given(st.binary(min_size=1, max_size=236), st.data())
def test_no_frame_with_up_to_three_flipped_bits_is_taken(body: bytes, data: st.DataObject) -> None:
    wire = bytearray(Frame(4, 7, 9, body).packed())
    places = data.draw(
        st.lists(st.integers(0, 8 * len(wire) - 1), min_size=1, max_size=3, unique=True)
    )
    for place in places:
        wire[place // 8] ^= 1 << place % 8
    assert not Reader().feed(bytes(wire) + b"\0")
