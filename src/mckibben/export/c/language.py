"""The kernel language, see ``docs/kernels.md``: how a kernel's source is read, and what is refused.

Kernels are Python functions of numbers and arrays that numba compiles. The part of Python that they are
written in is small enough to have one meaning in Python, in numba and in C.
"""

from __future__ import annotations

import ast
import inspect
import io
import textwrap
import tokenize
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from functools import cache, cached_property
from typing import Any

from mckibben.blocks.kernels import SINGLE
from mckibben.errors import ModelError

REAL, INT = "mck_real", "int"
"""Types of a value in C: a number, and a whole number or truth value."""

TYPES = {"float": REAL, "int": INT, "bool": INT}
"""Types of numbers, as annotated."""

_FUNCTIONS = """acos acosh asin asinh atan atan2 atanh ceil copysign cos cosh exp expm1 fabs floor fmod
log log10 log1p log2 pow sin sinh sqrt tan tanh trunc"""

FUNCTIONS = frozenset(_FUNCTIONS.split())
"""Functions of ``math`` that kernels may call."""

Kernel = Callable[..., Any]


class KernelError(ModelError):
    """A kernel that is not written in the kernel language.

    Attributes
    ----------
    file, line : str, int
        Where it is.
    construct, instead : str
        What it has, and what to write instead.
    """

    def __init__(self, file: str, line: int, construct: str, instead: str) -> None:
        self.file, self.line, self.construct, self.instead = file, line, construct, instead
        super().__init__(
            f"{file}, line {line}: kernels cannot have {construct}. Remedy: {instead}."
        )


class Source:
    """The source of a kernel: its syntax tree, its comments, and what its global names mean."""

    def __init__(self, kernel: Kernel) -> None:
        self.function = kernel.py_func  # type: ignore[attr-defined]
        lines, self._first = inspect.getsourcelines(self.function)
        text = textwrap.dedent("".join(lines))
        tree = ast.parse(text).body[0]
        assert isinstance(tree, ast.FunctionDef)
        self.tree = _WithoutDerivatives().visit(tree)
        self.comments = dict(_comments(text))
        closed = inspect.getclosurevars(self.function).nonlocals
        self.globals: Mapping[str, Any] = {**self.function.__globals__, **closed}
        self.body = tree.body[1:] if ast.get_docstring(tree) is not None else tree.body

    def refusal(self, node: ast.AST, construct: str, instead: str) -> KernelError:
        """Return the error for a construct that is outside the language."""
        line = self._first + getattr(node, "lineno", 1) - 1
        return KernelError(inspect.getfile(self.function), line, construct, instead)

    def annotations(self) -> Iterator[tuple[ast.arg, str]]:
        """Yield the parameters and their types as written."""
        given = self.tree.args
        if given.vararg or given.kwarg or given.kwonlyargs or given.defaults or given.posonlyargs:
            raise self.refusal(self.tree, "default or variable arguments", "name every argument")
        for arg in given.args:
            if arg.annotation is None:
                raise self.refusal(arg, f"the argument {arg.arg!r} without a type", "annotate it")
            yield arg, ast.unparse(arg.annotation)

    @cached_property
    def returns(self) -> list[str]:
        """The types that are returned."""
        written = ast.unparse(self.tree.returns) if self.tree.returns else "without a type"
        if written == "None":
            return []
        names = written.removeprefix("tuple[").removesuffix("]").split(", ")
        if not TYPES.keys() >= {*names}:
            fill = "return numbers, and fill arrays that are passed in"
            raise self.refusal(self.tree, f"the result {written}", fill)
        return [TYPES[name] for name in names]

    @cached_property
    def nodes(self) -> list[ast.AST]:
        """All parts of the body."""
        return [node for statement in self.body for node in ast.walk(statement)]

    @cached_property
    def stored(self) -> Counter[str]:
        """How often every local name is assigned to."""
        names = [node for node in self.nodes if isinstance(node, ast.Name)]
        return Counter(node.id for node in names if isinstance(node.ctx, ast.Store))

    @cached_property
    def counters(self) -> set[str]:
        """Names that loops count."""
        return {ast.unparse(node.target) for node in self.nodes if isinstance(node, ast.For)}

    @property
    def locals(self) -> set[str]:
        """Names of arguments and of their sizes, and of what is assigned to."""
        given = [arg.arg for arg in self.tree.args.args]
        return {*self.stored, *given, *(f"{name}_size" for name in given)}

    @cached_property
    def matrices(self) -> set[str]:
        """Names of arrays with two dimensions: those reshaped, or indexed with two places."""
        found = set()
        for node in self.nodes:
            if isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Tuple):
                found.add(ast.unparse(node.value))
            elif isinstance(node, ast.Assign) and ".reshape(" in ast.unparse(node.value):
                found |= {ast.unparse(target) for target in node.targets}
        return found

    def constant(self, name: str) -> int | float | None:
        """Return the number that a global name means; None where it means something else."""
        value = self.globals.get(name)
        return value if isinstance(value, bool | int | float) else None

    def single(self, name: str) -> float | None:
        """Return a constant's value in single precision, from ``SINGLE`` of its or a kernel's module."""
        kernels = [each.py_func for each in self.globals.values() if hasattr(each, "py_func")]
        for known in (self.globals, *(kernel.__globals__ for kernel in kernels)):
            table = known.get("SINGLE", SINGLE)
            if name in table and known.get(name) == self.globals[name]:
                return float(table[name])
        return SINGLE.get(name)


@cache
def source_of(kernel: Kernel) -> Source:
    """Return the source of a kernel."""
    return Source(kernel)


class _WithoutDerivatives(ast.NodeTransformer):
    """Leaves out what derivatives alone ask for."""

    def visit_If(self, node: ast.If) -> ast.If | None:
        self.generic_visit(node)
        return None if ast.unparse(node.test).partition(" ")[0] == "DERIVED" else node


def _comments(text: str) -> Iterator[tuple[int, tuple[str, bool]]]:
    """Yield the row of every comment, its words, and whether it has the line for itself."""
    lines = text.splitlines()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT and not token.string.startswith("# type:"):
            row = token.start[0]
            alone = lines[row - 1].lstrip().startswith("#")
            yield row, (token.string.lstrip("# ").split("  # ")[0], alone)
