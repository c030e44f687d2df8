"""Expressions of xacro files, interpreted over a white list. Nothing is compiled or run.

The text is parsed into Python's syntax tree, and the tree is walked: numbers, text, lists, dicts,
arithmetic, comparisons, conditions, subscripts, list comprehensions, the functions of
`pinsing.description.xacro_values` and the names that the file defines. A value is plain data of
exactly the known types, wrapped YAML, a namespace or a `Function`; any other is refused the moment
it turns up. No attribute of a Python object is read: a dot looks up a key of wrapped YAML, a name
in a namespace, or, when called, a method in a table of our own.
"""

from __future__ import annotations

import ast
import functools
import operator
import unicodedata  # noqa: F401 (the parser asks for it where a name is not ASCII)
from collections.abc import Callable, Mapping
from typing import Any

from pinsing._dataclass import dataclass
from pinsing.description.xacro_values import (
    CONTAINERS,
    NUMBERS,
    PLAIN,
    Function,
    Refused,
    bounded,
    items_of,
    method_table,
    power,
    remainder,
    shift_left,
    times,
)

LONGEST_EXPRESSION = 20_000
DEEPEST = 60
MOST_STEPS = 200_000
MOST_VOLUME = 10_000_000
"""Items and characters of all values on the way, together."""


@dataclass(frozen=True)
class Kinds:
    """Classes of xacro's own that values may have, besides plain data.

    Attributes
    ----------
    dotted : type
        Dicts whose keys are reached by a dot.
    listed : type
        Lists of such dicts.
    namespace : type
        Dicts of names: ``math``, ``xacro``, ``python``, and those of included files.
    """

    dotted: type[Any]
    listed: type[Any]
    namespace: type[Any]


_BINARY: Mapping[type, Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: times,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: remainder,
    ast.Pow: power,
    ast.LShift: shift_left,
    ast.RShift: operator.rshift,
    ast.BitAnd: operator.and_,
    ast.BitOr: operator.or_,
    ast.BitXor: operator.xor,
}
_UNARY: Mapping[type, Callable[[Any], Any]] = {
    ast.UAdd: operator.pos,
    ast.USub: operator.neg,
    ast.Invert: operator.invert,
    ast.Not: operator.not_,
}
_COMPARE: Mapping[type, Callable[[Any, Any], Any]] = {
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Is: operator.is_,
    ast.IsNot: operator.is_not,
    ast.In: lambda a, b: operator.contains(b, a),
    ast.NotIn: lambda a, b: not operator.contains(b, a),
}
_WORDS: Mapping[type, str] = {
    ast.Lambda: "lambda",
    ast.NamedExpr: "':='",
    ast.JoinedStr: "an f-string",
    ast.Await: "await",
    ast.Yield: "yield",
    ast.YieldFrom: "yield",
    ast.Starred: "'*' outside a call",
}


def evaluate(text: str, names: Mapping[str, Any], kinds: Kinds) -> Any:
    """Return the value of an expression.

    Parameters
    ----------
    text : str
        The expression.
    names : Mapping of str to object
        What names stand for; a KeyError says that there is no such name.
    kinds : Kinds
        Classes of wrapped YAML and of namespaces.

    Raises
    ------
    Refused
        If it does what no expression may do, or needs too much.
    SyntaxError, NameError, TypeError, ValueError, ArithmeticError, LookupError, AttributeError
        As Python would.
    """
    return _Walk(names, kinds).value(_parsed(text.strip()))


@functools.lru_cache(maxsize=2000)  # a macro evaluates the same text again and again
def _parsed(text: str) -> ast.expr:
    if len(text) > LONGEST_EXPRESSION:
        raise Refused(f"an expression of more than {LONGEST_EXPRESSION} characters is not accepted")
    try:
        return ast.parse(text, mode="eval").body
    except (RecursionError, MemoryError):
        raise Refused("an expression nested that deeply is not accepted") from None


class _Walk:
    """One expression under evaluation: its names, and how much it may still do."""

    def __init__(self, names: Mapping[str, Any], kinds: Kinds) -> None:
        self.names, self.kinds = names, kinds
        self.scopes: list[dict[str, Any]] = []
        self.steps = self.depth = self.volume = 0
        self.accepted = PLAIN | {kinds.dotted, kinds.listed}
        self.operands = (
            NUMBERS | CONTAINERS | {str, type(None), Function, kinds.dotted, kinds.listed}
        )

    def value(self, node: ast.AST) -> Any:
        """Return the value of a node, of an accepted type and size."""
        return self.admit(self.holder(node))

    def holder(self, node: ast.AST) -> Any:
        """Return the value of a node, which may be a namespace: something to take a name from."""
        self.steps += 1
        if self.steps > MOST_STEPS:
            raise Refused("an expression with that many steps is not accepted")
        handler = _HANDLERS.get(type(node))
        if handler is None:
            word = _WORDS.get(type(node), type(node).__name__)
            raise Refused(f"{word} is not accepted in an expression")
        self.depth += 1
        if self.depth > DEEPEST:
            raise Refused("an expression nested that deeply is not accepted")
        result = handler(self, node)
        self.depth -= 1
        return result if type(result) is self.kinds.namespace else self.admit(result)

    def admit(self, value: Any) -> Any:
        """Return a value that is plain data; refuse any other."""
        if type(value) is self.kinds.namespace:
            raise Refused("a namespace is no value")
        if type(value) not in self.accepted:
            raise Refused(f"a value of type {type(value).__name__} is not accepted")
        if isinstance(value, (str, list, tuple, dict, set, frozenset)):
            self.volume += len(value)
            if self.volume > MOST_VOLUME:
                raise Refused("an expression that needs too much memory is not accepted")
        return bounded(value)

    def operand(self, node: ast.AST) -> Any:
        value = self.value(node)
        if type(value) not in self.operands:
            raise Refused(f"computing with a {type(value).__name__} is not accepted")
        return value

    def constant(self, node: ast.Constant) -> Any:
        if isinstance(node.value, bytes):
            raise Refused("bytes are not accepted in an expression")
        return node.value

    def name(self, node: ast.Name) -> Any:
        for scope in reversed(self.scopes):
            if node.id in scope:
                return scope[node.id]
        if node.id.startswith("__"):
            raise Refused(f"the name {node.id!r} is not accepted")
        try:
            return self.names[node.id]
        except KeyError:
            raise NameError(f"name '{node.id}' is not defined") from None

    def binary(self, node: ast.BinOp) -> Any:
        left, right = self.operand(node.left), self.operand(node.right)
        return _BINARY[type(node.op)](left, right) if type(node.op) in _BINARY else self.no(node.op)

    def unary(self, node: ast.UnaryOp) -> Any:
        return _UNARY[type(node.op)](self.operand(node.operand))

    def no(self, operation: ast.AST) -> Any:
        raise Refused(f"{type(operation).__name__} is not accepted in an expression")

    def boolean(self, node: ast.BoolOp) -> Any:
        stops = isinstance(node.op, ast.Or)
        result: Any = None
        for part in node.values:
            result = self.value(part)
            if bool(result) is stops:
                break
        return result

    def compare(self, node: ast.Compare) -> Any:
        left = self.value(node.left)
        result: Any = True
        for operation, part in zip(node.ops, node.comparators, strict=True):
            right = self.value(part)
            result = _COMPARE[type(operation)](left, right)
            if not result:
                break
            left = right
        return result

    def condition(self, node: ast.IfExp) -> Any:
        return self.value(node.body if self.value(node.test) else node.orelse)

    def sequence(self, node: ast.List | ast.Tuple | ast.Set) -> Any:
        values = [self.value(part) for part in node.elts]
        if isinstance(node, ast.List):
            return values
        return tuple(values) if isinstance(node, ast.Tuple) else set(values)

    def mapping(self, node: ast.Dict) -> Any:
        if any(key is None for key in node.keys):
            raise Refused("'**' is not accepted in an expression")
        return {
            self.value(key): self.value(part)
            for key, part in zip(node.keys, node.values, strict=True)
            if key is not None
        }

    def slice(self, node: ast.Slice) -> slice:
        parts = [None if p is None else self.value(p) for p in (node.lower, node.upper, node.step)]
        return slice(*parts)

    def subscript(self, node: ast.Subscript) -> Any:
        values = self.holder(node.value)
        if type(values) is self.kinds.namespace:
            key = self.value(node.slice)
            if not isinstance(key, str):
                raise Refused("a namespace is read by names only")
            return self.of_namespace(values, key)
        if type(values) is Function:
            raise Refused(f"reading items of {values} is not accepted")
        if isinstance(node.slice, ast.Slice):
            return values[self.slice(node.slice)]
        return values[self.value(node.slice)]

    def of_namespace(self, space: Any, name: str) -> Any:
        # Blocks of macros are kept beside the names; they start with a star.
        if not name.isidentifier() or name.startswith("_"):
            raise Refused(f"the name {name!r} of a namespace is not accepted")
        try:
            return space[name]
        except KeyError:
            raise NameError(f"name '{name}' is not defined") from None

    def attribute(self, node: ast.Attribute) -> Any:
        holder = self.holder(node.value)
        if type(holder) is self.kinds.namespace:
            return self.of_namespace(holder, node.attr)
        if type(holder) is self.kinds.dotted and not node.attr.startswith("__"):
            return holder[node.attr]
        what = f"attribute {node.attr!r} of a {type(holder).__name__}"
        raise Refused(f"{what} is not accepted: a dot is for YAML data and namespaces")

    def call(self, node: ast.Call) -> Any:
        target = node.func
        if not isinstance(target, (ast.Name, ast.Attribute, ast.Subscript)):
            raise Refused(f"calling a {type(target).__name__} is not accepted")
        if isinstance(target, ast.Attribute):
            holder = self.holder(target.value)
            if type(holder) is not self.kinds.namespace:
                return self.method(holder, target.attr, node)
            function = self.admit(self.of_namespace(holder, target.attr))
        else:
            function = self.value(target)
        if type(function) is not Function:
            raise TypeError(f"'{type(function).__name__}' object is not callable")
        return function.call(*self.positional(node), **self.named(node))

    def method(self, holder: Any, name: str, node: ast.Call) -> Any:
        methods = method_table(holder, (self.kinds.dotted, self.kinds.listed))
        if name not in methods:
            what = f"method {name!r} of a {type(holder).__name__}"
            raise Refused(f"{what} is not accepted")
        return methods[name](holder, *self.positional(node), **self.named(node))

    def positional(self, node: ast.Call) -> list[Any]:
        values: list[Any] = []
        for part in node.args:
            if isinstance(part, ast.Starred):
                values += items_of(self.value(part.value))
            else:
                values.append(self.value(part))
        return values

    def named(self, node: ast.Call) -> dict[str, Any]:
        if any(word.arg is None for word in node.keywords):
            raise Refused("'**' is not accepted in an expression")
        return {str(word.arg): self.value(word.value) for word in node.keywords}

    def comprehension(self, node: ast.ListComp | ast.GeneratorExp | ast.SetComp) -> Any:
        found: list[Any] = []
        self.loop(node.generators, lambda: found.append(self.value(node.elt)), found)
        return set(found) if isinstance(node, ast.SetComp) else found

    def dict_comprehension(self, node: ast.DictComp) -> Any:
        found: list[Any] = []

        def pair() -> None:
            found.append((self.value(node.key), self.value(node.value)))

        self.loop(node.generators, pair, found)
        return dict(found)

    def loop(
        self, generators: list[ast.comprehension], body: Callable[[], None], found: list[Any]
    ) -> None:
        """Run the body for every item; the innermost loop comes last."""
        if not generators:
            body()
            bounded(found)
            return
        first, *rest = generators
        if first.is_async:
            raise Refused("async is not accepted in an expression")
        items = self.value(first.iter)
        self.scopes.append({})
        for item in items_of(items):
            self.bind(first.target, self.admit(item))
            if all(self.value(test) for test in first.ifs):
                self.loop(rest, body, found)
        self.scopes.pop()

    def bind(self, target: ast.expr, value: Any) -> None:
        if isinstance(target, ast.Name):
            self.scopes[-1][target.id] = value
        elif isinstance(target, (ast.Tuple, ast.List)):
            values = items_of(value)
            if len(values) != len(target.elts):
                raise ValueError(f"expected {len(target.elts)} values to unpack, got {len(values)}")
            for part, item in zip(target.elts, values, strict=True):
                self.bind(part, self.admit(item))
        else:
            raise Refused("a loop over anything but names is not accepted")


_HANDLERS: Mapping[type, Callable[[_Walk, Any], Any]] = {
    ast.Constant: _Walk.constant,
    ast.Name: _Walk.name,
    ast.BinOp: _Walk.binary,
    ast.UnaryOp: _Walk.unary,
    ast.BoolOp: _Walk.boolean,
    ast.Compare: _Walk.compare,
    ast.IfExp: _Walk.condition,
    ast.List: _Walk.sequence,
    ast.Tuple: _Walk.sequence,
    ast.Set: _Walk.sequence,
    ast.Dict: _Walk.mapping,
    ast.Subscript: _Walk.subscript,
    ast.Attribute: _Walk.attribute,
    ast.Call: _Walk.call,
    ast.ListComp: _Walk.comprehension,
    ast.GeneratorExp: _Walk.comprehension,
    ast.SetComp: _Walk.comprehension,
    ast.DictComp: _Walk.dict_comprehension,
}
