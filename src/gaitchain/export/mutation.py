"""What a function writes to, and which of its names may stand for the same memory.

Arguments that it does not write to are `const` in C.
"""

import ast
import inspect
import textwrap
from collections.abc import Callable, Iterator, Mapping
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
    tree, memory = syntax_of(function), memories(function)
    found: set[str] = set()
    for node in ast.walk(tree):
        for place in places(node, function):
            found |= memory.get(root(place), frozenset())
    return frozenset({argument.arg for argument in tree.args.args} & found)


@cache
def memories(function: Callable[..., Any]) -> Mapping[str, frozenset[str]]:
    """Return for each name of a plain function those that it may be a part of.

    It is one of them itself. Numbers count as parts, too, as types are not known here.
    """
    links = [
        (target.id, root(part))
        for node in ast.walk(syntax_of(function))
        for target, value in _bindings(node)
        for part in _choices(value)
        if isinstance(target, ast.Name) and root(part)
    ]
    found = {name: frozenset({name}) for name in function.__code__.co_varnames}
    for _ in links:  # at most so many names lie between one and the last it stands for
        for name, of in links:
            found[name] |= found.get(of, frozenset({of}))
    return found


def _choices(value: ast.expr) -> list[ast.expr]:
    return [value.body, value.orelse] if isinstance(value, ast.IfExp) else [value]


def _bindings(node: ast.AST) -> Iterator[tuple[ast.expr, ast.expr]]:
    """Yield each target with its value."""
    if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
        return
    for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
        if not isinstance(target, ast.Tuple):
            yield target, node.value
        elif isinstance(node.value, ast.Tuple):
            yield from zip(target.elts, node.value.elts, strict=True)
        else:
            yield from ((part, node.value) for part in target.elts)


def places(node: ast.AST, function: Callable[..., Any]) -> Iterator[ast.expr]:
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


def root(node: ast.expr) -> str:
    """Return the name that an expression is a part of, empty if there is none."""
    while isinstance(node, ast.Attribute | ast.Subscript):
        node = node.value
    return node.id if isinstance(node, ast.Name) else ""
