"""What all results have in common: JSON both ways, with a named and versioned schema."""

from __future__ import annotations

import dataclasses
import json
import types
import typing
from collections.abc import Callable, Mapping
from enum import Enum
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from pinsing._package import Advised
from pinsing.arguments import checked
from pinsing.errors import PinsingError, ResultError
from pinsing.measures import NDArray
from pinsing.notebook import one_line, text as notebook_text
from pinsing.prose import WIDTH

if TYPE_CHECKING:
    from typing_extensions import Self


class Written(NamedTuple):
    """How a field stands in JSON, where not as it is: its metadata under "json"."""

    name: str  # its key
    encode: Callable[[Any], Any]  # to what JSON has
    decode: Callable[[Any], Any]  # and back
    kind: Any  # what JSON has there


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
        return notebook_text(str(self), block=True)

    def to_dict(self) -> dict[str, Any]:
        """Return a plain dictionary, ready for ``json.dumps``; the first key is the schema.

        Examples
        --------
        >>> import pinsing
        >>> pinsing.at(pinsing.load("planar3r"), [0, 0, 1]).to_dict()["status"]
        'singular'
        """
        return {"schema": self.schema, **_encode_fields(self)}

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
            raise ResultError(f"damaged {cls.schema} data: {_short(error)}") from None
        try:  # rows too few, or numbers of what there is not: found here and not later
            with np.errstate(over="raise", invalid="raise"):
                str(made)
        except _UNFIT as error:
            raise ResultError(
                f"damaged {cls.schema} data: its parts do not fit together ({_short(error)})"
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
            raise ResultError(f"not JSON: {_short(error)}") from None
        return cls.from_dict(data)


_UNFIT = (TypeError, ValueError, LookupError, ArithmeticError, AttributeError, RecursionError)


def _short(error: Exception) -> str:
    text = "".join(c if c.isprintable() else "?" for c in str(error))
    return text if len(text) <= 200 else f"{text[:200]}..."


def _one_line(self: Any) -> str:
    kind: Any = type(self)
    plain = kind.__str__ is JsonResult.__str__ and not hasattr(kind, "text")
    return one_line(kind.__name__, "" if plain else str(self))


def _encode_fields(value: Any) -> dict[str, Any]:
    out = {}
    for f in dataclasses.fields(value):
        written = f.metadata.get("json", True)
        if isinstance(written, Written):
            out[written.name] = encode(written.encode(getattr(value, f.name)))
        elif written:
            out[f.name] = encode(getattr(value, f.name))
    return out


def encode(value: Any) -> Any:
    """Turn dataclasses, arrays, tuples and odd floats into what JSON has."""
    if isinstance(value, float | np.floating):
        number = float(value)
        return number if np.isfinite(number) else str(number)
    if isinstance(value, np.ndarray):
        return encode(value.tolist())
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return _encode_fields(value)
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
            written = f.metadata.get("json", True)
            if isinstance(written, Written):
                read[f.name] = written.decode(_decode(written.kind, data[written.name]))
            elif written and (f.name in data or not f.metadata.get("optional")):
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
        return {_key(args[0], k): _decode(args[1], v) for k, v in _expect(dict, value).items()}
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


def _key(kind: Any, key: str) -> Any:
    """Keys are text in JSON, whatever they were."""
    _whole(key)
    return kind(key) if kind in (int, float) else key


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
