"""Calls: of translated functions, of `math` and `np`, of makers of named tuples."""

import ast
import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from gaitchain.balance.packed_state import put
from gaitchain.export.c_literals import literal
from gaitchain.export.c_types import (
    BOOL,
    INT,
    REAL,
    Array,
    Linear,
    Nothing,
    Scalar,
    Static,
    Struct,
    Type,
    Value,
)
from gaitchain.export.expressions import Expressions
from gaitchain.export.mutation import plain, syntax_of
from gaitchain.export.scope import bare

_SAME: tuple[str, ...] = ("sin", "cos", "tan", "acos", "atan2", "sqrt", "exp")
_SAME += ("sinh", "cosh", "hypot", "isnan")
_MATH: Mapping[Any, str] = {getattr(math, name): name for name in _SAME} | {
    math.remainder: "remainder",
    min: "lesser",
    max: "greater",
}


class Program(Protocol):
    """What knows all functions and structs, see `program.Program`."""

    def instance(
        self, function: Callable[..., Any], arguments: Sequence[Value]
    ) -> tuple[str, Type]:
        """Return the name in C of a function for these arguments, and its result."""

    def struct(self, name: str, fields: Sequence[tuple[str, Type]]) -> Struct:
        """Return the struct of this name."""

    def makes_room(self, name: str) -> bool:
        """Whether a function of C would only return what holds no numbers yet."""

    def table(self, values: tuple[float, ...]) -> str:
        """Return the name of a table of numbers."""


class Caller:
    """Translates calls."""

    def __init__(self, program: Program) -> None:
        """Know the program's functions."""
        self._program = program

    def call(self, node: ast.Call, expressions: Expressions) -> Value:
        """Translate a call.

        Raises:
            ExportError: it is none of the subset.
        """
        if isinstance(node.func, ast.Attribute):
            owner = expressions.named(node.func.value)
            if isinstance(owner, Value):
                return self._method(node, owner, expressions)
        called = expressions.named(node.func)
        assert isinstance(called, Static)
        function: Any = called.value
        if function in (np.empty, np.zeros):
            return self._new_array(node, function is np.zeros, expressions)
        if function is put:
            return self._put(node, expressions)
        arguments = [expressions.value(argument) for argument in node.args]
        if isinstance(function, type) and hasattr(function, "_fields"):
            return self._make(node, function, arguments, expressions)
        simple = self._simple(function, arguments)
        return simple or self._function(node, function, arguments, expressions)

    def _simple(self, function: Any, arguments: list[Value]) -> Value | None:
        """Return the call of a function of numbers that C has, too."""
        codes = [argument.code for argument in arguments]
        if function in _MATH:
            kind = BOOL if function is math.isnan else REAL
            return Value(kind, f"{_MATH[function]}({', '.join(codes)})")
        if function is abs:
            return Value(REAL, f"fabs({codes[0]})")
        if function in (float, bool) and isinstance(arguments[0].type, Scalar):
            return _converted(function, arguments[0])
        if function is len and isinstance(arguments[0].type, Array):
            size = arguments[0].type.shape[0]
            return Value(INT, str(size), Linear(size))
        return None

    def _method(self, node: ast.Call, owner: Value, ex: Expressions) -> Value:
        assert isinstance(node.func, ast.Attribute)
        if isinstance(owner.type, Array) and node.func.attr == "copy":
            return ex.each(node, [owner], lambda at: at[0])
        if isinstance(owner.type, Struct) and node.func.attr == "_replace":
            made = ex.scope.fresh(owner.type)
            fields = [(part.arg or "", ex.value(part.value)) for part in node.keywords]
            ex.scope.emit(f"{made.code} = {owner.code};")
            for name, value in fields:
                ex.scope.emit(f"{made.code}.{name} = {value.code};")
            return made
        ex.scope.refuse(node, "is no method of the subset")

    def _new_array(self, node: ast.Call, zero: bool, ex: Expressions) -> Value:
        size = node.args[0]
        sizes = size.elts if isinstance(size, ast.Tuple) else [size]
        shape = []
        for part in sizes:
            linear = ex.value(part).linear
            if linear is None or linear.known is None:
                ex.scope.refuse(node, "its size is not known")
            shape.append(linear.known)
        made = ex.scope.fresh(Array(tuple(shape)))
        if zero:
            ex.fill(made, [], lambda _: "0.0")
            return made
        return replace(made, blank=True)

    def _put(self, node: ast.Call, ex: Expressions) -> Value:
        place, value = (ex.value(argument) for argument in node.args)
        ex.scope.emit(f"{place.code} = {bare(value.code)};")
        return Value(Nothing(), "")

    def _make(
        self, node: ast.AST, kind: Any, arguments: list[Value], ex: Expressions
    ) -> Value:
        """Make a named tuple."""
        names = kind._fields
        if len(arguments) != len(names):
            ex.scope.refuse(node, f"needs {len(names)} arguments, by position")
        return self._filled(kind.__name__.lstrip("_"), names, arguments, ex)

    def tuple_of(self, parts: Sequence[Value], expressions: Expressions) -> Value:
        """Make a plain tuple."""
        letters = "".join(_letters(part.type) for part in parts)
        names = [f"v{i}" for i in range(len(parts))]
        return self._filled(f"Tuple_{letters.strip('_')}", names, parts, expressions)

    def _filled(
        self, name: str, names: Sequence[str], parts: Sequence[Value], ex: Expressions
    ) -> Value:
        types = [_packed(part.type) for part in parts]
        kind = self._program.struct(name, list(zip(names, types, strict=True)))
        if not any(isinstance(part.type, Array) for part in parts):
            codes = ", ".join(part.code for part in parts)
            return Value(kind, f"(({kind.name}){{{codes}}})")
        made = ex.scope.fresh(kind)
        for field, part in zip(names, parts, strict=True):
            self._write_field(made.member(field), part, ex)
        return replace(made, blank=all(part.blank for part in parts))

    def _write_field(self, place: Value, part: Value, ex: Expressions) -> None:
        if isinstance(part.type, Array):
            if part.blank:
                del ex.scope.declared[part.code]  # the field has no numbers yet, too
                return
            ex.fill(place, [part], lambda at: at[0])
        else:
            ex.scope.emit(f"{place.code} = {bare(part.code)};")

    def _function(
        self, node: ast.Call, called: Any, arguments: list[Value], ex: Expressions
    ) -> Value:
        function = plain(called)
        if not inspect.isfunction(function) or node.keywords:
            ex.scope.refuse(node, "is no call of the subset")
        missing = len(syntax_of(function).args.args) - len(arguments)
        if missing:
            defaults = (function.__defaults__ or ())[-missing:]
            arguments = [*arguments, *(_default(value) for value in defaults)]
        name, returns = self._program.instance(function, arguments)
        if self._program.makes_room(name):
            return replace(ex.scope.fresh(returns), blank=True)
        handed = [argument.address for argument in arguments]
        if isinstance(returns, Nothing):
            ex.scope.emit(f"{name}({', '.join(handed)});")
            return Value(returns, "")
        if isinstance(returns, Scalar):
            return Value(returns, f"{name}({', '.join(handed)})")
        made = ex.scope.fresh(returns)
        ex.scope.emit(f"{name}({', '.join([*handed, made.address])});")
        return made

    def constant(self, value: tuple[float, ...]) -> Value:
        """Return a table of numbers."""
        shape = Array((len(value),), (), const=True)
        return Value(shape, self._program.table(value))


def _converted(function: Any, number: Value) -> Value:
    """Return a number as one of another type."""
    kind, code = number.type, number.code
    if function is bool:
        return Value(BOOL, code if kind == BOOL else f"({code} != 0)")
    # One whole number over another would have no digits after the point.
    return Value(REAL, code if kind == REAL else f"((double){code})")


def _default(value: Any) -> Value:
    return Value(REAL, literal(float(value)))


def _packed(kind: Type) -> Type:
    return kind.packed if isinstance(kind, Array) else kind


def _letters(kind: Type) -> str:
    if isinstance(kind, Array):
        return "a" + "x".join(map(str, kind.shape))
    assert isinstance(kind, Scalar | Struct)
    short = kind.name.removeprefix("gait_")
    return short[0] if isinstance(kind, Scalar) else f"_{short}_"
