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
_TERMINAL = b"\0\x07\b\x1b"
_WITHIN = re.compile(  # a number, or where one may have been
    rb"(?<=[0-9.,])[\0\x07\x08]+(?=[0-9.eE+-])|(?<=[0-9.,;\t ])[\x01-\x06\x0e-\x1f\x7f]+(?=[0-9.,;\t ])"
)
_MOST, _MOST_OTHERS = (
    0.2,
    0.005,
)  # shares of a text: of what terminals write, and of other characters


def decoded(data: bytes, path: Path) -> bytes:
    """Return a text in UTF-8 with line feeds, without control characters.

    Raises
    ------
    DataError
        For binary data.
    """
    if data.endswith(bytes(4)) and data.strip(b"\0"):  # what a logger reserved
        n_zeros = len(data) - len(data := data.rstrip(b"\0"))
        warn(path, f"{n_zeros} zero bytes at the end are left out")
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
    others = text.translate(None, _TERMINAL)
    plain = others.translate(None, _CONTROL)
    n_others, n = len(others) - len(plain), len(text)
    if not plain.strip() or n_others > max(4, _MOST_OTHERS * n) or n - len(plain) > _MOST * n:
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
