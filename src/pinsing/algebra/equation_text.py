"""How equations are written: signs, coefficients, angles and powers, as plain text or LaTeX."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from pinsing.robot.surd import Exact, exact_text, parts_of


@dataclass(frozen=True)
class Style:
    """Plain text or LaTeX."""

    cos: str
    sin: str
    latex: bool

    @property
    def modulo(self) -> str:
        """What is said of whole turns."""
        return r"\pmod{360^\circ}" if self.latex else "(mod 360°)"

    def joint(self, name: str) -> str:
        """A joint's symbol."""
        return latex_symbol(name) if self.latex else name

    def power(self, name: str, exponent: int) -> str:
        """A joint's symbol with an exponent, unless that is one."""
        if exponent == 1:
            return self.joint(name)
        return f"{self.joint(name)}^{{{exponent}}}" if self.latex else f"{name}^{exponent}"

    def angle(self, radians: float) -> str:
        """An angle in degrees."""
        return format_angle(radians, self.latex)

    def small_angle(self, radians: float) -> str:
        """Like ``angle``, but never zero."""
        if round(math.degrees(radians), 4) != 0:
            return self.angle(radians)
        return f"{math.degrees(radians):.2g}" + (r"^\circ" if self.latex else "°")


PLAIN = Style("cos", "sin", False)


LATEX = Style(r"\cos ", r"\sin ", True)


def latex_symbol(symbol: str) -> str:
    r"""``q_{12}`` for q12, ``\alpha_{2}`` for alpha2; names of several words upright."""
    head = symbol.rstrip("0123456789")
    digits = symbol[len(head) :]
    if head == "alpha":
        head = r"\alpha"
    elif len(head) > 1:
        return rf"\mathrm{{{_SPECIAL.sub(_escaped, symbol)}}}"
    return f"{head}_{{{digits}}}" if digits else head


_SPECIAL = re.compile(r"[^A-Za-z0-9.]")


def _escaped(match: re.Match[str]) -> str:
    """A character that LaTeX would take for a command."""
    return rf"\{match[0]}" if match[0] in "_#$%&{} " else "-"


def format_angle(radians: float, latex: bool = False) -> str:
    """Degrees with as many digits as tell anything: ``90°``, ``-11.537°``."""
    degrees = math.degrees(radians)
    shown = round(degrees, 4)
    text = f"{shown:.10g}" if shown != 0 else "0"
    return text + (r"^\circ" if latex else "°")


def signed_sum(pieces: Sequence[tuple[float, str]], tight: bool = False) -> str:
    """Sum of signed pieces, a coefficient of one left out."""
    out = ""
    for k, (coefficient, body) in enumerate(pieces):
        sign = "-" if coefficient < 0 else "+"
        size = f"{abs(coefficient):.6g}"
        if not body:
            term = size
        elif size == "1":
            term = body
        else:
            term = f"{size} {body}"
        if k == 0:
            out = f"-{term}" if sign == "-" else term
        else:
            out += f"{sign}{term}" if tight else f" {sign} {term}"
    return out or "0"


def exact_sum(pieces: Sequence[tuple[Exact, str]], latex: bool) -> str:
    """Sum of pieces with exact numbers; sums with roots stand in brackets."""
    out = ""
    for number, body in pieces:
        parts = [p for p in parts_of(number) if p]
        negative = len(parts) == 1 and parts[0] < 0
        size = exact_text(-number if negative else number)
        if latex:
            size = re.sub(r"sqrt\((\d)\)", r"\\sqrt{\1}", size)
        size = f"({size})" if len(parts) > 1 else size
        shown = body if size == "1" and body else f"{size} {body}".strip()
        out += ("-" if negative else "") if not out else (" - " if negative else " + ")
        out += shown
    return out or "0"
