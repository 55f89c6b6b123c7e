"""Kernels to C99: one function of C for every function of Python, with its names and comments.

``docs/kernels.md`` describes what can be translated. Arrays become pointers, with their sizes as
arguments of their own where a function needs them; results behind the first are written through
pointers; functions and tuples of arrays that a kernel takes are bound, so that a kernel that takes
functions is written once for every caller. Nothing is allocated.

A function is written repeatedly, each time with the types of local names and the arrays written to that
the pass before has found, until its text stays the same.
"""

from __future__ import annotations

import ast
import math
import re
import textwrap
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from mckibben.blocks.kernels import accumulate
from mckibben.export.c.language import FUNCTIONS, INT, REAL, TYPES, Kernel, Source, source_of
from mckibben.export.naming import WORDS
from mckibben.export.templating import literal

WIDTH = 100
"""Columns of a line of C."""

LEAST, MOST = 1e-6, 3.4e38
"""Range of the sizes of constants that are the same in both precisions."""

ATOM, UNARY, TIMES, PLUS, RELATION, EQUAL, AND, OR, CHOICE = 15, 13, 12, 11, 9, 8, 5, 4, 3
"""How tightly operators of C bind."""

_BINARY = (ast.Add, ast.Sub, ast.Mult, ast.Div, ast.FloorDiv, ast.Mod)
ARITHMETIC: dict[type[ast.AST], str] = dict(zip(_BINARY, "+-*//%", strict=True))
_COMPARED = (ast.Lt, ast.LtE, ast.Gt, ast.GtE, ast.Eq, ast.NotEq)
COMPARISON = dict(zip(_COMPARED, ("<", "<=", ">", ">=", "==", "!="), strict=True))

RESERVED = FUNCTIONS.union(
    WORDS.split(), ["y0", "y1", "yn", "j0", "j1", "jn", "gamma", "div", "copy", "run", "parts"]
)
"""Names that C, <math.h> or the export's own functions have already."""


class Value(NamedTuple):
    """An expression of C: its text, how tightly it binds, and its type."""

    text: str
    binds: int = ATOM
    type: str = INT

    def within(self, least: int) -> str:
        """Return the text, in brackets where it binds less tightly than asked for."""
        return self.text if self.binds >= least else f"({self.text})"

    def to(self, kind: str) -> Value:
        """Return it as a real number, if it is a whole one and that is asked for."""
        if kind == INT or self.type == kind:
            return self
        return Value(f"(mck_real){self.within(UNARY)}", UNARY, REAL)


class Whole(Counter[str]):
    """A sum of whole numbers, as places in arrays and sizes are: how often each term of C counts.

    The term "" is the number 1.
    """

    def plus(self, other: Whole, times: int = 1) -> Whole:
        """Return the sum with another one, taken so many times."""
        found = Whole(self)
        for term, count in other.items():
            found[term] += times * count
        return found

    def value(self) -> Value:
        """Return it as C."""
        text = ""
        for term, count in sorted(self.items(), key=lambda item: (not item[0], item[1] < 0)):
            factor = term if term.isidentifier() or abs(count) == 1 else f"({term})"
            words = [str(abs(count))] * (abs(count) != 1 or not term) + [factor] * bool(term)
            if count:
                text += (" - " if count < 0 else " + " if text else "") + " * ".join(words)
        if text.startswith(" - "):
            text = f"-{text[3:]}"
        added = " + " in text or " - " in text
        return Value(text or "0", PLUS if added else TIMES if " " in text else ATOM)


@dataclass
class View:
    """An array, or a part of one: a pointer, the place where it begins, its size, and its row length.

    ``roots`` are the names of the pointers that are written to where it is.
    """

    base: str
    size: Whole
    roots: tuple[str, ...]
    begin: Whole = field(default_factory=Whole)
    columns: Value | None = None

    def place(self) -> str:
        """Return the pointer to its first number."""
        return (
            f"{self.base} + {self.begin.value().within(PLUS)}"
            if any(self.begin.values())
            else self.base
        )

    def element(self, at: Whole) -> Value:
        """Return one of its numbers."""
        return Value(f"{self.base}[{self.begin.plus(at).value().text}]", ATOM, REAL)


class Parameter(NamedTuple):
    """A parameter of a function of C.

    ``place`` is that of the argument of Python, ``item`` which array of a tuple it is, and ``asks`` what
    of an array: "itself", its "size" or its "columns".
    """

    name: str
    type: str
    place: int
    item: int = 0
    asks: str = ""


@dataclass
class Function:
    """A function of C: its name, what it takes and returns, which arrays it writes to, and its text."""

    name: str
    returns: list[str]
    parameters: list[Parameter] = field(default_factory=list)
    written: set[str] = field(default_factory=set)
    text: str = ""

    def call(self, *arguments: tuple[str, int]) -> str:
        """Return a call with arguments in Python's order, each its text and, of arrays, its size."""
        given = [str(arguments[each.place][each.asks == "size"]) for each in self.parameters]
        return f"{self.name}({', '.join(given)})"


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
        self._locals: set[str] = set()

    def add(self, kernel: Kernel, bound: tuple[tuple[str, Any], ...] = ()) -> Function:
        """Return the function of a kernel, added with those that it calls if it is new.

        ``bound`` is, by parameter, the kernel that it is called with, or how many arrays of a tuple. A
        construct outside the language raises `KernelError`.
        """
        source = source_of(kernel)
        key = (source.function, *bound)
        if key not in self._functions:
            if source in self._open:
                raise source.refusal(source.tree, "a call of itself", "write a loop")
            self._open.append(source)
            function = _Translator(self, source, dict(bound)).function
            self._open.pop()
            self._functions[key] = function
        return self._functions[key]

    def free_name(self, source: Source) -> str:
        """Return a name that no function has yet, nor a local name of one begun before."""
        taken = {*self.constants, *RESERVED, *self.names, *self._locals}
        self._locals |= source.locals
        plain, module = source.tree.name.strip("_"), source.function.__module__.rpartition(".")[2]
        choices = [plain, f"{module}_{plain}", *(f"{module}_{plain}_{k}" for k in range(2, 100))]
        self.names.add(free := next(each for each in choices if each not in taken))
        return free

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
        self.refusal = source.refusal
        self.function = Function(whole.free_name(source), source.returns)
        self.results = [f"result_{k}" for k in range(2, len(source.returns) + 1)]
        self.types: dict[str, str] = {}
        self.arrays: dict[str, View | list[View]] = {}
        self.given: list[Parameter] = []
        self.body = list(source.body)
        self._parameters()
        self.lines: list[str] = []
        before: list[str] | None = None
        while before != self.lines:
            before, self.lines = self.lines, []
            self.pending: list[str] = []
            self.comments, self.comment = dict(source.comments), ""
            self.spares = self.depth = 0
            taken = {*self.arrays, *(each.name for each in self.given), *source.counters, "_"}
            self.declared: dict[int, list[str]] = {}
            for name in sorted(source.stored.keys() - taken):
                self.declared.setdefault(id(_declaring(self.body, name)), []).append(name)
            self._block(self.body)
        self._finish()

    # -- parameters --------------------------------------------------------------------------------

    def _parameters(self) -> None:
        for place, (arg, kind) in enumerate(self.source.annotations()):
            known = self.bound.get(arg.arg)
            if isinstance(known, int):
                names = self._unpacked(arg.arg) or [f"{arg.arg}_{k + 1}" for k in range(known)]
                views = [self._array(name, place, k) for k, name in enumerate(names)]
                self.arrays |= {arg.arg: views, **dict(zip(names, views, strict=True))}
            elif kind == "Array":
                self.arrays[arg.arg] = self._array(arg.arg, place, 0)
            elif kind in TYPES:
                self.types[arg.arg] = TYPES[kind]
                self.given.append(Parameter(arg.arg, self.types[arg.arg], place))
            elif known is None:
                what = f"the argument {arg.arg}: {kind}"
                raise self.refusal(arg, what, "use float, int, bool, Array or kernels")

    def _unpacked(self, name: str) -> list[str]:
        """Return what the arrays of a tuple are called where the body unpacks it, and drop that line."""
        for statement in self.body:
            if isinstance(statement, ast.Assign) and ast.unparse(statement.value) == name:
                self.body.remove(statement)
                target = statement.targets[0]
                return [ast.unparse(each) for each in getattr(target, "elts", [target])]
        return []

    def _array(self, name: str, place: int, item: int) -> View:
        self.given.append(Parameter(name, REAL, place, item, "itself"))
        for asks in ("size", "columns"):
            self.given.append(Parameter(f"{name}_{asks}", INT, place, item, asks))
        pointer, size, columns = (self._safe(each.name) for each in self.given[-3:])
        rows = Value(columns) if name in self.source.matrices else None
        return View(pointer, Whole([size]), (name,), columns=rows)

    def _safe(self, name: str) -> str:
        """Return a local name that C has not taken."""
        taken = RESERVED | self.whole.names | {self.function.name}
        return f"{name}_" if name in taken else name

    def _spare(self, name: str) -> str:
        self.spares += 1
        return f"{name}_{self.spares}"

    # -- statements --------------------------------------------------------------------------------

    def _emit(self, text: str) -> None:
        """Append a line of C with the statement's comment, behind those that have to be before it."""
        words, self.comment = f" /* {self.comment} */" if self.comment else "", ""
        pending, self.pending = self.pending, []
        for line in (*pending, text + words):
            self.lines += _wrapped("    " * self.depth + line)

    def _block(self, body: Sequence[ast.stmt]) -> None:
        self.depth += 1
        for statement in body:
            row = statement.lineno - 1
            above: list[str] = []
            while self.comments.get(row, ("", False))[1]:
                above.insert(0, self.comments.pop(row)[0])
                row -= 1
            if above:
                self._emit(f"/* {' '.join(above)} */")
            last = statement.lineno if hasattr(statement, "body") else statement.end_lineno
            rows = range(statement.lineno, (last or 0) + 1)
            self.comment = next((self.comments[r][0] for r in rows if r in self.comments), "")
            self.fresh = {*self.declared.get(id(statement), ())}
            self._statement(statement)
        self.depth -= 1

    def _statement(self, node: ast.stmt) -> None:
        if not isinstance(node, ast.Assign):
            self._declare(*self.fresh)
        match node:
            case ast.Assign():
                for target in node.targets:
                    self._assign(target, node.value)
            case ast.AugAssign() if not self._is_array(node.target):
                place, value = self.value(node.target), self.value(node.value)
                self._learn(node.target, kind := self._arithmetic(node, place, value).type)
                word = ARITHMETIC[type(node.op)]
                self._emit(f"{place.text} {word}= {value.to(kind).text};")
            case ast.If():
                self._emit(f"if ({self.value(node.test).text}) {{")
                self._branches(node)
            case ast.While(orelse=[]):
                self._emit(f"while ({self._condition(node.test)}) {{")
                self._block(node.body)
                self._emit("}")
            case ast.For(ast.Name(counter), ast.Call(ast.Name("range"), arguments), orelse=[]):
                self._for(node, counter, arguments)
            case ast.Break() | ast.Continue():
                self._emit(f"{type(node).__name__.lower()};")
            case ast.Return():
                self._return(node.value)
            case ast.Expr(value=ast.Call() as call):
                value = self._call(call)
                self._emit(f"{'(void)' * bool(value.type)}{value.text};")
            case _:
                what = f"a statement like this ({type(node).__name__.lower()})"
                raise self.refusal(node, what, "use =, if, while, for i in range(...), return")

    def _declare(self, *names: str) -> None:
        for name in sorted(names):
            self.fresh.discard(name)
            self.pending.append(f"{self.types.get(name, INT)} {self._safe(name)};")

    def _condition(self, node: ast.expr) -> str:
        """Return a condition before which nothing can be computed."""
        before = len(self.pending)
        test = self.value(node)
        if len(self.pending) > before:
            raise self.refusal(node, "this condition", "call the kernel before it")
        return test.text

    def _branches(self, node: ast.If) -> None:
        self._block(node.body)
        match node.orelse:
            case [ast.If() as other] if id(other) not in self.declared:
                self._emit(f"}} else if ({self._condition(other.test)}) {{")
                self._branches(other)
                return
            case [_, *_]:
                self._emit("} else {")
                self._block(node.orelse)
        self._emit("}")

    def _for(self, node: ast.For, counter: str, arguments: list[ast.expr]) -> None:
        if counter != "_" and counter in self.types:
            raise self.refusal(node, f"{counter!r} for a counter in here", "use another name")
        self.types[counter] = INT
        low, high = [Value("0"), *map(self.value, arguments[:2])][-2:]
        step = self.value(arguments[2]).text if len(arguments) == 3 else "1"
        if self.source.locals.intersection(re.findall(r"\w+", step)):
            raise self.refusal(node, f"the step {step}", "write a number")
        stored = {name for name in self.source.stored if _mentions(node, name, ast.Store)}
        if stored & {*re.findall(r"\w+", high.text)} or "(" in high.text:
            end = self._spare("end")
            self._emit(f"const int {end} = {high.text};")
            high = Value(end)
        name = self._safe(counter) if counter != "_" else self._spare("k")
        test = f"{name} {'>' if step[0] == '-' else '<'} {high.within(RELATION + 1)}"
        moved = name + {"1": "++", "-1": "--"}.get(step, f" += {step}")
        self._emit(f"for (int {name} = {low.text}; {test}; {moved}) {{")
        self._block(node.body)
        self._emit("}")
        self.types.pop(counter, None)

    def _return(self, value: ast.expr | None) -> None:
        parts = value.elts if isinstance(value, ast.Tuple) else [value] if value else []
        kinds = self.function.returns
        if len(parts) != len(kinds):
            what = f"{len(parts)} results for {len(kinds)}"
            raise self.refusal(value or self.source.tree, what, "return each result by its name")
        texts = [self.value(p).to(k).text for p, k in zip(parts, kinds, strict=True)]
        for name, text in zip(self.results, texts[1:], strict=False):
            self._emit(f"*{name} = {text};")
        self._emit(f"return {texts[0]};" if texts else "return;")

    # -- assignments -------------------------------------------------------------------------------

    def _assign(self, target: ast.expr, value: ast.expr) -> None:
        match target, value:
            case ast.Tuple(names), ast.Tuple(values) if len(names) == len(values):
                self._assign_several(names, values)
            case ast.Tuple(names), ast.Call() if len(names) == len(self._callee(value).returns):
                pairs = zip(names[1:], self._callee(value).returns[1:], strict=True)
                others = [self._pointer(each, kind) for each, kind in pairs]
                self._set(names[0], self._call(value, others))
            case ast.Tuple(), _:
                raise self.refusal(target, "this assignment", "assign one name at a time")
            case ast.Name(), _ if self._is_array(value):
                self._name_view(target, self.view(value))
            case _ if self._is_array(target):
                self._fill(target, value)
            case _:
                self._set(target, self.value(value))

    def _assign_several(self, targets: Sequence[ast.expr], values: Sequence[ast.expr]) -> None:
        names = [ast.unparse(each) for each in targets]
        late = (ast.unparse(n) in names[:k] for k, v in enumerate(values) for n in ast.walk(v))
        if not any(late):
            for target, value in zip(targets, values, strict=True):
                self._assign(target, value)
            return
        held = [(self._spare("held"), self.value(each)) for each in values]  # as in a swap
        for name, one in held:
            self._emit(f"const {one.type} {name} = {one.text};")
        self._declare(*self.fresh)
        for target, (name, one) in zip(targets, held, strict=True):
            self._set(target, Value(name, ATOM, one.type))

    def _set(self, target: ast.expr, value: Value) -> None:
        opening = ""
        self._learn(target, value.type)
        if isinstance(target, ast.Name):
            if target.id == "_":
                self._emit(f"(void){value.text};")
                return
            if target.id in self.fresh:
                self.fresh.discard(target.id)
                changed = self.source.stored[target.id] > 1
                opening = f"{'' if changed else 'const '}{self.types[target.id]} "
        place = self.value(target)
        self._emit(f"{opening}{place.text} = {value.to(place.type).text};")

    def _learn(self, target: ast.expr, kind: str) -> None:
        """Note that a number of a type is assigned to a name, or that an array is written to."""
        if isinstance(target, ast.Name) and target.id in self.source.counters - {"_"}:
            raise self.refusal(target, f"{target.id!r} counted and assigned", "use two names")
        if isinstance(target, ast.Name) and self.types.get(target.id) != REAL:
            self.types[target.id] = kind
        elif isinstance(target, ast.Subscript):
            self.function.written |= {*self.view(target.value).roots}

    def _pointer(self, target: ast.expr, kind: str) -> str:
        """Return a pointer to where a result is written."""
        if isinstance(target, ast.Name) and target.id == "_":
            return self._unused(kind)
        self._learn(target, kind)
        if isinstance(target, ast.Name) and target.id in self.fresh:
            self._declare(target.id)
        return f"&{self.value(target).text}"

    def _unused(self, kind: str) -> str:
        """Return a pointer for a result that is not needed."""
        name = self._spare("unused")
        self.pending.append(f"{kind} {name};")
        return f"&{name}"

    def _name_view(self, target: ast.Name, view: View) -> None:
        if self.source.stored[target.id] > 1:
            raise self.refusal(target, "an array under two names", "use two names")
        name, size = self._safe(target.id), view.size
        const = "" if target.id in self.function.written else "const "
        self._emit(f"{const}mck_real *{name} = {view.place()};")
        words = re.findall(r"\w+", size.value().text)
        if any(self.source.stored[word] > 1 for word in words):
            self._emit(f"const int {name}_size = {size.value().text};")  # as it is now
            size = Whole([f"{name}_size"])
        self.arrays[target.id] = View(name, size, (target.id, *view.roots), columns=view.columns)

    def _fill(self, target: ast.expr, value: ast.expr) -> None:
        if self._is_array(value):
            raise self.refusal(value, f"a copy of {ast.unparse(value)!r}", "write a loop")
        view, k, given = self.view(target), self._spare("k"), self.value(value).to(REAL).text
        if not isinstance(value, ast.Constant | ast.Name):  # computed once, as in Python
            self._emit(f"const mck_real {(same := self._spare('same'))} = {given};")
            given = same
        size = view.size.value().within(RELATION + 1)
        self._emit(f"for (int {k} = 0; {k} < {size}; {k}++) {{")
        self._emit(f"    {view.element(Whole([k])).text} = {given};")
        self._emit("}")
        self.function.written |= {*view.roots}

    # -- arrays ------------------------------------------------------------------------------------

    def _is_array(self, node: ast.expr) -> bool:
        """Return whether an expression is an array, or a part of one."""
        if isinstance(node, ast.Subscript):
            row = ast.unparse(node.value) in self.source.matrices
            return isinstance(node.slice, ast.Slice) or row > isinstance(node.slice, ast.Tuple)
        if isinstance(node, ast.Name):
            return isinstance(self.arrays.get(node.id), View)
        return isinstance(node, ast.Call) and ast.unparse(node.func).endswith(".reshape")

    def view(self, node: ast.expr) -> View:
        """Return the array that an expression is."""
        if isinstance(node, ast.Name) and isinstance(found := self.arrays.get(node.id), View):
            return found
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            shape = node.args[0] if len(node.args) == 1 else None
            if node.func.attr == "reshape" and isinstance(shape, ast.Tuple):
                base, (rows, columns) = self.view(node.func.value), shape.elts
                size = self._product(rows, length := self.value(columns))
                return View(base.base, size, base.roots, base.begin, length)
        if not isinstance(node, ast.Subscript) or isinstance(node.slice, ast.Tuple):
            raise self.refusal(node, f"{ast.unparse(node)!r} for an array", "pass one in")
        base, part = self.view(node.value), node.slice
        if not isinstance(part, ast.Slice):
            if base.columns is None:
                raise self.refusal(node, f"{ast.unparse(node)!r} for an array", "slice it")
            begin = base.begin.plus(self._product(part, base.columns))
            return View(base.base, self._terms(base.columns), base.roots, begin)
        if part.step or base.columns is not None:
            raise self.refusal(node, "a slice like this", "write a loop")
        low = self._at(part.lower, base.size) if part.lower else Whole()
        high = self._at(part.upper, base.size) if part.upper else base.size
        return View(base.base, high.plus(low, -1), base.roots, base.begin.plus(low))

    def _at(self, place: ast.expr, size: Whole) -> Whole:
        """Return a place in an array; one below 0 is counted from the end."""
        found = self._whole(place)
        below = isinstance(place, ast.UnaryOp) and isinstance(place.op, ast.USub)
        return size.plus(found) if below else found

    def _whole(self, node: ast.expr) -> Whole:
        """Return a whole number as a sum."""
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Sub):
            sign = 1 if isinstance(node.op, ast.Add) else -1
            return self._whole(node.left).plus(self._whole(node.right), sign)
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            return Whole().plus(self._whole(node.operand), -1)
        if isinstance(node, ast.Attribute) and node.attr == "size":
            return self.view(node.value).size
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult):
            return self._product(node.left, self.value(node.right))
        return self._terms(self.value(node))

    def _terms(self, value: Value) -> Whole:
        return Whole({"": int(value.text)} if value.text.isdigit() else [value.within(TIMES)])

    def _product(self, times: ast.expr, value: Value) -> Whole:
        one = self._whole(times)
        if not any(count for term, count in one.items() if term):
            return Whole().plus(self._terms(value), one[""])
        return self._terms(Value(f"{one.value().within(TIMES)} * {value.within(UNARY)}", TIMES))

    def _item(self, node: ast.Subscript) -> Value:
        if isinstance(node.value, ast.Call) and not self._is_array(node.value):
            if ast.unparse(node.slice) != "0":
                raise self.refusal(node, f"{ast.unparse(node)!r}", "name the results")
            return self._call(node.value)
        base, at = self.view(node.value), node.slice
        if not isinstance(at, ast.Tuple):
            return base.element(self._at(at, base.size))
        if base.columns is None or len(at.elts) != 2:
            raise self.refusal(node, f"{ast.unparse(node)!r}", "use one place")
        return base.element(self._product(at.elts[0], base.columns).plus(self._whole(at.elts[1])))

    # -- numbers -----------------------------------------------------------------------------------

    def value(self, node: ast.expr) -> Value:
        """Return a number as C."""
        match node:
            case ast.Constant(value=float(number)):
                return Value(self._real(number, node), ATOM, REAL)
            case ast.Constant(value=bool(number) | int(number)):
                return Value(str(int(number)))
            case ast.Name():
                return self._name(node)
            case ast.UnaryOp(op=ast.Not()):
                return Value(f"!{self.value(node.operand).within(UNARY)}", UNARY)
            case ast.UnaryOp(op=ast.USub()):
                inner = self.value(node.operand)
                text = inner.within(UNARY)
                text = f"({text})" if text.startswith("-") else text
                return Value(f"-{text}", UNARY, inner.type)
            case ast.BinOp():
                return self._arithmetic(node, self.value(node.left), self.value(node.right))
            case ast.BoolOp():
                word, binds = ("&&", AND) if isinstance(node.op, ast.And) else ("||", OR)
                values = [self.value(each) for each in node.values]
                if any(each.type == REAL or each.text.isdigit() for each in values):
                    raise self.refusal(node, "and, or of numbers", "compare them")
                return Value(f" {word} ".join(each.within(EQUAL) for each in values), binds)
            case ast.Compare():
                return self._compare(node)
            case ast.IfExp():
                test = self.value(node.test).within(AND)
                one, other, kind = _alike(self.value(node.body), self.value(node.orelse))
                texts = one.within(CHOICE + 1), other.within(CHOICE + 1)
                return Value(f"{test} ? {texts[0]} : {texts[1]}", CHOICE, kind)
            case ast.Attribute(value=ast.Name(id="np" | "math"), attr="inf" | "nan" | "pi" as name):
                number = getattr(math, name)
                return Value(self._real(number, node), ATOM, REAL)
            case ast.Attribute(attr="size"):
                return self.view(node.value).size.value()
            case ast.Subscript():
                return self._item(node)
            case ast.Call():
                found = self._function(node)
                if found.type:
                    return found
        raise self.refusal(node, f"{ast.unparse(node)!r}", "see docs/kernels.md")

    def _name(self, node: ast.Name) -> Value:
        name = node.id
        if name in self.types or name in self.source.stored.keys() - self.source.counters:
            return Value(self._safe(name), ATOM, self.types.get(name, INT))
        known, kind = self.source.constant(name), INT
        if known is None:
            instead = "use numbers, arguments and constants of the module"
            raise self.refusal(node, f"the name {name!r}", instead)
        text = str(int(known)) if math.isfinite(known) else ""
        if isinstance(known, float):
            single, kind = self.source.single(name) if self.whole.single else None, REAL
            text = literal(single, single=True) if single else self._real(known, node)
        return Value(self.whole.constant(name.strip("_").upper(), text), ATOM, kind)

    def _real(self, value: float, node: ast.AST) -> str:
        """Return a real number in C, or refuse one that single precision does not hold."""
        kept = self.whole.single or isinstance(node, ast.Constant)
        if math.isnan(value):
            return "((mck_real)NAN)"
        if value and not LEAST < abs(value) < MOST and math.isfinite(value) and kept:
            what = f"the number {value!r}, which single precision has no room for, or rounds away"
            raise self.refusal(node, what, "name it, and add it to the table SINGLE of the module")
        return literal(value, single=self.whole.single)

    def _arithmetic(self, node: ast.BinOp | ast.AugAssign, one: Value, other: Value) -> Value:
        squared = isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow)
        if squared and other.text == "2" and "(" not in one.text:
            return Value(f"{one.within(UNARY)} * {one.within(UNARY)}", TIMES, one.type)
        if type(node.op) not in ARITHMETIC:
            raise self.refusal(node, "this operator", "use + - * / // % and ** 2 of a name")
        one, other, kind = _alike(one, other, REAL if isinstance(node.op, ast.Div) else INT)
        if kind == REAL and isinstance(node.op, ast.FloorDiv | ast.Mod):
            raise self.refusal(node, "// or % of real numbers", "use math.floor or math.fmod")
        word = ARITHMETIC[type(node.op)]
        binds = PLUS if word in "+-" else TIMES
        return Value(f"{one.within(binds)} {word} {other.within(binds + 1)}", binds, kind)

    def _compare(self, node: ast.Compare) -> Value:
        if isinstance(node.ops[0], ast.In) and isinstance(node.comparators[0], ast.Tuple):
            choices = node.comparators[0].elts
            each = [ast.Compare(node.left, [ast.Eq()], [one]) for one in choices]
            return self.value(ast.BoolOp(ast.Or(), [*each]))
        links = []
        for op, left, right in zip(
            node.ops, [node.left, *node.comparators], node.comparators, strict=False
        ):
            if type(op) not in COMPARISON:
                raise self.refusal(node, "this comparison", "use < <= > >= == != or in")
            one, other, _ = _alike(self.value(left), self.value(right))
            word = COMPARISON[type(op)]
            text = f"{one.within(RELATION + 1)} {word} {other.within(RELATION + 1)}"
            links.append(Value(text, EQUAL if word in ("==", "!=") else RELATION))
        return links[0] if len(links) == 1 else Value(" && ".join(each.text for each in links), AND)

    # -- calls -------------------------------------------------------------------------------------

    def _function(self, node: ast.Call) -> Value:
        name = ast.unparse(node.func)
        module, _, plain = name.rpartition(".")
        if name in ("min", "max", "abs", "int"):
            return self._bounded(name, [self.value(each) for each in node.args])
        if module in ("math", "np"):
            if plain not in FUNCTIONS:
                raise self.refusal(node, f"{name}()", f"use {', '.join(sorted(FUNCTIONS))}")
            texts = [self.value(each).to(REAL).text for each in node.args]
            return Value(f"{plain}{'f' * self.whole.single}({', '.join(texts)})", ATOM, REAL)
        return self._call(node)

    def _bounded(self, name: str, values: list[Value]) -> Value:
        """Return the smallest, the largest, the size or the whole part of numbers."""
        real, one = any(each.type == REAL for each in values), values[0]
        if name == "int":
            return Value(f"(int){one.within(UNARY)}", UNARY) if real else one
        if name == "abs" and real:
            return Value(f"fabs{'f' * self.whole.single}({one.text})", ATOM, REAL)
        if name == "abs":
            name, values = "max", [one, Value(f"-{one.within(UNARY)}", UNARY)]
        for other in values[1:]:
            if real:
                text = f"mck_{name}({one.to(REAL).text}, {other.to(REAL).text})"
                one = Value(text, ATOM, REAL)
            else:
                a, b = one.within(RELATION + 1), other.within(RELATION + 1)
                one = Value(f"({b} {'<' if name == 'min' else '>'} {a} ? {b} : {a})")
        return one

    def _callee(self, node: ast.Call) -> Function:
        """Return the function that is called, with the functions and tuples that it is given."""
        kernel = self._meaning(node.func)
        if not hasattr(kernel, "py_func"):
            what = f"a call of {ast.unparse(node.func)}()"
            raise self.refusal(node, what, "call kernels, min, max, abs, math.…")
        names = [arg.arg for arg in source_of(kernel).tree.args.args]
        if len(names) != len(node.args) or node.keywords:
            raise self.refusal(node, "arguments by name", "give every argument by its place")
        bound: list[tuple[str, Any]] = []
        for parameter, given in zip(names, node.args, strict=True):
            known = self._meaning(given)
            if isinstance(known, list):
                bound.append((parameter, len(known)))
            elif hasattr(known, "py_func"):
                bound.append((parameter, known))
        return self.whole.add(kernel, tuple(bound))

    def _meaning(self, node: ast.expr) -> Any:
        """Return the kernel that a name means, or the arrays of a tuple; None for all else."""
        if isinstance(node, ast.Tuple):
            return node.elts
        if not isinstance(node, ast.Name) or node.id in self.types:
            return None
        if node.id in self.arrays:
            return self.arrays[node.id]
        return self.bound.get(node.id, self.source.globals.get(node.id))

    def _call(self, node: ast.Call, pointers: Sequence[str] = ()) -> Value:
        """Return a call, whose results behind the first go where pointers say, or nowhere."""
        if self._meaning(node.func) is accumulate:
            return self._accumulate(*node.args)
        callee = self._callee(node)
        pointers = pointers or [self._unused(kind) for kind in callee.returns[1:]]
        texts = ", ".join([*self._arguments(node, callee), *pointers])
        return Value(f"{callee.name}({texts})", ATOM, next(iter(callee.returns), ""))

    def _arguments(self, node: ast.Call, callee: Function) -> Iterator[str]:
        for each in callee.parameters:
            given = node.args[each.place]
            if not each.asks:
                yield self.value(given).to(each.type).text
                continue
            items = self._meaning(given)
            item = items[each.item] if isinstance(items, list) else given
            view = item if isinstance(item, View) else self.view(item)
            if each.name in callee.written:
                self.function.written |= {*view.roots}
            if each.asks == "itself":
                yield view.place()
            elif each.asks == "size":
                yield view.size.value().text
            elif view.columns is not None:
                yield view.columns.text
            else:
                raise self.refusal(given, "an array without rows here", "reshape it")

    def _accumulate(self, total: ast.expr, change: ast.expr, lost: ast.expr, at: ast.expr) -> Value:
        """Return a sum, which in single precision carries what rounding loses."""
        one, other, _ = _alike(self.value(total), self.value(change), REAL)
        if not self.whole.single:
            return Value(f"{one.within(PLUS)} + {other.within(PLUS + 1)}", PLUS, REAL)
        element = self._item(ast.Subscript(lost, at))
        self._learn(ast.Subscript(lost, at), REAL)
        return Value(f"mck_sum({one.text}, {other.text}, &{element.text})", ATOM, REAL)

    # -- the whole ---------------------------------------------------------------------------------

    def _finish(self) -> None:
        """Write the function: its docstring, its head with the parameters that it needs, its body."""
        function = self.function
        body = _without_idle("\n".join(self.lines))
        words = []
        for each in self.given:
            name = self._safe(each.name)
            if re.search(rf"\b{name}\b", body):
                function.parameters.append(each)
                const = "const " * (each.name not in function.written)
                kind = f"{const}{REAL} *" if each.asks == "itself" else f"{each.type} "
                words.append(kind + name)
        words += [f"{k} *{n}" for k, n in zip(function.returns[1:], self.results, strict=True)]
        kind = next(iter(function.returns), "void")
        head = _wrapped(f"static {kind} {function.name}({', '.join(words) or 'void'})")
        doc = re.sub(r"`+", "`", ast.get_docstring(self.source.tree) or "").replace("*/", "* /")
        about = [f"/* {doc}".replace("\n", "\n * ").replace(" * \n", " *\n") + " */"] if doc else []
        function.text = "\n".join([*about, *head, "{", body, "}", ""])


def _alike(one: Value, other: Value, kind: str = INT) -> tuple[Value, Value, str]:
    """Return two numbers in the type that holds both, and that type."""
    kind = REAL if REAL in (one.type, other.type, kind) else INT
    return one.to(kind), other.to(kind), kind


def _wrapped(line: str) -> list[str]:
    """Return a line of C as lines that are short enough."""
    rest = " " * (len(line) - len(line.lstrip()) + 8)
    line = re.sub(r"(const|mck_real|int) (?=\*?\w)", "\\1\u00a0", line)  # types stay with names
    lines = textwrap.wrap(line, WIDTH, subsequent_indent=rest, break_on_hyphens=False)
    return [each.replace("\u00a0", " ") for each in lines]


def _without_idle(text: str) -> str:
    """Return a body without constants that only sizes were read from, which C does not need."""
    pattern = re.compile(r"^ *const (?:int|mck_real) \*?(\w+) = (?:(?!\w\()[^;])*;\n?", re.M)
    while True:
        for found in pattern.finditer(text):
            if len(re.findall(rf"\b{found[1]}\b", text)) == 1:
                text = text.replace(found[0], "", 1)
                break
        else:
            return text


def _declaring(body: Sequence[ast.stmt], name: str) -> ast.stmt:
    """Return the statement with which, or before which, C declares a local name.

    It is in the innermost block that has all uses, and before a loop that may carry a value through.
    """
    uses = [statement for statement in body if _mentions(statement, name)]
    first = uses[0]
    blocks = [getattr(first, part, []) for part in ("body", "orelse")]
    inner = [block for block in blocks if any(_mentions(each, name) for each in block)]
    head = getattr(first, "test", getattr(first, "iter", None))
    if len(uses) > 1 or len(inner) != 1 or (head is not None and _mentions(head, name)):
        return first
    found = _declaring(inner[0], name)
    assigns = isinstance(found, ast.Assign) and not _mentions(found, name, ast.Load)
    if isinstance(first, ast.For | ast.While) and found in inner[0] and not assigns:
        return first
    return found


def _mentions(node: ast.AST, name: str, how: type[ast.expr_context] = ast.expr_context) -> bool:
    names = (each for each in ast.walk(node) if isinstance(each, ast.Name) and each.id == name)
    return any(isinstance(each.ctx, how) for each in names)
