"""What an expression of a xacro file may hold and call: plain data, and functions on it.

Every function here is bounded in the size of what it makes, and looks at nothing but its
arguments. Functions that take a function (``map``, ``sorted(key=...)``) take one of these only.
Standard library only: the xacro child process loads this module by its folder.
"""

from __future__ import annotations

import datetime
import math
import operator
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from pinsing._dataclass import dataclass

LONGEST_TEXT = 1_000_000
_HALVES = re.compile("[\ud800-\udfff]")
MOST_ITEMS = 100_000
LARGEST_INTEGER_BITS = 8192
_MOST_DIGITS = 2000


class Refused(Exception):
    """Something that no expression may do."""


@dataclass(frozen=True, eq=False)
class Function:
    """A function that an expression may call; the interpreter never calls anything else."""

    name: str
    call: Callable[..., Any]

    def __str__(self) -> str:
        return f"<function {self.name}>"

    __repr__ = __str__


NUMBERS: frozenset[type] = frozenset([bool, int, float])
CONTAINERS: frozenset[type] = frozenset([list, tuple, dict, set, frozenset, range])
PLAIN: frozenset[type] = (
    NUMBERS
    | CONTAINERS
    | frozenset([str, type(None), bytes, datetime.date, datetime.datetime, Function])
)


def bounded(value: Any) -> Any:
    """Return a value, unless it is larger than any robot needs."""
    if isinstance(value, int):
        if value.bit_length() > LARGEST_INTEGER_BITS:
            raise Refused("an integer of thousands of digits is not accepted")
    elif isinstance(value, (str, bytes)):
        if len(value) > LONGEST_TEXT:
            raise Refused(f"a text of more than {LONGEST_TEXT} characters is not accepted")
        if isinstance(value, str) and _HALVES.search(value):
            raise Refused("half of a character (a surrogate) is not accepted")
    elif isinstance(value, (list, tuple, dict, set, frozenset, range)) and len(value) > MOST_ITEMS:
        raise Refused(f"more than {MOST_ITEMS} items are not accepted")
    return value


def items_of(values: Any) -> list[Any]:
    """Return the items of plain data, few enough."""
    if isinstance(values, (list, tuple, dict, set, frozenset, range, str)):
        if len(values) > max(MOST_ITEMS, LONGEST_TEXT if isinstance(values, str) else 0):
            raise Refused(f"more than {MOST_ITEMS} items are not accepted")
        return list(values)
    raise TypeError(f"'{type(values).__name__}' object is not iterable")


# Operators ----------------------------------------------------------------------------


def power(base: Any, exponent: Any) -> Any:
    """``base ** exponent``, judged before it is computed."""
    if isinstance(base, int) and isinstance(exponent, int) and abs(base) > 1 and exponent > 0:
        _fits(base.bit_length() * exponent)
    result = operator.pow(base, exponent)
    if type(result) not in NUMBERS:  # a negative base and a fraction: a complex number
        raise Refused("a complex number is not accepted")
    return result


def shift_left(value: Any, count: Any) -> Any:
    """``value << count``, judged before it is computed."""
    if isinstance(value, int) and isinstance(count, int) and value and count > 0:
        _fits(value.bit_length() + count)
    return operator.lshift(value, count)


def times(left: Any, right: Any) -> Any:
    """``left * right``, judged before it is computed."""
    for values, count in ((left, right), (right, left)):
        if isinstance(values, (str, list, tuple)) and isinstance(count, int) and count > 0:
            most = LONGEST_TEXT if isinstance(values, str) else MOST_ITEMS
            if len(values) * count > most:
                raise Refused("a repetition of that many times needs too much memory")
    if isinstance(left, int) and isinstance(right, int):
        _fits(left.bit_length() + right.bit_length() - 1)
    return operator.mul(left, right)


def _fits(bits: int) -> None:
    if bits > LARGEST_INTEGER_BITS:
        raise Refused("an integer of thousands of digits is not accepted")


_CONVERSION = re.compile(r"%(?:\([^()]*\))?[#0\- +]*(\*|\d+)?(?:\.(\*|\d+))?")
_NESTED = re.compile(r"%\([^)]*\(")


def _letters(value: Any) -> int:
    """How long a text or an integer is at most when it is printed."""
    if isinstance(value, (str, bytes)):
        return len(value)
    return value.bit_length() // 3 + 2 if isinstance(value, int) else 0


def remainder(left: Any, right: Any) -> Any:
    """``left % right``: numbers, or old formatting whose result is of a sane size."""
    if isinstance(left, str):
        if _NESTED.search(left):  # Python counts them, the expression above does not
            raise Refused("a format with parentheses within parentheses is not accepted")
        sizes = _CONVERSION.findall(left)
        if any(w == "*" or len(w) > 3 for size in sizes for w in size):
            raise Refused("a format with a width of that size is not accepted")
        values = right.values() if isinstance(right, dict) else right
        values = values if isinstance(right, (dict, tuple)) else (values,)
        longest = max(map(_letters, values), default=0)
        total = sum(max(longest, *(int(w or 0) for w in size)) for size in sizes)
        if len(left) + total > LONGEST_TEXT:
            raise Refused(f"a text of more than {LONGEST_TEXT} characters is not accepted")
    return operator.mod(left, right)


# Functions ----------------------------------------------------------------------------


def _function(value: Any) -> Function:
    if type(value) is not Function:
        raise Refused(f"a {type(value).__name__} is not accepted where a function is called")
    return value


def _map(function: Any, *values: Any) -> list[Any]:
    call = _function(function).call
    return [call(*row) for row in zip(*map(items_of, values), strict=False)]


def _filter(function: Any, values: Any) -> list[Any]:
    if function is None:
        return [v for v in items_of(values) if v]
    call = _function(function).call
    return [v for v in items_of(values) if call(v)]


def _sorted(values: Any, *, key: Any = None, reverse: bool = False) -> list[Any]:
    call = None if key is None else _function(key).call
    return sorted(items_of(values), key=call, reverse=bool(reverse))


def _extreme(choose: Callable[..., Any]) -> Callable[..., Any]:
    def choice(*values: Any, key: Any = None, **default: Any) -> Any:
        call = None if key is None else _function(key).call
        if set(default) - {"default"}:
            raise TypeError(f"{choose.__name__}() got an unexpected keyword argument")
        if len(values) == 1:
            return choose(items_of(values[0]), key=call, **default)
        return choose(*values, key=call, **default)

    return choice


def _dict(*values: Any, **named: Any) -> dict[Any, Any]:
    if not values:
        return dict(**named)
    if len(values) > 1:
        raise TypeError("dict expected at most 1 argument")
    if isinstance(values[0], dict):
        return dict(values[0], **named)
    return dict([tuple(items_of(pair)) for pair in items_of(values[0])], **named)


def _int(value: Any = 0, base: int = 10) -> int:
    if isinstance(value, str):
        if len(value) > _MOST_DIGITS:
            raise Refused("an integer of thousands of digits is not accepted")
        return int(value, base)
    return int(value)


def _round(number: Any, digits: Any = None) -> Any:
    if isinstance(digits, int) and abs(digits) > 400:
        raise Refused("rounding to hundreds of digits is not accepted")
    if type(number) not in NUMBERS:
        raise TypeError(f"type {type(number).__name__} doesn't define __round__ method")
    return round(number) if digits is None else round(number, digits)


def _sum(values: Any, start: Any = 0) -> Any:
    total = start
    if isinstance(start, str):
        raise TypeError("sum() can't sum strings [use ''.join(seq) instead]")
    for value in items_of(values):
        if type(value) not in NUMBERS and not isinstance(value, (list, tuple)):
            raise TypeError(f"cannot add a {type(value).__name__}")
        total = bounded(total + value)
    return total


def _str(value: Any = "") -> str:
    return str(value)


_TYPES = {
    kind.__name__: kind
    for kind in (str, int, float, bool, list, dict, tuple, set, frozenset, range)
}


def _isinstance(value: Any, kinds: Any) -> bool:
    wanted = kinds if isinstance(kinds, tuple) else (kinds,)
    return isinstance(value, tuple(_TYPES[_function(k).name] for k in wanted))


def _zip(*values: Any) -> list[Any]:
    return list(zip(*map(items_of, values), strict=False))


def _enumerate(values: Any, start: int = 0) -> list[Any]:
    return list(enumerate(items_of(values), start))


def _abs(value: Any) -> Any:
    return abs(value)


_BUILTINS: dict[str, Callable[..., Any]] = {
    "abs": _abs,
    "all": lambda values: all(items_of(values)),
    "any": lambda values: any(items_of(values)),
    "bool": lambda value=False: bool(value),
    "dict": _dict,
    "divmod": lambda a, b: divmod(a, b),
    "enumerate": _enumerate,
    "filter": _filter,
    "float": lambda value=0.0: float(value),
    "frozenset": lambda values=(): frozenset(items_of(values)),
    "int": _int,
    "isinstance": _isinstance,
    "len": lambda values: len(values),
    "list": lambda values=(): items_of(values),
    "map": _map,
    "max": _extreme(max),
    "min": _extreme(min),
    "ord": lambda letter: ord(letter),
    "range": lambda *limits: bounded_range(*limits),
    "repr": lambda value: repr(value),
    "reversed": lambda values: items_of(values)[::-1],
    "round": _round,
    "set": lambda values=(): set(items_of(values)),
    "sorted": _sorted,
    "str": _str,
    "sum": _sum,
    "tuple": lambda values=(): tuple(items_of(values)),
    "zip": _zip,
}


def bounded_range(*limits: Any) -> range:
    """``range(...)`` of few enough numbers."""
    found = range(*limits)
    if not -1 <= (found.stop - found.start) // found.step <= MOST_ITEMS:
        if (found.stop - found.start) * found.step <= 0:
            return range(0)
        raise Refused(f"more than {MOST_ITEMS} items are not accepted")
    return found


FUNCTIONS: Mapping[str, Function] = {n: Function(n, call) for n, call in _BUILTINS.items()}
"""Python's own functions, as far as an expression may call them."""

_PLAIN_MATH = (
    "acos acosh asin asinh atan atan2 atanh cbrt ceil copysign cos cosh degrees dist erf erfc exp "
    "exp2 expm1 fabs floor fma fmod frexp fsum gamma gcd hypot isclose isfinite isinf isnan isqrt "
    "ldexp lgamma log log10 log1p log2 modf nextafter pow radians remainder sin sinh sqrt sumprod "
    "tan tanh trunc ulp"
)


def _small(call: Callable[..., Any]) -> Callable[..., Any]:
    """Let a function have small integers only: its results grow faster than any power."""

    def checked(*numbers: Any) -> Any:
        if any(isinstance(n, int) and abs(n) > 500 for n in numbers):
            raise Refused(f"math.{call.__name__} of numbers above 500 is not accepted")
        return call(*numbers)

    return checked


def _product(values: Any, *, start: Any = 1) -> Any:
    total = start
    for value in items_of(values):
        if type(value) not in NUMBERS:
            raise TypeError(f"cannot multiply by a {type(value).__name__}")
        total = times(total, value)
    return total


def _least_multiple(*numbers: int) -> int:
    total = 1
    for number in numbers:
        total = bounded(math.lcm(total, number))
    return total


MATH: Mapping[str, Any] = {
    **{name: getattr(math, name) for name in ("pi", "e", "tau", "inf", "nan")},
    **{n: Function(n, getattr(math, n)) for n in _PLAIN_MATH.split() if hasattr(math, n)},
    **{n: Function(n, _small(getattr(math, n))) for n in ("factorial", "comb", "perm")},
    "prod": Function("prod", _product),
    "lcm": Function("lcm", _least_multiple),
}
"""The module ``math``: constants and functions."""


# Methods ------------------------------------------------------------------------------


def _join(text: str, values: Any) -> str:
    parts = items_of(values)
    if sum(len(p) + len(text) for p in parts if isinstance(p, str)) > LONGEST_TEXT:
        raise Refused(f"a text of more than {LONGEST_TEXT} characters is not accepted")
    return text.join(parts)


def _replace(text: str, old: str, new: str, count: int = -1) -> str:
    if len(text) + (text.count(old) + 1) * len(new) > LONGEST_TEXT:
        raise Refused(f"a text of more than {LONGEST_TEXT} characters is not accepted")
    return text.replace(old, new, count)


def _pad(method: Callable[..., str]) -> Callable[..., str]:
    def padded(text: str, width: int, *fill: str) -> str:
        if width > LONGEST_TEXT:
            raise Refused(f"a text of more than {LONGEST_TEXT} characters is not accepted")
        return method(text, width, *fill)

    return padded


def _get(values: dict[Any, Any], key: Any, default: Any = None) -> Any:
    return dict.get(values, key, default)


_STR = (
    "capitalize casefold count endswith find index isalnum isalpha isascii isdecimal isdigit "
    "isidentifier islower isnumeric isspace istitle isupper lower lstrip partition removeprefix "
    "removesuffix rfind rindex rpartition rsplit rstrip split splitlines startswith strip swapcase "
    "title upper"
)
_OF_LISTS: Sequence[str] = ("count", "index")

METHODS: Mapping[type, Mapping[str, Callable[..., Any]]] = {
    str: {
        **{name: getattr(str, name) for name in _STR.split()},
        "join": _join,
        "replace": _replace,
        **{name: _pad(getattr(str, name)) for name in ("center", "ljust", "rjust", "zfill")},
    },
    list: {name: getattr(list, name) for name in _OF_LISTS},
    tuple: {name: getattr(tuple, name) for name in _OF_LISTS},
    dict: {
        "get": _get,
        "keys": lambda values: list(dict.keys(values)),
        "values": lambda values: list(dict.values(values)),
        "items": lambda values: list(dict.items(values)),
    },
    float: {"is_integer": float.is_integer},
}
"""Methods that change nothing, by the exact type of the value. ``format`` is none of them: its
templates read attributes."""


def method_table(value: Any, dotted: Iterable[type]) -> Mapping[str, Callable[..., Any]]:
    """Return the methods of a value; wrapped YAML has those of what it wraps."""
    kind = type(value)
    if kind in METHODS:
        return METHODS[kind]
    if kind in tuple(dotted):
        return METHODS[dict if isinstance(value, dict) else list]
    return {}
