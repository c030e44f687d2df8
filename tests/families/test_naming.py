"""Wrist, elbow and shoulder: given where the geometry warrants it, and nowhere else."""

from __future__ import annotations

import numpy as np
import pytest
from arms import textbook
from test_inverse_oracle import CRX, PUMA, UR5, made

import pinsing
from pinsing.description.catalog import data_folder
from pinsing.errors import UnknownNameError
from pinsing.robot.load import load

UR = {"shoulder": "wrist center above the base axis"}


def titles(arm: pinsing.Arm) -> dict[str, str]:
    """Title and condition of the families that have one."""
    form = pinsing.closed_form(arm, prove=False)
    named = [f for f in form if f.title]
    assert len({f.title for f in named}) == len(named)
    return {f.title: f.where() for f in named}


@pytest.mark.parametrize(
    ("name", "wanted"),
    [
        ("ur5", UR | {"wrist": "wrist_2_joint = 0° or 180°", "elbow": "elbow_joint = 0° or 180°"}),
        ("puma560", UR | {"wrist": "q5 = 0° or 180°", "elbow": "q3 = -87.3084° or 92.6916°"}),
        ("irb1400", UR | {"wrist": "q5 = 0° or 180°", "elbow": "q3 = -80.5377° or 99.4623°"}),
        ("z1", UR | {"wrist": "joint5 = ±90°", "elbow": "joint3 = 14.653° or -165.347°"}),
        (
            "kinova",
            UR
            | {
                "wrist": "j2s6s200_joint_5 = 0° or 180°",
                "elbow": "j2s6s200_joint_3 = 0° or 180°",
            },
        ),
        ("stanford", {"wrist": "q5 = 0° or 180°", "shoulder": "q2 = 0° or 180°"}),
        (
            "iiwa14",
            {
                "elbow": "q4 = 0° or 180°",
                "shoulder": "q2 = 0° or 180° and q3 = ±90°",
                "wrist": "q5 = ±90° and q6 = 0° or 180°",
            },
        ),
        ("surgical7", {}),
        ("scara", {}),
        ("planar3r", {}),
        ("panda", {}),
        ("xarm7", {}),
        ("so101", {}),
    ],
)
def test_catalogue(name: str, wanted: dict[str, str]) -> None:
    assert titles(load(name)) == wanted


GANTRY = [("x", 0, 90), ("y", 0, 90), ("z", 0, 0)]


def test_negatives() -> None:
    assert titles(made(CRX)) == {}
    assert set(titles(made(UR5))) == set(titles(made(PUMA))) == {"wrist", "elbow", "shoulder"}
    position = textbook("puma560", "position")
    assert titles(position) == {}
    bent = [(d, a, 70 if i == 4 else alpha) for i, (d, a, alpha) in enumerate(UR5)]
    assert "wrist" in titles(made(bent)) or titles(made(bent)) == {}


def test_gantry_has_a_wrist_alone(tmp_path) -> None:
    slides = ["{a: 0, alpha: 90, d: 0, type: prismatic, limits: [-1, 1]}"] * 2
    turns = ["{a: 0, alpha: %s, d: 0}" % alpha for alpha in (90, -90, 0)]
    rows = [*slides, slides[0].replace("alpha: 90", "alpha: 0"), *turns]
    path = tmp_path / "gantry.dh.yaml"
    path.write_text(
        "name: gantry\nconvention: standard\njoints:\n" + "".join(f"  - {r}\n" for r in rows)
    )
    assert set(titles(load(str(path)))) <= {"wrist"}


NAMED = {
    "anymal_b_simple_description/robots/anymal-kinova.urdf",
    "b1_description/urdf/b1-z1.urdf",
}


@pytest.mark.slow
def test_chains_of_example_robot_data() -> None:
    """No leg, head, finger or wheel has a name; arms have those of their joints."""
    from scripts_path import survey_jobs

    for job in survey_jobs():
        arm = load(str(data_folder() / job.file), tip=job.tip, base=job.base)
        if arm.n in (6, 7):
            check_names(arm)


def test_lookup_and_json() -> None:
    form = pinsing.closed_form(load("ur5"), prove=False)
    assert form["wrist"] is form["F2"]
    assert form["F2"].title == "wrist"
    assert [f.name for f in form] == ["F1", "F2", "F3"]
    with pytest.raises(UnknownNameError, match="elbow"):
        form["elbo"]
    again = pinsing.ClosedForm.from_json(form.to_json())
    assert again["shoulder"].name == "F3"
    q = np.array([0, -1.2, 1.3, -1, np.pi, 0])
    assert form["wrist"].where(q) == "wrist_2_joint = 180°"


@pytest.mark.parametrize("name", ["ur5", "stanford", "iiwa14"])
def test_gradients(name: str) -> None:
    form = pinsing.closed_form(load(name), prove=False)
    rng = np.random.default_rng(1)
    n = form.families[0].n
    steps = 1e-4 * np.eye(n)
    for q in rng.uniform(-1.5, 1.5, (2, n)):
        for family in form:
            ends = [[family.distance(q + s * h, gap=1e-9).upper for s in (1, -1)] for h in steps]
            slope = (np.array(ends) @ [1, -1]) / 2e-4
            assert np.allclose(family.gradient(q), slope, atol=1e-6)
        for certify in (False, True):
            found = pinsing.clearance(form, q, certify=certify, gap=1e-9)
            near = [
                [
                    pinsing.clearance(form, q + s * h, certify=certify, gap=1e-9).lower
                    for s in (1, -1)
                ]
                for h in steps
            ]
            assert np.allclose(found.gradient, np.array(near) @ [1, -1] / 2e-4, atol=1e-4)
