"""What public functions take and give: arguments held against annotations, results as JSON.

``@checked`` reads the annotations of a function once and compares each call with them, so that a
robot's name where a loaded arm belongs, a text for a number or a masked array is one clear line
and not a failure deep inside. Ranges and shapes are the function's own business.

All results have JSON in common, both ways, with a named and versioned schema.
"""

from __future__ import annotations

import contextlib
import dataclasses
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
from enum import Enum
from typing import TYPE_CHECKING, Any, ClassVar, Generic, Literal, TypeVar

import numpy as np

from pinsing._package import Advised
from pinsing.errors import ArgumentError, ConfigurationError, OptionError, PinsingError, ResultError
from pinsing.measures import Array, ArrayLike, Bool, NDArray
from pinsing.prose import WIDTH, html_text, one_line, shortened, unbroken

if TYPE_CHECKING:
    from typing_extensions import Self

F = TypeVar("F", bound=Callable[..., Any])
T = TypeVar("T")

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
        return function(**given)

    return typing.cast(F, call)


def real_numbers(values: ArrayLike, name: str, own: bool = True) -> Array:
    """Return real numbers as floats, a copy if ``own``; ConfigurationError for anything else."""
    if wrong := _no_numbers(values):
        raise ConfigurationError(f"{name} {wrong}")
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
    if not least <= value <= most:
        raise OptionError(f"{name} must lie between {least:,} and {most:,}, got {shown(value)}")
    return int(value)


def shown(value: Any) -> str:
    """Return in a few words what a value is, whatever it is."""
    if _is_masked(value):
        return "a masked value" if value.ndim == 0 else "a masked array"
    if isinstance(value, int) and value.bit_length() > _MOST_BITS:
        return f"one too large ({value.bit_length():,} bits)"
    if value is None or isinstance(value, bool | int | float | complex | np.number):
        return shortened(f"{value}", _LONGEST)
    if isinstance(value, bytes | bytearray):
        return "bytes"
    if isinstance(value, str):
        return f"the text {shortened(value, _LONGEST)!r}"
    if isinstance(value, np.ndarray):
        return f"an array of {value.dtype} of shape {value.shape}"
    if isinstance(value, type):
        return f"the class {value.__name__}"
    kind = type(value).__name__
    return f"{'an' if kind[:1].lower() in 'aeiou' else 'a'} {kind}"


def _refusal(name: str, kind: _Kind, value: Any) -> ConfigurationError | ArgumentError:
    if kind.expected == _NUMBERS:
        return ConfigurationError(f"{name} {_no_numbers(value)}")
    if isinstance(value, Mapping | list | tuple) and _holds(value, _is_nan, False):
        return ConfigurationError(f"{name} holds a value that is not finite")
    hint = kind.hint and f"{kind.hint} gives one"
    if kind.hint.startswith("pinsing.load("):
        hint = _how_to_load(value) or hint
    return ArgumentError(name, kind.expected, shown(value), hint or _NAMES.get(name, ""))


def _how_to_load(value: Any) -> str:
    """Return how a robot is made of what was given in place of one; empty if it is none."""
    called = type(value).__name__
    if isinstance(value, str | os.PathLike):
        path = os.fspath(value)
        short = isinstance(path, str) and path.isprintable() and 0 < len(path) <= _LONGEST
        robot = json.dumps(path if short else "ur5", ensure_ascii=False)
        return f"load it first, pinsing.load({robot})"
    if shown(value) == "the class Model":
        return "load a built one, pinsing.load(pin.buildModelFromUrdf(path))"
    if called in ("Model", "Data"):
        needless = ": Data is not needed" if called == "Data" else ""
        return f"load it first, pinsing.load(model){needless}"
    wrapper = type(getattr(value, "model", None)).__name__ == "Model"
    return "load it first, pinsing.load(robot)" if wrapper else ""


def _no_numbers(value: Any) -> str:
    """Say why NumPy makes no floats of a value without losing anything; empty where it does."""
    if type(value) is np.ndarray and value.dtype.kind == "f":  # most often: not masked, as it is
        return ""
    plain = isinstance(value, str | bytes | bytearray | Mapping | type(None))
    array = None
    if not plain and not _holds(value, _is_masked, True):
        with contextlib.suppress(TypeError, ValueError, OverflowError):
            array = np.asarray(value)
    if array is not None and array.dtype.kind in "iuf":
        return ""
    numbers = [] if array is None or array.dtype.kind != "O" else array.ravel().tolist()
    if numbers and all(map(_is_real, numbers)):  # integers of any size
        fits = all(map(_is_float, numbers))
        return "" if fits else "holds a number too large for a float"
    order = ": give a list, values of joints in the order of arm.joints"
    return f"must be {_NUMBERS}, got {shown(value)}{order * isinstance(value, Mapping)}"


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
        if isinstance(value, np.ndarray) and (text or not value.ndim or _no_numbers(value)):
            return False
        # No generator, which is empty the second time.
        plain = isinstance(value, Collection) and not isinstance(value, bytes | bytearray | Mapping)
        return plain and (item is None or all(map(item.fits, value)))

    return _Kind("names" if text else "a sequence of values", fits, once=once)


def _is_number(value: Any) -> bool:
    return _is_real(value) and _is_float(value) and not math.isnan(value)  # NaN is no number


def _is_float(value: Any) -> bool:
    """Return True if a real number is not too large for a float."""
    try:
        float(value)
    except OverflowError:
        return False
    return True


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


def _is_masked(value: Any) -> bool:
    # Without numpy.ma, whose import would cost each start 25 ms.
    return isinstance(value, np.ndarray) and hasattr(type(value), "mask")


_PLAIN: dict[Any, _Kind | None] = {
    Any: None,
    type(None): _Kind("None", lambda v: v is None),
    bool: _Kind("True or False", lambda v: isinstance(v, bool | np.bool_)),
    int: _Kind("a whole number", _is_count),
    float: _Kind("a number", _is_number),
    str: _Kind("text", lambda v: isinstance(v, str)),
    **dict.fromkeys((_ArrayLike, np.ndarray), _Kind(_NUMBERS, lambda v: not _no_numbers(v))),
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
        # pi/2, -pi, 3pi/2
        top, bottom = (abs(quarters), "/2") if quarters % 2 else (abs(quarters) // 2, "")
        turned = f"{'-' * (quarters < 0)}{top if top > 1 else ''}pi{bottom}"
        return f"{90 * quarters}" if degrees else turned
    if abs(value) < 10.0 ** -min(digits + 3, _EXACT):
        return "0"
    return f"{math.degrees(value) if degrees and not slides else value:.{digits}g}"


class JsonResult(Advised):
    """Mixin of frozen dataclasses whose fields are numbers, text, arrays, tuples and their like.

    Numbers that JSON does not have are written as the strings "inf", "-inf" and "nan".
    """

    schema: ClassVar[str]

    def __init_subclass__(cls) -> None:
        # Here, since a dataclass writes one of all its fields where the class itself has none.
        if "__repr__" not in cls.__dict__:
            cls.__repr__ = _one_line  # type: ignore[method-assign]
        if "text" not in cls.__annotations__ and not hasattr(cls, "text"):
            cls.text = cls.__str__  # type: ignore[attr-defined]

    def __str__(self) -> str:
        text: Any = getattr(type(self), "text", str)
        if text is not str and text is not type(self).__str__:
            return str(text(self))
        fields: Any = dataclasses.fields(self)  # type: ignore[arg-type]
        lines = (f"{f.name}: {getattr(self, f.name)}" for f in fields)
        return "\n".join(line for line in lines if len(line) < WIDTH and "\n" not in line)

    def _repr_html_(self) -> str:
        return html_text(str(self), block=True)

    def to_dict(self) -> dict[str, Any]:
        """Return a plain dictionary, ready for ``json.dumps``; the first key is the schema.

        Examples
        --------
        >>> import pinsing
        >>> pinsing.at(pinsing.load("planar3r"), [0, 0, 1]).to_dict()["status"]
        'singular'
        """
        return {"schema": self.schema, **encode(self)}

    @checked
    def to_json(self, indent: int | None = 2) -> str:
        """Return JSON text (strict: no NaN or Infinity tokens).

        Parameters
        ----------
        indent : int or None
            Spaces of each level; None for one line.

        Examples
        --------
        >>> import pathlib, pinsing
        >>> state = pinsing.at(pinsing.load("planar3r"), [0, 0, 1])
        >>> pathlib.Path("state.json").write_text(state.to_json()) > 1000
        True
        """
        return json.dumps(self.to_dict(), indent=indent, allow_nan=False, ensure_ascii=False)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Self:
        """Rebuild from ``to_dict``.

        Parameters
        ----------
        data : mapping
            What ``to_dict`` has made, or ``json.loads`` of what ``to_json`` has.

        Raises
        ------
        ResultError
            If the schema is another one, a field is missing, or what they hold does not fit
            together.

        Examples
        --------
        >>> import pinsing
        >>> state = pinsing.at(pinsing.load("planar3r"), [0, 0, 1])
        >>> pinsing.State.from_dict(state.to_dict()).rank
        2
        """
        found = data.get("schema") if isinstance(data, Mapping) else None
        ResultError.refuse_if(
            found != cls.schema, f"expected data of schema {cls.schema!r}, found {found!r:.80}"
        )
        try:
            made = _decode(cls, {k: v for k, v in data.items() if k != "schema"})
        except KeyError as error:
            raise ResultError(f"damaged {cls.schema} data: {error} is missing") from None
        except (TypeError, ValueError, OverflowError, RecursionError, PinsingError) as error:
            raise ResultError(f"damaged {cls.schema} data: {error!s:.200}") from None
        try:  # rows too few, or numbers of what there is not: found here and not later
            with np.errstate(over="raise", invalid="raise"):
                str(made)
        except _UNFIT as error:
            raise ResultError(
                f"damaged {cls.schema} data: its parts do not fit together ({error!s:.200})"
            ) from None
        return typing.cast("Self", made)

    @classmethod
    @checked
    def from_json(cls, text: str) -> Self:
        """Rebuild from ``to_json``.

        Parameters
        ----------
        text : str
            JSON.

        Raises
        ------
        ResultError
            If the text is not JSON, of another schema, or incomplete.

        Examples
        --------
        >>> import pinsing
        >>> state = pinsing.at(pinsing.load("planar3r"), [0, 0, 1])
        >>> pinsing.State.from_json(state.to_json()).rank
        2
        """
        try:
            data = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise ResultError(f"not JSON: {error!s:.200}") from None
        return cls.from_dict(data)


class Sequenced(Generic[T]):
    """Mixin of results that are read as a sequence: of the items of one field."""

    _items: ClassVar[str]

    def __len__(self) -> int:
        return len(getattr(self, self._items))

    def __iter__(self) -> Iterator[T]:
        return iter(getattr(self, self._items))

    def __getitem__(self, index: int) -> T:
        return typing.cast(T, getattr(self, self._items)[index])


_UNFIT = (TypeError, ValueError, LookupError, ArithmeticError, AttributeError, RecursionError)


def _one_line(self: Any) -> str:
    kind: Any = type(self)
    plain = kind.__str__ is JsonResult.__str__ and not hasattr(kind, "text")
    return one_line(kind.__name__, "" if plain else str(self))


def encode(value: Any) -> Any:
    """Turn dataclasses, arrays, tuples and odd floats into what JSON has."""
    if isinstance(value, float | np.floating):
        number = float(value)
        return number if np.isfinite(number) else str(number)
    if isinstance(value, np.ndarray):
        return encode(value.tolist())
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        written = [f.name for f in dataclasses.fields(value) if f.metadata.get("json", True)]
        return {name: encode(getattr(value, name)) for name in written}
    if isinstance(value, Mapping):
        return {str(k): encode(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [encode(v) for v in value]
    if isinstance(value, np.bool_ | np.integer):
        return value.item()
    return value.value if isinstance(value, Enum) else value


def _decode(kind: Any, value: Any) -> Any:
    origin, args = typing.get_origin(kind), typing.get_args(kind)
    if isinstance(value, str):
        _whole(value)
    if dataclasses.is_dataclass(kind) and isinstance(kind, type):
        hints = typing.get_type_hints(kind)
        data = _expect(dict, value)
        read = {}
        for f in dataclasses.fields(kind):
            left_out = f.metadata.get("optional") and f.name not in data
            if f.metadata.get("json", True) and not left_out:
                read[f.name] = _decode(hints[f.name], data[f.name])
        return kind(**read)
    if origin in (typing.Union, types.UnionType):
        if value is None and type(None) in args:
            return None
        return _decode(next(a for a in args if a is not type(None)), value)
    if origin is tuple:
        items = _expect(list, value)
        if len(args) == 2 and args[1] is Ellipsis:
            return tuple(_decode(args[0], v) for v in items)
        return tuple(_decode(a, v) for a, v in zip(args, items, strict=True))
    if origin in (dict, Mapping) or getattr(origin, "__name__", "") == "Mapping":
        return {_decode(args[0], k): _decode(args[1], v) for k, v in _expect(dict, value).items()}
    if origin in (np.ndarray, NDArray):  # the latter is an alias with a name from NumPy 2.5 on
        scalar = args[0] if origin is NDArray else typing.get_args(args[1])[0]
        return _array(scalar if isinstance(scalar, type) else np.float64, value)
    if kind is float:
        if isinstance(value, bool):
            raise TypeError("found true or false where a number belongs")
        return float(value)
    if isinstance(kind, type) and issubclass(kind, Enum):
        return kind(value)
    return _expect(kind, value) if kind in (int, bool, str) else value


def _whole(text: str) -> None:
    """Refuse half a character, which JSON can name but no file can hold."""
    try:
        text.encode()
    except UnicodeEncodeError:
        raise ValueError(f"{text!a:.80} holds half a character") from None


def _expect(kind: type, value: Any) -> Any:
    if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
        raise TypeError(f"found {type(value).__name__} where {kind.__name__} belongs")
    return value


def _array(scalar: type[np.generic], value: Any) -> Any:
    """Array of a kind out of nested lists, in which "inf" and "nan" are text."""
    if not isinstance(value, list) and not np.isscalar(value):
        raise TypeError(f"found {type(value).__name__} where an array belongs")
    array = np.array(_numbers(value))
    if array.size and not np.can_cast(array.dtype, scalar, "same_kind"):
        raise TypeError(f"found {array.dtype} numbers where {scalar.__name__} belongs")
    return array.astype(scalar)


def _numbers(value: Any) -> Any:
    """Nested lists with "inf" and "nan" turned back into floats."""
    if isinstance(value, list):
        return [_numbers(v) for v in value]
    return float(value) if isinstance(value, str) else value
