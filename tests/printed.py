"""The value of an equation as it is printed: a sum of products, juxtaposed."""

import math
import re
from collections.abc import Mapping
from typing import Any

import numpy as np

_CALL = re.compile(r"(cos|sin)([²³]?)(?: (\w+)|\(\(([^()]*)\)/2\)|\(([^()]*)/2\)|\(([^()]*)\))")


def value_of(text: str, joints: Mapping[str, Any]) -> Any:
    """Of joint values that are numbers, or arrays of the same shape."""
    text = _CALL.sub(_call, text).replace("^", "**")
    python = re.sub(r"(?<=[\w)]) (?=[\w(])", " * ", text)
    return eval(python, {"cos": np.cos, "sin": np.sin, "sqrt": math.sqrt}, dict(joints))


def _call(found: re.Match[str]) -> str:
    """A printed sine or cosine."""
    name, power, plain, halved, half, inner = found.groups()
    angle = re.sub(r"(\d+) (?=[qd])", r"\1*", plain or halved or half or inner)
    angle = re.sub(r"([\d.]+)°", lambda degrees: repr(math.radians(float(degrees[1]))), angle)
    return f"({name}(({angle}) / {2 if halved or half else 1})**{' ²³'.index(power or ' ') + 1})"
