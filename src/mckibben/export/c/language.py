"""The kernel language, see ``docs/kernels.md``: how a kernel's source is read, and what is refused.

Kernels are Python functions of numbers and arrays that numba compiles. The part of Python that they are
written in is small enough to have one meaning in Python, in numba and in C.
"""

from __future__ import annotations

import ast
import inspect
import io
import re
import textwrap
import tokenize
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache, cached_property
from typing import Any

from mckibben.blocks.kernels import SINGLE
from mckibben.errors import ModelError

BOOL, INT, REAL = "bool", "int", "float"
"""Types of values, as annotated: each holds those before it."""

TYPES = {BOOL: "int", INT: "int", REAL: "mck_real"}
"""What they are in C."""

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
        self._breaks: list[list[set[str]]] = []

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
        return names

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
    def changing(self) -> set[str]:
        """Names that are assigned to more than once; arguments have been before."""
        return {name for name, n in self.stored.items() if n > 1 or name in self.given}

    @cached_property
    def counters(self) -> set[str]:
        """Names that loops count."""
        return {ast.unparse(node.target) for node in self.nodes if isinstance(node, ast.For)}

    @property
    def given(self) -> list[str]:
        """Names of the arguments."""
        return [arg.arg for arg in self.tree.args.args]

    @property
    def locals(self) -> set[str]:
        """Names of arguments and of what is assigned to."""
        return {*self.stored, *self.given}

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

    def number(self, node: ast.expr) -> int | float | None:
        """Return the number that is written out or named by a constant; None for anything else."""
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            number = self.number(node.operand)
            return None if number is None else -number
        value = getattr(node, "value", None)
        if isinstance(node, ast.Name) and node.id not in self.locals:
            value = self.globals.get(node.id)
        return value if isinstance(value, bool | int | float) else None

    def follow(self, body: Sequence[ast.stmt], known: set[str]) -> set[str] | None:
        """Return what is assigned on every way to the end of a body; None where no way leads there.

        ``known`` are those assigned before. A name that is read where it may not be is refused.
        """
        for node in body:
            for name in _read(node):
                if name.id in self.locals - known:
                    what = f"{name.id!r} where it may not be assigned"
                    raise self.refusal(name, what, "assign it before the branch or loop")
            ends: list[set[str] | None] = [known | _stored(node)]
            if isinstance(node, ast.If):
                ends = [self.follow(part, known) for part in (node.body, node.orelse)]
            elif isinstance(node, ast.For | ast.While):
                self._breaks.append([])
                self.follow(node.body, known | _stored(node))
                endless = isinstance(node, ast.While) and self.number(node.test)
                ends = [*self._breaks.pop(), *([] if endless else [known])]
            elif isinstance(node, ast.Return | ast.Break | ast.Continue):
                if isinstance(node, ast.Break):
                    self._breaks[-1].append(known)
                return None
            reached = [end for end in ends if end is not None]
            if not reached:
                return None
            known = set.intersection(*reached)
        return known

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
    """Leaves out what derivatives alone ask for: in C, ``DERIVED`` is false."""

    def visit_If(self, node: ast.If) -> ast.If | list[ast.stmt]:
        self.generic_visit(node)
        all_of = isinstance(node.test, ast.BoolOp) and isinstance(node.test.op, ast.And)
        tests = node.test.values if all_of else [node.test]  # type: ignore[attr-defined]
        return node.orelse if "DERIVED" in map(ast.unparse, tests) else node


def names_in(*nodes: ast.AST | None) -> list[ast.Name]:
    """Return all names in parts of a kernel."""
    return [n for node in nodes if node for n in ast.walk(node) if isinstance(n, ast.Name)]


def _head(node: ast.stmt) -> list[ast.AST]:
    """Return the parts of a statement without those of the statements inside it."""
    return [part for part in ast.iter_child_nodes(node) if not isinstance(part, ast.stmt)]


def _stored(node: ast.stmt) -> set[str]:
    """Return the names that a statement itself assigns to."""
    return {name.id for name in names_in(*_head(node)) if isinstance(name.ctx, ast.Store)}


def _read(node: ast.stmt) -> list[ast.Name]:
    """Return the names that a statement itself reads."""
    both = isinstance(node, ast.AugAssign)
    return [name for name in names_in(*_head(node)) if both or isinstance(name.ctx, ast.Load)]


def plain(words: str) -> str:
    """Return words that neither end nor begin a comment of C."""
    return re.sub(r"\*(?=/)|/(?=\*)|\?(?=\?)", r"\g<0> ", words)


def _comments(text: str) -> Iterator[tuple[int, tuple[str, bool]]]:
    """Yield the row of every comment, its words, and whether it has the line for itself."""
    lines = text.splitlines()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT and not token.string.startswith("# type:"):
            row = token.start[0]
            alone = lines[row - 1].lstrip().startswith("#")
            yield row, (plain(token.string.lstrip("# ").split("  # ")[0]), alone)
