"""The function that is being translated: its variables, and the lines made so far."""

import ast
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import count
from typing import Any, NoReturn

from gaitchain.errors import ExportError
from gaitchain.export.c_types import (
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

# Names that mean something else in C, or in the code around it.
_KEYWORDS = """
auto break case char const continue default do double else enum extern float for goto
if inline int long register restrict return short signed sizeof static struct switch
typedef union unsigned void volatile while bool true false
"""
_FUNCTIONS = """
acos acosh asin atan atan2 ceil cos cosh exp fabs floor fmod hypot isnan log pow sin
sinh sqrt tan tanh remainder lesser greater squared out
"""
_TAKEN = frozenset((_KEYWORDS + _FUNCTIONS).split())
_OURS = re.compile(r"[ti][0-9]+")  # variables that are made here
Named = Value | Span | Static


def bare(code: str) -> str:
    """Return an expression without parentheses around all of it."""
    depth = 0
    for place, sign in enumerate(code):
        depth += (sign == "(") - (sign == ")")
        if depth == 0:
            return bare(code[1:-1]) if place == len(code) - 1 > 0 else code
    return code


def c_name(name: str) -> str:
    """Return a name that C leaves free."""
    return f"{name}_" if name in _TAKEN or _OURS.fullmatch(name) else name


@dataclass
class Scope:
    """Variables and lines of one function."""

    function: Callable[..., Any]
    """The plain Python function."""
    used: frozenset[str]
    """Names that it reads: what nobody reads is not computed."""
    names: dict[str, Named] = field(default_factory=dict)
    declared: dict[str, str] = field(default_factory=dict)
    """Declarations of variables by name."""
    lines: list[str] = field(default_factory=list)
    returns: Type | None = None
    blank: bool = False
    """Whether what it returns holds no numbers yet: it makes room only."""
    depth: int = 1
    loops: int = 0
    branches: int = 0
    _numbers: Iterator[int] = field(default_factory=lambda: count(1))

    def refuse(self, node: ast.AST, why: str) -> NoReturn:
        """Refuse what the subset of Python does not have.

        Raises:
            ExportError: always; it names the line.
        """
        text = ast.unparse(node)
        raise ExportError(f"{self.function.__qualname__}: {text!r:.90}: {why}")

    def emit(self, line: str) -> None:
        """Add a line."""
        if self.branches:
            raise ExportError(
                f"{self.function.__qualname__}: needs a statement inside a condition: "
                f"{line}"
            )
        self.lines.append("    " * self.depth + line)

    @contextmanager
    def block(self, head: str, tail: str = "}") -> Iterator[None]:
        """Put the lines that are added meanwhile in braces."""
        self.emit(f"{head} {{")
        self.depth += 1
        yield
        self.depth -= 1
        self.emit(tail)

    @contextmanager
    def branch(self) -> Iterator[None]:
        """Refuse statements meanwhile: they would run whatever the condition is."""
        self.branches += 1
        yield
        self.branches -= 1

    def fresh(self, kind: Type) -> Value:
        """Return a new variable without a value."""
        name = f"t{next(self._numbers)}"
        if isinstance(kind, Array):
            kind = kind.packed
        self.declared[name] = declaration(kind, name)
        return Value(kind, name)

    def settle(self, value: Value) -> Value:
        """Return a value whose expression may be used more than once."""
        if isinstance(value.type, Array) or value.code.isidentifier():
            return value
        if value.lasting or not value.code.startswith("("):
            return value
        held = self.fresh(value.type)
        self.emit(f"{held.code} = {bare(value.code)};")
        return held

    def variable(self, node: ast.AST, name: str, value: Value) -> Value:
        """Return the variable of a name, declared for what it is to hold."""
        own, kind = c_name(name), value.type
        old = self.names.get(name)
        if isinstance(old, Value) and isinstance(kind, Scalar):
            kind = _joined(old.type, kind) or self.refuse(node, "changes its type")
        if isinstance(kind, Scalar):
            self.declared.setdefault(own, "")
            wider = kind == REAL or not self.declared[own].startswith("double")
            if wider and own not in self._arguments:
                self.declared[own] = declaration(kind, own)
            linear = Linear(0, {own: 1}) if kind == INT else None
            return Value(kind, own, linear)
        return self._pointer(node, own, value, old)

    def _pointer(
        self, node: ast.AST, own: str, value: Value, old: Named | None
    ) -> Value:
        kind = value.type
        if isinstance(kind, Array):
            if isinstance(old, Value) and isinstance(old.type, Array):
                if (old.type.shape, old.type.strides) != (kind.shape, kind.strides):
                    self.refuse(node, "changes its shape, or the way it lies in memory")
                const = kind.const or old.type.const
                kind = Array(kind.shape, kind.strides, const)
            star = "const double *" if kind.const else "double *"
            if own not in self._arguments:
                self.declared[own] = f"{star}{own}"
            return Value(kind, own)
        assert isinstance(kind, Struct)
        star = ("const " if value.const else "") + f"{kind.name} *{own}"
        wanted = star if value.lasting else f"{kind.name} {own}"
        if self.declared.get(own, wanted).removeprefix("const ") != wanted.removeprefix(
            "const "
        ):
            self.refuse(node, "is a copy here and a part of an argument there")
        if wanted.startswith("const ") or own not in self.declared:
            self.declared[own] = wanted
        code = f"(*{own})" if value.lasting else own
        return Value(kind, code, None, value.lasting, value.const)

    @property
    def _arguments(self) -> frozenset[str]:
        code = self.function.__code__
        return frozenset(map(c_name, code.co_varnames[: code.co_argcount]))


def _joined(old: Type, new: Scalar) -> Scalar | None:
    """Return the type of a variable that holds both."""
    if old == new:
        return new
    return REAL if {old, new} == {REAL, INT} else None


def declaration(kind: Type, name: str) -> str:
    """Return the declaration of a variable or a field."""
    if isinstance(kind, Array):
        return f"double {name}[{kind.size}]"
    assert isinstance(kind, Scalar | Struct)
    return f"{kind.name} {name}"
