"""Messages of a page, read with bounds: nothing in them may cost more than a moment."""

from __future__ import annotations

import json
import math
from typing import Any

LONGEST = 64 * 1024
_DEEPEST = 8
_LARGEST = 2**53


class BadMessage(ValueError):
    """A message that is not understood; ``number`` is its id, as far as it has a sane one."""

    def __init__(self, reason: str, number: int | None = None) -> None:
        self.number = number
        super().__init__(reason)


def read_message(text: str | bytes) -> dict[str, Any]:
    """Return a request: an object with an ``id`` that is a natural number.

    Raises
    ------
    BadMessage
        If it is too long or nested too deeply, no JSON, holds NaN, an infinity or an integer that
        no double holds, or has no such id.
    """
    if len(text) > LONGEST:
        raise BadMessage("the message is too long")
    try:
        if isinstance(text, bytes):
            text = text.decode("utf-8")
        if _depth(text) > _DEEPEST:
            raise BadMessage("the message is nested too deeply")
        request = json.loads(text, parse_constant=_refuse, parse_int=_integer, parse_float=_number)
    except (ValueError, RecursionError) as error:
        reason = str(error) if isinstance(error, BadMessage) else "the message is no JSON"
        raise BadMessage(reason) from None
    number = request.get("id") if isinstance(request, dict) else None
    if type(number) is not int or not number >= 0:
        raise BadMessage("the message has no id")
    assert isinstance(request, dict)
    return request


def _depth(text: str) -> int:
    # Brackets within text count as well: no message of ours holds any.
    depth = deepest = 0
    for letter in text:
        if letter in "[{":
            depth += 1
            deepest = max(deepest, depth)
        elif letter in "]}":
            depth -= 1
    return deepest


def _refuse(word: str) -> Any:
    raise BadMessage(f"the message holds {word}")


def _integer(digits: str) -> int:
    if len(digits) > 17 or abs(int(digits)) > _LARGEST:
        raise BadMessage("the message holds an integer of too many digits")
    return int(digits)


def _number(digits: str) -> float:
    value = float(digits)
    if not math.isfinite(value):
        raise BadMessage("the message holds a number that is not finite")
    return value
