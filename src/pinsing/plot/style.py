"""What the plots have in common: size, colours, ticks in multiples of pi, legends outside."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.colors import ListedColormap
from matplotlib.ticker import FixedLocator, FuncFormatter, MaxNLocator
from matplotlib.transforms import ScaledTranslation

from pinsing.measures import Array, NDArray

COLUMN = 3.5
"""Width of a figure, inches: one column of a paper."""

# Okabe and Ito, "Color universal design" (2008), the dark ones first.
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
DASHES = ("-", "--", "-.", ":")

SINGULAR = "#000000"
SMALL = 8
"""Size of the letters, points."""


def new_axes(height: float = 2.7) -> Axes:
    """Axes of a new figure, one column wide."""
    return plt.figure(figsize=(COLUMN, height), layout="constrained").add_subplot()


def joint_symbol(index: int, slides: bool) -> str:
    """``$q_5$`` or ``$d_3$`` of a joint counted from 0."""
    return f"${'d' if slides else 'q'}_{{{index + 1}}}$"


def unit(slides: bool, degrees: bool = False) -> str:
    """Return what the values of a joint are in."""
    return "m" if slides else "deg" if degrees else "rad"


def joint_label(index: int, slides: bool, degrees: bool = False) -> str:
    """Axis label with its unit."""
    return f"{joint_symbol(index, slides)} [{unit(slides, degrees)}]"


def value_label(value: float, slides: bool, degrees: bool = False) -> str:
    r"""``0``, ``$-\pi/2$``, ``0.52``, ``30°`` or ``0.1 m``."""
    if slides:
        return f"{value:g} m"
    if degrees:
        return f"{round(math.degrees(value), 2) + 0.0:g}°"
    return pi_text(value) or f"{value:.3g}"


def held_label(index: int, slides: bool, value: float, degrees: bool = False) -> str:
    """``$q_2$ = 30°`` of a joint counted from 0."""
    return f"{joint_symbol(index, slides)} = {value_label(value, slides, degrees)}"


def pi_text(value: float, *, limit: int = 12) -> str:
    """A multiple of pi in LaTeX, empty if the value is no simple one."""
    part = Fraction(value / math.pi).limit_denominator(limit)
    if abs(float(part) * math.pi - value) > 1e-9 * max(1.0, abs(value)):
        return ""
    if part == 0:
        return "0"
    sign = "-" if part < 0 else ""
    top, bottom = abs(part.numerator), part.denominator
    pi = r"\pi" if top == 1 else rf"{top}\pi"
    return f"${sign}{pi}$" if bottom == 1 else f"${sign}{pi}/{bottom}$"


def pi_ticks(axis: Axis, low: float, high: float) -> None:
    """Ticks at multiples of pi, at most seven of them."""
    for part in (1 / 12, 1 / 6, 1 / 4, 1 / 2, 1, 2, 4, 8):
        step = part * math.pi
        first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
        if last - first < 6:
            break
    axis.set_major_locator(FixedLocator((step * np.arange(first, last + 1)).tolist()))
    axis.set_major_formatter(FuncFormatter(lambda value, _: pi_text(value, limit=24)))


def degree_ticks(axis: Axis, low: float, high: float) -> None:
    """Ticks at round numbers of degrees on an axis in radians, at most six: they are wide."""
    span = math.degrees(high - low)
    step = next((s for s in (5, 10, 15, 30, 45, 60, 90, 180, 360) if span / s <= 5), 720)
    if span >= 15:
        first = math.ceil(math.degrees(low) / step - 1e-9)
        last = math.floor(math.degrees(high) / step + 1e-9)
        places = step * np.arange(first, last + 1, dtype=float)
    else:
        places = np.array(MaxNLocator(5).tick_values(math.degrees(low), math.degrees(high)))
        places = places[(places >= math.degrees(low)) & (places <= math.degrees(high))]
    axis.set_major_locator(FixedLocator(np.radians(places).tolist()))
    axis.set_major_formatter(
        FuncFormatter(
            lambda value, _: f"{round(math.degrees(value), 6) + 0.0:g}°".replace("-", "\u2212")
        )
    )


def ticks(axis: Axis, low: float, high: float, slides: bool, degrees: bool = False) -> None:
    """Ticks of a joint: pi or degrees for angles, plain for prismatic joints; small letters."""
    if degrees and not slides:
        degree_ticks(axis, low, high)
    elif not slides and high - low > 0.5:
        pi_ticks(axis, low, high)
    else:
        axis.set_major_locator(MaxNLocator(5))  # numbers with decimals are wide
    axis.set_tick_params(labelsize=SMALL)


def labelled(
    ax: Axes, x: str, y: str, title: str = "", *, size: float = SMALL, numbers: float = SMALL
) -> None:
    """Label axes in letters and numbers of a size, with a small title."""
    ax.set_xlabel(x, fontsize=size)
    ax.set_ylabel(y, fontsize=size)
    ax.set_title(title, fontsize=SMALL)
    ax.tick_params(labelsize=numbers)


def coloured(ax: Axes, x: Array, y: Array, numbers: NDArray[Any], colours: Sequence[str]) -> None:
    """Colour a grid by whole numbers from 0 on; NaN stays blank."""
    ax.pcolormesh(
        x, y, numbers, cmap=ListedColormap(list(colours)), vmin=-0.5, vmax=len(colours) - 0.5,
        shading="nearest", rasterized=True,
    )  # fmt: skip


def legend_below(
    ax: Axes,
    columns: int = 2,
    *,
    at: tuple[float, float] | None = None,
    left: bool = False,
    title: str = "",
) -> None:
    """Draw a legend under the axis label, or ``at`` shares of the axes, below its ``title``."""
    handles, labels = ax.get_legend_handles_labels()
    if handles:
        # Half an inch, for ticks and label: of low axes a share of the height is less.
        down = ScaledTranslation(0, -0.5, ax.figure.dpi_scale_trans)
        ax.legend(
            handles,
            labels,
            loc="upper left" if left else "upper center",
            bbox_to_anchor=at or (-0.17 if left else 0.5, 0),
            bbox_transform=ax.transAxes if at else ax.transAxes + down,
            borderaxespad=0.5 if at else 0,
            title=title or None,
            title_fontsize=SMALL - 2,
            ncols=min(columns, len(handles)),
            fontsize=SMALL - 1,
            frameon=False,
            handlelength=2.4,
        )


def legend_of_all(every: Sequence[Axes], columns: int = 2) -> None:
    """One legend under several axes of a figure; what several have stands in it once."""
    found: dict[str, Any] = {}
    for ax in every:
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            found.setdefault(label, handle)
    if found:
        every[0].figure.legend(
            list(found.values()),
            list(found),
            loc="outside lower center",
            ncols=min(columns, len(found)),
            fontsize=SMALL - 1,
            frameon=False,
            handlelength=2.4,
        )


def plain(name: str) -> str:
    """A name as it is: matplotlib takes what stands between dollar signs for mathematics."""
    return short(name).replace("$", r"\$")


def short(text: str, longest: int = 50) -> str:
    """A text for a legend."""
    return text if len(text) <= longest else text[: longest - 1].rstrip() + "…"
