"""The server in C does what its twin in Python does, whatever comes."""

from __future__ import annotations

import struct

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mckibben.link.framing import Frame, Reader
from tests.link.serving import SERVING, Compiled, block, exported, twin
from tests.link.twin import Twin
from tests.tools import needs

KINDS = st.integers(0, 14)
NUMBERS = st.one_of(
    st.floats(-1, 7), st.floats(allow_nan=True, allow_infinity=True), st.sampled_from([0.0, 6.0])
)


@st.composite
def bodies(draw: st.DrawFn, kind: int) -> bytes:
    """Return what a frame of a kind may say, mostly as it should be."""
    if draw(st.integers(0, 9)) == 0:
        return draw(st.binary(max_size=40))
    if kind == 3:
        print_ = bytes.fromhex(exported()[0]) if draw(st.booleans()) else bytes(8)
        return print_ + struct.pack("<BI", draw(st.integers(0, 2)), draw(st.integers(0, 6)))
    if kind == 4:
        return struct.pack("<d", draw(NUMBERS))
    if kind == 2:
        return bytes([draw(st.integers(0, 3))])
    if kind == 6:
        return struct.pack("<H", draw(st.integers(0, 3)))
    if kind == 7:
        return struct.pack("<BHB", draw(st.integers(0, 2)), *draw(st.tuples(*[SMALL] * 2)))
    if kind == 8:
        what, first = draw(st.integers(0, 2)), draw(st.sampled_from([0, 0, 0, 1]))
        own = block().c_numbers(None) if what == 0 else np.zeros(1)
        scale = draw(st.sampled_from([1.0, 1.1, 0.8, 2.0, -1.0]))
        values = (own * scale)[first : first + draw(st.integers(1, len(own)))]
        return struct.pack("<BH", what, first) + values.tobytes()
    if kind == 9:
        return bytes([draw(st.integers(0, 2))])
    return b""


SMALL = st.integers(0, 12)


@st.composite
def doings(draw: st.DrawFn) -> tuple[str, bytes | int]:
    what = draw(st.sampled_from(["frame"] * 8 + ["bytes", "tick", "tick", "send", "switch on"]))
    if what == "frame":
        kind = draw(KINDS)
        session = draw(st.sampled_from([1, 1, 1, 2, 65537, 0]))
        sequence = draw(st.sampled_from([1, 2, 3, 4, 5, 6, 7, 8, 2**31 + 3]))
        frame = Frame(kind, session, sequence, draw(bodies(kind))).packed()
        return what, frame
    if what == "bytes":
        return what, draw(st.binary(max_size=300))
    return what, draw(st.integers(1, 7))


@needs("cc")
@settings(max_examples=150)
@given(st.booleans(), st.lists(doings(), max_size=40))
def test_c_answers_as_the_twin_does(is_open: bool, told: list[tuple[str, bytes | int]]) -> None:
    servers: list[Twin | Compiled] = [own := twin(), Compiled()]
    own.fingerprint = bytes.fromhex(exported()[0])
    if is_open:
        opening = bytes.fromhex(exported()[0]) + struct.pack("<BI", 1, 5)
        told = [("frame", Frame(3, 1, 0, opening).packed()), ("send", 60), *told]
    for what, how in told:
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
            n = how if what == "send" and isinstance(how, int) else 500 if what == "frame" else 0
            sent.append([server.send() for _ in range(n)])
        assert sent[0] == sent[1]
        np.testing.assert_array_equal(servers[0].outputs, servers[1].outputs)
        (low, high) = SERVING.limits["displacement"]
        assert low <= servers[1].outputs[0] <= high


@given(st.lists(st.binary(max_size=236), max_size=5), st.integers(1, 50))
def test_frames_come_out_as_they_went_in_however_they_are_cut(
    bodies: list[bytes], cut: int
) -> None:
    frames = [Frame(k % 14, 2**32 - 1 - k, k, body) for k, body in enumerate(bodies)]
    wire = b"".join(frame.packed() for frame in frames)
    reader = Reader()
    found = [frame for at in range(0, len(wire), cut) for frame in reader.feed(wire[at : at + cut])]
    assert found == frames
    assert wire.count(0) == len(frames)
    assert not reader.dropped


@given(st.binary(min_size=1, max_size=236), st.data())
def test_no_frame_with_up_to_three_flipped_bits_is_taken(body: bytes, data: st.DataObject) -> None:
    wire = bytearray(Frame(4, 7, 9, body).packed())
    places = data.draw(
        st.lists(st.integers(0, 8 * len(wire) - 1), min_size=1, max_size=3, unique=True)
    )
    for place in places:
        wire[place // 8] ^= 1 << place % 8
    assert not Reader().feed(bytes(wire) + b"\0")
