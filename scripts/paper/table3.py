"""Table 3: determinant, manipulability and condition number of the 7-DOF arm."""

from __future__ import annotations

import itertools

import numpy as np

from paper import printed
from paper.printed import surgical_configuration as configuration
from paper.rows import AGREES, DIFFERS, Row, Section
from pinsing.kinematics.at import at


def _all(row: printed.Table3Row) -> list[np.ndarray]:
    """Every configuration that a row of Table 3 stands for."""
    out = []
    for values in itertools.product((0.0, np.pi), repeat=len(row.special)):
        for fixed in itertools.product(*row.fixed.values()):
            joints = dict(zip(row.special, values, strict=True))
            joints.update(zip(row.fixed, fixed, strict=True))
            out.append(configuration(**joints))
    return out


def _range(values: list[float], digits: int = 4) -> str:
    low, high = min(values), max(values)
    if np.isinf(low):
        return "∞"
    if high < 1e-12:
        return "0"
    if np.isinf(high) or high > low * (1 + 1e-6):
        top = "∞" if np.isinf(high) else f"{high:.{digits}g}"
        return f"{low:.{digits}g} to {top}"
    return f"{low:.{digits}g}"


def bound(arm) -> float:
    """Largest σ1² σ2 σ3 σ4 σ5 that any Jacobian of the arm can have, from its Frobenius norm.

    The norm is at most that of one sliding column and six turning ones as far off as all lengths
    together. Lagrange: of squares with a given sum, the product with the first counted twice is
    largest when it has two sixths of it and each of the other four one sixth.
    """
    reach = sum(abs(a) + abs(d) for _, a, d, slides in printed.TABLE_2 if not slides)
    total = 1 + (arm.n - 1) * (1 + reach**2)
    return total / 3 * (total / 6) ** 2


def make(arm) -> Section:
    rows, products = [], []
    for k, row in enumerate(printed.TABLE_3, 1):
        states = [at(arm, q) for q in _all(row)]
        det = _range([s.determinant for s in states])
        omega = _range([s.manipulability for s in states])
        K = _range([s.condition_number for s in states])
        singular = all(s.singular for s in states)
        said = row.K == "inf"
        if said:
            verdict, reason = (AGREES if singular else DIFFERS), "Exactly singular."
        elif singular:
            verdict = DIFFERS
            reason = "Exactly singular, not nearly: q4 = 0, ±π alone is a family."
        else:
            verdict = DIFFERS
            worst = max(s.condition_number for s in states)
            reason = f"Well away from singular: K at most {worst:.3g}."
        if not said:
            products.append((k, float(row.omega) * float(row.K)))
        special = " = ".join(row.special) + " = 0 (±π)"
        fixed = ", ".join(
            f"{n} = {'±' if len(v) > 1 else ''}{v[0]:.5g}" for n, v in row.fixed.items()
        )
        shown = "∞" if said else f"{int(row.K):,}"
        rows.append(
            Row(
                f"Row {k}: {special}" + (f", {fixed}" if fixed else ""),
                f"det {row.det}, ω {row.omega}, K {shown}",
                f"det {det}, ω {omega}, K {K}",
                verdict,
                reason,
            )
        )
    limit = bound(arm)
    least = min(p for _, p in products)
    squared = [float(r.omega) * float(r.K) ** 0.5 for r in printed.TABLE_3 if r.K != "inf"]
    consistent = max(
        abs(float(r.omega) ** 2 / float(r.det) - 1)
        for r in printed.TABLE_3
        if r.K != "inf" and len(r.det.rstrip("0")) > 12
    )
    rows.append(
        Row(
            "Rows 4 to 13: ω times K",
            f"{least:.0f} to {max(p for _, p in products):.0f}",
            f"at most {limit:.2f} for any Jacobian of this arm",
            DIFFERS,
            "ω K = σ1² σ2 σ3 σ4 σ5 is bounded by the Frobenius norm, in metres: the printed ω and "
            "K exclude each other, whatever the configuration. With K read as the condition "
            f"number of J Jᵀ (its square) they do not (ω √K is {min(squared):.2f} to "
            f"{max(squared):.2f}); the values are still not those of Table 2.",
        )
    )
    rows.append(
        Row(
            "det = ω²",
            "in every row",
            f"det and ω² agree to {consistent:.1%} in the rows with three digits",
            AGREES if consistent < 0.05 else DIFFERS,
            "By definition, Equations (5) and (14).",
        )
    )
    return Section(
        "Table 3: determinant, manipulability and condition number of the 7-DOF arm",
        text=(
            "d1 = 0.3 m, other joints at π/3. Each row stands for several configurations (0, π, "
            "and both signs); where they differ, the range is given. det is that of J Jᵀ.",
        ),
        rows=tuple(rows),
    )
