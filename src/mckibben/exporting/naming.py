"""Names and texts from model files, made safe for generated sources.

A model file may come from anyone: its channel names and units are arbitrary text.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from mckibben.errors import ModelError

WORDS = """
auto break case char const continue default do double else enum extern float for goto if inline int
long register restrict return short signed sizeof static struct switch typedef union unsigned void
volatile while bool true false class delete new operator private protected public template this
throw try catch namespace using virtual friend main
"""

HEADERS = """
assert complex ctype errno fenv float inttypes iso646 limits locale math mex setjmp signal stdarg
stdatomic stdbool stddef stdint stdio stdlib string tgmath time uchar wchar unit unit_model fmi2
"""

RESERVED = frozenset((*WORDS.split(), *HEADERS.split()))
"""Keywords of C and C++, and headers that a model's file must not shadow."""

ELEMENTARY = """
acos acosh asin asinh atan atan2 atanh cbrt ceil copysign cos cosh erf erfc exp exp2 expm1 fabs fdim
floor fma fmax fmin fmod frexp hypot ilogb ldexp lgamma llrint llround log log10 log1p log2 logb lrint
lround modf nan nearbyint nextafter nexttoward pow remainder remquo rint round scalbln scalbn sin sinh
sqrt tan tanh tgamma trunc
"""
"""Functions of <math.h>, which have twins that end in f and in l."""

OTHERS = """
alignas alignof and asm bitand bitor compl concept constexpr decltype explicit export mutable noexcept
not nullptr or requires typeid typename typeof using wchar_t xor
double_t float_t fpclassify gamma isfinite isgreater isinf isless isnan isnormal isunordered j0 j1 jn
signbit signgam y0 y1 yn FP_FAST_FMA FP_FAST_FMAF FP_FAST_FMAL FP_ILOGB0 FP_ILOGBNAN FP_INFINITE FP_NAN
FP_NORMAL FP_SUBNORMAL FP_ZERO HUGE_VAL HUGE_VALF HUGE_VALL INFINITY MATH_ERREXCEPT MATH_ERRNO M_1_PI
M_2_PI M_2_SQRTPI M_E M_LN10 M_LN2 M_LOG10E M_LOG2E M_PI M_PI_2 M_PI_4 M_SQRT1_2 M_SQRT2 NAN NULL
abort abs calloc div exit free labs llabs malloc memchr memcmp memcpy memmove memset printf putchar puts
realloc strlen tolower toupper
MCK_FLOAT32 MCK_H MCK_INFINITY all_finite copy mck_max mck_min mck_real mck_sum
parts run
"""

TAKEN = frozenset(
    (
        *WORDS.split(),
        *OTHERS.split(),
        *(f + end for f in ELEMENTARY.split() for end in ("", "f", "l")),
    )
)
"""Names that C, C++, <math.h>, compilers or the export's own files have already."""

LONGEST_NAME = 40
"""Longest name of a file or function [characters]."""


def identifier(name: str) -> str:
    """Return a name that may prefix C functions and macros; raise an error for others.

    Raises
    ------
    ModelError
        If it is not a letter followed by letters, digits and underscores, is a word of C or C++, or
        starts like the package's own functions.
    """
    if (
        not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name)
        or len(name) > LONGEST_NAME
        or name.lower() in RESERVED
        or name.lower().startswith("mck")
    ):
        raise ModelError(
            f"{name!r:.60} cannot name C functions",
            parameter="name",
            remedy="give `name` a letter and then letters, digits or underscores, at most "
            f"{LONGEST_NAME}, no word of C or name of its headers, and not starting with "
            "mck",
        )
    return name


def name_from(path: Path) -> str:
    """Return an identifier from a file name, with underscores for invalid characters."""
    words = re.sub(r"[^A-Za-z0-9_]+", "_", path.stem).strip("_")[: LONGEST_NAME - 6]
    fits = words and words[0].isalpha() and words.lower() not in RESERVED
    return words if fits and not words.lower().startswith("mck") else f"model_{words}".rstrip("_")


def said(text: str) -> str:
    """Return text for a comment or a string of a source file, with unsafe characters replaced."""
    return re.sub(r"[^A-Za-z0-9_ .,()^%/+=:-]|//|/\*|\*/", "_", text)[:80]


def commented(text: str) -> str:
    """Return text for a comment of C, without comment marks.

    >>> commented("a */ b")
    'a * / b'
    """
    return re.sub(r"\*(?=/)|/(?=\*)|\?(?=\?)", r"\g<0> ", text)


def macros(names: Sequence[str]) -> list[str]:
    """Return distinct macro suffixes for channels."""
    found: list[str] = []
    for number, name in enumerate(names, start=1):
        ending = re.sub(r"[^A-Z0-9]+", "_", name.upper()).strip("_") or f"CHANNEL_{number}"
        while ending in found:
            ending += f"_{number}"
        found.append(ending)
    return found
