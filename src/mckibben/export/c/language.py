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
from functools import cached_property
from typing import Any

from mckibben.blocks.kernels import SINGLE
from mckibben.errors import ModelError

REAL, INT, VIEW = "mck_real", "int", "view"
"""Types of a value: a number, a whole number or truth value, and an array or a part of one."""

FUNCTIONS = {
    *(
        "acos",
        "acosh",
        "asin",
        "asinh",
        "atan",
        "atan2",
        "atanh",
        "ceil",
        "copysign",
        "cos",
        "cosh",
    ),
    *(
        "exp",
        "expm1",
        "fabs",
        "floor",
        "fmod",
        "isfinite",
        "isinf",
        "isnan",
        "log",
        "log10",
        "log1p",
    ),
    *("log2", "pow", "sin", "sinh", "sqrt", "tan", "tanh", "trunc"),
}
"""Functions of ``math`` (or of the same name in NumPy, of one number) that kernels may call."""

Kernel = Callable[..., Any]


class KernelError(ModelError):
    """A kernel that is not written in the kernel language.

    Attributes
    ----------
    file : str
        Where it is.
    line : int
    """

    def __init__(self, file: str, line: int, construct: str, instead: str) -> None:
        self.file, self.line = file, line
        super().__init__(
            f"{file}, line {line}: kernels cannot have {construct}. Remedy: {instead}."
        )


class Source:
    """The source of a kernel: its syntax tree, its comments, and what its global names mean.

    Parameters
    ----------
    kernel : callable
        With the plain function as ``py_func``.
    """

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

    @property
    def module(self) -> str:
        """Name of the module, without those of the packages."""
        return str(self.function.__module__).rpartition(".")[2]

    @property
    def doc(self) -> str:
        """The docstring, without its indents."""
        return inspect.cleandoc(ast.get_docstring(self.tree) or "")

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
        if self.tree.returns is None:
            raise self.refusal(self.tree, "no return type", "annotate it, as with -> None")
        written = ast.unparse(self.tree.returns).removeprefix("tuple[").removesuffix("]")
        known = {"float": REAL, "int": INT, "bool": INT}
        if written == "None":
            return []
        kinds = [known.get(kind) for kind in written.split(", ")]
        found = [kind for kind in kinds if kind]
        if len(found) < len(kinds):
            raise self.refusal(
                self.tree,
                f"the result {written}",
                "return numbers, and fill arrays that are passed in",
            )
        return found

    @cached_property
    def nodes(self) -> list[ast.AST]:
        """All parts of the body."""
        return [node for statement in self.body for node in ast.walk(statement)]

    @cached_property
    def stored(self) -> Counter[str]:
        """How often every local name is assigned to; ``+=`` assigns to what was there before."""
        names = [node for node in self.nodes if isinstance(node, ast.Name)]
        added = [node.target for node in self.nodes if isinstance(node, ast.AugAssign)]
        stores = [node for node in names if isinstance(node.ctx, ast.Store)]
        return Counter(node.id for node in [*stores, *added] if isinstance(node, ast.Name))

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

    def only_counts(self, name: str) -> bool:
        """Return whether a name is only used in loops that it counts."""
        loops = [
            each
            for each in self.nodes
            if isinstance(each, ast.For) and ast.unparse(each.target) == name
        ]
        inside = {id(node) for loop in loops for node in ast.walk(loop)}
        uses = [node for node in self.nodes if isinstance(node, ast.Name) and node.id == name]
        counted = self.stored[name] == len(loops) and all(id(node) in inside for node in uses)
        return name == "_" or counted

    def constant(self, name: str) -> int | float | None:
        """Return the number that a global name means; None where it means something else."""
        value = self.globals.get(name)
        return value if isinstance(value, bool | int | float) else None

    def single(self, name: str) -> float | None:
        """Return what a constant is in single precision, if its module has that in ``SINGLE``.

        Its module is this one, or one that kernels are imported from.
        """
        kernels = [each.py_func for each in self.globals.values() if hasattr(each, "py_func")]
        for known in (self.globals, *(kernel.__globals__ for kernel in kernels)):
            table = known.get("SINGLE", SINGLE)
            if name in table and known.get(name) == self.globals[name]:
                return float(table[name])
        return SINGLE.get(name)


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


# -- sums of whole numbers, as sizes and places of arrays are ----------------------------------------


def plus(one: ast.expr, other: ast.expr, sign: int = 1) -> ast.expr:
    """Return the sum or the difference of two whole numbers, simplified.

    >>> ast.unparse(plus(ast.parse("n + 1").body[0].value, ast.Constant(1), -1))
    'n'
    """
    terms: Counter[str] = Counter()
    nodes: dict[str, ast.expr] = {}

    def add(node: ast.expr, sign: int) -> None:
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Sub):
            add(node.left, sign)
            add(node.right, sign if isinstance(node.op, ast.Add) else -sign)
        elif isinstance(node, ast.Constant):
            terms[""] += sign * _whole(node)
        elif (
            isinstance(node, ast.BinOp)
            and isinstance(node.op, ast.Mult)
            and isinstance(node.left, ast.Constant)
        ):
            key = ast.unparse(node.right)
            terms[key] += sign * _whole(node.left)
            nodes.setdefault(key, node.right)
        else:
            key = ast.unparse(node)
            terms[key] += sign
            nodes.setdefault(key, node)

    add(one, 1)
    add(other, sign)
    number = terms.pop("", 0)
    total: ast.expr | None = None
    for key, times in sorted(terms.items(), key=lambda term: term[1] < 0):
        if times:
            size = abs(times)
            term = nodes[key] if size == 1 else times_of(ast.Constant(size), nodes[key])
            if total is None:
                total = term if times > 0 else ast.UnaryOp(ast.USub(), term)
            else:
                total = ast.BinOp(total, ast.Add() if times > 0 else ast.Sub(), term)
    if total is None:
        return ast.Constant(number)
    if number:
        total = ast.BinOp(total, ast.Add() if number > 0 else ast.Sub(), ast.Constant(abs(number)))
    return total


def _whole(node: ast.Constant) -> int:
    assert isinstance(node.value, int)
    return node.value


def times_of(one: ast.expr, other: ast.expr) -> ast.expr:
    """Return the product of two whole numbers."""
    for number, rest in ((one, other), (other, one)):
        if isinstance(number, ast.Constant) and number.value in (0, 1):
            return rest if number.value else number
    return ast.BinOp(one, ast.Mult(), other)
