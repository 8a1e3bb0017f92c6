"""Statements of the compiled subset of Python, as C: the body of one function."""

import ast
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence, Set
from dataclasses import replace
from typing import Any

from gaitchain.export.c_types import (
    INT,
    REAL,
    Array,
    Linear,
    Nothing,
    Scalar,
    Span,
    Static,
    Struct,
    Value,
)
from gaitchain.export.expressions import Expressions
from gaitchain.export.mutation import memories, places, root
from gaitchain.export.scope import Named, Scope, bare, c_name


class Statements:
    """Translates the statements of one function."""

    def __init__(self, scope: Scope, expressions: Expressions) -> None:
        """Write the lines to the scope."""
        self._scope, self._ex = scope, expressions
        self._stored: Counter[str] = Counter()

    def body(self, definition: ast.FunctionDef) -> None:
        """Translate a function's body.

        Raises:
            ExportError: it is not of the subset.
        """
        self._stored = Counter(
            node.id
            for node in ast.walk(definition)
            if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
        )
        self._stored.update(argument.arg for argument in definition.args.args)
        self._all(definition.body)

    def _all(self, nodes: Sequence[ast.stmt]) -> None:
        for node in nodes:
            translate: Callable[[Any], None] | None
            translate = getattr(self, f"_{type(node).__name__.lower()}", None)
            if translate is None:
                self._scope.refuse(node, "is not in the translated subset")
            translate(node)

    def _expr(self, node: ast.Expr) -> None:
        if not isinstance(node.value, ast.Constant):  # a docstring
            self._ex.value(node.value)

    def _assign(self, node: ast.Assign) -> None:
        if self._scope.loops:
            self._check_loop(node)
        targets, value = node.targets, node.value
        if len(targets) > 1:
            self._store_in_all(targets, value)
        elif isinstance(targets[0], ast.Tuple) and isinstance(value, ast.Tuple):
            self._parallel(targets[0].elts, value.elts)
        elif isinstance(targets[0], ast.Tuple):
            self._unpack(targets[0], value)
        else:
            self._store(targets[0], self._ex.named(value), value)

    def _store_in_all(self, targets: Sequence[ast.expr], node: ast.expr) -> None:
        """Give one value to several targets."""
        value = self._ex.named(node)
        if isinstance(value, Value):
            if _has_arrays(value) and not value.lasting:
                self._scope.refuse(node, "would be copied for each target")
            value = self._kept(value)
        for target in targets:
            self._store(target, value, node)

    def _check_loop(self, node: ast.Assign) -> None:
        """Refuse arrays that a loop keeps from one round to the next.

        Each place that makes an array has one memory for it: the next round writes
        there, maybe while it reads.
        """
        value = node.value
        parts = value.elts if isinstance(value, ast.Tuple) else [value]
        if any(map(self._names_array, parts)):
            self._scope.refuse(node, "keeps an array under another name in a loop")
        for target in node.targets:
            made = {n.id for n in ast.walk(target) if isinstance(n, ast.Name)}
            read = {n.id for n in ast.walk(node.value) if isinstance(n, ast.Name)}
            known = map(self._scope.names.get, made & read)
            for old in known:
                array = isinstance(old, Value) and isinstance(old.type, Array)
                if array and not isinstance(target, ast.Subscript):
                    self._scope.refuse(node, "makes an array of itself in a loop")

    def _names_array(self, node: ast.expr) -> bool:
        found = self._scope.names.get(node.id) if isinstance(node, ast.Name) else None
        return isinstance(found, Value) and isinstance(found.type, Array)

    def _parallel(
        self, targets: Sequence[ast.expr], values: Sequence[ast.expr]
    ) -> None:
        """Assign several values at once."""
        meet = any(self._meet(target, node) for target in targets for node in values)
        found = []
        for target, node in zip(targets, values, strict=True):
            value = self._ex.named(node)
            if meet and isinstance(value, Value):
                if not isinstance(value.type, Scalar) and _is_view(node):
                    self._scope.refuse(node, "is no number, and may be changed here")
                value = self._kept(value)
            found.append(value)
            if not meet:
                self._store(target, value, node)
        if meet:
            for target, value, node in zip(targets, found, values, strict=True):
                self._store(target, value, node)

    def _meet(self, target: ast.expr, value: ast.expr) -> bool:
        """Whether writing to a target may change what a value is computed from."""
        read = _names_in(value)
        if isinstance(target, ast.Subscript):
            return bool(self._memory({root(target)}) & self._memory(read))
        return root(target) in read

    def _memory(self, names: Set[str]) -> set[str]:
        """Return names whose memory some names may stand for; numbers have none."""
        known = memories(self._scope.function)
        return {
            other
            for name in names
            if not _is_number(self._scope.names.get(name))
            for other in known.get(name, {name})
        }

    def _kept(self, value: Value) -> Value:
        """Return a number that later assignments leave as it is."""
        if not isinstance(value.type, Scalar):
            return self._scope.settle(value)
        kept = self._scope.fresh(value.type)
        self._scope.emit(f"{kept.code} = {bare(value.code)};")
        return kept

    def _unpack(self, target: ast.Tuple, node: ast.expr) -> None:
        value = self._ex.value(node)
        if isinstance(value.type, Array):
            self._scope.refuse(target, "arrays are not unpacked")
        held = self._scope.settle(value)
        for place, part in zip(target.elts, held.members(), strict=True):
            self._store(place, part, node)

    def _store(self, target: ast.expr, value: Named, node: ast.expr) -> None:
        """Give a target the value of an expression."""
        if isinstance(target, ast.Name):
            self._bind(target, value)
            return
        if not isinstance(target, ast.Attribute | ast.Subscript):
            self._scope.refuse(target, "is no single target")
        if isinstance(value, Static):
            value = self._ex.fixed(target, value.value)
        if isinstance(value, Span):
            self._scope.refuse(target, "a slice is kept in names only")
        place = self._ex.value(_loaded(target))
        if isinstance(place.type, Array):
            value = self._apart(target, place, node, value)
            self._ex.fill(place, [self._scope.settle(value)], lambda at: at[0])
        else:
            self._scope.emit(f"{place.code} = {bare(value.code)};")

    def _apart(
        self, target: ast.expr, place: Value, node: ast.expr, value: Value
    ) -> Value:
        """Return a value that stays as it is while an array is written to.

        An expression of arrays has been computed into memory of its own.
        """
        if isinstance(value.type, Array) and isinstance(place.type, Array):
            if value.type.shape != place.type.shape:
                self._scope.refuse(node, "has another shape than its target")
            same = (value.code, value.type.strides) == (place.code, place.type.strides)
            if same or not _is_view(node):
                return value
        if not self._memory({root(target)}) & self._memory(_names_in(node)):
            return value
        if isinstance(value.type, Array):
            return self._ex.each(node, [value], lambda at: at[0])
        return self._kept(value)

    def _bind(self, target: ast.Name, value: Named) -> None:
        """Give a name a value."""
        name, scope = target.id, self._scope
        if isinstance(value, Static):
            value = self._ex.fixed(target, value.value)
        if isinstance(value, Span):
            if self._stored[name] > 1 and scope.depth > 1:
                scope.refuse(target, "a slice that depends on what ran before")
            scope.names[name] = self._held_span(value)
            return
        known = value.linear is not None and value.linear.known is not None
        if known and self._stored[name] == 1:
            scope.names[name] = value
        elif name in scope.used:
            self._assign_variable(target, value)

    def _held_span(self, span: Span) -> Span:
        if span.first.isdigit():
            return span
        held = self._scope.fresh(INT)
        self._scope.emit(f"{held.code} = {span.first};")
        return replace(span, first=held.code)

    def _assign_variable(self, target: ast.Name, value: Value) -> None:
        scope = self._scope
        place = scope.variable(target, target.id, value)
        scope.names[target.id] = place
        if value.blank and isinstance(value.type, Struct):
            del scope.declared[value.code]
            return
        left = place.code[2:-1] if place.lasting else place.code
        right = value.address if place.lasting else value.code
        scope.emit(f"{left} = {bare(right)};")

    def _annassign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            plain = ast.Assign([node.target], node.value)
            self._assign(ast.copy_location(plain, node))

    def _augassign(self, node: ast.AugAssign) -> None:
        binary = ast.BinOp(_loaded(node.target), node.op, node.value)
        place = self._ex.value(_loaded(node.target))
        if isinstance(place.type, Array):
            value = self._ex.value(node.value)
            if not isinstance(node.op, ast.Add | ast.Sub):
                self._scope.refuse(node, "is not in the translated subset")
            value = self._apart(node.target, place, node.value, value)
            sign = "+" if isinstance(node.op, ast.Add) else "-"
            self._ex.fill(place, [place, value], lambda at: f"{at[0]} {sign} {at[1]}")
        else:
            self._store(node.target, self._ex.value(binary), node.value)

    def _return(self, node: ast.Return) -> None:
        scope = self._scope
        if node.value is None:
            scope.emit("return;")
            scope.returns = scope.returns or Nothing()
            return
        value = self._ex.value(node.value)
        kind = value.type.packed if isinstance(value.type, Array) else value.type
        if scope.returns not in (None, kind):
            if {scope.returns, kind} != {REAL, INT}:
                scope.refuse(node, "another type than before is returned")
            kind = REAL
        scope.returns = kind
        if value.blank:
            scope.blank = True
        elif isinstance(kind, Array):
            out = Value(kind, "out")
            self._ex.fill(out, [value], lambda at: at[0])
        elif isinstance(kind, Struct):
            scope.emit(f"*out = {bare(value.code)};")
        else:
            scope.emit(f"return {bare(value.code)};")
            return
        scope.emit("return;")

    def _if(self, node: ast.If) -> None:
        test = self._ex.real(node.test)
        with self._scope.block(
            f"if ({bare(test)})", "}" if not node.orelse else "} else {"
        ):
            self._all(node.body)
        if node.orelse:
            self._scope.depth += 1
            self._all(node.orelse)
            self._scope.depth -= 1
            self._scope.emit("}")

    def _for(self, node: ast.For) -> None:
        if node.orelse:
            self._scope.refuse(node, "a loop has no else here")
        if not isinstance(node.target, ast.Name):
            self._scope.refuse(node, "a loop has one target")
        called = isinstance(node.iter, ast.Call) and ast.unparse(node.iter.func)
        self._scope.loops += 1
        if called == "range":
            self._count(node, node.target)
        else:
            self._visit(node, node.target)
        self._scope.loops -= 1

    def _count(self, node: ast.For, target: ast.Name) -> None:
        assert isinstance(node.iter, ast.Call)
        ends = [self._ex.value(part) for part in node.iter.args]
        start = ends[0].code if len(ends) > 1 else "0"
        stop = ends[min(1, len(ends) - 1)].code
        down = len(ends) > 2
        if down and (ends[2].linear is None or ends[2].linear.known != -1):
            self._scope.refuse(node, "steps are 1 or -1")
        self._check_body(node, set(re.findall(r"[A-Za-z_]\w*", stop)) | {target.id})
        name = self._counter(target)
        test, step = (">", "--") if down else ("<", "++")
        head = f"for ({name} = {start}; {name} {test} {stop}; {name}{step})"
        with self._scope.block(head):
            self._all(node.body)
        self._scope.names.pop(target.id, None)  # C would have gone one further

    def _check_body(self, node: ast.For, fixed: Set[str]) -> None:
        """Refuse a body that changes what C looks at in each round, and Python once."""
        changed: set[str] = set()
        for part in (part for line in node.body for part in ast.walk(line)):
            if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store):
                changed.add(c_name(part.id))
            for place in places(part, self._scope.function):
                changed |= set(map(c_name, self._memory({root(place)})))
        if changed & (fixed | self._memory(fixed)):
            self._scope.refuse(node, "its body changes what it counts")

    def _counter(self, target: ast.Name) -> str:
        """Declare the variable of a loop."""
        if target.id == "_":
            return self._scope.fresh(INT).code
        if target.id in self._scope.names:
            self._scope.refuse(target, "is a loop's target and has another value, too")
        name = c_name(target.id)
        self._scope.declared[name] = f"int {name}"
        self._scope.names[target.id] = Value(INT, name, Linear(0, {name: 1}))
        return name

    def _visit(self, node: ast.For, target: ast.Name) -> None:
        """Loop over the numbers of an array."""
        array, counter = self._ex.value(node.iter), self._scope.fresh(INT)
        kind = array.type
        if not isinstance(kind, Array) or len(kind.shape) != 1:
            self._scope.refuse(node, "loops over ranges and rows of numbers only")
        self._check_body(node, _names_in(node.iter))
        place = f"{array.code}[{counter.code} * {kind.strides[0]}]"
        head = f"for ({counter.code} = 0; {counter.code} < {kind.shape[0]}; "
        with self._scope.block(f"{head}{counter.code}++)"):
            self._assign_variable(target, Value(REAL, place))
            self._all(node.body)

    def _break(self, node: ast.Break) -> None:
        self._scope.emit("break;")

    def _continue(self, node: ast.Continue) -> None:
        self._scope.emit("continue;")


def _loaded(target: ast.expr) -> ast.expr:
    """Return the expression that reads what a target writes."""
    copy = ast.parse(ast.unparse(target), mode="eval").body
    return copy


def _names_in(node: ast.AST) -> set[str]:
    return {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}


def _is_view(node: ast.expr) -> bool:
    """Whether an array is a part of another one, not computed."""
    return isinstance(node, ast.Name | ast.Attribute | ast.Subscript | ast.IfExp)


def _is_number(found: Named | None) -> bool:
    return isinstance(found, Value) and isinstance(found.type, Scalar)


def _has_arrays(value: Value) -> bool:
    if not isinstance(value.type, Struct):
        return False
    return any(isinstance(p.type, Array) or _has_arrays(p) for p in value.members())


def names_read(definition: ast.FunctionDef) -> Iterator[str]:
    """Yield the names that a function reads."""
    for node in ast.walk(definition):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
            yield node.id
        elif isinstance(node, ast.AugAssign) and isinstance(node.target, ast.Name):
            yield node.target.id
