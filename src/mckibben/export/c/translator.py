"""Kernels to C99: one function of C for every function of Python, with its names and comments.

``docs/kernels.md`` describes what can be translated. Arrays become pointers, with their sizes as
arguments of their own where a function asks for them; results behind the first are written through
pointers; functions and tuples of arrays that a kernel takes are bound, so that a kernel that takes
functions is written once for every caller. Nothing is allocated.
"""

from __future__ import annotations

import ast
import inspect
import math
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from mckibben.blocks.kernels import accumulate
from mckibben.export.c.language import (
    FUNCTIONS,
    INT,
    REAL,
    VIEW,
    Kernel,
    Source,
    plus,
    times_of,
)

WIDTH = 100
"""Columns of a line of C."""

LEAST, MOST = 1e-6, 3.4e38
"""Range of the sizes of constants that are the same in both precisions."""

ATOM, UNARY, TIMES, PLUS, RELATION, EQUAL, AND, OR, CHOICE = 15, 13, 12, 11, 9, 8, 5, 4, 3
"""How tightly operators of C bind."""

ARITHMETIC = {
    ast.Add: ("+", PLUS),
    ast.Sub: ("-", PLUS),
    ast.Mult: ("*", TIMES),
    ast.Div: ("/", TIMES),
    ast.FloorDiv: ("/", TIMES),
    ast.Mod: ("%", TIMES),
}
COMPARISON = {
    ast.Lt: ("<", RELATION),
    ast.LtE: ("<=", RELATION),
    ast.Gt: (">", RELATION),
    ast.GtE: (">=", RELATION),
    ast.Eq: ("==", EQUAL),
    ast.NotEq: ("!=", EQUAL),
}

RESERVED = FUNCTIONS | {
    *(
        "auto",
        "break",
        "case",
        "char",
        "const",
        "continue",
        "default",
        "do",
        "double",
        "else",
        "enum",
    ),
    *(
        "extern",
        "float",
        "for",
        "goto",
        "if",
        "inline",
        "int",
        "long",
        "register",
        "restrict",
        "return",
    ),
    *(
        "short",
        "signed",
        "sizeof",
        "static",
        "struct",
        "switch",
        "typedef",
        "union",
        "unsigned",
        "void",
    ),
    *(
        "volatile",
        "while",
        "y0",
        "y1",
        "yn",
        "j0",
        "j1",
        "jn",
        "gamma",
        "div",
        "copy",
        "run",
        "parts",
    ),
}
"""Names that C or <math.h> have already."""


class Value(NamedTuple):
    """An expression of C: its text, how tightly it binds, and its type."""

    text: str
    binds: int
    type: str

    def within(self, least: int) -> str:
        """Return the text, in brackets where it binds less tightly than asked for."""
        return self.text if self.binds >= least else f"({self.text})"

    def to(self, kind: str) -> Value:
        """Return it as a real number, if it is a whole one and that is asked for."""
        if kind == INT or self.type == kind:
            return self
        return Value(f"(mck_real){self.within(UNARY)}", UNARY, REAL)


@dataclass
class View:
    """An array, or a part of one: a pointer, the place where it begins, its size, and its row length.

    ``roots`` are the names of the pointers that are written to where it is.
    """

    base: str
    size: ast.expr
    roots: tuple[str, ...]
    begin: ast.expr = field(default_factory=lambda: ast.Constant(0))
    columns: ast.expr | None = None


class Parameter(NamedTuple):
    """A parameter of a function of C.

    ``place`` is that of the argument of Python, ``item`` which array of a tuple it is, and ``asks`` what
    of the array: itself (""), its "size" or its "columns".
    """

    name: str
    type: str
    place: int
    item: int = 0
    asks: str = ""


@dataclass
class Function:
    """A function of C: its name, what it takes and gives, which arrays it writes to, and its text."""

    name: str
    returns: list[str]
    parameters: list[Parameter] = field(default_factory=list)
    written: set[str] = field(default_factory=set)
    text: str = ""

    def call(self, *arguments: tuple[str, int]) -> str:
        """Return a call with arguments in Python's order, each its text and, of arrays, its size."""
        given = [
            str(arguments[each.place][1]) if each.asks else arguments[each.place][0]
            for each in self.parameters
        ]
        return f"{self.name}({', '.join(given)})"


ACCUMULATE = Function("mck_sum", [REAL])
"""In place of the kernel `accumulate`, which in single precision carries what rounding loses."""


class Translation:
    """Functions of C in the order in which they need one another, and the constants that they use.

    Parameters
    ----------
    single : bool
        In single instead of double precision.
    taken : iterable of str
        Names that others have.
    """

    def __init__(self, *, single: bool = False, taken: Iterable[str] = ()) -> None:
        self.single = single
        self.constants: dict[str, str] = {}
        self.names = set(taken)
        self._functions: dict[tuple[Any, ...], Function] = {}
        self._open: list[Source] = []

    def add(self, kernel: Kernel, bound: tuple[tuple[str, Any], ...] = ()) -> Function:
        """Return the function of a kernel, added with those that it calls if it is new.

        Parameters
        ----------
        kernel : callable
        bound : tuple of (str, object)
            What it is called with: for a parameter, the kernel, or the number of arrays of the tuple.

        Raises
        ------
        KernelError
            If a construct is outside the language.
        """
        source = Source(kernel)
        key = (source.function, *bound)
        if key not in self._functions:
            if source.function in [each.function for each in self._open]:
                raise source.refusal(source.tree, "a call of itself", "write a loop")
            self._open.append(source)
            function = _Translator(self, source, dict(bound)).function
            self._open.pop()
            self._functions[key] = function
        return self._functions[key]

    def free_name(self, name: str, module: str) -> str:
        """Return a name that no function has yet, nor a local name of one that waits for this one."""
        taken = {*self.constants, *RESERVED, *self.names}
        for waiting in self._open[:-1]:
            taken |= waiting.locals
        plain = name.strip("_")
        choices = [plain, f"{module}_{plain}", *(f"{module}_{plain}_{k}" for k in range(2, 100))]
        self.names.add(free := next(each for each in choices if each not in taken))
        return free

    def number(self, value: float, source: Source, node: ast.AST) -> str:
        """Return a real number in C.

        Raises
        ------
        KernelError
            If single precision does not hold it.
        """
        if math.isinf(value):
            return "-MCK_INFINITY" if value < 0 else "MCK_INFINITY"
        if (
            value
            and not LEAST < abs(value) < MOST
            and (self.single or isinstance(node, ast.Constant))
        ):
            raise source.refusal(
                node,
                f"the number {value!r}, which single precision has no room for, or rounds away",
                "name it, and add its single-precision value to the table SINGLE of the module",
            )
        if not self.single:
            return repr(value)
        return f"{float(np.float32(value)) if 'e' not in repr(value) else value!r}f"

    def constant(self, name: str, text: str) -> str:
        """Return the name of a constant, which another one of the same name does not have."""
        while self.constants.setdefault(name, text) != text:
            name += "_"
        return name

    def text(self) -> str:
        """Return the constants and all functions, as C."""
        names = [f"#define {name} {text}" for name, text in self.constants.items()]
        head = "\n".join(names) + "\n\n" if names else ""
        return head + "\n".join(each.text for each in self._functions.values())


class _Translator:
    """Translates one function, with what is bound to its parameters."""

    def __init__(self, whole: Translation, source: Source, bound: dict[str, Any]) -> None:
        self.whole, self.source, self.bound = whole, source, bound
        self.function = Function(whole.free_name(source.tree.name, source.module), source.returns)
        self.types: dict[str, str] = {}
        self.arrays: dict[str, View | list[View]] = {}
        self.asked: dict[tuple[str, str], None] = {}
        self.given: list[Parameter] = []
        self.body = list(source.body)
        self.lines: list[str] = []
        self.before: list[str] = []
        self.spare = 0
        self._parameters()
        self._infer()
        self.declared = _declarations(self.body, self._is_declared)
        self._block(self.body, 1)
        self._finish()

    # -- parameters and types ----------------------------------------------------------------------

    def _parameters(self) -> None:
        for place, (arg, kind) in enumerate(self.source.annotations()):
            known = self.bound.get(arg.arg)
            if isinstance(known, int):
                names = self._unpacked(arg.arg) or [f"{arg.arg}_{k + 1}" for k in range(known)]
                views = [self._array(name, place, k) for k, name in enumerate(names)]
                self.arrays |= {arg.arg: views, **dict(zip(names, views, strict=True))}
            elif kind == "Array":
                self.arrays[arg.arg] = self._array(arg.arg, place, 0)
            elif kind in ("float", "int", "bool"):
                self.types[arg.arg] = REAL if kind == "float" else INT
                self.given.append(Parameter(arg.arg, self.types[arg.arg], place))
            elif known is None:
                raise self.source.refusal(
                    arg, f"the argument {arg.arg}: {kind}", "use float, int, bool, Array or kernels"
                )

    def _unpacked(self, name: str) -> list[str]:
        """Return what the arrays of a tuple are called where the body unpacks it, and drop that line."""
        for statement in self.body:
            if isinstance(statement, ast.Assign) and ast.unparse(statement.value) == name:
                self.body.remove(statement)
                target = statement.targets[0]
                return [ast.unparse(each) for each in getattr(target, "elts", [target])]
        return []

    def _array(self, name: str, place: int, item: int) -> View:
        self.given.append(Parameter(name, VIEW, place, item))
        columns = ast.Name(f"{name}.columns") if name in self.source.matrices else None
        return View(self._safe(name), ast.Name(f"{name}.size"), (name,), columns=columns)

    def _infer(self) -> None:
        """Find the types of the local names; what is assigned may be of a type found later."""
        before: dict[str, str] | None = None
        while before != self.types:
            before = dict(self.types)
            for node in self.source.nodes:
                if isinstance(node, ast.Assign):
                    for target in node.targets:
                        self._typed(target, node.value)
                elif isinstance(node, ast.AugAssign):
                    self._typed(node.target, ast.BinOp(node.target, node.op, node.value))
                elif isinstance(node, ast.For) and isinstance(node.target, ast.Name):
                    self.types[node.target.id] = INT

    def _typed(self, target: ast.expr, value: ast.expr) -> None:
        if isinstance(value, ast.IfExp) and isinstance(value.body, ast.Tuple):
            self._typed(target, value.body)
            value = value.orelse
        if isinstance(target, ast.Tuple):
            if isinstance(value, ast.Tuple):
                pairs = zip(target.elts, value.elts, strict=True)
            elif isinstance(value, ast.Call):
                kinds = self._callee(value).returns
                for each, kind in zip(target.elts, kinds, strict=True):
                    if isinstance(each, ast.Name):
                        self.types[each.id] = kind
                return
            else:
                return
            for each, own in pairs:
                self._typed(each, own)
        elif isinstance(target, ast.Name):
            found = self._type(value)
            if found and self.types.get(target.id) != REAL:
                self.types[target.id] = found

    def _type(self, node: ast.expr) -> str | None:
        """Return the type of an expression; None while a name in it has none yet."""
        if isinstance(node, ast.Constant):
            return REAL if isinstance(node.value, float) else INT
        if isinstance(node, ast.Name):
            if "." in node.id:
                return INT
            if isinstance(self.arrays.get(node.id), View):
                return VIEW
            if node.id in self.types or node.id in self.source.stored:
                return self.types.get(node.id)
            return REAL if isinstance(self.source.constant(node.id), float) else INT
        if isinstance(node, ast.BinOp):
            kinds = {self._type(node.left), self._type(node.right)}
            real = REAL in kinds or isinstance(node.op, ast.Div)
            return REAL if real else None if None in kinds else INT
        if isinstance(node, ast.UnaryOp):
            return INT if isinstance(node.op, ast.Not) else self._type(node.operand)
        if isinstance(node, ast.IfExp):
            kinds = {self._type(node.body), self._type(node.orelse)}
            return REAL if REAL in kinds else None if None in kinds else INT
        if isinstance(node, ast.Subscript):
            if isinstance(node.value, ast.Call):
                return self._callee(node.value).returns[self._number_of(node.slice)]
            if isinstance(node.value, ast.Attribute):
                return INT
            return VIEW if self._is_part(node) else REAL
        if isinstance(node, ast.Call):
            name = ast.unparse(node.func)
            if name.endswith(".reshape"):
                return VIEW
            if name in ("int", "len"):
                return INT
            if name in ("min", "max", "abs"):
                kinds = {self._type(each) for each in node.args}
                return REAL if REAL in kinds else None if None in kinds else INT
            plain = name.rpartition(".")[2]
            if name == "float" or "." in name:
                return INT if plain.startswith("is") else REAL
            return next(iter(self._callee(node).returns), None)
        if isinstance(node, ast.Attribute):
            return INT if node.attr == "size" else REAL
        return INT  # comparisons, and, or

    def _is_part(self, node: ast.Subscript) -> bool:
        """Return whether an index leaves an array: a slice, or one place in two dimensions."""
        if isinstance(node.slice, ast.Tuple):
            return any(isinstance(each, ast.Slice) for each in node.slice.elts)
        return isinstance(node.slice, ast.Slice) or ast.unparse(node.value) in self.source.matrices

    def _is_declared(self, name: str) -> bool:
        """Return whether a name is a local number, which C declares."""
        given = {each.name for each in self.given}
        return name != "_" and name not in given and self.types.get(name) in (REAL, INT)

    # -- statements --------------------------------------------------------------------------------

    def _emit(self, text: str, depth: int, comment: str = "") -> None:
        self.lines += _wrapped("    " * depth + text + (f" /* {comment} */" if comment else ""))

    def _block(self, body: Sequence[ast.stmt], depth: int) -> None:
        for statement in body:
            row = statement.lineno - 1
            above: list[str] = []
            while self.source.comments.get(row, ("", False))[1]:
                above.insert(0, self.source.comments.pop(row)[0])
                row -= 1
            if above:
                self._emit(f"/* {' '.join(above)} */", depth)
            last = statement.lineno if hasattr(statement, "body") else statement.end_lineno
            rows = range(statement.lineno, (last or 0) + 1)
            comment = next(
                (self.source.comments[r][0] for r in rows if r in self.source.comments), ""
            )
            self.fresh = {*self.declared.get(id(statement), ())}
            self._statement(statement, depth, comment)

    def _statement(self, node: ast.stmt, depth: int, comment: str) -> None:
        if isinstance(node, ast.Assign):
            for target in node.targets:
                self._assign(target, node.value, depth, comment)
            return
        self._declare(depth)
        if isinstance(node, ast.AugAssign):
            place = self.value(node.target)
            operator = ARITHMETIC.get(type(node.op))
            if operator is None:
                raise self.source.refusal(node, "this operator", "use + - * / // %")
            value = self.value(node.value).to(place.type)
            self._flush(depth)
            self._emit(f"{place.text} {operator[0]}= {value.text};", depth, comment)
            self._wrote(node.target)
        elif isinstance(node, ast.If):
            self._if(node, depth, comment, "")
        elif isinstance(node, ast.While):
            test = self.value(node.test)
            if self.before or node.orelse:
                raise self.source.refusal(node.test, "this condition", "call the kernel before it")
            self._emit(f"while ({test.text}) {{", depth, comment)
            self._block(node.body, depth + 1)
            self._emit("}", depth)
        elif isinstance(node, ast.For):
            self._for(node, depth, comment)
        elif isinstance(node, ast.Break | ast.Continue):
            self._emit(f"{type(node).__name__.lower()};", depth, comment)
        elif isinstance(node, ast.Return):
            self._return(node.value, depth, comment)
        elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
            call = self._call(node.value, [])
            self._flush(depth)
            self._emit(f"{'(void)' * bool(call.type)}{call.text};", depth, comment)
        else:
            what = type(node).__name__.lower()
            raise self.source.refusal(
                node, f"a statement like this ({what})", "see docs/kernels.md"
            )

    def _declare(self, depth: int, *names: str) -> None:
        for name in sorted(names or self.fresh):
            self.fresh.discard(name)
            self._emit(f"{self.types[name]} {self._safe(name)};", depth)

    def _flush(self, depth: int) -> None:
        for line in self.before:
            self._emit(line, depth)
        self.before = []

    def _if(self, node: ast.If, depth: int, comment: str, opening: str) -> None:
        test = self.value(node.test)
        if self.before and opening:
            raise self.source.refusal(node.test, "this condition", "call the kernel before it")
        self._flush(depth)
        self._emit(f"{opening}if ({test.text}) {{", depth, comment)
        self._block(node.body, depth + 1)
        first = node.orelse[0] if node.orelse else None
        if len(node.orelse) == 1 and isinstance(first, ast.If) and id(first) not in self.declared:
            self._if(first, depth, "", "} else ")
            return
        if first:
            rows = range((node.body[-1].end_lineno or 0) + 1, first.lineno)
            beside = [r for r in rows if not self.source.comments.get(r, ("", True))[1]]
            words = self.source.comments.pop(beside[0])[0] if beside else ""
            self._emit("} else {", depth, words)
            self._block(node.orelse, depth + 1)
        self._emit("}", depth)

    def _for(self, node: ast.For, depth: int, comment: str) -> None:
        loop, target = node.iter, node.target
        if (
            not (isinstance(loop, ast.Call) and ast.unparse(loop.func) == "range")
            or not isinstance(target, ast.Name)
            or node.orelse
        ):
            raise self.source.refusal(node, "this loop", "write for i in range(...)")
        if not self.source.only_counts(target.id):
            what = f"the use of {target.id!r} outside its loop"
            raise self.source.refusal(node, what, "copy it to another name")
        ends = [self.value(each) for each in loop.args]
        self._flush(depth)
        low, high = (Value("0", ATOM, INT), *ends) if len(ends) == 1 else ends[:2]
        step = self._number_of(loop.args[2]) if len(ends) == 3 else 1
        inside = [n for each in node.body for n in ast.walk(each) if isinstance(n, ast.Name)]
        stored = {name.id for name in inside if isinstance(name.ctx, ast.Store)}
        if stored & {*re.findall(r"\w+", high.text)} or "(" in high.text:
            end = self._spare("end")
            self._emit(f"const int {end} = {high.text};", depth)
            high = Value(end, ATOM, INT)
        name = self._safe(target.id) if target.id != "_" else self._spare("k")
        test = f"{name} {'<' if step > 0 else '>'} {high.within(RELATION + 1)}"
        moved = {1: f"{name}++", -1: f"{name}--"}.get(step) or f"{name} += {ends[2].text}"
        self._emit(f"for (int {name} = {low.text}; {test}; {moved}) {{", depth, comment)
        self._block(node.body, depth + 1)
        self._emit("}", depth)

    def _return(self, value: ast.expr | None, depth: int, comment: str) -> None:
        if value is None:
            self._emit("return;", depth, comment)
        elif isinstance(value, ast.IfExp) and isinstance(value.body, ast.Tuple):
            self._emit(f"if ({self.value(value.test).text}) {{", depth, comment)
            self._return(value.body, depth + 1, "")
            self._emit("}", depth)
            self._return(value.orelse, depth, "")
        elif isinstance(value, ast.Call) and len(self.source.returns) > 1:
            call = self._call(value, self._results())
            self._flush(depth)
            self._emit(f"return {call.text};", depth, comment)
        else:
            parts = value.elts if isinstance(value, ast.Tuple) else [value]
            kinds = self.source.returns
            texts = [self.value(p).to(k).text for p, k in zip(parts, kinds, strict=True)]
            self._flush(depth)
            for name, text in zip(self._results(), texts[1:], strict=True):
                self._emit(f"*{name} = {text};", depth)
            self._emit(f"return {texts[0]};", depth, comment)

    def _results(self) -> list[str]:
        """Return the names of the pointers for results behind the first."""
        return [f"result_{k}" for k in range(2, len(self.source.returns) + 1)]

    def _assign(self, target: ast.expr, value: ast.expr, depth: int, comment: str) -> None:
        if isinstance(value, ast.IfExp) and isinstance(value.body, ast.Tuple):
            self._declare(depth)
            self._emit(f"if ({self.value(value.test).text}) {{", depth, comment)
            self._assign(target, value.body, depth + 1, "")
            self._emit("} else {", depth)
            self._assign(target, value.orelse, depth + 1, "")
            self._emit("}", depth)
        elif isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
            self._assign_several(target.elts, value.elts, depth, comment)
        elif isinstance(target, ast.Tuple) and isinstance(value, ast.Call):
            kinds = self._callee(value).returns
            pairs = zip(target.elts[1:], kinds[1:], strict=True)
            others = [self._pointer(each, kind, depth) for each, kind in pairs]
            self._set(target.elts[0], self._call(value, others), depth, comment)
        elif isinstance(target, ast.Tuple):
            raise self.source.refusal(target, "this assignment", "assign one name at a time")
        elif isinstance(target, ast.Name) and self._type(value) == VIEW:
            self._name_view(target, self.view(value), depth, comment)
        elif isinstance(target, ast.Subscript) and self._is_part(target):
            self._fill(target, value, depth, comment)
        else:
            self._set(target, self.value(value), depth, comment)

    def _assign_several(
        self, targets: Sequence[ast.expr], values: Sequence[ast.expr], depth: int, comment: str
    ) -> None:
        names = [ast.unparse(each) for each in targets]
        late = any(
            ast.unparse(node) in names[:k]
            for k, value in enumerate(values)
            for node in ast.walk(value)
        )
        if not late:
            for k, (target, value) in enumerate(zip(targets, values, strict=True)):
                self._assign(target, value, depth, comment if k == len(names) - 1 else "")
            return
        held = [self._spare("held") for _ in values]  # as in a swap
        for name, one in zip(held, map(self.value, values), strict=True):
            self._flush(depth)
            self._emit(f"const {one.type} {name} = {one.text};", depth)
        self._declare(depth)
        for target, name, value in zip(targets, held, values, strict=True):
            self._set(target, Value(name, ATOM, self._type(value) or INT), depth, "")

    def _set(self, target: ast.expr, value: Value, depth: int, comment: str) -> None:
        self._flush(depth)
        opening = ""
        if isinstance(target, ast.Name):
            if target.id == "_":
                self._emit(f"(void){value.text};", depth, comment)
                return
            if target.id in self.fresh:
                self.fresh.discard(target.id)
                changed = self.source.stored[target.id] > 1
                opening = f"{'' if changed else 'const '}{self.types[target.id]} "
        place = self.value(target)
        self._emit(f"{opening}{place.text} = {value.to(place.type).text};", depth, comment)
        self._wrote(target)

    def _pointer(self, target: ast.expr, kind: str, depth: int) -> str:
        """Return a pointer to where a result is written."""
        if isinstance(target, ast.Name) and target.id == "_":
            return f"&{self._unused(kind)}"
        if isinstance(target, ast.Name) and target.id in self.fresh:
            self._declare(depth, target.id)
        self._wrote(target)
        return f"&{self.value(target).text}"

    def _unused(self, kind: str) -> str:
        name = self._spare("unused")
        self.before.append(f"{kind} {name};")
        return name

    def _spare(self, name: str) -> str:
        self.spare += 1
        return f"{name}_{self.spare}"

    def _wrote(self, target: ast.expr) -> None:
        if isinstance(target, ast.Subscript):
            self.function.written |= {*self.view(target.value).roots}

    def _name_view(self, target: ast.Name, view: View, depth: int, comment: str) -> None:
        if self.source.stored[target.id] > 1:
            raise self.source.refusal(target, "an array under two names", "use two names")
        name = self._safe(target.id)
        pointer = self._place_of(view)
        # const, as known at the end, when all that writes through it has been seen
        self._emit(f"\0{target.id}\0mck_real *{name} = {pointer};", depth, comment)
        size = view.size
        if any(isinstance(n, ast.Name) and self.source.stored[n.id] > 1 for n in ast.walk(size)):
            self._emit(f"const int {name}_size = {self.value(size).text};", depth)  # as it is now
            size = ast.Name(f".{name}_size")
        self.arrays[target.id] = View(name, size, (target.id, *view.roots), columns=view.columns)

    def _fill(self, target: ast.Subscript, value: ast.expr, depth: int, comment: str) -> None:
        view, k = self.view(target), self._spare("k")
        if self._type(value) == VIEW:
            given = self._element(self.view(value), ast.Name(f".{k}"))
        else:
            given = self.value(value).to(REAL).text
        self._flush(depth)
        size = self.value(view.size).within(RELATION + 1)
        self._emit(f"for (int {k} = 0; {k} < {size}; {k}++) {{", depth, comment)
        self._emit(f"{self._element(view, ast.Name(f'.{k}'))} = {given};", depth + 1)
        self._emit("}", depth)
        self.function.written |= {*view.roots}

    # -- arrays ------------------------------------------------------------------------------------

    def view(self, node: ast.expr) -> View:
        """Return the array that an expression is."""
        if isinstance(node, ast.Name) and isinstance(found := self.arrays.get(node.id), View):
            return found
        if (
            isinstance(node, ast.Call)
            and isinstance(node.func, ast.Attribute)
            and node.func.attr == "reshape"
            and isinstance(node.args[0], ast.Tuple)
        ):
            base, (rows, columns) = self.view(node.func.value), node.args[0].elts
            return View(base.base, times_of(rows, columns), base.roots, base.begin, columns)
        if not isinstance(node, ast.Subscript):
            raise self.source.refusal(node, f"{ast.unparse(node)!r} for an array", "pass one in")
        base = self.view(node.value)
        parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        begin, size = base.begin, base.size
        if base.columns is not None:
            begin, size = plus(begin, times_of(parts[0], base.columns)), base.columns
            parts = parts[1:]
        for part in parts:
            if not isinstance(part, ast.Slice) or part.step:
                raise self.source.refusal(node, f"{ast.unparse(node)!r} for an array", "slice it")
            low = self._from_end(part.lower, size) if part.lower else ast.Constant(0)
            high = self._from_end(part.upper, size) if part.upper else size
            begin, size = plus(begin, low), plus(high, low, -1)
        return View(base.base, size, base.roots, begin)

    def _from_end(self, place: ast.expr, size: ast.expr) -> ast.expr:
        """Return a place in an array; one below 0 is counted from the end."""
        if isinstance(place, ast.UnaryOp) and isinstance(place.op, ast.USub):
            return plus(size, place.operand, -1)
        return place

    def _place_of(self, view: View) -> str:
        """Return the pointer to the first number of a view."""
        begin = self.value(view.begin)
        return view.base if begin.text == "0" else f"{view.base} + {begin.within(PLUS)}"

    def _element(self, view: View, at: ast.expr) -> str:
        return f"{view.base}[{self.value(plus(view.begin, self._from_end(at, view.size))).text}]"

    def _item(self, node: ast.Subscript) -> Value:
        if isinstance(node.value, ast.Attribute) and node.value.attr == "shape":
            view = self.view(node.value.value)
            if self._number_of(node.slice) == 1 and view.columns is not None:
                return self.value(view.columns)
            if view.columns is None:
                return self.value(view.size)
            raise self.source.refusal(node, "the number of rows of an array", "pass it in")
        if isinstance(node.value, ast.Call):
            callee, place = self._callee(node.value), self._number_of(node.slice)
            others = [self._unused(kind) for kind in callee.returns[1:]]
            call = self._call(node.value, [f"&{name}" for name in others])
            if place == 0:
                return call
            self.before.append(f"(void){call.text};")
            return Value(others[place - 1], ATOM, callee.returns[place])
        base = self.view(node.value)
        at: ast.expr = node.slice
        if isinstance(at, ast.Tuple):
            if base.columns is None or len(at.elts) != 2:
                raise self.source.refusal(node, f"{ast.unparse(node)!r}", "use one place")
            at = plus(times_of(at.elts[0], base.columns), at.elts[1])
        return Value(self._element(base, at), ATOM, REAL)

    # -- numbers -----------------------------------------------------------------------------------

    def value(self, node: ast.expr) -> Value:
        """Return a number as C."""
        if isinstance(node, ast.Constant) and isinstance(node.value, bool | int | float):
            if isinstance(node.value, float):
                return Value(self.whole.number(node.value, self.source, node), ATOM, REAL)
            return Value(str(int(node.value)), ATOM, INT)
        if isinstance(node, ast.Name):
            return self._name(node)
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.Not):
            inner = self.value(node.operand)
            if isinstance(node.op, ast.Not):
                return Value(f"!{inner.within(UNARY)}", UNARY, INT)
            text = inner.within(UNARY)
            return Value(f"-({text})" if text.startswith("-") else f"-{text}", UNARY, inner.type)
        if isinstance(node, ast.BinOp):
            return self._binary(node)
        if isinstance(node, ast.BoolOp):
            word, binds = ("&&", AND) if isinstance(node.op, ast.And) else ("||", OR)
            words = (self.value(each).within(EQUAL) for each in node.values)
            return Value(f" {word} ".join(words), binds, INT)
        if isinstance(node, ast.Compare):
            return self._compare(node)
        if isinstance(node, ast.IfExp):
            test, one, other = map(self.value, (node.test, node.body, node.orelse))
            kind = REAL if REAL in (one.type, other.type) else INT
            one, other = one.to(kind), other.to(kind)
            text = f"{test.within(AND)} ? {one.within(CHOICE + 1)} : {other.within(CHOICE + 1)}"
            return Value(text, CHOICE, kind)
        if isinstance(node, ast.Attribute):
            if node.attr == "size":
                return self.value(self.view(node.value).size)
            if ast.unparse(node) in ("np.inf", "math.inf"):
                return Value("MCK_INFINITY", ATOM, REAL)
            if ast.unparse(node) in ("np.nan", "math.nan"):
                return Value("((mck_real)NAN)", ATOM, REAL)
            if ast.unparse(node) in ("np.pi", "math.pi"):
                return Value(self.whole.number(math.pi, self.source, node), ATOM, REAL)
        if isinstance(node, ast.Subscript):
            return self._item(node)
        if isinstance(node, ast.Call):
            return self._function(node)
        raise self.source.refusal(node, f"{ast.unparse(node)!r}", "see docs/kernels.md")

    def _name(self, node: ast.Name) -> Value:
        array, dot, asks = node.id.partition(".")
        if dot:  # the size of an array, or a counter of this translator
            if array:
                self.asked[array, asks] = None
            return Value(self._safe(f"{array}_{asks}") if array else asks, ATOM, INT)
        if node.id in self.types:
            return Value(self._safe(node.id), ATOM, self.types[node.id])
        known = self.source.constant(node.id)
        if known is None:
            raise self.source.refusal(
                node, f"the name {node.id!r}", "use numbers, arguments and constants of the module"
            )
        if isinstance(known, float):
            single = self.source.single(node.id) if self.whole.single else None
            number = self.whole.number
            text = f"{single!r}f" if single else number(known, self.source, node)
            return Value(self.whole.constant(node.id.strip("_").upper(), text), ATOM, REAL)
        return Value(self.whole.constant(node.id.strip("_").upper(), str(int(known))), ATOM, INT)

    def _binary(self, node: ast.BinOp) -> Value:
        one, other = self.value(node.left), self.value(node.right)
        if isinstance(node.op, ast.Pow) and ast.unparse(node.right) == "2" and "(" not in one.text:
            return Value(f"{one.within(UNARY)} * {one.within(UNARY)}", TIMES, one.type)
        if type(node.op) not in ARITHMETIC:
            raise self.source.refusal(node, "this operator", "use + - * / // % and ** 2 of a name")
        real = REAL in (one.type, other.type) or isinstance(node.op, ast.Div)
        if real and isinstance(node.op, ast.FloorDiv | ast.Mod):
            raise self.source.refusal(
                node, "// or % of real numbers", "use math.floor or math.fmod"
            )
        word, binds = ARITHMETIC[type(node.op)]
        kind = REAL if real else INT
        one, other = one.to(kind), other.to(kind)
        return Value(f"{one.within(binds)} {word} {other.within(binds + 1)}", binds, kind)

    def _compare(self, node: ast.Compare) -> Value:
        if isinstance(node.ops[0], ast.In | ast.NotIn):
            choices = getattr(node.comparators[0], "elts", [])
            isin = isinstance(node.ops[0], ast.In)
            same, either = (ast.Eq(), ast.Or()) if isin else (ast.NotEq(), ast.And())
            each: list[ast.expr] = [ast.Compare(node.left, [same], [one]) for one in choices]
            return self.value(ast.BoolOp(either, each))
        links: list[Value] = []
        left = node.left
        for op, right in zip(node.ops, node.comparators, strict=True):
            one, other = self.value(left), self.value(right)
            kind = REAL if REAL in (one.type, other.type) else INT
            one, other = one.to(kind), other.to(kind)
            word, binds = COMPARISON[type(op)]
            text = f"{one.within(RELATION + 1)} {word} {other.within(RELATION + 1)}"
            links.append(Value(text, binds, INT))
            left = right
        if len(links) == 1:
            return links[0]
        return Value(" && ".join(link.text for link in links), AND, INT)

    def _function(self, node: ast.Call) -> Value:
        name = ast.unparse(node.func)
        if name in ("int", "float", "bool") and len(node.args) == 1:
            inner = self.value(node.args[0])
            if name == "float":
                return inner.to(REAL)
            return inner if inner.type == INT else Value(f"(int){inner.within(UNARY)}", UNARY, INT)
        if name == "len":
            return self.value(self.view(node.args[0]).size)
        if name in ("min", "max", "abs"):
            return self._bounded(name, [self.value(each) for each in node.args])
        module, _, plain = name.rpartition(".")
        plain = {"arctan": "atan", "arctanh": "atanh", "fabs": "abs"}.get(plain, plain)
        if module in ("math", "np"):
            if plain not in FUNCTIONS | {"abs"}:
                raise self.source.refusal(
                    node, f"{name}()", f"use one of {', '.join(sorted(FUNCTIONS))}"
                )
            texts = [self.value(each).to(REAL).text for each in node.args]
            if plain.startswith("is"):
                return Value(f"({plain}({texts[0]}) != 0)", ATOM, INT)
            suffix = "f" if self.whole.single else ""
            return Value(
                f"{'fabs' if plain == 'abs' else plain}{suffix}({', '.join(texts)})", ATOM, REAL
            )
        return self._call(node, [])

    def _bounded(self, name: str, values: list[Value]) -> Value:
        """Return the smallest, the largest, or the size of numbers."""
        if all(each.type == INT for each in values):
            if name == "abs":
                return Value(
                    f"({values[0].text} < 0 ? -{values[0].within(UNARY)} : {values[0].text})",
                    ATOM,
                    INT,
                )
            word = "<" if name == "min" else ">"
            one, other = (each.within(RELATION + 1) for each in values)
            return Value(f"({other} {word} {one} ? {other} : {one})", ATOM, INT)
        texts = [each.to(REAL).text for each in values]
        if name == "abs":
            return Value(f"fabs{'f' if self.whole.single else ''}({texts[0]})", ATOM, REAL)
        while len(texts) > 1:
            texts[:2] = [f"mck_{name}({texts[0]}, {texts[1]})"]
        return Value(texts[0], ATOM, REAL)

    def _number_of(self, node: ast.expr) -> int:
        """Return a whole number that is written out, or a constant."""
        if isinstance(node, ast.Name) and isinstance(known := self.source.constant(node.id), int):
            return known
        try:
            return int(ast.literal_eval(node))
        except ValueError:
            raise self.source.refusal(
                node, f"{ast.unparse(node)!r} here", "write a number"
            ) from None

    # -- calls -------------------------------------------------------------------------------------

    def _callee(self, node: ast.Call) -> Function:
        """Return the function that is called, with the functions and tuples that it is given."""
        name = ast.unparse(node.func)
        kernel: Any = self.bound.get(name, self.source.globals.get(name))
        if kernel is accumulate:
            return ACCUMULATE
        if not hasattr(kernel, "py_func"):
            raise self.source.refusal(
                node, f"a call of {name}()", "call kernels, min, max, abs, math.…"
            )
        names = inspect.signature(kernel.py_func).parameters
        bound: list[tuple[str, Any]] = []
        if len(names) != len(node.args) or node.keywords:
            raise self.source.refusal(node, "arguments by name", "give every argument by its place")
        for parameter, given in zip(names, node.args, strict=True):
            if isinstance(given, ast.Tuple):
                bound.append((parameter, len(given.elts)))
            elif isinstance(given, ast.Name) and given.id not in self.types:
                known = self.bound.get(given.id, self.source.globals.get(given.id))
                views = self.arrays.get(given.id)
                if hasattr(known, "py_func"):
                    bound.append((parameter, known))
                elif isinstance(views, list):
                    bound.append((parameter, len(views)))
        function = self.whole.add(kernel, tuple(bound))
        if function.name in {*self.source.stored, *self.types}:
            what = f"{function.name!r} for a number and for a kernel"
            raise self.source.refusal(node, what, "give one of them another name")
        return function

    def _call(self, node: ast.Call, pointers: Sequence[str]) -> Value:
        callee = self._callee(node)
        if callee is ACCUMULATE:
            return self._accumulate(*node.args)
        if len(pointers) < len(callee.returns) - 1:
            pointers = [f"&{self._unused(kind)}" for kind in callee.returns[1:]]
        texts: list[str] = []
        for each in callee.parameters:
            given: ast.expr = node.args[each.place]
            if each.type in (REAL, INT) and not each.asks:
                texts.append(self.value(given).to(each.type).text)
                continue
            view = self._argument(given, each.item)
            if each.asks == "size":
                texts.append(self.value(view.size).text)
            elif each.asks == "columns":
                if view.columns is None:
                    raise self.source.refusal(given, "an array without rows here", "reshape it")
                texts.append(self.value(view.columns).text)
            else:
                texts.append(self._place_of(view))
                if each.name in callee.written:
                    self.function.written |= {*view.roots}
        kind = callee.returns[0] if callee.returns else ""
        return Value(f"{callee.name}({', '.join([*texts, *pointers])})", ATOM, kind)

    def _accumulate(self, total: ast.expr, change: ast.expr, lost: ast.expr, at: ast.expr) -> Value:
        if not self.whole.single:
            return self._binary(ast.BinOp(total, ast.Add(), change))
        view = self.view(lost)
        self.function.written |= {*view.roots}
        texts = [self.value(each).to(REAL).text for each in (total, change)]
        return Value(f"mck_sum({', '.join(texts)}, &{self._element(view, at)})", ATOM, REAL)

    def _argument(self, given: ast.expr, item: int) -> View:
        if isinstance(given, ast.Tuple):
            return self.view(given.elts[item])
        if isinstance(given, ast.Name) and isinstance(views := self.arrays.get(given.id), list):
            return views[item]
        return self.view(given)

    def _safe(self, name: str) -> str:
        """Return a local name that C has not taken."""
        taken = RESERVED | self.whole.names | {self.function.name}
        return f"{name}_" if name in taken else name

    # -- the whole ---------------------------------------------------------------------------------

    def _finish(self) -> None:
        function, written = self.function, self.function.written
        for given in self.given:
            function.parameters.append(given)
            for name, asks in self.asked:
                if name == given.name:
                    own = f"{name}_{asks}"
                    function.parameters.append(Parameter(own, INT, given.place, given.item, asks))
        body = _without_idle("\n".join(self.lines))
        body = re.sub(r"\0(\w+)\0", lambda m: "" if m[1] in written else "const ", body)
        names = {each.name: self._safe(each.name) for each in function.parameters}
        function.parameters = [
            each for each in function.parameters if re.search(rf"\b{names[each.name]}\b", body)
        ]
        words = [
            f"{'' if each.name in written else 'const '}mck_real *{names[each.name]}"
            if each.type == VIEW
            else f"{each.type} {names[each.name]}"
            for each in function.parameters
        ]
        words += [f"{k} *{n}" for k, n in zip(function.returns[1:], self._results(), strict=True)]
        kind = function.returns[0] if function.returns else "void"
        head = _wrapped(f"static {kind} {function.name}({', '.join(words) or 'void'})")
        doc = re.sub(r"`+", "`", self.source.doc).replace("*/", "* /")
        about = [f"/* {doc}".replace("\n", "\n * ").replace(" * \n", " *\n") + " */"] if doc else []
        function.text = "\n".join([*about, *head, "{", body, "}", ""])


def _wrapped(line: str) -> list[str]:
    """Return a line of C as lines that are short enough, broken behind commas or operators."""
    lines: list[str] = []
    indent = re.match(r" *", line)
    start = len(indent[0]) if indent else 0
    while len(re.sub(r"\0\w+\0", "const ", line)) > WIDTH:
        cuts = [
            line.rfind(mark, start + 12, WIDTH - 2)
            for mark in (", ", " && ", " || ", " + ", " - ", " * ")
        ]
        cut = cuts[0] + 1 if cuts[0] > 0 else max(cuts) + 3
        if cut < start + 12:
            break
        lines.append(line[:cut].rstrip())
        line = " " * (start + 8) + line[cut:].lstrip()
    return [*lines, line]


def _without_idle(text: str) -> str:
    """Return a body without names that only sizes were read from, which C does not need."""
    pattern = re.compile(
        r"^ *(?:const (?:int|mck_real)|\0\w+\0mck_real) \*?(\w+) = (?:(?!\w\()[^;])*;\n?", re.M
    )
    while True:
        for found in pattern.finditer(text):
            plain = text.replace(f"\0{found[1]}\0", "")
            if len(re.findall(rf"\b{found[1]}\b", plain)) == 1:
                text = text.replace(found[0], "", 1)
                break
        else:
            return text


def _declarations(body: list[ast.stmt], declares: Callable[[str], bool]) -> dict[int, list[str]]:
    """Return for statements the local names that are declared with them, or before them.

    A name is declared in the innermost block that has all its uses, and before a loop that it may carry
    a value through.
    """
    found: dict[str, list[tuple[tuple[tuple[int, bool, int], ...], bool]]] = {}
    counters: list[str] = []

    def note(node: ast.AST, path: tuple[tuple[int, bool, int], ...], assigns: bool) -> None:
        names = [each for each in ast.walk(node) if isinstance(each, ast.Name)]
        for name in sorted(names, key=lambda each: isinstance(each.ctx, ast.Store)):
            if name.id not in counters and declares(name.id):
                direct = assigns and isinstance(name.ctx, ast.Store)
                found.setdefault(name.id, []).append((path, direct))

    def walk(block: list[ast.stmt], path: tuple[tuple[int, bool, int], ...], looped: bool) -> None:
        for statement in block:
            here = (*path, (id(block), looped, id(statement)))
            inner = [getattr(statement, name, []) for name in ("body", "orelse")]
            if not any(inner):
                note(statement, here, isinstance(statement, ast.Assign))
                continue
            for name in ("test", "iter"):
                if hasattr(statement, name):
                    note(getattr(statement, name), here, assigns=False)
            target = getattr(statement, "target", None)
            counters.append(target.id if isinstance(target, ast.Name) else "")
            for each in inner:
                walk(each, here, isinstance(statement, ast.For | ast.While))
            counters.pop()

    walk(body, (), looped=False)
    declared: dict[int, list[str]] = {}
    for name, uses in found.items():
        first, direct = uses[0]
        depth = len(first)
        for path, _ in uses:
            shared = 0
            while shared < min(depth, len(path)) and first[shared][:2] == path[shared][:2]:
                shared += 1
            depth = shared
        while depth > 1 and first[depth - 1][1] and not (direct and len(first) == depth):
            depth -= 1
        declared.setdefault(first[depth - 1][2], []).append(name)
    return declared
