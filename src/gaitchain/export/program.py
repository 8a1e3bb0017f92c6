"""All that a set of Python functions needs in C: structs, tables, functions in order.

Functions are translated for the types that they are called with, shapes included, as
Numba does; so each array has its size, and each copy its own memory on the stack.
"""

import ast
import inspect
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, get_type_hints

import numpy as np

from gaitchain.errors import ExportError
from gaitchain.export.c_literals import literal
from gaitchain.export.c_types import (
    BOOL,
    INT,
    REAL,
    Array,
    Linear,
    Nothing,
    Scalar,
    Struct,
    Type,
    Value,
)
from gaitchain.export.calls import Caller
from gaitchain.export.expressions import Expressions
from gaitchain.export.mutation import plain, syntax_of, written
from gaitchain.export.scope import Scope, c_name, declaration
from gaitchain.export.statements import Statements, names_read

_SCALARS: dict[Any, Scalar] = {float: REAL, int: INT, bool: BOOL}


class Program:
    """Translates functions and what they call."""

    def __init__(self) -> None:
        """Begin without any function."""
        self._structs: dict[str, Struct] = {}
        self._tables: dict[tuple[float, ...], str] = {}
        self._found: dict[Any, tuple[str, Type]] = {}
        self._code: list[str] = []
        self._names: set[str] = set()
        self._blank: set[str] = set()

    @property
    def structs(self) -> str:
        """Definitions of all structs, in order."""
        return "\n".join(_definition(struct) for struct in self._structs.values())

    @property
    def functions(self) -> str:
        """Tables and functions, each before it is used."""
        tables = (
            f"static const double {name}[{len(values)}] = "
            f"{{{', '.join(map(literal, values))}}};\n"
            for values, name in self._tables.items()
        )
        return "\n".join([*tables, *self._code])

    def type_of(self, value: Any) -> Type:
        """Return the type of a value of Python."""
        if isinstance(value, np.ndarray):
            return Array(value.shape)
        if hasattr(value, "_fields"):
            pairs = zip(value._fields, value, strict=True)
            fields = [(name, self.type_of(part)) for name, part in pairs]
            return self.struct(type(value).__name__, fields)
        return _SCALARS[type(value)]

    def type_of_kind(self, kind: Any) -> Type:
        """Return the type of a named tuple of numbers and other such tuples."""
        if kind in _SCALARS:
            return _SCALARS[kind]
        hints = get_type_hints(kind).items()
        fields = [(name, self.type_of_kind(part)) for name, part in hints]
        return self.struct(kind.__name__, fields)

    def struct(self, name: str, fields: Sequence[tuple[str, Type]]) -> Struct:
        """Return the struct of this name.

        Raises:
            ExportError: one of other fields has that name.
        """
        found = Struct(f"gait_{_snake(name.removeprefix('Gait'))}", tuple(fields))
        if self._structs.setdefault(name, found) != found:
            raise ExportError(f"{name} has fields of two kinds; give each one kind")
        return found

    def table(self, values: tuple[float, ...]) -> str:
        """Return the name of a table of numbers."""
        return self._tables.setdefault(values, f"numbers_{len(self._tables) + 1}")

    def translate(self, function: Callable[..., Any], *types: Type) -> str:
        """Translate a function for arguments of these types; return its name in C."""
        names = [argument.arg for argument in syntax_of(plain(function)).args.args]
        values = [Value(t, n) for t, n in zip(types, names, strict=True)]
        return self.instance(plain(function), values)[0]

    def instance(
        self, function: Callable[..., Any], arguments: Sequence[Value]
    ) -> tuple[str, Type]:
        """Return the name in C of a function for such arguments, and what it returns.

        Raises:
            ExportError: the function is not of the translated subset.
        """
        taken = _parameters(function, arguments)
        key = function, tuple((value.type, _known(value)) for value in taken)
        if key not in self._found:
            name = self._free_name(function)
            returns = self._write(function, name, taken)
            self._found[key] = name, returns
        return self._found[key]

    def makes_room(self, name: str) -> bool:
        """Whether a function of C would only return what holds no numbers yet."""
        return name in self._blank

    def _free_name(self, function: Callable[..., Any]) -> str:
        # The module's name, because variables are often named like functions.
        module = function.__module__.rpartition(".")[2]
        plain_name = f"{module}_{function.__name__.lstrip('_')}"
        name, number = plain_name, 1
        while name in self._names:
            number += 1
            name = f"{plain_name}_{number}"
        self._names.add(name)
        return name

    def _write(
        self, function: Callable[..., Any], name: str, taken: Sequence[Value]
    ) -> Type:
        definition = syntax_of(function)
        scope = Scope(function, frozenset(names_read(definition)))
        for argument, value in zip(definition.args.args, taken, strict=True):
            scope.names[argument.arg] = value
        Statements(scope, Expressions(scope, Caller(self))).body(definition)
        returns = scope.returns or Nothing()
        if scope.blank:
            self._blank.add(name)
            return returns
        words = set(re.findall(r"\w+", " ".join(scope.lines)))
        arguments = (c_name(argument.arg) for argument in definition.args.args)
        unused = [f"    (void){name};" for name in arguments if name not in words]
        head = _head(name, definition, taken, returns)
        variables = [f"    {text};" for text in scope.declared.values() if text]
        told = (inspect.getdoc(function) or "").partition("\n")[0]
        note = f"/* {function.__module__}.{function.__name__}: {told} */"
        lines = [note, f"{head} {{", *variables, *unused, *scope.lines, "}"]
        self._code.append("\n".join(lines) + "\n")
        return returns


def _parameters(
    function: Callable[..., Any], arguments: Sequence[Value]
) -> list[Value]:
    """Return the arguments as the function sees them."""
    definition, changed = syntax_of(function), written(function)
    sizes = {
        part.id
        for node in ast.walk(definition)
        if isinstance(node, ast.Call) and ast.unparse(node.func) in _MAKERS
        for part in ast.walk(node.args[0])
        if isinstance(part, ast.Name)
    }
    taken = []
    for node, value in zip(definition.args.args, arguments, strict=True):
        name, kind, const = c_name(node.arg), value.type, node.arg not in changed
        if isinstance(kind, Array):
            taken.append(Value(Array(kind.shape, kind.strides, const), name))
        elif isinstance(kind, Struct):
            taken.append(Value(kind, f"(*{name})", None, True, const))
        else:
            fixed = node.arg in sizes and value.linear is not None
            taken.append(Value(kind, name, value.linear if fixed else None))
    return [_named_whole(value) for value in taken]


_MAKERS = ("np.empty", "np.zeros")


def _snake(name: str) -> str:
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower()


def _known(value: Value) -> int | None:
    return value.linear.known if value.linear else None


def _named_whole(value: Value) -> Value:
    """Let slices be computed from a whole number that is not known."""
    if value.type != INT or value.linear is not None:
        return value
    return replace(value, linear=Linear(0, {value.code: 1}))


def _head(
    name: str, definition: ast.FunctionDef, taken: Sequence[Value], returns: Type
) -> str:
    """Return the first line of a function."""
    nodes = definition.args.args
    parts = [
        _parameter(node.arg, value) for node, value in zip(nodes, taken, strict=True)
    ]
    kind = "void"
    if isinstance(returns, Scalar):
        kind = returns.name
    elif isinstance(returns, Array):
        parts.append("double *out")
    elif isinstance(returns, Struct):
        parts.append(f"{returns.name} *out")
    return f"static {kind} {name}({', '.join(parts)})"


def _parameter(name: str, value: Value) -> str:
    name, kind = c_name(name), value.type
    if isinstance(kind, Array):
        return f"{'const ' if kind.const else ''}double *{name}"
    if isinstance(kind, Struct):
        return f"{'const ' if value.const else ''}{kind.name} *{name}"
    assert isinstance(kind, Scalar)
    return f"{kind.name} {name}"


def _definition(struct: Struct) -> str:
    fields = "".join(f"    {declaration(t, name)};\n" for name, t in struct.fields)
    return f"typedef struct {{\n{fields}}} {struct.name};\n"
