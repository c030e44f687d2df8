"""The value of an equation as it is printed: a sum of products, juxtaposed."""

import math
import re
from collections.abc import Mapping

_CALL = re.compile(r"(cos|sin)([²³]?)(?: (\w+)|\(\(([^()]*)\)/2\)|\(([^()]*)/2\)|\(([^()]*)\))")


def value_of(text: str, joints: Mapping[str, float]) -> float:
    text = _CALL.sub(lambda found: f"({_call(found, joints)!r})", text)
    text = re.sub(r"√(\d)", lambda found: repr(math.sqrt(int(found[1]))), text).replace("^", "**")
    return float(eval(re.sub(r"(?<=[\w)]) (?=[\w(])", " * ", text), {}, dict(joints)))


def _call(found: re.Match[str], joints: Mapping[str, float]) -> float:
    """A printed sine or cosine."""
    name, power, plain, halved, half, inner = found.groups()
    angle = re.sub(r"(\d+) (?=q)", r"\1*", plain or halved or half or inner)
    angle = re.sub(r"([\d.]+)°", lambda degrees: repr(math.radians(float(degrees[1]))), angle)
    value = eval(angle, {}, dict(joints)) / (2 if halved or half else 1)
    return float(getattr(math, name)(value) ** {"": 1, "²": 2, "³": 3}[power])
