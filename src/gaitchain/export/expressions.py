"""Expressions of the compiled subset of Python, as C."""

import ast
from collections.abc import Callable, Sequence
from typing import Any, Protocol

from gaitchain.export.c_literals import literal
from gaitchain.export.c_types import (
    BOOL,
    INT,
    REAL,
    Array,
    Linear,
    Scalar,
    Span,
    Static,
    Struct,
    Type,
    Value,
)
from gaitchain.export.scope import Named, Scope, bare

_OPERATORS: dict[type[ast.AST], str] = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.FloorDiv: "/",
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Eq: "==",
    ast.NotEq: "!=",
    ast.And: "&&",
    ast.Or: "||",
    ast.USub: "-",
    ast.Not: "!",
}
_NO_AXIS = 0  # numbers of an axis that is not known yet: ends count from the first


class Calls(Protocol):
    """What makes calls and structs, see `calls.Caller`."""

    def call(self, node: ast.Call, expressions: "Expressions") -> Value:
        """Translate a call."""

    def tuple_of(self, parts: Sequence[Value], expressions: "Expressions") -> Value:
        """Make a plain tuple."""

    def constant(self, value: tuple[float, ...]) -> Value:
        """Return a table of numbers."""


class Expressions:
    """Translates expressions within one function."""

    def __init__(self, scope: Scope, calls: Calls) -> None:
        """Translate for a function; what calls are is told by `calls`."""
        self.scope, self._calls = scope, calls

    def value(self, node: ast.expr) -> Value:
        """Translate an expression that has a value in C.

        Raises:
            ExportError: it is none of the subset.
        """
        found = self.named(node)
        if isinstance(found, Static):
            return self.fixed(node, found.value)
        if isinstance(found, Span):
            self.scope.refuse(node, "is a slice")
        return found

    def named(self, node: ast.expr) -> Named:
        """Translate an expression, which may also be known beforehand."""
        translate: Callable[[Any], Named] | None
        translate = getattr(self, f"_{type(node).__name__.lower()}", None)
        if translate is None:
            self.scope.refuse(node, "is not in the translated subset")
        found: Named = translate(node)
        return found

    def real(self, node: ast.expr) -> str:
        """Translate a number."""
        value = self.value(node)
        if not isinstance(value.type, Scalar):
            self.scope.refuse(node, "must be a number")
        return value.code

    def _constant(self, node: ast.Constant) -> Named:
        return Static(node.value)

    def fixed(self, node: ast.AST, value: object) -> Value:
        """Return a number that is known beforehand."""
        if isinstance(value, bool):
            return Value(BOOL, str(value).lower())
        if isinstance(value, int):
            return Value(INT, str(value), Linear(value))
        if isinstance(value, float):
            return Value(REAL, literal(value))
        if isinstance(value, tuple) and all(isinstance(x, float) for x in value):
            return self._calls.constant(value)
        self.scope.refuse(node, "is no number")

    def _name(self, node: ast.Name) -> Named:
        if node.id in self.scope.names:
            return self.scope.names[node.id]
        builtins = {"min": min, "max": max, "abs": abs, "len": len, "float": float}
        builtins |= {"bool": bool, "range": range, "slice": slice}
        known = {**builtins, **self.scope.function.__globals__}
        if node.id not in known or node.id in self.scope.function.__code__.co_varnames:
            self.scope.refuse(node, "has no value here")
        return Static(known[node.id])

    def _attribute(self, node: ast.Attribute) -> Named:
        owner = self.named(node.value)
        if isinstance(owner, Static):
            return Static(getattr(owner.value, node.attr))
        if not isinstance(owner, Value):
            self.scope.refuse(node, "has no parts")
        if isinstance(owner.type, Array):
            return self._array_part(node, owner)
        if not isinstance(owner.type, Struct):
            self.scope.refuse(node, "has no parts")
        return self.scope.settle(owner).member(node.attr)

    def _array_part(self, node: ast.Attribute, owner: Value) -> Value:
        assert isinstance(owner.type, Array)
        if node.attr != "T":
            self.scope.refuse(node, "is no part of an array here")
        shape, strides = owner.type.shape[::-1], owner.type.strides[::-1]
        return Value(Array(shape, strides, owner.type.const), owner.code)

    def _subscript(self, node: ast.Subscript) -> Named:
        if isinstance(node.value, ast.Attribute) and node.value.attr == "shape":
            array = self.value(node.value.value)
            assert isinstance(array.type, Array)
            size = array.type.shape[ast.literal_eval(node.slice)]
            return Value(INT, str(size), Linear(size))
        owner = self.value(node.value)
        if isinstance(owner.type, Struct):
            return self._item(node, owner)
        return self.element(node, owner)

    def _item(self, node: ast.Subscript, owner: Value) -> Value:
        """Return a part of a tuple, or the record of a row."""
        assert isinstance(owner.type, Struct)
        number = ast.literal_eval(node.slice)
        if owner.type.name == "gait_walk" and number == 0:
            return owner
        name = owner.type.fields[number][0]
        return self.scope.settle(owner).member(name)

    def element(self, node: ast.Subscript, owner: Value) -> Value:
        """Return an element or a view of an array."""
        if not isinstance(owner.type, Array):
            self.scope.refuse(node, "has no elements")
        picks = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        kind, offset = owner.type, [""]
        shape, strides = [], []
        axes = zip(kind.shape, kind.strides, strict=True)
        for pick, (size, stride) in zip(picks, axes, strict=False):
            index = self._index(pick, size)
            first = index.first if isinstance(index, Span) else index.code
            offset.append("" if first == "0" else _product(first, stride))
            if isinstance(index, Span):
                shape.append(index.count)
                strides.append(stride)
        shape += kind.shape[len(picks) :]
        strides += kind.strides[len(picks) :]
        place = " + ".join(filter(None, offset)) or "0"
        if not shape:
            return Value(REAL, f"{owner.code}[{place}]")
        code = owner.code if place == "0" else f"({owner.code} + {place})"
        return Value(Array(tuple(shape), tuple(strides), kind.const), code)

    def _index(self, pick: ast.expr, size: int) -> Value | Span:
        """Return an index within an axis, or a slice."""
        if isinstance(pick, ast.Slice):
            start = self.value(pick.lower) if pick.lower else None
            stop = self.value(pick.upper) if pick.upper else None
            if pick.step:
                self.scope.refuse(pick, "slices have no steps here")
            return self._within(pick, self._span(pick, start, stop, size), size)
        index = self.named(pick)
        if isinstance(index, Static):
            index = self.fixed(pick, index.value)
        if isinstance(index, Span):
            return self._within(pick, index, size)
        return self._counted(pick, index, size)

    def _counted(self, pick: ast.expr, index: Value, size: int) -> Value:
        """Return an index, counted from the first number.

        One that is not known before the code runs is not checked: below 0 it would
        count from the end in Python, and not in C.
        """
        if index.type != INT:
            self.scope.refuse(pick, "an index must be a whole number")
        known = index.linear.known if index.linear else None
        if known is None:
            return index
        if not -size <= known < size:
            self.scope.refuse(pick, f"is outside of {size} numbers")
        return Value(INT, str(known % size))

    def _within(self, node: ast.AST, span: Span, size: int) -> Span:
        """Refuse a slice that reaches beyond an axis, where that is known."""
        first = int(span.first) if span.first.isdigit() else 0
        if first + span.count > size:
            self.scope.refuse(node, f"is outside of {size} numbers")
        return span

    def _span(
        self, node: ast.AST, start: Value | None, stop: Value | None, size: int
    ) -> Span:
        """Return a slice, whose length must follow from its ends."""
        first = self._end(node, start or Value(INT, "0", Linear(0)), size)
        last = self._end(node, stop or Value(INT, str(size), Linear(size)), size)
        if first.linear is None or last.linear is None:
            self.scope.refuse(node, "the slice's length is not known")
        count = last.linear.plus(first.linear, -1).known
        if count is None:
            self.scope.refuse(node, "the slice's length is not known")
        if count < 1:
            self.scope.refuse(node, "the slice is empty")
        return Span(first.code, count)

    def _end(self, node: ast.AST, end: Value, size: int) -> Value:
        """Count a known end that is negative from the end of an axis."""
        known = end.linear.known if end.linear else None
        if known is None or known >= 0:
            return end
        if known < -size:
            self.scope.refuse(node, "begins or ends before the first number")
        return Value(INT, str(known + size), Linear(known + size))

    def _tuple(self, node: ast.Tuple) -> Value:
        return self._calls.tuple_of([self.value(part) for part in node.elts], self)

    def _call(self, node: ast.Call) -> Named:
        called = self.named(node.func) if isinstance(node.func, ast.Name) else None
        if isinstance(called, Static) and called.value is slice:
            if len(node.args) != 2:
                self.scope.refuse(node, "a slice is made of its first and its end")
            start, stop = (self.value(part) for part in node.args)
            return self._span(node, start, stop, _NO_AXIS)
        return self._calls.call(node, self)

    def _unaryop(self, node: ast.UnaryOp) -> Named:
        value, operator = self.value(node.operand), self._sign(node, node.op)
        if operator == "!" and isinstance(value.type, Scalar):
            return Value(BOOL, f"!({value.code})")
        if operator == "!" or value.type == BOOL:
            self.scope.refuse(node, "is not in the translated subset")
        if isinstance(value.type, Array):
            return self.each(node, [value], lambda at: f"{operator}{at[0]}")
        linear = value.linear and value.linear.times(Linear(-1))
        return Value(value.type, f"{operator}({value.code})", linear)

    def _sign(self, node: ast.expr, operator: ast.AST) -> str:
        """Return an operator in C."""
        found = _OPERATORS.get(type(operator))
        return found or self.scope.refuse(node, "is not in the translated subset")

    def _binop(self, node: ast.BinOp) -> Value:
        left, right = self.value(node.left), self.value(node.right)
        if isinstance(node.op, ast.Pow):
            return self._power(node, left, right)
        sign = self._sign(node, node.op)
        whole = left.type == INT and right.type == INT
        if isinstance(node.op, ast.FloorDiv) and not whole:
            self.scope.refuse(node, "of whole numbers only")
        if BOOL in {left.type, right.type}:
            self.scope.refuse(node, "truth values are not added up: float(...) first")
        if isinstance(left.type, Array) or isinstance(right.type, Array):
            return self.each(node, [left, right], lambda at: f"{at[0]} {sign} {at[1]}")
        if whole:
            return self._whole(node, left, right)
        return Value(REAL, f"({left.code} {sign} {right.code})")

    def _whole(self, node: ast.BinOp, left: Value, right: Value) -> Value:
        """Return the result of an operation on whole numbers.

        `int` of C has 32 bits: a result from 2^31 on is another one than Python's, and
        nothing tells. Whole numbers of a walk count joints, links and rounds.
        """
        linear, (a, b) = None, (left.linear, right.linear)
        if a and b and isinstance(node.op, ast.Add | ast.Sub):
            linear = a.plus(b, 1 if isinstance(node.op, ast.Add) else -1)
        elif a and b and isinstance(node.op, ast.Mult):
            linear = a.times(b)
        elif isinstance(node.op, ast.FloorDiv):
            if not (a and b) or a.known is None or not b.known:
                self.scope.refuse(node, "its operands are not known")
            linear = Linear(a.known // b.known)
        elif isinstance(node.op, ast.Div):
            return Value(REAL, f"((double){left.code} / {right.code})")
        if linear and linear.known is not None:
            return Value(INT, str(linear.known), linear)
        sign = _OPERATORS[type(node.op)]
        return Value(INT, f"({left.code} {sign} {right.code})", linear)

    def _power(self, node: ast.BinOp, base: Value, exponent: Value) -> Value:
        if exponent.code not in {"2", "2.0"} or not isinstance(base.type, Scalar):
            self.scope.refuse(node, "only squares")
        return Value(REAL, f"squared({base.code})")

    def _compare(self, node: ast.Compare) -> Value:
        if isinstance(node.ops[0], ast.In) and isinstance(
            node.comparators[0], ast.Tuple
        ):
            left, members = self.real(node.left), node.comparators[0].elts
            tests = [f"({left} == {self.real(member)})" for member in members]
            return Value(BOOL, f"({' || '.join(tests)})")
        sides = [self.real(part) for part in (node.left, *node.comparators)]
        signs = [self._sign(node, op) for op in node.ops]
        tests = [
            f"({a} {sign} {b})"
            for a, sign, b in zip(sides, signs, sides[1:], strict=False)
        ]
        return Value(BOOL, tests[0] if len(tests) == 1 else f"({' && '.join(tests)})")

    def _boolop(self, node: ast.BoolOp) -> Value:
        first = self._truth(node.values[0])
        with self.scope.branch():
            rest = [self._truth(part) for part in node.values[1:]]
        return Value(BOOL, f"({f' {self._sign(node, node.op)} '.join([first, *rest])})")

    def _truth(self, node: ast.expr) -> str:
        """Translate a part of `and` or `or`, of which Python returns the last one."""
        value = self.value(node)
        if value.type != BOOL:
            self.scope.refuse(node, "must be a truth value: bool(...)")
        return value.code

    def _ifexp(self, node: ast.IfExp) -> Value:
        test = self.real(node.test)
        with self.scope.branch():
            one, other = self.value(node.body), self.value(node.orelse)
        if isinstance(one.type, Struct) and one.lasting and other.lasting:
            code = f"(*({test} ? {one.address} : {other.address}))"
            return Value(one.type, code, None, True, one.const or other.const)
        if not isinstance(one.type, Scalar) or not isinstance(other.type, Scalar):
            self.scope.refuse(node, "both must be numbers, or parts of an argument")
        kind = one.type if one.type == other.type else REAL
        return Value(kind, f"({test} ? {one.code} : {other.code})")

    def each(
        self, node: ast.AST, parts: Sequence[Value], formula: Callable[[list[str]], str]
    ) -> Value:
        """Compute a new array, element by element; numbers count for each of them."""
        shapes = {part.type.shape for part in parts if isinstance(part.type, Array)}
        if len(shapes) != 1:
            self.scope.refuse(node, f"shapes {shapes} differ")
        made = self.scope.fresh(Array(shapes.pop()))
        self.fill(made, [self.scope.settle(part) for part in parts], formula)
        return made

    def fill(
        self, place: Value, parts: Sequence[Value], formula: Callable[[list[str]], str]
    ) -> None:
        """Write a formula of arrays and numbers to each element of an array."""
        assert isinstance(place.type, Array)
        arrays = [place, *parts]
        shape = place.type.shape
        if all(_is_packed(part.type) for part in arrays):
            shape = (place.type.size,)
        names = [f"i{axis}" for axis in range(len(shape))]
        heads = [
            f"for (int {name} = 0; {name} < {size}; {name}++)"
            for name, size in zip(names, shape, strict=True)
        ]
        target, *sources = (_at(part, names) for part in arrays)
        for depth, head in enumerate(heads):
            self.scope.emit("    " * depth + head)
        self.scope.emit("    " * len(heads) + f"{target} = {bare(formula(sources))};")


def _is_packed(kind: Type) -> bool:
    return not isinstance(kind, Array) or kind == Array(kind.shape, (), kind.const)


def _at(part: Value, names: list[str]) -> str:
    """Return the element of an array at some indices, or the number itself."""
    if not isinstance(part.type, Array):
        return part.code
    strides = part.type.strides if len(names) == len(part.type.shape) else (1,)
    places = [_product(n, stride) for n, stride in zip(names, strides, strict=True)]
    return f"{part.code}[{' + '.join(places)}]"


def _product(name: str, factor: int) -> str:
    return name if factor == 1 else f"{name} * {factor}"
