"""Arms written as rows of Denavit and Hartenberg, and what is made of named ones, once."""

import functools
import tempfile
from itertools import pairwise
from pathlib import Path

import numpy as np

import pinsing
from pinsing.description.dh_table import dh_to_urdf, read_dh

# Alpha in degrees, a, d, and where they are not 0 and "revolute" theta in degrees and the kind.
CRX = [
    (-90, 0, 0.245), (0, 0.71, 0, -90), (-90, 0, 0), (90, 0, 0.54), (-90, 0, -0.15), (0, 0, 0.16),
]  # fmt: skip
GOFA = [
    (-90, 0, 0.265), (0, 0.444, 0, -90), (-90, 0.11, 0), (90, 0, 0.47), (-90, 0.08, 0),
    (0, 0, 0.101, 180),
]  # fmt: skip
HOLLOW = [(90, 0, 0.5), (0, 0.43, 0), (-90, 0.02, 0.15), (60, 0, 0.43), (-60, 0, 0)]
"""Of twists that are no quarter turns: without its last row."""


def row_matrix(convention: str, alpha: float, a: float, d: float, theta: float) -> np.ndarray:
    """A row as textbooks have it, (4, 4)."""
    ct, st, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
    if convention == "standard":  # Paul 1981
        rows = [ct, -st * ca, st * sa, a * ct], [st, ct * ca, -ct * sa, a * st], [0, sa, ca, d]
    else:  # Craig 1986, Eq. (3.6)
        rows = [ct, -st, 0, a], [st * ca, ct * ca, -sa, -sa * d], [st * sa, ct * sa, ca, ca * d]
    return np.array([*rows, [0, 0, 0, 1]])


def dh_text(rows, limits=(-180, 180), convention="standard"):
    """The table of some rows, which may have limits of their own; slides go from -1 to 1 m."""
    text = f"name: made\nconvention: {convention}\nunits: {{angle: deg, length: m}}\nrows:\n"
    for alpha, a, d, *rest in rows:
        theta, kind, own = (*rest, *(0, "revolute", None)[len(rest) :])
        low, high = own or (limits if kind == "revolute" else (-1, 1))
        text += f"  - {{alpha: {alpha}, a: {a}, d: {d}, theta: {theta}, type: {kind}"
        text += "}\n" if kind == "continuous" else f", limits: [{low}, {high}]}}\n"
    return text


def dh_arm(rows, task="pose", limits=(-180, 180)):
    """The arm of some rows (standard convention)."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "made.dh.yaml")
        path.write_text(dh_text(rows, limits))
        return pinsing.load(dh_to_urdf(read_dh(path)), task=task)


def snake(joints):
    """Neighbouring axes at right angles and at a distance: no three meet or are parallel."""
    a, d, alpha = (0.2, 0.15, 0.25), (0.1, 0.05), (90, -90)
    rows = [(alpha[i % 2], a[i % 3], d[i % 2]) for i in range(joints)]
    return dh_arm(rows, limits=(-170, 170))


def along(path, count=300):
    """Points all along a way (K, n), ``count`` from each waypoint to the next."""
    return np.concatenate([np.linspace(a, b, count) for a, b in pairwise(path)])


@functools.cache
def arm_of(name, **options):
    return pinsing.load(name, **options)


@functools.cache
def form_of(name):
    return pinsing.closed_form(arm_of(name))


@functools.cache
def aspects_of(name, limits=True):
    return pinsing.aspects(form_of(name), limits)
