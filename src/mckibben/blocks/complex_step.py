"""Derivatives of kernels by complex step: f'(x) is the imaginary part of f(x + ih), over h.

With h so small that its square vanishes, real parts are those of the kernel, and imaginary parts its
exact derivatives: there is no difference of near numbers, so no step size to choose. The kernel for
complex numbers, its *twin*, is made from the kernel's source: comparisons, ``min``, ``max``, ``abs`` and
``int`` look at real parts, functions of ``math`` carry their derivative along, and calls lead to twins.

Source: Squire and Trapp, "Using complex variables to estimate derivatives of real functions", 1998.
"""

from __future__ import annotations

import ast
import inspect
import math
import textwrap
import threading
from collections.abc import Callable
from functools import cache, reduce
from typing import Any

from mckibben.errors import ModelError
from mckibben.system.compiling import Deferred, deferred

STEP = 1e-200
"""Complex step h: derivatives from 1e-100 to 1e150 are representable, and its square underflows to
0.
"""


@deferred
def _int(x: Any) -> int:
    return int(x.real)


@deferred
def _abs(x: Any) -> Any:
    return -x if x.real < 0.0 else x


@deferred
def _min(a: Any, b: Any) -> Any:
    return b if b.real < a.real else a


@deferred
def _max(a: Any, b: Any) -> Any:
    return b if b.real > a.real else a


@deferred
def _over(a: Any, b: Any) -> complex:
    above, below = complex(a), complex(b)  # whole numbers by name have a wrong ``imag`` in numba
    quotient = above.real / below.real
    return complex(quotient, (above.imag - quotient * below.imag) / below.real)


@deferred
def _copysign(x: Any, way: Any) -> Any:
    return x if math.copysign(1.0, x.real) == math.copysign(1.0, way.real) else -x


@deferred
def _atan2(y: Any, x: Any) -> complex:
    y, x = complex(y), complex(x)
    square = x.real * x.real + y.real * y.real
    return complex(math.atan2(y.real, x.real), (x.real * y.imag - y.real * x.imag) / square)


@deferred
def _pow(x: Any, n: Any) -> complex:
    x, n = complex(x), complex(n)
    value = x.real**n.real
    change = x.imag * n.real * x.real ** (n.real - 1.0)
    return complex(value, change + n.imag * value * math.log(x.real) if n.imag != 0.0 else change)


def _improved(evaluate: Any, target: Any, u: Any, memory: Any) -> Any:
    # the residual is linear in imaginary parts: one step would do, but for rounding of the slope
    residual = evaluate(u, memory)
    step = abs(residual.imag) + STEP  # of the size that is there, or it would be lost beside it
    slope = (evaluate(u + complex(0.0, step), memory) - residual).imag / step
    if slope != 0.0:
        for _ in range(3):
            missing = evaluate(u, memory) - target
            u = complex(u.real, u.imag - missing.imag / slope)
    return u


def _with_derivative(name: str, slope: Callable[[float, float], float]) -> Callable[[Any], complex]:
    """Return a function of ``math`` that propagates its derivative, ``slope(x, value)``."""
    function, by = getattr(math, name), deferred(slope)

    def with_derivative(x: Any) -> complex:
        z = complex(x)
        value = function(z.real)
        return complex(value, z.imag * by(z.real, value))

    return deferred(with_derivative)


HELPERS: dict[str, Callable[..., Any]] = {
    "int": _int,
    "abs": _abs,
    "min": _min,
    "max": _max,
    "over": _over,
    "fabs": _abs,
    "copysign": _copysign,
    "atan2": _atan2,
    "pow": _pow,
    "acos": _with_derivative("acos", lambda x, _: -1.0 / math.sqrt(1.0 - x * x)),
    "acosh": _with_derivative("acosh", lambda x, _: 1.0 / math.sqrt(x * x - 1.0)),
    "asin": _with_derivative("asin", lambda x, _: 1.0 / math.sqrt(1.0 - x * x)),
    "asinh": _with_derivative("asinh", lambda x, _: 1.0 / math.sqrt(x * x + 1.0)),
    "atan": _with_derivative("atan", lambda x, _: 1.0 / (1.0 + x * x)),
    "atanh": _with_derivative("atanh", lambda x, _: 1.0 / (1.0 - x * x)),
    "cos": _with_derivative("cos", lambda x, _: -math.sin(x)),
    "cosh": _with_derivative("cosh", lambda x, _: math.sinh(x)),
    "exp": _with_derivative("exp", lambda _, value: value),
    "expm1": _with_derivative("expm1", lambda _, value: value + 1.0),
    "log": _with_derivative("log", lambda x, _: 1.0 / x),
    "log10": _with_derivative("log10", lambda x, _: 1.0 / (x * math.log(10.0))),
    "log1p": _with_derivative("log1p", lambda x, _: 1.0 / (1.0 + x)),
    "log2": _with_derivative("log2", lambda x, _: 1.0 / (x * math.log(2.0))),
    "sin": _with_derivative("sin", lambda x, _: math.cos(x)),
    "sinh": _with_derivative("sinh", lambda x, _: math.cosh(x)),
    "sqrt": _with_derivative("sqrt", lambda _, value: 0.5 / value),
    "tan": _with_derivative("tan", lambda _, value: 1.0 + value * value),
    "tanh": _with_derivative("tanh", lambda _, value: 1.0 - value * value),
}
"""Complex-step replacements of functions of the kernel language, and ``over`` for division."""

BY_REAL_PART = ("ceil", "floor", "trunc", "isfinite", "isinf", "isnan")
"""Piecewise constant functions of ``math``, evaluated on real parts."""

_lock = threading.RLock()

PREFIX = "_twin_"
"""Prefix of the helpers' names."""


class _Rewriting(ast.NodeTransformer):
    """Rewrites the source of a kernel for complex numbers."""

    def visit_Call(self, node: ast.Call) -> ast.expr:
        self.generic_visit(node)
        name = ast.unparse(node.func).removeprefix("math.").removeprefix("np.")
        if isinstance(node.func, ast.Attribute) and name in BY_REAL_PART:
            node.args = [_real_part(node.args[0])]
        elif name in ("min", "max"):
            return reduce(lambda one, other: _helper_call(name, one, other), node.args)
        elif name in HELPERS:
            return _helper_call(name, *node.args)
        elif name != ast.unparse(node.func):
            functions = ", ".join(sorted({*HELPERS, *BY_REAL_PART} - {"over"}))
            raise ModelError(
                f"kernels have no derivative of {ast.unparse(node.func)}",
                remedy=f"use one of {functions}",
            )
        return node

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        self.generic_visit(node)
        divides = isinstance(node.op, ast.Div)
        return _helper_call("over", node.left, node.right) if divides else node

    def visit_AugAssign(self, node: ast.AugAssign) -> ast.stmt:
        written = ast.parse(f"{ast.unparse(node.target)} = {ast.unparse(node.target)}").body[0]
        self.generic_visit(node)
        if not isinstance(node.op, ast.Div):
            return node
        assert isinstance(written, ast.Assign)
        written.value = _helper_call("over", written.value, node.value)
        return written

    def visit_Compare(self, node: ast.Compare) -> ast.expr:
        self.generic_visit(node)
        node.left = _real_part(node.left)
        node.comparators = [_real_part(each) for each in node.comparators]
        return node


def _helper_call(name: str, *arguments: Any) -> ast.Call:
    return ast.Call(ast.Name(PREFIX + name, ast.Load()), list(arguments), [])


def _real_part(node: Any) -> Any:
    """Return the real part of a compared value."""
    if isinstance(node, ast.Tuple):
        return ast.Tuple([_real_part(each) for each in node.elts], ast.Load())
    truth = ast.Compare | ast.BoolOp | ast.Constant
    return node if isinstance(node, truth) else ast.Attribute(node, "real", ast.Load())


def twin(kernel: Any) -> Any:
    """Return the complex version of a compiled kernel, compiled at its first call.

    Parameters
    ----------
    kernel : callable
        In the kernel language, or the loop made from one.
    """
    with _lock:  # one, however many threads ask; and Python 3.11 parses in one at a time
        return _twin(kernel)


@cache
def _twin(kernel: Any) -> Any:
    assert isinstance(kernel, Deferred)
    function = kernel.py_func
    lines, first = inspect.getsourcelines(function)
    tree = ast.parse(textwrap.dedent("".join(lines)))
    definition = next(node for node in tree.body if isinstance(node, ast.FunctionDef))
    definition.decorator_list, definition.returns = [], None
    for argument in definition.args.args:
        argument.annotation = None
    _Rewriting().visit(definition)
    ast.increment_lineno(ast.fix_missing_locations(tree), first - 1)
    scope = {**function.__globals__, **inspect.getclosurevars(function).nonlocals}
    for name in {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}:
        if name == "improved":
            scope[name] = deferred(_improved, inline="always")
        elif isinstance(scope.get(name), Deferred):
            scope[name] = twin(scope[name])
    scope |= {PREFIX + name: helper for name, helper in HELPERS.items()} | {"DERIVED": True}
    exec(compile(tree, inspect.getfile(function), "exec"), scope)  # the kernel's own text
    made = scope[definition.name]
    made.__module__, made.__qualname__ = function.__module__, f"{function.__qualname__}_twin"
    return Deferred(made, kernel.targetoptions)
