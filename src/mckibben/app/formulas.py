"""Formulas of time, such as ``5 + 3*sin(2*pi*t/10)``, read as arithmetic and nothing else."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable
from typing import Any

import numpy as np

from mckibben.arrays import Array
from mckibben.errors import DataError

FUNCTIONS: dict[str, Callable[..., Any]] = {
    **{name: getattr(np, name) for name in ("sin", "cos", "tan", "tanh", "exp", "log", "sqrt")},
    "abs": np.abs,
    "sign": np.sign,
    "min": np.minimum,
    "max": np.maximum,
    "floor": np.floor,
}
"""By their names in a formula."""

OPERATORS: dict[type, Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Mod: operator.mod,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}


def values(text: str, t: Array) -> Array:
    """Return a formula at some times.

    Parameters
    ----------
    text : str
        Of ``t``, numbers, ``pi``, `FUNCTIONS` and ``+ - * / % **``; ``^`` is ``**``.
    t : array, shape (n,)
        Times [s].

    Raises
    ------
    DataError
        On anything else, and on values that are not finite.

    Examples
    --------
    >>> values("2*t + max(t, 1)", np.array([0.0, 2.0])).tolist()
    [1.0, 6.0]
    """
    try:
        with np.errstate(all="ignore"):
            result = _value(ast.parse(text.replace("^", "**"), mode="eval").body, t)
        result = np.asarray(result, dtype=float) + np.zeros_like(t)
    except (SyntaxError, ValueError, TypeError, KeyError, ArithmeticError, RecursionError):
        problem = f"{text!r:.60} is no formula of t"
        remedy = f"write one such as 5 + 3*sin(2*pi*t/10), of {', '.join(FUNCTIONS)}"
        raise DataError(problem, remedy=remedy) from None
    if not np.isfinite(result).all():
        raise DataError(f"{text!r:.60} is not finite at all times", remedy="write another formula")
    return result


def _value(node: ast.expr, t: Array) -> Any:
    match node:
        case ast.Constant(value=int() | float() as number):
            return float(number)
        case ast.Name(id=name):
            return {"t": t, "pi": np.pi}[name]
        case ast.BinOp(left=left, op=sign, right=right):
            return OPERATORS[type(sign)](_value(left, t), _value(right, t))
        case ast.UnaryOp(op=sign, operand=operand):
            return OPERATORS[type(sign)](_value(operand, t))
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
            return FUNCTIONS[name](*(_value(each, t) for each in arguments))
    raise ValueError
