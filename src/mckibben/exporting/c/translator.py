"""Translation of kernels to C99: one C function per Python function, with its names and comments.

``docs/kernels.md`` describes what can be translated. Arrays become pointers, with their sizes as
arguments of their own where a function needs them; results behind the first are written through
pointers; functions and tuples of arrays that a kernel takes are bound, so that a kernel that takes
functions is written once for every caller. Nothing is allocated.
"""

from __future__ import annotations

import ast
import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

from mckibben.blocks.kernels import accumulate
from mckibben.exporting.c.language import BOOL, FUNCTIONS, INT, REAL, TYPES, Source, source_of, used
from mckibben.exporting.naming import TAKEN, commented
from mckibben.exporting.templating import literal, wrapped

SMALLEST_CONSTANT, LARGEST_CONSTANT = 1e-6, 3.4e38
"""Range of the sizes of constants that are the same in both precisions."""

ATOM, UNARY, TIMES, PLUS, RELATION, EQUAL, AND, OR, CHOICE = 15, 13, 12, 11, 9, 8, 5, 4, 3
"""Precedence of operators in C."""

_BINARY = (ast.Add, ast.Sub, ast.Mult, ast.Div, ast.FloorDiv, ast.Mod)
ARITHMETIC: dict[type[ast.AST], str] = dict(zip(_BINARY, "+-*//%", strict=True))
_COMPARED = (ast.Lt, ast.LtE, ast.Gt, ast.GtE, ast.Eq, ast.NotEq)
COMPARISON = dict(zip(_COMPARED, ("<", "<=", ">", ">=", "==", "!="), strict=True))

LARGEST_INTEGER = 32767
"""Largest integer literal: it fits into an `int` of C and is exact in single precision."""

CONVERSIONS = {INT: "take int(...) of it", BOOL: "compare it"}
"""Replacements for numbers that a type cannot represent."""


class Value(NamedTuple):
    """An expression of C: text, precedence and type."""

    text: str
    binds: int = ATOM
    type: str = INT

    def within(self, least: int) -> str:
        """Return the text, in brackets if its precedence is lower than required."""
        return self.text if self.binds >= least else f"({self.text})"

    def to(self, kind: str) -> Value:
        """Return it as a real number, if it is an integer and that is required."""
        if kind != REAL or self.type == kind:
            return self
        return Value(f"(mck_real){self.within(UNARY)}", UNARY, REAL)


class Whole(Counter[str]):
    """A sum of integers, as in indices and sizes: the count of each term of C.

    The term "" is the number 1.
    """

    def plus(self, other: Whole, times: int = 1) -> Whole:
        """Return the sum with another one, times a factor."""
        terms = [*self, *(term for term in other if term not in self)]
        sums = {term: self[term] + times * other[term] for term in terms}
        return Whole({term: count for term, count in sums.items() if count})

    def value(self) -> Value:
        """Return it as C."""
        text = ""
        for term, count in sorted(self.items(), key=lambda item: (not item[0], item[1] < 0)):
            factor = term if term.isidentifier() or abs(count) == 1 else f"({term})"
            words = [str(abs(count))] * (abs(count) != 1 or not term) + [factor] * bool(term)
            text += (" - " if count < 0 else " + " if text else "") + " * ".join(words)
        if text.startswith(" - "):
            text = f"-{text[3:]}"
        added = " + " in text or " - " in text
        return Value(text or "0", PLUS if added else TIMES if " " in text else ATOM)


@dataclass
class View:
    """An array, or a part of one: pointer, offset, size, and row length.

    ``roots`` are the names of the pointers that are written to where it is.
    """

    base: str
    size: Whole
    roots: tuple[str, ...]
    begin: Whole = field(default_factory=Whole)
    columns: Value | None = None

    def place(self) -> str:
        """Return the pointer to its first number."""
        return f"{self.base} + {self.begin.value().within(PLUS)}" if self.begin else self.base

    def element(self, at: Whole) -> Value:
        """Return one of its numbers."""
        return Value(f"{self.base}[{self.begin.plus(at).value().text}]", ATOM, REAL)


class Parameter(NamedTuple):
    """A parameter of a C function, for the argument of Python at a ``place``.

    It is an ``item`` of a tuple there, and ``asks`` of an array "itself", its "size" or its "columns".
    """

    name: str
    type: str
    place: int
    item: int = 0
    asks: str = ""


@dataclass
class Function:
    """A C function: name, parameters and results, arrays written to, and text."""

    name: str
    returns: list[str]
    parameters: list[Parameter] = field(default_factory=list)
    written: set[str] = field(default_factory=set)
    text: str = ""

    def call(self, *arguments: tuple[str, int]) -> str:
        """Return a call with arguments in Python's order, each as text with the size of arrays."""
        texts = [str(arguments[each.place][each.asks == "size"]) for each in self.parameters]
        return f"{self.name}({', '.join(texts)})"


class Translation:
    """C functions in order of dependence, and the constants that they use.

    They are in ``single`` or in double precision, and have names that are not ``taken``.
    """

    def __init__(self, *, single: bool = False, taken: Iterable[str] = ()) -> None:
        self.single = single
        self.constants: dict[str, str] = {}
        self.names = set(taken)
        self._functions: dict[tuple[Any, ...], Function] = {}
        self._open: list[Source] = []
        self._locals: set[str] = set()

    def add(self, kernel: Any, bound: tuple[tuple[str, Any], ...] = ()) -> Function:
        """Return the function of a kernel; a new one is added with its callees.

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
        """Return a name not used by a function, nor by a local of an earlier one."""
        reserved = {*self.constants, *TAKEN, *self.names, *self._locals}
        self._locals |= {*source.locals, *(f"{name}_size" for name in source.given)}
        plain, module = source.tree.name.strip("_"), source.function.__module__.rpartition(".")[2]
        choices = [plain, f"{module}_{plain}", *(f"{module}_{plain}_{k}" for k in range(2, 100))]
        self.names.add(free := next(each for each in choices if each not in reserved))
        return free

    def constant(self, name: str, text: str) -> str:
        """Return a unique name for a constant."""
        while name in TAKEN or self.constants.setdefault(name, text) != text:
            name += "_"
        return name

    def text(self) -> str:
        """Return the constants and all functions, as C."""
        names = [f"#define {name} {text}" for name, text in self.constants.items()]
        head = "\n".join(names) + "\n\n" if names else ""
        return head + "\n".join(each.text for each in self._functions.values())


class _Translator:
    """Translates one function, with the values bound to its parameters.

    It is written repeatedly, each time with the types of names and the arrays written to that the pass
    before has found, until its text stays the same.
    """

    def __init__(self, translation: Translation, source: Source, bound: dict[str, Any]) -> None:
        self.translation, self.source, self.bound = translation, source, bound
        self.refusal = source.refusal
        self.function = Function(translation.free_name(source), source.returns)
        self.results = [self._unused_name(f"result_{k}") for k in range(2, len(source.returns) + 1)]
        self.types: dict[str, str] = {}
        self.arrays: dict[str, View | list[View]] = {}
        self.given: list[Parameter] = []
        self.body = list(source.body)
        self._parameters()
        self.lines: list[str] = []
        self.breaks: list[set[str]] = []
        self.nowhere = {*source.locals, "return"}  # known where no way leads on
        known_at_start = {*source.given, *self.arrays}
        before: list[str] | None = None
        while before != self.lines:
            before, self.lines = self.lines, []
            self.pending: list[str] = []
            self.comments, self.comment = dict(source.comments), ""
            self.spares = self.depth = 0
            parameters = {*self.arrays, *(each.name for each in self.given), *source.counters, "_"}
            self.declared: dict[int, list[str]] = {}
            for name in sorted(source.stored.keys() - parameters):
                self.declared.setdefault(id(_declaring(self.body, name)), []).append(name)
            self.known = {*known_at_start}
            self._block(self.body)
        if source.returns and "return" not in self.known:
            raise self.refusal(source.tree, "a way through without a result", "end with return")
        self._finish()

    def _parameters(self) -> None:
        for index, (arg, kind) in enumerate(self.source.annotations()):
            bound = self.bound.get(arg.arg)
            if isinstance(bound, int):
                names = [self._unused_name(f"{arg.arg}_{k + 1}") for k in range(bound)]
                names = self._unpacked(arg.arg, bound) or names
                views = [self._array(name, index, k) for k, name in enumerate(names)]
                self.arrays |= {arg.arg: views, **dict(zip(names, views, strict=True))}
            elif kind == "Array":
                self.arrays[arg.arg] = self._array(arg.arg, index, 0)
            elif kind in TYPES:
                self.types[arg.arg] = kind
                self.given.append(Parameter(arg.arg, kind, index))
            elif bound is None:
                what = f"the argument {arg.arg}: {kind}"
                raise self.refusal(arg, what, "use float, int, bool, Array or kernels")

    def _unpacked(self, name: str, count: int) -> list[str]:
        """Return the names of an unpacked tuple's arrays, and drop that line."""
        for statement in self.body:
            if isinstance(statement, ast.Assign) and ast.unparse(statement.value) == name:
                names = [ast.unparse(n) for n in getattr(statement.targets[0], "elts", [])]
                if len(names) == count:
                    self.body.remove(statement)
                    return names
        return []

    def _array(self, name: str, k: int, item: int) -> View:
        self.given.append(Parameter(name, REAL, k, item, "itself"))
        for asks in ("size", "columns"):
            self.given.append(Parameter(self._unused_name(f"{name}_{asks}"), INT, k, item, asks))
        pointer, size, columns = (self._safe(each.name) for each in self.given[-3:])
        rows = Value(columns) if name in self.source.matrices else None
        return View(pointer, Whole([size]), (name,), columns=rows)

    def _safe(self, name: str) -> str:
        """Return a local name that is not reserved in C; macros have capitals."""
        free = not (name.isupper() or name in TAKEN or name in self.translation.names)
        return name if free else self._unused_name(f"{name.lower()}_")

    def _unused_name(self, name: str) -> str:
        """Return a name that is not among the kernel's own."""
        while name in self.source.locals:
            name += "_"
        return name

    def _spare(self, name: str) -> str:
        self.spares += 1
        return self._unused_name(f"{name}_{self.spares}")

    def _emit(self, text: str) -> None:
        """Append a line of C with the statement's comment, after pending lines."""
        words, self.comment = f" /* {self.comment} */" if self.comment else "", ""
        for line in (*self.pending, text + words):
            self.lines += wrapped("    " * self.depth + line)
        self.pending = []

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
        self.alone = _alone(node)
        match node:
            case ast.Assign(targets=[target]):
                self._assign(target, node.value)
                self.known |= used(target, how=ast.Store).keys()
            case ast.AugAssign() if not self._is_array(node.target):
                assigned, value = self.value(node.target), self.value(node.value)
                self._register(node.target, kind := self._arithmetic(node, assigned, value).type)
                word = ARITHMETIC[type(node.op)]
                self._emit(f"{assigned.text} {word}= {value.to(kind).text};")
            case ast.If():
                self._emit(f"if ({self.value(node.test).text}) {{")
                self._branches(node)
            case ast.While(orelse=[]):
                self._emit(f"while ({self.value(node.test).text}) {{")
                self._loop(node.body, endless=bool(self.source.number(node.test)))
            case ast.For(ast.Name(counter), ast.Call(ast.Name("range"), arguments), orelse=[]):
                self._for(node, counter, arguments)
            case ast.Break() | ast.Continue():
                self._emit(f"{type(node).__name__.lower()};")
                if isinstance(node, ast.Break):
                    self.breaks[-1] &= self.known
                self.known = {*self.nowhere}
            case ast.Return():
                self._return(node.value)
                self.known = {*self.nowhere}
            case ast.Expr(value=ast.Call() as call):
                value = self._call(call)
                self._emit(f"{'(void)' * bool(value.type)}{value.text};")
            case _:
                what = f"the statement {ast.unparse(node).partition(chr(10))[0]!r}"
                instead = "use = with one target, if, while, for i in range(...) and return"
                raise self.refusal(node, what, instead)

    def _declare(self, *names: str) -> None:
        for name in sorted(names):
            self.fresh.discard(name)
            self.pending.append(f"{TYPES[self.types.get(name, BOOL)]} {self._safe(name)};")

    def _branches(self, node: ast.If) -> None:
        known_before = {*self.known}
        self._block(node.body)
        known_in_body, self.known = self.known, known_before
        match node.orelse:
            case [ast.If() as elif_] if id(elif_) not in self.declared:
                self.alone = _alone(elif_)
                test = self.value(elif_.test).text
                if self.pending:
                    raise self.refusal(elif_, "this condition", "call the kernel before it")
                self._emit(f"}} else if ({test}) {{")
                self._branches(elif_)
            case orelse:
                if orelse:
                    self._emit("} else {")
                self._block(orelse)
                self._emit("}")
        self.known &= known_in_body

    def _loop(self, body: Sequence[ast.stmt], counter: str = "_", *, endless: bool = False) -> None:
        """Write the body of a loop, and update known values after it."""
        before, self.known = self.known, {*self.known, counter}
        self.breaks.append({*self.nowhere})
        self._block(body)
        self._emit("}")
        at_breaks = self.breaks.pop()
        self.known = at_breaks if endless else before

    def _for(self, node: ast.For, counter: str, arguments: list[ast.expr]) -> None:
        assigned = self.types.keys() | used(*node.body, how=ast.Store).keys()
        if counter in assigned - {"_"}:
            raise self.refusal(node, f"{counter!r} counted and assigned", "use two names")
        self.types[counter] = INT
        low, high = [Value("0"), *(self._as(each, INT) for each in arguments[:2])][-2:]
        step_node = arguments[2] if len(arguments) == 3 else ast.Constant(1)
        step, stride = self._as(step_node, INT).text, self.source.number(step_node)
        if not stride:
            raise self.refusal(node, f"the step {ast.unparse(step_node)!r}", "write a number")
        if "(" in high.text or self._changes(high.text, node):
            end = self._spare("end")
            self._emit(f"const int {end} = {high.text};")
            high = Value(end)
        name = self._safe(counter) if counter != "_" else self._spare("k")
        test = f"{name} {'>' if stride < 0 else '<'} {high.within(RELATION + 1)}"
        advance = name + {"1": "++", "-1": "--"}.get(step, f" += {step}")
        self._emit(f"for (int {name} = {low.text}; {test}; {advance}) {{")
        self._loop(node.body, counter)
        self.types.pop(counter, None)

    def _return(self, value: ast.expr | None) -> None:
        parts = value.elts if isinstance(value, ast.Tuple) else [value] if value else []
        kinds = self.function.returns
        if len(parts) != len(kinds):
            what = f"{len(parts)} results for {len(kinds)}"
            raise self.refusal(value or self.source.tree, what, "return each result by its name")
        texts = [self._as(p, k).text for p, k in zip(parts, kinds, strict=True)]
        for name, text in zip(self.results, texts[1:], strict=False):
            self._emit(f"*{name} = {text};")
        self._emit(f"return {texts[0]};" if texts else "return;")

    def _assign(self, target: ast.expr, value: ast.expr) -> None:
        match target, value:
            case ast.Tuple(names), ast.Tuple(values) if len(names) == len(values):
                self._assign_several(names, values)
            case ast.Tuple(names), ast.Call() if len(names) == len(self._callee(value).returns):
                pairs = zip(names[1:], self._callee(value).returns[1:], strict=True)
                pointers = [self._pointer(each, kind) for each, kind in pairs]
                self._set(names[0], self._call(value, pointers))
            case ast.Tuple(), _:
                raise self.refusal(target, "this assignment", "assign one name at a time")
            case ast.Name(), _ if self._is_array(value):
                self._name_view(target, self.view(value))
            case _ if self._is_array(target):
                self._fill_array(target, value)
            case _:
                self._set(target, self.value(value))

    def _assign_several(self, targets: Sequence[ast.expr], values: Sequence[ast.expr]) -> None:
        changed = [{t.id} if isinstance(t, ast.Name) else self._roots(used(t)) for t in targets]
        read = [used(value).keys() | self._roots(used(value)) for value in values]
        if not any(read[k] & each for k in range(len(read)) for each in changed[:k]):
            for target, value in zip(targets, values, strict=True):
                self._assign(target, value)
            return
        copies = [(self._spare("held"), self.value(each)) for each in values]  # as in a swap
        for name, one in copies:
            self._emit(f"const {TYPES[one.type]} {name} = {one.text};")
        self._declare(*self.fresh)
        for target, (name, one) in zip(targets, copies, strict=True):
            self._set(target, Value(name, ATOM, one.type))

    def _roots(self, names: Iterable[str]) -> set[str]:
        """Return the pointers to where arrays of some names are."""
        arrays = [self.arrays[name] for name in names if name in self.arrays]
        views = (view for each in arrays for view in (each if isinstance(each, list) else [each]))
        return {root for view in views for root in view.roots}

    def _set(self, target: ast.expr, value: Value) -> None:
        opening = ""
        self._register(target, value.type)
        if isinstance(target, ast.Name):
            self.known.add(target.id)
            if target.id == "_":
                self._emit(f"(void){value.text};")
                return
            if target.id in self.fresh:
                self.fresh.discard(target.id)
                const = "const " * (target.id not in self.source.changing)
                opening = f"{const}{TYPES[self.types[target.id]]} "
        destination = self.value(target)
        self._emit(f"{opening}{destination.text} = {value.to(destination.type).text};")

    def _register(self, target: ast.expr, kind: str) -> None:
        """Register the assignment of a type to a name, or of an array element."""
        if isinstance(target, ast.Name):
            before = self.types.get(target.id, BOOL)
            self.types[target.id] = _widest(before, kind)
            if target.id in self.source.given and self.types[target.id] != before:
                raise self.refusal(target, f"the {kind} in {target.id!r}", "use two names")
        elif isinstance(target, ast.Subscript):
            self.function.written |= {*self.view(target.value).roots}

    def _pointer(self, target: ast.expr, kind: str) -> str:
        """Return a pointer for a result; none for `_`."""
        if isinstance(target, ast.Name) and target.id == "_":
            name = self._spare("unused")
            self.pending.append(f"{TYPES[kind]} {name};")
            return f"&{name}"
        self._register(target, kind)
        if not isinstance(target, ast.Name) or self.types[target.id] != kind:
            raise self.refusal(target, f"a result in {ast.unparse(target)!r}", "name it anew")
        if target.id in self.fresh:
            self._declare(target.id)
        return f"&{self._safe(target.id)}"

    def _name_view(self, target: ast.Name, view: View) -> None:
        if target.id in self.source.changing:
            raise self.refusal(target, f"two arrays called {target.id!r}", "use two names")
        name = self._safe(target.id)
        const = "" if target.id in self.function.written else "const "
        self._emit(f"{const}mck_real *{name} = {view.place()};")
        size, columns = view.size, view.columns
        if self._changes(size.value().text):
            size_name = self._unused_name(f"{name}_size")
            self._emit(f"const int {size_name} = {size.value().text};")  # as it is now
            size = Whole([size_name])
        if columns and self._changes(columns.text):
            raise self.refusal(target, "rows of a length that changes", "assign the length once")
        self.arrays[target.id] = View(name, size, (target.id, *view.roots), columns=columns)

    def _changes(self, text: str, loop: ast.For | None = None) -> bool:
        """Return whether the value of a C expression may change later, or in a loop."""
        stored = used(loop, how=ast.Store) if loop else self.source.changing
        words = {*re.findall(r"\w+", text)}
        read = self._roots(name for name in self.arrays if self._safe(name) in words)
        return bool(words & {*map(self._safe, stored)} or read & self.function.written)

    def _fill_array(self, target: ast.expr, value: ast.expr) -> None:
        if self._is_array(value):
            raise self.refusal(value, f"a copy of {ast.unparse(value)!r}", "call fill(to, numbers)")
        view, k, number = self.view(target), self._spare("k"), self.value(value).to(REAL).text
        self.function.written |= {*view.roots}
        if not isinstance(value, ast.Constant | ast.Name):  # computed once, as in Python
            self._emit(f"const mck_real {(same := self._spare('same'))} = {number};")
            number = same
        size = view.size.value().within(RELATION + 1)
        self._emit(f"for (int {k} = 0; {k} < {size}; {k}++) {{")
        self._emit(f"    {view.element(Whole([k])).text} = {number};")
        self._emit("}")

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
        match node:
            case ast.Name(name) if isinstance(found := self.arrays.get(name), View):
                self._assigned(node)
                return found
            case ast.Call(ast.Attribute(inner, "reshape"), [ast.Tuple([rows, columns])]):
                size = self._product(rows, length := self._as(columns, INT))
                return replace(self.view(inner), size=size, columns=length)
            case ast.Subscript(inner, part) if not isinstance(part, ast.Tuple):
                base = self.view(inner)
                match part, base.columns:
                    case ast.Slice(below, above, None), None:
                        low = self._at(below, base.size) if below else Whole()
                        high = self._at(above, base.size) if above else base.size
                        return replace(base, size=high.plus(low, -1), begin=base.begin.plus(low))
                    case ast.expr(), Value() as length if not isinstance(part, ast.Slice):
                        begin = base.begin.plus(self._at(part, base.size, length))
                        return replace(base, size=self._terms(length), begin=begin, columns=None)
        instead = "use arrays that are passed in, their rows, and parts without a step"
        raise self.refusal(node, f"{ast.unparse(node)!r} for an array", instead)

    def _at(self, index: ast.expr, size: Whole, row: Value | None = None) -> Whole:
        """Return the position of a number or a row; negative literals count from the end."""
        number = self.source.number(index)
        if number is None and isinstance(index, ast.UnaryOp):
            raise self.refusal(index, f"a place {ast.unparse(index)!r}", "count from a.size")
        at = self._product(index, row) if row else self._whole(index)
        return size.plus(at) if (number or 0) < 0 else at

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
            return self._product(node.left, self._as(node.right, INT))
        return self._terms(self._as(node, INT))

    def _terms(self, value: Value) -> Whole:
        return Whole({"": int(value.text)} if value.text.isdigit() else [value.within(TIMES)])

    def _product(self, times: ast.expr, value: Value) -> Whole:
        factor = self._whole(times)
        if factor.keys() <= {""}:
            return Whole().plus(self._terms(value), factor[""])
        return self._terms(Value(f"{factor.value().within(TIMES)} * {value.within(UNARY)}", TIMES))

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
        row = self._at(at.elts[0], base.size, base.columns)
        return base.element(row.plus(self._at(at.elts[1], self._terms(base.columns))))

    def value(self, node: ast.expr) -> Value:
        """Return a number as C."""
        match node:
            case ast.Constant(value=bool(number) | int(number) | float(number)):
                return self._written(number, node)
            case ast.Name():
                return self._name(node)
            case ast.UnaryOp(op=ast.Not()):
                return Value(f"!{self.value(node.operand).within(UNARY)}", UNARY, BOOL)
            case ast.UnaryOp(op=ast.USub()):
                return _negative(self.value(node.operand))
            case ast.BinOp():
                return self._arithmetic(node, self.value(node.left), self.value(node.right))
            case ast.BoolOp():
                word, binds = ("&&", AND) if isinstance(node.op, ast.And) else ("||", OR)
                values = [self._as(each, BOOL) for each in node.values]
                return Value(f" {word} ".join(each.within(EQUAL) for each in values), binds, BOOL)
            case ast.Compare():
                return self._compare(node)
            case ast.IfExp():
                test = self.value(node.test).within(AND)
                left, right, kind = _alike(self.value(node.body), self.value(node.orelse), BOOL)
                texts = left.within(CHOICE + 1), right.within(CHOICE + 1)
                return Value(f"{test} ? {texts[0]} : {texts[1]}", CHOICE, kind)
            case ast.Attribute(value=ast.Name(id="np" | "math"), attr="inf" | "nan" | "pi" as name):
                return self._written(getattr(math, name), node)
            case ast.Attribute(attr=name) if self.source.number(node) is not None:
                text = self._written(self.source.number(node) or 0, node).text
                return Value(self.translation.constant(name, text))
            case ast.Attribute(attr="size"):
                return self.view(node.value).size.value()
            case ast.Subscript():
                return self._item(node)
            case ast.Call():
                call = self._function(node)
                if call.type:
                    return call
        instead = "compute it from numbers, places in arrays and calls of kernels"
        raise self.refusal(node, f"{ast.unparse(node)!r} for a number", instead)

    def _as(self, node: ast.expr, kind: str) -> Value:
        """Return a number as one of a type, which must represent it."""
        value = self.value(node)
        if _widest(value.type, kind) != kind:
            what = f"{ast.unparse(node)!r}, of type {value.type}, for {kind}"
            raise self.refusal(node, what, CONVERSIONS[kind])
        return value.to(kind)

    def _name(self, node: ast.Name) -> Value:
        name = node.id
        if name in self.source.locals - self.arrays.keys():
            self._assigned(node)
            return Value(self._safe(name), ATOM, self.types.get(name, BOOL))
        number = self.source.number(node)
        if number is None:
            raise self.refusal(node, f"the name {name!r}", "use arguments and constants")
        single = self.source.single(name) if self.translation.single else None
        if single is None:
            constant = self._written(number, node)
        else:
            constant = Value(literal(single, single=True), ATOM, REAL)
        return constant._replace(
            text=self.translation.constant(name.strip("_").upper(), constant.text)
        )

    def _assigned(self, node: ast.Name) -> None:
        """Raise an error for a name that may be unassigned here."""
        if node.id not in self.known:
            what = f"{node.id!r} where it may not be assigned"
            raise self.refusal(node, what, "assign it before the branch or loop")

    def _written(self, number: int | float, node: ast.AST) -> Value:
        """Return a literal in C; raise an error if `int` or single precision cannot represent it."""
        if not isinstance(number, float):
            if abs(number) > LARGEST_INTEGER:
                raise self.refusal(node, f"the whole number {number}", f"write {number}.0")
            return Value(str(int(number)), ATOM, BOOL if isinstance(number, bool) else INT)
        is_literal = self.translation.single or isinstance(node, ast.Constant)
        if (
            is_literal
            and number
            and math.isfinite(number)
            and not SMALLEST_CONSTANT < abs(number) < LARGEST_CONSTANT
        ):
            what = f"the number {number!r}, which single precision has no room for, or rounds away"
            raise self.refusal(node, what, "name it, and add it to the table SINGLE of the module")
        text = literal(number, single=self.translation.single)
        return Value("((mck_real)NAN)" if math.isnan(number) else text, ATOM, REAL)

    def _arithmetic(self, node: ast.BinOp | ast.AugAssign, left: Value, right: Value) -> Value:
        squared = isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow)
        if squared and right.text == "2" and "(" not in left.text:
            return Value(f"{left.within(UNARY)} * {left.within(UNARY)}", TIMES, left.type)
        if type(node.op) not in ARITHMETIC:
            raise self.refusal(node, "this operator", "use + - * / // %, ** 2 of a name, math.pow")
        left, right, kind = _alike(left, right, REAL if isinstance(node.op, ast.Div) else INT)
        if kind == REAL and isinstance(node.op, ast.FloorDiv | ast.Mod):
            raise self.refusal(node, "// or % of real numbers", "use math.floor(x / y)")
        word = ARITHMETIC[type(node.op)]
        binds = PLUS if word in "+-" else TIMES
        return Value(f"{left.within(binds)} {word} {right.within(binds + 1)}", binds, kind)

    def _compare(self, node: ast.Compare) -> Value:
        lefts = [node.left, *node.comparators]
        links = [*zip(lefts, node.ops, node.comparators, strict=False)]
        left_node, op, right_node = links[0]
        within = isinstance(op, ast.In) and isinstance(right_node, ast.Tuple) and len(links) == 1
        if within:
            links = [(left_node, ast.Eq(), each) for each in getattr(right_node, "elts", ())]
        if within or len(links) > 1:
            each = [ast.copy_location(ast.Compare(a, [b], [c]), node) for a, b, c in links]
            return self.value(ast.BoolOp(ast.Or() if within else ast.And(), [*each]))
        if type(op) not in COMPARISON:
            raise self.refusal(node, "this comparison", "use < <= > >= == != or in")
        first, second, _ = _alike(self.value(left_node), self.value(right_node))
        word = COMPARISON[type(op)]
        text = f"{first.within(RELATION + 1)} {word} {second.within(RELATION + 1)}"
        return Value(text, EQUAL if word in ("==", "!=") else RELATION, BOOL)

    def _function(self, node: ast.Call) -> Value:
        name = ast.unparse(node.func)
        module, _, plain = name.rpartition(".")
        if name in ("min", "max", "abs", "int"):
            return self._bounded(name, [self.value(each) for each in node.args])
        if module in ("math", "np"):
            if plain not in FUNCTIONS:
                raise self.refusal(node, f"{name}()", f"use {', '.join(sorted(FUNCTIONS))}")
            texts = [self.value(each).to(REAL).text for each in node.args]
            return Value(f"{plain}{'f' * self.translation.single}({', '.join(texts)})", ATOM, REAL)
        return self._call(node)

    def _bounded(self, name: str, values: list[Value]) -> Value:
        """Return the smallest, the largest, the size or the whole part of numbers."""
        real, result = any(each.type == REAL for each in values), values[0]
        if name == "int":
            return Value(f"(int){result.within(UNARY)}", UNARY) if real else result
        if name == "abs" and real:
            return Value(f"fabs{'f' * self.translation.single}({result.text})", ATOM, REAL)
        if name == "abs":
            name, values = "max", [result, _negative(result)]
        for other in values[1:]:
            if real:
                text = f"mck_{name}({result.to(REAL).text}, {other.to(REAL).text})"
                result = Value(text, ATOM, REAL)
            else:
                a, b = result.within(RELATION + 1), other.within(RELATION + 1)
                result = Value(f"({b} {'<' if name == 'min' else '>'} {a} ? {b} : {a})")
        return result

    def _callee(self, node: ast.Call) -> Function:
        """Return the function that is called, with the functions and tuples that it is given."""
        kernel = self._meaning(node.func)
        if not hasattr(kernel, "py_func"):
            what = f"a call of {ast.unparse(node.func)}()"
            raise self.refusal(node, what, "call kernels, min, max, abs, math.…")
        names = source_of(kernel).given
        if len(names) != len(node.args) or node.keywords:
            raise self.refusal(node, "arguments by name", "give every argument by its place")
        meanings = zip(names, map(self._meaning, node.args), strict=True)
        bound = [(name, len(each) if isinstance(each, list) else each) for name, each in meanings]
        return self.translation.add(kernel, tuple(each for each in bound if each[1] is not None))

    def _meaning(self, node: ast.expr) -> Any:
        """Return the kernel that a name means, or the arrays of a tuple; None for all else."""
        if isinstance(node, ast.Tuple):
            return node.elts
        if not isinstance(node, ast.Name) or node.id in self.types:
            return None
        meaning = self.bound.get(node.id, self.source.globals.get(node.id))
        arrays = self.arrays.get(node.id)
        return (
            arrays if isinstance(arrays, list) else meaning if hasattr(meaning, "py_func") else None
        )

    def _call(self, node: ast.Call, pointers: Sequence[str] = ()) -> Value:
        """Return a call, with pointers for results after the first."""
        callee = None if self._meaning(node.func) is accumulate else self._callee(node)
        if (callee is None or callee.written) and node is not self.alone:
            what = f"{ast.unparse(node.func)}(), which fills arrays, within another expression"
            raise self.refusal(node, what, "name its result first, x = f(a)")
        if callee is None:
            return self._accumulate(*node.args)
        pointers = pointers or [self._pointer(ast.Name("_"), kind) for kind in callee.returns[1:]]
        texts = ", ".join([*self._arguments(node, callee), *pointers])
        return Value(f"{callee.name}({texts})", ATOM, next(iter(callee.returns), ""))

    def _arguments(self, node: ast.Call, callee: Function) -> Iterator[str]:
        for parameter in callee.parameters:
            argument = node.args[parameter.place]
            if not parameter.asks:
                yield self._as(argument, parameter.type).text
                continue
            items = self._meaning(argument)
            item = items[parameter.item] if isinstance(items, list) else argument
            view = item if isinstance(item, View) else self.view(item)
            if parameter.name in callee.written:
                self.function.written |= {*view.roots}
            if parameter.asks == "columns" and view.columns is None:
                raise self.refusal(argument, "an array without rows here", "reshape it")
            columns = view.columns.text if view.columns else ""
            size = view.size.value().text
            yield {"itself": view.place(), "size": size, "columns": columns}[parameter.asks]

    def _accumulate(self, total: ast.expr, change: ast.expr, lost: ast.expr, at: ast.expr) -> Value:
        """Return a sum, which in single precision carries what rounding loses."""
        sum_, addend, _ = _alike(self.value(total), self.value(change), REAL)
        if not self.translation.single:
            return Value(f"{sum_.within(PLUS)} + {addend.within(PLUS + 1)}", PLUS, REAL)
        element = self._item(ast.Subscript(lost, at))
        self._register(ast.Subscript(lost, at), REAL)
        return Value(f"mck_sum({sum_.text}, {addend.text}, &{element.text})", ATOM, REAL)

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
                pointer = each.asks == "itself"
                words.append(
                    f"{const}mck_real *{name}" if pointer else f"{TYPES[each.type]} {name}"
                )
        kind, *kinds = [TYPES[each] for each in function.returns] or ["void"]
        words += [f"{each} *{name}" for each, name in zip(kinds, self.results, strict=True)]
        head = wrapped(f"static {kind} {function.name}({', '.join(words) or 'void'})")
        doc = commented(re.sub(r"`+", "`", ast.get_docstring(self.source.tree) or ""))
        about = [f"/* {doc}".replace("\n", "\n * ").replace(" * \n", " *\n") + " */"] if doc else []
        function.text = "\n".join([*about, *head, "{", body, "}", ""])


def _alike(left: Value, right: Value, kind: str = INT) -> tuple[Value, Value, str]:
    """Return two numbers in the type that holds both, and that type."""
    kind = _widest(left.type, right.type, kind)
    return left.to(kind), right.to(kind), kind


def _widest(*kinds: str) -> str:
    """Return the type that holds all of some."""
    return max(kinds, key=[*TYPES].index)


def _alone(node: ast.stmt) -> ast.expr | None:
    """Return the part of a statement that is computed before all else and once, as in Python."""
    value = getattr(node, "value", getattr(node, "test", None))
    while isinstance(value, ast.UnaryOp | ast.Subscript):
        value = value.operand if isinstance(value, ast.UnaryOp) else value.value
    targets = (each for target in getattr(node, "targets", []) for each in ast.walk(target))
    places = [each for each in targets if isinstance(each, ast.Subscript)]
    return None if isinstance(node, ast.AugAssign) or len(places) > 1 else value


def _negative(value: Value) -> Value:
    text = value.within(UNARY)
    text = f"({text})" if text.startswith("-") else text
    return Value(f"-{text}", UNARY, _widest(value.type, INT))


def _without_idle(text: str) -> str:
    """Return a body without constants that only sizes were read from, which C does not need."""
    pattern = re.compile(r"^ *const (?:int|mck_real) \*?(\w+) = (?:(?!\w\()[^;])*;\n?", re.M)
    for match in pattern.finditer(text):
        if len(re.findall(rf"\b{match[1]}\b", text)) == 1:
            return _without_idle(text.replace(match[0], "", 1))
    return text


def _declaring(body: Sequence[ast.stmt], name: str) -> ast.stmt:
    """Return the statement with which, or before which, C declares a local name.

    It is in the innermost block that has all uses, and before a loop that may carry a value through.
    """
    uses = [statement for statement in body if name in used(statement)]
    first = uses[0]
    blocks = [getattr(first, part, []) for part in ("body", "orelse")]
    inner = [block for block in blocks if name in used(*block)]
    head = getattr(first, "test", getattr(first, "iter", None))
    if len(uses) > 1 or len(inner) != 1 or (head is not None and name in used(head)):
        return first
    inner_first = _declaring(inner[0], name)
    assigns = isinstance(inner_first, ast.Assign) and name not in used(inner_first, how=ast.Load)
    if isinstance(first, ast.For | ast.While) and inner_first in inner[0] and not assigns:
        return first
    return inner_first
