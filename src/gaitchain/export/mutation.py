"""Which arguments a function writes to: all others are `const` in C."""

import ast
import inspect
import textwrap
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

from gaitchain.balance.packed_state import put


def plain(function: Any) -> Callable[..., Any]:
    """Return the Python function that a compiled one was made of."""
    found: Callable[..., Any] = getattr(function, "py_func", function)
    return found


@cache
def syntax_of(function: Callable[..., Any]) -> ast.FunctionDef:
    """Return the syntax tree of a plain function."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    definition = tree.body[0]
    assert isinstance(definition, ast.FunctionDef)
    return definition


@cache
def written(function: Callable[..., Any]) -> frozenset[str]:
    """Return the names of the arguments that a plain function writes to."""
    if function is plain(put):
        return frozenset({"place"})
    tree = syntax_of(function)
    roots = {argument.arg: {argument.arg} for argument in tree.args.args}
    found: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Assign):
            for target, value in _pairs(node):
                _alias(target, value, roots)
    for node in ast.walk(tree):
        for place in _places(node, function):
            found |= roots.get(_root(place), set())
    return frozenset(found)


def _pairs(node: ast.Assign) -> Iterator[tuple[ast.expr, ast.expr]]:
    """Yield each target with its value."""
    for target in node.targets:
        if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
            yield from zip(target.elts, node.value.elts, strict=True)
        else:
            yield target, node.value


def _alias(target: ast.expr, value: ast.expr, roots: dict[str, set[str]]) -> None:
    """Note that a name may now stand for a part of an argument."""
    parts = [value.body, value.orelse] if isinstance(value, ast.IfExp) else [value]
    for part in parts:
        root = _root(part)
        if isinstance(target, ast.Name) and root in roots:
            roots[target.id] = roots.get(target.id, set()) | roots[root]


def _places(node: ast.AST, function: Callable[..., Any]) -> Iterator[ast.expr]:
    """Yield what a statement or a call writes to."""
    if isinstance(node, ast.Attribute | ast.Subscript):
        if isinstance(node.ctx, ast.Store):
            yield node
    elif isinstance(node, ast.AugAssign) and isinstance(node.target, ast.Name):
        yield node.target
    elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
        called = plain(function.__globals__.get(node.func.id))
        if inspect.isfunction(called):
            names = [argument.arg for argument in syntax_of(called).args.args]
            for name, argument in zip(names, node.args, strict=False):
                if name in written(called):
                    yield argument


def _root(node: ast.expr) -> str:
    """Return the name that an expression is a part of, empty if there is none."""
    while isinstance(node, ast.Attribute | ast.Subscript):
        node = node.value
    return node.id if isinstance(node, ast.Name) else ""
