"""The kernel language, see ``docs/kernels.md``: parsing of kernels, and unsupported constructs.

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
from collections.abc import Iterator, Mapping
from functools import cache, cached_property
from typing import Any

from mckibben.blocks.kernels import SINGLE
from mckibben.errors import KernelError
from mckibben.exporting.naming import commented

BOOL, INT, REAL = "bool", "int", "float"
"""Types of values, as annotated; each includes those before it."""

TYPES = {BOOL: "int", INT: "int", REAL: "mck_real"}
"""Their types in C."""

_FUNCTIONS = """acos acosh asin asinh atan atan2 atanh ceil copysign cos cosh exp expm1 fabs floor
log log10 log1p log2 pow sin sinh sqrt tan tanh trunc"""

FUNCTIONS = frozenset(_FUNCTIONS.split())
"""Functions of ``math`` that kernels may call."""


class Source:
    """The source of a kernel: its syntax tree, its comments, and the meaning of its names.

    Of its local names, ``stored`` is how often each is assigned to, ``given`` are its arguments,
    ``changing`` have more than one value in a call, and ``counters`` are counted by loops.
    """

    def __init__(self, kernel: Any) -> None:
        self.function = kernel.py_func
        lines, self._first = inspect.getsourcelines(self.function)
        text = textwrap.dedent("".join(lines))
        tree = ast.parse(text).body[0]
        assert isinstance(tree, ast.FunctionDef)
        self.tree = _WithoutDerivatives().visit(tree)
        self.comments = dict(_comments(text))
        closed = inspect.getclosurevars(self.function).nonlocals
        self.globals: Mapping[str, Any] = {**self.function.__globals__, **closed}
        self.body = tree.body[1:] if ast.get_docstring(tree) is not None else tree.body
        self.given = [arg.arg for arg in tree.args.args]
        self.stored = used(*self.body, how=ast.Store)
        self.locals = {*self.stored, *self.given}
        self.changing = {name for name, n in self.stored.items() if n > 1 or name in self.given}
        self.counters = {ast.unparse(n.target) for n in ast.walk(tree) if isinstance(n, ast.For)}

    def refusal(self, node: ast.AST, construct: str, instead: str) -> KernelError:
        """Return the error for an unsupported construct."""
        line = self._first + getattr(node, "lineno", 1) - 1
        return KernelError(inspect.getfile(self.function), line, construct, instead)

    def annotations(self) -> Iterator[tuple[ast.arg, str]]:
        """Yield the parameters and their types as written."""
        arguments = self.tree.args
        if (
            arguments.vararg
            or arguments.kwarg
            or arguments.kwonlyargs
            or arguments.defaults
            or arguments.posonlyargs
        ):
            raise self.refusal(self.tree, "default or variable arguments", "name every argument")
        for arg in arguments.args:
            yield arg, ast.unparse(arg.annotation) if arg.annotation else "without a type"

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
    def matrices(self) -> set[str]:
        """Names of arrays with two dimensions: those reshaped, or indexed with two places."""
        names = set()
        for node in ast.walk(self.tree):
            if isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Tuple):
                names.add(ast.unparse(node.value))
            elif isinstance(node, ast.Assign) and ".reshape(" in ast.unparse(node.value):
                names |= {ast.unparse(target) for target in node.targets}
        return names

    def number(self, node: ast.expr) -> int | float | None:
        """Return the value of a literal or a constant; None for anything else."""
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            number = self.number(node.operand)
            return None if number is None else -number
        value = getattr(node, "value", None)
        if isinstance(node, ast.Name) and node.id not in self.locals:
            value = self.globals.get(node.id)
        elif isinstance(node, ast.Attribute):  # of a module
            value = getattr(self.globals.get(ast.unparse(node.value)), node.attr, None)
        return value if isinstance(value, bool | int | float) else None

    def single(self, name: str) -> float | None:
        """Return a constant's value in single precision, from ``SINGLE`` of its or a kernel's module."""
        kernels = [each.py_func for each in self.globals.values() if hasattr(each, "py_func")]
        for names in (self.globals, *(kernel.__globals__ for kernel in kernels)):
            table = names.get("SINGLE", SINGLE)
            if name in table and names.get(name) == self.globals[name]:
                return float(table[name])
        return SINGLE.get(name)


source_of = cache(Source)
"""The source of a kernel; cached."""


class _WithoutDerivatives(ast.NodeTransformer):
    """Removes code for derivatives: ``DERIVED`` is false in C."""

    def visit_If(self, node: ast.If) -> ast.If | list[ast.stmt]:
        self.generic_visit(node)
        all_of = isinstance(node.test, ast.BoolOp) and isinstance(node.test.op, ast.And)
        tests = node.test.values if all_of else [node.test]  # type: ignore[attr-defined]
        return node.orelse if "DERIVED" in map(ast.unparse, tests) else node


def used(*nodes: ast.AST, how: type[ast.expr_context] = ast.expr_context) -> Counter[str]:
    """Return how often each name is used, read, or assigned to in parts of a kernel."""
    names = (n for node in nodes for n in ast.walk(node) if isinstance(n, ast.Name))
    return Counter(name.id for name in names if isinstance(name.ctx, how))


def _comments(text: str) -> Iterator[tuple[int, tuple[str, bool]]]:
    """Yield row and text of every comment, and whether it is alone in its line."""
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT and not token.string.startswith("# type:"):
            alone = token.line.lstrip().startswith("#")
            yield token.start[0], (commented(token.string.lstrip("# ").split("  # ")[0]), alone)
