"""Seals at the end of figures: a digest of the rest, by which one that was changed is told."""

from __future__ import annotations

import zlib

from mckibben.system.manifest import digest

MAKER = "drawn by mckibben"
"""In every figure."""

PNG, PDF = b"\x89PNG", b"%PDF"
"""How these begin; what begins otherwise is taken for an SVG."""

IEND = 12
"""Bytes of the last chunk of a PNG, which stays the last."""


def sealed(figure: bytes) -> bytes:
    """Return a PNG, SVG or PDF with a seal: a chunk of text, or a comment after its end."""
    words = f"{MAKER}, sha256 {digest(figure)}".encode()
    if figure.startswith(PNG):
        chunk = b"tEXtComment\0" + words
        size, check = len(chunk) - 4, zlib.crc32(chunk)  # the size is without the chunk's name
        seal = size.to_bytes(4, "big") + chunk + check.to_bytes(4, "big")
        return figure[:-IEND] + seal + figure[-IEND:]
    return figure + (b"%% %b\n" % words if figure.startswith(PDF) else b"<!-- %b -->\n" % words)


def is_sealed(figure: bytes) -> bool:
    """Tell whether a figure has its seal, and is as it was when that was set."""
    size = len(sealed(figure)) - len(figure)
    end = len(figure) - (IEND if figure.startswith(PNG) else 0)
    return sealed(figure[: max(end - size, 0)] + figure[end:]) == figure
