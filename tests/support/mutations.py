"""Mutants of a module: all that one change by an operator makes of its code.

    comparison    < to <= and to >=, and so on; == to !=, `is` and `in` to their opposites
    arithmetic    + and -, * and /, // to *, % to //, ** to *, << and >>, & and |, ^ to |
    constant      an integer by one more and by one less, a float by one more, True and False
    string        another one
    unary         `not`, ~ or - left out
    logic         `and` and `or`; the condition of an `if` negated, unless it is a comparison
    return        None instead of a value
    statement     a call, a raise, += or an assignment to an item or attribute left out
    arguments     the first two positional arguments exchanged

Left out because only speed or text depends on it: docstrings, annotations, decorators, messages
(`raise`, f-strings, strings with blanks), ``__all__``, the choice between compiled kernels and
numpy, sizes of pieces of work, values stored in ``__dict__`` for cached properties, and exchanged
arguments of symmetric functions.  Others are listed in ``equivalent_mutants.txt``.
"""

from __future__ import annotations

import ast
import copy
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
_COMPARISONS = {
    ast.Lt: (ast.LtE, ast.GtE), ast.LtE: (ast.Lt, ast.Gt), ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt), ast.Eq: (ast.NotEq,), ast.NotEq: (ast.Eq,), ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,), ast.In: (ast.NotIn,), ast.NotIn: (ast.In,),
}  # fmt: skip
_ARITHMETIC = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult, ast.Mod: ast.FloorDiv, ast.Pow: ast.Mult, ast.LShift: ast.RShift,
    ast.RShift: ast.LShift, ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd, ast.BitXor: ast.BitOr,
}  # fmt: skip
_CHOICE = {"compiled_checks", "compiled_kernels", "load_for", "load_early"}
_PIECES = {"_PIECE", "_LARGE_PIECE", "_BLOCK", "_BAND", "_BATCH", "_LARGE", "_HUGE", "_AT_ONCE"}
_SYMMETRIC = {"minimum", "maximum", "min", "max", "hypot", "array_equal", "isclose", "allclose"}
_TEXT = {"annotation", "returns", "decorator_list", "type_params", "bases"}


class Mutant(NamedTuple):
    """A node of the tree of a module, and the node in its place."""

    path: Path
    tree: ast.Module
    node: ast.AST
    operator: str
    changed: ast.AST

    @property
    def line(self) -> int:
        """The line at which the change begins."""
        return int(getattr(self.node, "lineno", 0))

    @property
    def place(self) -> str:
        """The file and the line of code, which stay the same if lines are moved."""
        code = self.path.read_text("utf-8").splitlines()[self.line - 1].strip()
        return f"{self.path.relative_to(ROOT)} :: {code}"

    def __str__(self) -> str:
        texts = (" ".join(ast.unparse(node).split())[:80] for node in (self.node, self.changed))
        return f"{self.place} :: {'  ->  '.join(texts)}"

    def source(self) -> str:
        """Return the source of the changed module."""
        node, kind, was = self.node, self.node.__class__, self.node.__dict__
        node.__class__, node.__dict__ = self.changed.__class__, {**was, **self.changed.__dict__}
        try:
            return ast.unparse(self.tree)
        finally:
            node.__class__, node.__dict__ = kind, was


def mutants_of(path: Path) -> list[Mutant]:
    """Return all mutants of a module."""
    tree = ast.parse(path.read_text("utf-8"))
    nodes = list(_relevant(tree))
    return [Mutant(path, tree, node, *change) for node in nodes for change in _changes(node)]


def _relevant(node: ast.AST) -> Iterator[ast.AST]:
    """Yield the nodes on which more than speed and text depends."""
    for name, value in ast.iter_fields(node):
        for child in value if isinstance(value, list) and name not in _TEXT else [value]:
            if name in _TEXT or not isinstance(child, ast.AST) or _is_irrelevant(child):
                continue
            if isinstance(child, ast.stmt | ast.expr):
                yield child
            if isinstance(child, ast.Call) and _name(child.func) == "in_parallel":
                child = ast.Tuple(child.args[:2])  # without the sizes of pieces
            if not isinstance(child, ast.Raise | ast.JoinedStr):
                yield from _relevant(child)


def _is_irrelevant(node: ast.AST) -> bool:
    match node:
        case ast.Expr(value=ast.Constant()):
            return True
        case ast.Call() | ast.Expr(value=ast.Call()) | ast.NamedExpr(value=ast.Call()):
            return _name(getattr(getattr(node, "value", node), "func", node)) in _CHOICE
        case ast.Assign(targets=[ast.Subscript(value=ast.Attribute(attr="__dict__"))]):
            return True
        case ast.Assign(targets=[ast.Name(id=name)]):
            return name in {*_PIECES, "__all__"}
    return False


def _name(node: ast.AST) -> str:
    return getattr(node, "id", getattr(node, "attr", ""))


def _changes(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    """Yield the operator and the changed node, for each change of one node."""
    match node:
        case ast.Compare(ops=[op, *others]):
            for other in _COMPARISONS[type(op)]:
                yield "comparison", ast.Compare(node.left, [other(), *others], node.comparators)
        case ast.BinOp(op=op) | ast.AugAssign(op=op) if type(op) in _ARITHMETIC:
            changed = copy.copy(node)
            changed.op = _ARITHMETIC[type(op)]()
            yield "arithmetic", changed
        case ast.Constant(value=bool(value)):
            yield "constant", ast.Constant(not value)
        case ast.Constant(value=int(value)):
            yield "constant", ast.Constant(value + 1)
            yield "constant", ast.Constant(value - 1)
        case ast.Constant(value=float(value)):
            yield "constant", ast.Constant(value + 1.0)
        case ast.Constant(value=str(value)) if " " not in value:
            yield "string", ast.Constant(f"other{value}")
        case ast.UnaryOp(op=ast.Not() | ast.Invert() | ast.USub()):
            yield "unary", node.operand
        case ast.BoolOp(op=op):
            yield (
                "logic",
                ast.BoolOp(ast.Or() if isinstance(op, ast.And) else ast.And(), node.values),
            )
        case ast.If(test=test) | ast.IfExp(test=test):
            if not isinstance(test, ast.Compare) and not _is_irrelevant(test):
                changed = copy.copy(node)
                changed.test = ast.UnaryOp(ast.Not(), test)
                yield "logic", changed
        case ast.Return(value=ast.expr() as value):
            if not (isinstance(value, ast.Constant) and value.value is None):
                yield "return", ast.Return(ast.Constant(None))
        case ast.Call(args=[one, other, *rest]) if _name(node.func) not in _SYMMETRIC:
            is_either = isinstance(one, ast.Starred) or isinstance(other, ast.Starred)
            if not is_either and ast.dump(one) != ast.dump(other):
                yield "arguments", ast.Call(node.func, [other, one, *rest], node.keywords)
    match node:
        case ast.Expr(value=ast.Call()) | ast.Raise() | ast.AugAssign():
            yield "statement", ast.Pass()
        case ast.Assign(targets=[ast.Subscript() | ast.Attribute()]):
            yield "statement", ast.Pass()
