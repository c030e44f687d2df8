"""Expressions of xacro files, interpreted over a white list. Nothing is compiled or run.

The text is parsed into Python's syntax tree, and the tree is walked: numbers, text, lists, dicts,
arithmetic, comparisons, conditions, subscripts, list comprehensions, some functions of Python and
of ``math``, and the names that the file defines. A value is plain data of exactly the known types,
wrapped YAML, a namespace or a `Function`; any other is refused the moment it turns up. No attribute
of a Python object is read: a dot looks up a key of wrapped YAML, a name in a namespace, or, when
called, a method in a table of our own. No function here calls what it is given, or looks at
anything but its arguments; what could grow is judged before it is computed.
Standard library only: the xacro child process loads this module by its folder.
"""

from __future__ import annotations

import ast
import datetime
import functools
import math
import operator
import re
import unicodedata  # noqa: F401 (the parser asks for it where a name is not ASCII)
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

LONGEST_EXPRESSION = 20_000
LONGEST_TEXT = 1_000_000
MOST_ITEMS = 100_000
MOST_STEPS = 200_000
MOST_VOLUME = 10_000_000
"""Items and characters of all values of one expression, together."""
MOST_BITS = 8192
"""Of an integer."""
DEEPEST = 60
_SIZED = (str, list, tuple, dict, set)
_SURROGATE = re.compile("[\ud800-\udfff]")


class Refused(Exception):
    """Something that no expression may do."""

    @classmethod
    def refuse_if(cls, wrong: object, *problem: Any) -> None:
        """Raise it if something is wrong."""
        if wrong:
            raise cls(*problem)


@dataclass(frozen=True, eq=False)
class Function:
    """A function that an expression may call; the interpreter never calls anything else."""

    name: str
    call: Callable[..., Any]

    def __str__(self) -> str:
        return f"<function {self.name}>"

    __repr__ = __str__


@dataclass(frozen=True)
class Kinds:
    """Classes of xacro's own that values may have, besides plain data."""

    dotted: type[Any]  # dicts whose keys are reached by a dot
    listed: type[Any]  # lists of such dicts
    # dicts of names: ``math``, ``xacro``, ``python``, and those of included files
    namespace: type[Any]


NUMBERS: frozenset[type] = frozenset([bool, int, float])
COMPUTED = NUMBERS | {list, tuple, dict, range, str, type(None), Function}
"""Types of values that operators take."""
PLAIN = COMPUTED | {set, bytes, datetime.date, datetime.datetime}


def _check_bits(bits: int) -> None:
    Refused.refuse_if(bits > MOST_BITS, "an integer of thousands of digits is not accepted")


def _check_length(letters: int) -> None:
    Refused.refuse_if(
        letters > LONGEST_TEXT, f"a text of more than {LONGEST_TEXT} characters is not accepted"
    )


# Operators ----------------------------------------------------------------------------


def _power(base: Any, exponent: Any) -> Any:
    if isinstance(base, int) and isinstance(exponent, int) and abs(base) > 1 and exponent > 0:
        _check_bits(base.bit_length() * exponent)
    result = operator.pow(base, exponent)
    if type(result) not in NUMBERS:  # a negative base and a fraction: a complex number
        raise Refused("a complex number is not accepted")
    return result


def _shift_left(value: Any, count: Any) -> Any:
    if isinstance(value, int) and isinstance(count, int) and value and count > 0:
        _check_bits(value.bit_length() + count)
    return operator.lshift(value, count)


def _times(left: Any, right: Any) -> Any:
    for values, count in ((left, right), (right, left)):
        if isinstance(values, str | list | tuple) and isinstance(count, int) and count > 0:
            most = LONGEST_TEXT if isinstance(values, str) else MOST_ITEMS
            Refused.refuse_if(
                len(values) * count > most, "a repetition of that many times needs too much memory"
            )
    if isinstance(left, int) and isinstance(right, int):
        _check_bits(left.bit_length() + right.bit_length() - 1)
    return operator.mul(left, right)


def _remainder(left: Any, right: Any) -> Any:
    """``left % right``: numbers, or old formatting whose result is of a sane size."""
    if isinstance(left, str):
        if re.search(r"%\(|%[#0\- +]*(?:\*|\d{4}|\d*\.(?:\*|\d{4}))", left):
            raise Refused("a format with a name, or a width of that size, is not accepted")
        values = right if isinstance(right, tuple) else (right,)
        longest = max([2000, *(len(repr(value)) for value in values)])
        _check_length(len(left) + left.count("%") * longest)
    return operator.mod(left, right)


_OPERATORS: Mapping[type, Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: _times,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: _remainder,
    ast.Pow: _power,
    ast.LShift: _shift_left,
    ast.RShift: operator.rshift,
    ast.BitAnd: operator.and_,
    ast.BitOr: operator.or_,
    ast.BitXor: operator.xor,
    ast.UAdd: operator.pos,
    ast.USub: operator.neg,
    ast.Invert: operator.invert,
    ast.Not: operator.not_,
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


# Functions and methods ----------------------------------------------------------------


def _round(number: Any, digits: Any = None) -> Any:
    Refused.refuse_if(
        isinstance(digits, int) and abs(digits) > 400,
        "rounding to hundreds of digits is not accepted",
    )
    if type(number) not in NUMBERS:
        raise TypeError(f"type {type(number).__name__} doesn't define __round__ method")
    return round(number, digits)


_BUILTINS: Mapping[str, Callable[..., Any]] = {
    **{f.__name__: f for f in (abs, all, any, bool, dict, float, int, len, max, min, range)},
    "enumerate": lambda values, start=0: list(enumerate(values, start)),
    "list": lambda values=(): list(values),
    "round": _round,
    "sorted": lambda values, reverse=False: sorted(values, reverse=reverse),
    "str": lambda value="": str(value),
    "sum": lambda values: sum(values),  # of numbers: a list to start from would grow
    "tuple": lambda values=(): tuple(values),
    "zip": lambda *values: list(zip(*values, strict=False)),
}
FUNCTIONS: Mapping[str, Function] = {n: Function(n, call) for n, call in _BUILTINS.items()}
"""Python's own functions, as far as an expression may call them."""

_MATH = (  # none grows faster than its arguments
    "acos acosh asin asinh atan atan2 atanh cbrt ceil copysign cos cosh degrees dist erf erfc exp "
    "exp2 expm1 fabs floor fmod frexp fsum gamma gcd hypot isclose isfinite isinf isnan isqrt "
    "ldexp lgamma log log10 log1p log2 modf pow radians remainder sin sinh sqrt tan tanh trunc"
)
MATH: Mapping[str, Any] = {
    **{name: getattr(math, name) for name in ("pi", "e", "tau", "inf", "nan")},
    **{n: Function(n, getattr(math, n)) for n in _MATH.split() if hasattr(math, n)},
}
"""The module ``math``: constants and functions."""


def _join(text: str, values: Any) -> str:
    _check_length(sum(len(part) + len(text) for part in values if isinstance(part, str)))
    return text.join(values)


def _replace(text: str, old: str, new: str, count: int = -1) -> str:
    _check_length(len(text) + (text.count(old) + 1) * len(new))
    return text.replace(old, new, count)


_OF_TEXT = (
    "capitalize count endswith find index isalnum isalpha isdigit isnumeric lower lstrip partition "
    "rfind rpartition rsplit rstrip split splitlines startswith strip title upper"
)
_METHODS: Mapping[type, Mapping[str, Callable[..., Any]]] = {
    str: {
        **{name: getattr(str, name) for name in _OF_TEXT.split()},
        "join": _join,
        "replace": _replace,
    },
    list: {"count": list.count, "index": list.index},
    tuple: {"count": tuple.count, "index": tuple.index},
    dict: {
        "get": lambda values, key, default=None: dict.get(values, key, default),
        "keys": lambda values: list(dict.keys(values)),
        "values": lambda values: list(dict.values(values)),
        "items": lambda values: list(dict.items(values)),
    },
}
# They change nothing. ``format`` is none of them: its templates read attributes.


# The walk -----------------------------------------------------------------------------


def evaluate(text: str, names: Mapping[str, Any], kinds: Kinds) -> Any:
    """Return the value of an expression; `Refused`, an error of Python, or KeyError of a name."""
    return _Walk(names, kinds).value(_parsed(text.strip()))


@functools.lru_cache(maxsize=2000)  # a macro evaluates the same text again and again
def _parsed(text: str) -> ast.expr:
    Refused.refuse_if(
        len(text) > LONGEST_EXPRESSION,
        f"an expression of more than {LONGEST_EXPRESSION} characters is not accepted",
    )
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
        self.computed = COMPUTED | {kinds.dotted, kinds.listed}

    def value(self, node: ast.AST) -> Any:
        """Return the value of a node, of an accepted type and size."""
        return self.admit(self.holder(node))

    def holder(self, node: ast.AST) -> Any:
        """Return what a node stands for: a value, or a namespace, to take a name from."""
        self.steps += 1
        self.depth += 1
        Refused.refuse_if(
            self.steps > MOST_STEPS, "an expression with that many steps is not accepted"
        )
        Refused.refuse_if(self.depth > DEEPEST, "an expression nested that deeply is not accepted")
        result = self.found(node)
        self.depth -= 1
        return result if type(result) is self.kinds.namespace else self.admit(result)

    def operand(self, node: ast.AST) -> Any:
        """Return the value of a node that is computed with."""
        value = self.value(node)
        Refused.refuse_if(
            type(value) not in self.computed,
            f"computing with a {type(value).__name__} is not accepted",
        )
        return value

    def admit(self, value: Any) -> Any:
        """Return a value that is plain data; refuse any other."""
        Refused.refuse_if(
            type(value) not in self.accepted,
            f"a value of type {type(value).__name__} is not accepted",
        )
        if isinstance(value, int):
            _check_bits(value.bit_length())
        elif isinstance(value, str | bytes):
            _check_length(len(value))
            Refused.refuse_if(
                isinstance(value, str) and _SURROGATE.search(value),
                "half of a character (a surrogate) is not accepted",
            )
        elif isinstance(value, list | tuple | dict | set | range):
            Refused.refuse_if(
                len(value) > MOST_ITEMS, f"more than {MOST_ITEMS} items are not accepted"
            )
        self.volume += len(value) if isinstance(value, _SIZED) else 0
        Refused.refuse_if(
            self.volume > MOST_VOLUME, "an expression that needs too much memory is not accepted"
        )
        return value

    def found(self, node: ast.AST) -> Any:
        """Return what a node stands for."""
        match node:
            case ast.Constant(value=bytes()):
                raise Refused("bytes are not accepted in an expression")
            case ast.Constant():
                return node.value
            case ast.Name():
                return self.named(node.id)
            case ast.BinOp() if type(node.op) in _OPERATORS:
                return _OPERATORS[type(node.op)](self.operand(node.left), self.operand(node.right))
            case ast.UnaryOp():
                return _OPERATORS[type(node.op)](self.operand(node.operand))
            case ast.BoolOp():
                return self.either(node)
            case ast.Compare():
                return self.compared(node)
            case ast.IfExp():
                return self.value(node.body if self.value(node.test) else node.orelse)
            case ast.List():
                return [self.value(part) for part in node.elts]
            case ast.Tuple():
                return tuple(self.value(part) for part in node.elts)
            case ast.Dict() if None not in node.keys:
                pairs = zip(node.keys, node.values, strict=True)
                return {self.value(key): self.value(part) for key, part in pairs if key is not None}
            case ast.ListComp() | ast.GeneratorExp():
                return list(self.items(node.elt, node.generators))
            case ast.Subscript():
                return self.item(node)
            case ast.Attribute():
                return self.dotted(self.holder(node.value), node.attr)
            case ast.Call():
                return self.called(node)
        raise Refused(f"{type(node).__name__} is not accepted in an expression")

    def named(self, name: str) -> Any:
        for scope in reversed(self.scopes):
            if name in scope:
                return scope[name]
        Refused.refuse_if(name.startswith("__"), f"the name {name!r} is not accepted")
        try:
            return self.names[name]
        except KeyError:
            raise NameError(f"name '{name}' is not defined") from None

    def either(self, node: ast.BoolOp) -> Any:
        result: Any = None
        for part in node.values:
            result = self.value(part)
            if bool(result) is isinstance(node.op, ast.Or):
                break
        return result

    def compared(self, node: ast.Compare) -> Any:
        left, result = self.value(node.left), True
        for operation, part in zip(node.ops, node.comparators, strict=True):
            right = self.value(part)
            if not (result := _OPERATORS[type(operation)](left, right)):
                break
            left = right
        return result

    def item(self, node: ast.Subscript) -> Any:
        values = self.holder(node.value)
        if type(values) is Function:
            raise Refused(f"reading items of {values} is not accepted")
        if isinstance(node.slice, ast.Slice):
            ends = (node.slice.lower, node.slice.upper, node.slice.step)
            key: Any = slice(*[None if end is None else self.value(end) for end in ends])
        else:
            key = self.value(node.slice)
        if type(values) is self.kinds.namespace:
            return self.of_namespace(values, str(key))
        return values[key]

    def of_namespace(self, space: Any, name: str) -> Any:
        # Blocks of macros are kept beside the names; they start with a star.
        Refused.refuse_if(
            not name.isidentifier() or name.startswith("_"),
            f"the name {name!r} of a namespace is not accepted",
        )
        try:
            return space[name]
        except KeyError:
            raise NameError(f"name '{name}' is not defined") from None

    def dotted(self, holder: Any, name: str) -> Any:
        if type(holder) is self.kinds.namespace:
            return self.of_namespace(holder, name)
        if type(holder) is self.kinds.dotted and not name.startswith("__"):
            return holder[name]
        what = f"attribute {name!r} of a {type(holder).__name__}"
        raise Refused(f"{what} is not accepted: a dot is for YAML data and namespaces")

    def called(self, node: ast.Call) -> Any:
        """Return what a function, or a method of a value, gives for the arguments."""
        target, first = node.func, []
        holder = self.holder(target.value) if isinstance(target, ast.Attribute) else None
        if isinstance(target, ast.Attribute) and type(holder) is not self.kinds.namespace:
            kind = {self.kinds.dotted: dict, self.kinds.listed: list}.get(
                type(holder), type(holder)
            )
            if target.attr not in _METHODS.get(kind, {}):
                what = f"method {target.attr!r} of a {type(holder).__name__}"
                raise Refused(f"{what} is not accepted")
            call, first = _METHODS[kind][target.attr], [holder]
        elif isinstance(target, ast.Name | ast.Attribute | ast.Subscript):
            function = self.value(target)
            if type(function) is not Function:
                raise TypeError(f"'{type(function).__name__}' object is not callable")
            call = function.call
        else:
            raise Refused(f"calling a {type(target).__name__} is not accepted")
        Refused.refuse_if(
            any(word.arg is None for word in node.keywords), "'**' is not accepted in an expression"
        )
        values = [self.value(part) for part in node.args]
        words = {str(w.arg): self.value(w.value) for w in node.keywords}
        try:
            return call(*first, *values, **words)
        except TypeError as error:  # some of ours have no name
            raise TypeError(str(error).replace("<lambda>", ast.unparse(target))) from None

    def items(self, body: ast.expr, generators: list[ast.comprehension]) -> Iterator[Any]:
        """Yield the items of a comprehension; the innermost loop comes last."""
        if not generators:
            yield self.value(body)
            return
        first, *rest = generators
        Refused.refuse_if(first.is_async, "async is not accepted in an expression")
        values = self.value(first.iter)
        self.scopes.append({})
        for value in values:
            self.bind(first.target, self.admit(value))
            if all(self.value(test) for test in first.ifs):
                yield from self.items(body, rest)
        self.scopes.pop()

    def bind(self, target: ast.expr, value: Any) -> None:
        """Let the names of a loop stand for an item."""
        if isinstance(target, ast.Name):
            self.scopes[-1][target.id] = value
        elif isinstance(target, ast.Tuple | ast.List):
            for part, item in zip(target.elts, value, strict=True):
                self.bind(part, self.admit(item))
        else:
            raise Refused("a loop over anything but names is not accepted")
