"""What public functions take: every argument is held against its annotation.

``@checked`` reads the annotations of a function once and compares each call with them, so that a
robot's name where a loaded arm belongs, a text for a number or a masked array is one clear line
and not a failure deep inside. Ranges and shapes are the function's own business.
"""

from __future__ import annotations

import functools
import inspect
import json
import math
import os
import sys
import types
import typing
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeVar

import numpy as np

from pinsing.errors import ArgumentError, ConfigurationError, OptionError
from pinsing.measures import Array, ArrayLike, Bool, NDArray
from pinsing.prose import unbroken

F = TypeVar("F", bound=Callable[..., Any])

MAX_SEED = int(np.iinfo(np.uint64).max)
MAX_STARTS = 10_000_000  # that one call draws

_NAMES = {
    "joints": "such as model.names[i]",
    **dict.fromkeys(("tip", "base"), "a frame's name, such as model.frames[i].name"),
}
_LONGEST = 40
_NUMBERS = "numbers"
_MOST_BITS = 1024  # whole numbers beyond it are no floats either


class _ArrayLike:
    """Stands for ``ArrayLike``, which is a union that dissolves in any other."""


@dataclass(frozen=True)
class _Kind:
    """One kind of value: what to call it, how to know it, how to get one."""

    expected: str
    fits: Callable[[Any], bool]
    hint: str = ""
    once: bool = False  # whether a generator will do
    classes: tuple[type, ...] = ()  # those that `stands_for` may make one of


_CONVERSIONS: dict[tuple[type, type], Callable[[Any], Any]] = {}


def stands_for(given: type, wanted: type, convert: Callable[[Any], Any]) -> None:
    """Let functions that are `checked` take class ``given`` for ``wanted``, by ``convert``."""
    _CONVERSIONS[given, wanted] = convert


def checked(function: F) -> F:
    """Make a function compare its arguments with their annotations before it runs."""
    # ArgumentError for another type, or NaN as one number, ConfigurationError where numbers belong.
    # ``Any`` and type variables let everything pass.

    @functools.wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        order, kinds = _parameters(function)
        given = dict(zip(order, args, strict=False)) | kwargs
        if len(given) < len(args) + len(kwargs):  # too many, or one twice: Python says which
            return function(*args, **kwargs)
        for name, kind in kinds.items():
            if name in given:
                value = given[name]
                if kind.once and isinstance(value, Iterator):
                    value = given[name] = tuple(value)  # looked at here, and there for the function
                if not kind.fits(value):
                    ways = [_CONVERSIONS.get((type(value), wanted)) for wanted in kind.classes]
                    if not any(ways):
                        raise _refusal(name, kind, value)
                    if name == "arm" and "forms" in inspect.signature(function).parameters:
                        given["forms"] = given.get("forms") or value
                    given[name] = next(filter(None, ways))(value)
        first = [given.pop(name) for name in order[: len(args)]]
        return function(*first, **given)

    return typing.cast(F, call)


def real_numbers(values: ArrayLike, name: str, own: bool = True) -> Array:
    """Return real numbers as floats, a copy if ``own``; ConfigurationError for anything else."""
    if not _are_numbers(values):
        raise _no_numbers(name, values)
    return np.array(values, dtype=float) if own else np.asarray(values, dtype=float)


def columns_of(values: Any, names: Sequence[str], called: str) -> Any:
    """Return columns ``names`` of a table (pandas, Polars, Arrow) or entries of a Series, in order.

    All else is returned as it is. ConfigurationError if a column is missing, doubled, or another.
    """
    if type(values) in (np.ndarray, list, tuple):
        return values
    labels = getattr(values, "column_names", None)  # Arrow
    labels = getattr(values, "columns", None) if labels is None else labels
    labels = getattr(values, "index", None) if labels is None else labels
    found = [] if labels is None or callable(labels) else list(labels)
    if not any(isinstance(name, str) for name in found):  # numbered, not named
        return values
    unknown = [name for name in found if name not in names]
    missing = [name for name in names if name not in found]
    twice = [name for name in names if found.count(name) > 1]
    for wrong, problem in ((missing, "has no"), (unknown, "has an unknown"), (twice, "has twice")):
        if wrong:
            raise ConfigurationError(
                f"{called} {problem} column {wrong[0]!s:.80}: the joints are {', '.join(names)}"
            )
    return np.stack([np.asarray(values[name]) for name in names], axis=-1)


def whole_number(value: int, name: str, least: int, most: int) -> int:
    """Return ``value`` if it is from ``least`` to ``most``; else raise OptionError."""
    OptionError.refuse_if(
        not least <= value <= most,
        f"{name} must lie between {least:,} and {most:,}, got {shown(value)}",
    )
    return int(value)


def shown(value: Any) -> str:
    """Return in a few words what a value is, whatever it is."""
    if _is_masked(value):
        return "a masked value" if value.ndim == 0 else "a masked array"
    if isinstance(value, int) and value.bit_length() > _MOST_BITS:
        return f"one too large ({value.bit_length():,} bits)"
    if value is None or isinstance(value, bool | int | float | complex | np.number):
        return _cut(f"{value}")
    if isinstance(value, bytes | bytearray):
        return "bytes"
    if isinstance(value, str):
        return f"the text {_cut(value)!r}"
    if isinstance(value, np.ndarray):
        return f"an array of {value.dtype} of shape {value.shape}"
    if isinstance(value, type):
        return f"the class {value.__name__}"
    kind = type(value).__name__
    return f"{'an' if kind[:1].lower() in 'aeiou' else 'a'} {kind}"


def _refusal(name: str, kind: _Kind, value: Any) -> ConfigurationError | ArgumentError:
    if kind.expected == _NUMBERS:
        return _no_numbers(name, value)
    if isinstance(value, Mapping | list | tuple) and _holds(value, _is_nan, False):
        return ConfigurationError(f"{name} holds a value that is not finite")
    said, called, hint = shown(value), type(value).__name__, kind.hint
    hint = hint and f"{hint} gives one"
    if kind.hint.startswith("pinsing.load("):
        if isinstance(value, str | os.PathLike):
            hint = f"load it first, {_load_call(os.fspath(value))}"
        elif said == "the class Model":
            hint = "load a built one, pinsing.load(pin.buildModelFromUrdf(path))"
        elif called in ("Model", "Data"):
            hint = "load it first, pinsing.load(model)" + ": Data is not needed" * (
                called == "Data"
            )
        elif type(getattr(value, "model", None)).__name__ == "Model":  # a RobotWrapper
            hint = "load it first, pinsing.load(robot)"
    return ArgumentError(name, kind.expected, said, hint or _NAMES.get(name, ""))


def _no_numbers(name: str, value: Any) -> ConfigurationError:
    """Return what is wrong with a value that `_are_numbers` does not take."""
    if _reals(value) is not None:
        return ConfigurationError(f"{name} holds a number too large for a float")
    order = ": give a list, values of joints in the order of arm.joints"
    hint = order if isinstance(value, Mapping) else ""
    return ConfigurationError(f"{name} must be {_NUMBERS}, got {shown(value)}{hint}")


def _holds(
    value: Any, what: Callable[[Any], bool], endless: bool, above: tuple[int, ...] = ()
) -> bool:
    """Whether it stands somewhere in lists and dicts; ``endless`` where they hold themselves."""
    if not isinstance(value, Mapping | list | tuple):
        return what(value)
    if id(value) in above or len(above) > 64:  # arrays of NumPy have no more axes
        return endless
    here = (*above, id(value))
    items = value.values() if isinstance(value, Mapping) else value
    return any(_holds(v, what, endless, here) for v in items)


def _is_nan(value: Any) -> bool:
    return isinstance(value, float | np.floating) and math.isnan(value)


def _load_call(robot: str | bytes) -> str:
    short = isinstance(robot, str) and robot.isprintable() and 0 < len(robot) <= _LONGEST
    return f"pinsing.load({json.dumps(robot if short else 'ur5', ensure_ascii=False)})"


def _cut(text: str) -> str:
    return text if len(text) <= _LONGEST else text[: _LONGEST - 3] + "..."


# Annotations --------------------------------------------------------------------------


@functools.cache
def _parameters(function: Callable[..., Any]) -> tuple[list[str], dict[str, _Kind]]:
    """Return the parameters that go by position, and the kinds of those annotated with a check."""
    names = {**sys.modules[function.__module__].__dict__, "ArrayLike": _ArrayLike}
    order, found = [], {}
    for name, p in inspect.signature(function).parameters.items():
        if p.kind is p.POSITIONAL_OR_KEYWORD:
            order.append(name)
        try:
            hint = eval(p.annotation, names) if isinstance(p.annotation, str) else Any
        except NameError:  # imported for type checking only
            continue
        if (kind := _kind_of(hint)) is not None:
            found[name] = kind
    return order, found


def _kind_of(hint: Any) -> _Kind | None:
    """Return the kind of value that an annotation asks for, None if any value may do."""
    origin, args = typing.get_origin(hint), typing.get_args(hint)
    for known in (hint, origin):
        if known in _PLAIN:
            return _PLAIN[known]
    if origin in (typing.Union, types.UnionType):
        return _union([_kind_of(a) for a in args])
    if origin is Literal:
        return _Kind(" or ".join(map(repr, args)), lambda v: isinstance(v, str) and v in args)
    if origin is tuple and args and Ellipsis not in args:
        every, size = _sequence(_kind_of(args[0])), len(args)
        return _Kind(f"{size} values", lambda v: every.fits(v) and len(v) == size)
    if origin in (Sequence, Iterable, list, tuple):
        return _sequence(_kind_of(args[0]) if args else None, once=origin is Iterable)
    if origin is Mapping:
        key, item = (_kind_of(a) or _Kind("", lambda v: True) for a in args)
        return _Kind(
            "a mapping",
            lambda v: (
                isinstance(v, Mapping) and all(key.fits(k) and item.fits(x) for k, x in v.items())
            ),
        )
    kind = origin or hint
    if not isinstance(kind, type) or kind is object or getattr(kind, "_is_protocol", False):
        return None
    name = kind.__name__.removesuffix("Like")
    article = "an" if name[0] in "AEIOU" else "a"
    made_by = getattr(kind, "made_by", "")
    return _Kind(f"{article} {name}", lambda v: isinstance(v, kind), made_by, classes=(kind,))


def _union(kinds: list[_Kind | None]) -> _Kind | None:
    some = [k for k in kinds if k is not None]
    if len(some) < len(kinds):
        return None
    return _Kind(
        " or ".join(dict.fromkeys(k.expected for k in some if k.expected != "None")),
        lambda v: any(k.fits(v) for k in some),
        next((k.hint for k in some if k.hint), ""),
        any(k.once for k in some),
        tuple(c for k in some for c in k.classes),
    )


def _sequence(item: _Kind | None, once: bool = False) -> _Kind:
    """Items are looked at one by one; ``once`` tells whether a generator will do."""
    text = item is not None and item.expected == "text"

    def fits(value: Any) -> bool:
        if isinstance(value, str):
            return text
        if isinstance(value, np.ndarray) and (text or not _are_numbers(value) or not value.ndim):
            return False
        # No generator, which is empty the second time.
        plain = isinstance(value, Collection) and not isinstance(value, bytes | bytearray | Mapping)
        return plain and (item is None or all(map(item.fits, value)))

    return _Kind("names" if text else "a sequence of values", fits, once=once)


def _is_number(value: Any) -> bool:
    if not _is_real(value):
        return False
    try:
        return not math.isnan(float(value))  # NaN is no number
    except OverflowError:  # an integer beyond all floats
        return False


def _is_real(value: Any) -> bool:
    # A span of time counts as an integer in NumPy, and True as one in Python.
    return isinstance(value, int | float | np.integer | np.floating) and not isinstance(
        value, bool | np.timedelta64
    )


def _is_count(value: Any) -> bool:
    return (
        isinstance(value, int | np.integer)
        and _is_real(value)
        and int(value).bit_length() <= _MOST_BITS
    )


def _is_mask(value: Any) -> bool:
    """Return True if a value is true or false, joint by joint."""
    if isinstance(value, np.ndarray):
        return value.dtype.kind == "b" and not _is_masked(value)
    if isinstance(value, list | tuple):
        return len(value) > 0 and all(isinstance(v, bool | np.bool_) or _is_mask(v) for v in value)
    return False


def _are_numbers(value: Any) -> bool:
    """Return True if NumPy would make floats of a value without losing anything."""
    if type(value) is np.ndarray and value.dtype.kind == "f":  # most often: not masked, as it is
        return True
    if (array := _reals(value)) is None:
        return False
    if array.dtype.kind == "O":  # integers of any size
        try:
            array.astype(float)
        except OverflowError:
            return False
    return True


def _reals(value: Any) -> NDArray[Any] | None:
    """Return an array of real numbers of whatever size, None if a value is none."""
    plain = isinstance(value, str | bytes | bytearray | Mapping | type(None))
    if plain or _holds(value, _is_masked, True):
        return None
    try:
        array = np.asarray(value)
    except (TypeError, ValueError, OverflowError):
        return None
    if array.dtype.kind == "O":
        return array if array.size > 0 and all(map(_is_real, array.flat)) else None
    return array if array.dtype.kind in "iuf" else None


def _is_masked(value: Any) -> bool:
    # Who has a masked array has imported numpy.ma; importing it here would cost each start 25 ms.
    ma = sys.modules.get("numpy.ma")
    kind = getattr(ma, "MaskedArray", None)  # another thread may be at importing it just now
    return kind is not None and isinstance(value, kind)


_PLAIN: dict[Any, _Kind | None] = {
    Any: None,
    type(None): _Kind("None", lambda v: v is None),
    bool: _Kind("True or False", lambda v: isinstance(v, bool | np.bool_)),
    int: _Kind("a whole number", _is_count),
    float: _Kind("a number", _is_number),
    str: _Kind("text", lambda v: isinstance(v, str)),
    **dict.fromkeys((_ArrayLike, np.ndarray), _Kind(_NUMBERS, lambda v: _are_numbers(v))),
    Bool: _Kind("a mask", _is_mask),
    Callable: _Kind("a function", callable),
    os.PathLike: _Kind("a path", lambda v: isinstance(v, os.PathLike)),
}


_EXACT = 12
"""Digits after which a configuration is as singular as it was."""


def typed(
    q: ArrayLike,
    prismatic: ArrayLike,
    degrees: bool = False,
    digits: int = _EXACT,
    *,
    loose: Collection[int] = (),
    room: int | None = None,
) -> str:
    """Return a configuration as an option to paste: ``--q 0.4,pi/2,-1.2``, ``--deg --q ...``."""
    # Six digits do for ``loose`` joints, else ``digits``. Beyond ``room`` columns the numbers stand
    # in quotes, so that a line may end between two of them.
    slides = np.asarray(prismatic, dtype=bool)
    words = [
        number_text(float(value), bool(slides[j]), degrees, 6 if j in loose else digits)
        for j, value in enumerate(np.asarray(q, dtype=float))
    ]
    turns = not degrees and bool((np.abs(np.asarray(q, dtype=float))[~slides] > math.tau).any())
    option = f"{'--deg ' if degrees else '--rad ' * turns}--q "
    line = unbroken(option) + ",".join(words)
    if room is None:
        return line.replace("\u00a0", " ")
    return (
        line if len(line) <= room or len(words) < 2 else f'{unbroken(option)}"{", ".join(words)}"'
    )


def number_text(value: float, slides: bool, degrees: bool, digits: int) -> str:
    """A joint value as it is typed, radians or ``degrees``; quarter turns are exact."""
    quarters = round(value / (math.pi / 2))
    if not slides and quarters and abs(value - quarters * math.pi / 2) < 1e-14 * abs(value):
        return f"{90 * quarters}" if degrees else _quarter_turns(quarters)
    if abs(value) < 10.0 ** -min(digits + 3, _EXACT):
        return "0"
    return f"{math.degrees(value) if degrees and not slides else value:.{digits}g}"


def _quarter_turns(quarters: int) -> str:
    """``pi/2``, ``-pi``, ``3pi/2``."""
    sign = "-" if quarters < 0 else ""
    top, bottom = (abs(quarters), "/2") if quarters % 2 else (abs(quarters) // 2, "")
    return f"{sign}{top if top > 1 else ''}pi{bottom}"
