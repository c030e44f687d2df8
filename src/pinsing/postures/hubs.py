"""Ways through a graph: of each place the next one towards a hub of its component."""

from __future__ import annotations

import numpy as np

from pinsing._types import Ints


def tree_to_hubs(label: Ints, order: Ints, a: Ints, b: Ints) -> Ints:
    """Of each place the next one on the way with the fewest steps to a hub, (N,).

    The hub of a component is the place of it that comes first in ``order``; there, and where the
    label is -1, it is -1.

    Parameters
    ----------
    label : (N,) array of int
        Component of each place; -1 for places that are in none.
    order : (N,) array of int
        What comes first: the least.
    a, b : (E,) arrays of int
        Places that are joined.
    """
    a, b = np.append(a, b), np.append(b, a)
    rank = np.argsort(a, kind="stable")
    a, b = a[rank], b[rank]
    start = np.searchsorted(a, np.arange(len(label) + 1))
    tree = np.full(len(label), -1, dtype=np.int64)
    rows = np.lexsort((order, label))
    rows = rows[label[rows] >= 0]
    front = rows[np.unique(label[rows], return_index=True)[1]]
    seen = np.zeros(len(label), dtype=bool)
    seen[front] = True
    while len(front):
        count = start[front + 1] - start[front]
        frm = np.repeat(front, count)
        within = np.arange(int(count.sum())) - np.repeat(np.cumsum(count) - count, count)
        to = b[np.repeat(start[front], count) + within]
        new = ~seen[to]
        to, one = np.unique(to[new], return_index=True)
        tree[to] = frm[new][one]
        seen[to] = True
        front = to
    return tree


def row_between(tree: Ints, first: int, last: int) -> list[int] | None:
    """Places from one to another: to the hub and back, less what is common."""
    rows = []
    for place in (first, last):
        row = [place]
        while tree[row[-1]] >= 0:
            row.append(int(tree[row[-1]]))
        rows.append(row)
    there, back = rows
    if there[-1] != back[-1]:
        return None
    while len(there) > 1 and len(back) > 1 and there[-2] == back[-2]:
        there.pop()
        back.pop()
    return there + back[-2::-1]
