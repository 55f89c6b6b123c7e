"""Text of a file of bytes: its encoding, line ends, and what terminals write between."""

from __future__ import annotations

import re
from contextlib import suppress
from pathlib import Path

from mckibben.errors import DataError
from mckibben.files.headers import foreign_words
from mckibben.files.notices import warn

_ENCODINGS = ("cp1252", "cp932", "gb18030", "cp949", "latin-1")
_LOOKED_AT = 2**16  # bytes by which the encoding is recognised
_CONTROL = bytes([*range(0x09), *range(0x0E, 0x20), 0x7F])
_ESCAPE = re.compile(rb"\x1b(?:\[[0-9;?]*[ -/]*[@-~]|\][^\x07\x1b\n]*(?:\x07|\x1b\\)|[@-Z\\^_])")
_WITHIN = re.compile(rb"(?<=[0-9.,])[\x00-\x06\x08\x0e-\x1f\x7f]+(?=[0-9.eE+-])")
_MOST = 0.02  # share of control characters in a text


def decoded(data: bytes, path: Path) -> bytes:
    """Return a text in UTF-8 with line feeds, without control characters.

    Raises
    ------
    DataError
        For binary data.
    """
    if data.endswith(bytes(4)):  # what a logger reserved
        data = data.rstrip(b"\0")
    start = data[:_LOOKED_AT]
    zeros = [start[at::2].count(0) * 4 > len(start) for at in (0, 1)]
    wide = "utf-16-be" if zeros[0] else "utf-16-le" if zeros[1] else "utf-8"
    try:
        text = data.decode("utf-16" if start.startswith((b"\xff\xfe", b"\xfe\xff")) else wide)
    except UnicodeDecodeError:
        text = _foreign(data, path)
    data = text.lstrip("\ufeff").rstrip("\x1a").encode()
    data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    return data if len(data.translate(None, _CONTROL)) == len(data) else _printable(data, path)


def _printable(data: bytes, path: Path) -> bytes:
    """Return a text without control characters; a number with one within is marked as damaged."""
    text = _ESCAPE.sub(b"", data)
    plain = text.translate(None, _CONTROL)
    if not plain.strip() or len(text) - len(plain) > max(8, _MOST * len(text)):
        better = "give the file the ending of its format, or export it as CSV"
        raise DataError("this is not text", file=path, remedy=better)
    controls = [line != line.translate(None, _CONTROL) for line in data.split(b"\n")]
    warn(
        path,
        f"control characters of a terminal in {sum(controls)} line(s), the first in row "
        f"{controls.index(True) + 1}, are left out",
    )
    return _WITHIN.sub("\ufffd".encode(), text).translate(None, _CONTROL)


def _foreign(data: bytes, path: Path) -> str:
    """Decode text in a non-Unicode encoding: the one in which its header has words of `names`."""
    texts = {}
    for encoding in _ENCODINGS:
        with suppress(UnicodeDecodeError):
            texts[encoding] = data.decode(encoding)
    words = {encoding: foreign_words(text[:_LOOKED_AT]) for encoding, text in texts.items()}
    best = max(words, key=words.__getitem__)
    if not words[best]:
        warn(path, f"its encoding shows by no word; it was read as {best}, so names may be garbled")
    return texts[best]
