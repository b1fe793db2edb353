"""Small changes of a module's text where mutmut makes none.

Mutmut leaves alone what stands outside functions, such as limits and prepared queries, and functions with a decorator,
such as every view. It also never leaves out a statement and never turns a condition round. That is done here.
"""

import ast
from collections.abc import Iterator
from dataclasses import dataclass

_COMPARISONS: dict[type[ast.cmpop], tuple[str, str]] = {
    ast.Lt: ("<", "<="),
    ast.LtE: ("<=", "<"),
    ast.Gt: (">", ">="),
    ast.GtE: (">=", ">"),
    ast.Eq: ("==", "!="),
    ast.NotEq: ("!=", "=="),
    ast.In: (" in ", " not in "),
    ast.NotIn: (" not in ", " in "),
    ast.Is: (" is ", " is not "),
    ast.IsNot: (" is not ", " is "),
}
_OPERATORS: dict[type[ast.operator], tuple[str, str]] = {
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: ("*", "+"),
    ast.Div: ("/", "*"),
    ast.BitOr: ("|", "&"),
    ast.BitAnd: ("&", "|"),
}
_Function = ast.FunctionDef | ast.AsyncFunctionDef
_KEPT_DECORATORS = {"dataclass", "property", "classmethod", "staticmethod", "wraps"}


@dataclass(frozen=True, slots=True)
class Change:
    """One change.

    Attributes:
        line: Where, from 1.
        function: The function it is in; empty outside functions.
        old: What stood there.
        new: What stands there instead.
        source: The whole module with the change.
    """

    line: int
    function: str
    old: str
    new: str
    source: str


def changes(source: str) -> Iterator[Change]:
    """Yield every change of a module, from top to bottom; each leaves a module that Python can read."""
    writer = _Writer(source)
    for node, function, is_left_alone in _walk(ast.parse(source), "", is_left_alone=True):
        for old, new, start, end in _of_node(node, writer, is_left_alone=is_left_alone):
            text = writer.replaced(start, end, new)
            try:
                ast.parse(text)
            except SyntaxError:
                continue
            yield Change(node.lineno, function, old, new, text)


_Place = tuple[int, int]


class _Writer:
    """A text of which parts are replaced; places are a line, from 1, and a column in bytes, as `ast` tells them."""

    def __init__(self, source: str) -> None:
        self._lines = [line.encode() for line in source.splitlines(keepends=True)]

    def text(self, start: _Place, end: _Place) -> str:
        return (b"".join(self._lines)[self._offset(start) : self._offset(end)]).decode()

    def replaced(self, start: _Place, end: _Place, new: str) -> str:
        whole = b"".join(self._lines)
        return (whole[: self._offset(start)] + new.encode() + whole[self._offset(end) :]).decode()

    def _offset(self, place: _Place) -> int:
        line, column = place
        return sum(map(len, self._lines[: line - 1])) + column


def _walk(node: ast.AST, function: str, *, is_left_alone: bool) -> Iterator[tuple[ast.expr | ast.stmt, str, bool]]:
    """Yield every node that runs, with its function and whether mutmut leaves it alone."""
    for name, value in ast.iter_fields(node):
        if name in {"annotation", "returns", "decorator_list", "args", "bases"} and not isinstance(node, ast.Call):
            continue
        for child in value if isinstance(value, list) else [value]:
            if not isinstance(child, ast.AST):
                continue
            inside, left = function, is_left_alone
            if isinstance(child, _Function) and not function:
                inside, left = child.name, bool(child.decorator_list)
            if isinstance(child, ast.expr | ast.stmt):
                yield child, inside, left
            yield from _walk(child, inside, is_left_alone=left)


_Replacement = tuple[str, str, _Place, _Place]


def _of_node(node: ast.expr | ast.stmt, writer: _Writer, *, is_left_alone: bool) -> Iterator[_Replacement]:
    yield from _everywhere(node, writer)
    if is_left_alone:
        yield from _where_left_alone(node, writer)


def _everywhere(node: ast.expr | ast.stmt, writer: _Writer) -> Iterator[_Replacement]:
    match node:
        case ast.Expr(value=ast.Call()):
            yield from _whole(node, writer, "pass")
        case ast.If(test=test) | ast.IfExp(test=test):
            yield from _whole(test, writer, f"(not ({_text(test, writer)}))")
        case ast.Raise():
            yield from _whole(node, writer, "pass")
        case ast.FunctionDef(decorator_list=decorators):
            for decorator in decorators:
                if not any(name in _text(decorator, writer) for name in _KEPT_DECORATORS):
                    line, column = decorator.lineno, decorator.col_offset - 1
                    yield f"@{_text(decorator, writer)}", "", (line, column), _end(decorator)


def _where_left_alone(node: ast.expr | ast.stmt, writer: _Writer) -> Iterator[_Replacement]:
    match node:
        case ast.Compare(left=left, ops=[operator, *_], comparators=[right, *_]) if type(operator) in _COMPARISONS:
            old, new = _COMPARISONS[type(operator)]
            yield from _between(left, right, writer, old, new)
        case ast.BoolOp(values=[first, second, *_]):
            words = (" and ", " or ") if isinstance(node.op, ast.And) else (" or ", " and ")
            yield from _between(first, second, writer, *words)
        case ast.BinOp(left=left, op=operator, right=right) if type(operator) in _OPERATORS:
            yield from _between(left, right, writer, *_OPERATORS[type(operator)])
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            yield from _whole(node, writer, _text(operand, writer))
        case ast.Constant(value=bool(value)):
            yield from _whole(node, writer, str(not value))
        case ast.Constant(value=int(value)):
            yield from _whole(node, writer, str(value + 1))
        case ast.Return(value=ast.expr() as value) if not isinstance(value, ast.Constant):
            yield from _whole(value, writer, "None")
        case ast.Call(args=[first, second]) if not any(isinstance(one, ast.Starred) for one in (first, second)):
            old = writer.text(_start(first), _end(second))
            between = writer.text(_end(first), _start(second))
            yield old, f"{_text(second, writer)}{between}{_text(first, writer)}", _start(first), _end(second)


def _whole(node: ast.expr | ast.stmt, writer: _Writer, new: str) -> Iterator[_Replacement]:
    yield _text(node, writer), new, _start(node), _end(node)


def _between(left: ast.expr, right: ast.expr, writer: _Writer, old: str, new: str) -> Iterator[_Replacement]:
    between = writer.text(_end(left), _start(right))
    if old in between:
        start, end = _start(left), _end(right)
        changed = _text(left, writer) + between.replace(old, new, 1) + _text(right, writer)
        yield writer.text(start, end), changed, start, end


def _text(node: ast.expr | ast.stmt, writer: _Writer) -> str:
    return writer.text(_start(node), _end(node))


def _start(node: ast.expr | ast.stmt) -> _Place:
    return node.lineno, node.col_offset


def _end(node: ast.expr | ast.stmt) -> _Place:
    assert node.end_lineno is not None
    assert node.end_col_offset is not None
    return node.end_lineno, node.end_col_offset
