"""Between the joint vector of an arm and the configuration of the whole model it was taken from.

The whole model's configuration is Pinocchio's: (nq,) numbers in the model's order, seven for a
floating base, cosine and sine for a continuous joint. The lengths n and nq are equal only where
the arm is the whole model and every joint is one number; then both mean the same, but for their
order where joints are traversed backwards.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pinsing._types import Array
from pinsing.errors import ConfigurationError
from pinsing.measures import ALIKE
from pinsing.robot.chains import frame_index
from pinsing.robot.joint_space import require_values
from pinsing.robot.models import way_between
from pinsing.robot.source import Coupling, Source

_UNIT = 1e-3
"""How far cosine and sine of a continuous joint may be from the unit circle."""


@dataclass(frozen=True, eq=False)
class Held:
    """A joint between base and tip that has no value in q: it follows others, or is locked."""

    name: str
    index: int  # in the whole model
    row: Array  # it is at ``q @ row + offset``, radians or metres
    offset: float
    slides: bool
    endless: bool  # whole turns do not matter to it
    why: str  # for messages: what it follows, or that it is locked

    def off(self, q: Array, value: Array | float) -> Array:
        """How far values (...) of the joint are from where q (..., n) puts it."""
        off = np.asarray(value - (q @ self.row + self.offset))
        return off - 2 * np.pi * np.round(off / (2 * np.pi)) if self.endless else off


@dataclass(frozen=True, eq=False)
class WholeModel:
    """The whole model, seen from an arm in it."""

    source: Source
    joints: tuple[str, ...]  # the arm's, base to tip
    tip: str
    coupling: Coupling | None

    def values(self, q: Array) -> Array:
        """One value (..., nv) for each joint that is not locked, of joint vectors (..., n)."""
        return q if self.coupling is None else self.coupling.values(q)

    def chain_q(self, q: Array, called: str) -> Array:
        """Return joint vectors (..., n) of such or of (..., nq); ConfigurationError if neither."""
        require_values(q, self.joints, called, int(self.source.full_model.nq))
        return q if q.shape[-1] == len(self.joints) else self.q_of(q)

    def chain_dq(self, dq: Array, called: str) -> Array:
        """Return joint speeds (n,), given such or (nv,); a joint that is held must not move."""
        whole = self.source.full_model
        if dq.shape == (len(self.joints),):
            return dq
        if dq.shape != (whole.nv,):
            raise ConfigurationError(
                f"{called} needs {len(self.joints)} values for {', '.join(self.joints)}, or the "
                f"whole model's {whole.nv}; got shape {dq.shape}",
                lengths=(len(self.joints), int(whole.nv)),
            )
        for j in self._on_the_way():
            speed = float(dq[whole.joints[j].idx_v])
            if abs(speed) > ALIKE:
                name = whole.names[j]
                raise ConfigurationError(
                    f"joint {name!r} is locked in this arm, but the whole model's {called} moves "
                    f"it at {speed:g}: load the arm with that joint as it is",
                    joint=name,
                    value=speed,
                )
        return np.array([dq[whole.joints[whole.getJointId(name)].idx_v] for name in self.joints])

    def _on_the_way(self) -> list[int]:
        """Joints of one value that are locked between base and tip."""
        whole, locked = self.source.full_model, set(self.source.locked)
        base = int(whole.frames[frame_index(whole, self.source.base)].parentJoint)
        last = int(whole.frames[frame_index(whole, self.tip)].parentJoint)
        # A floating base carries the arm's axes.
        path = way_between(whole, base, last).path
        return [j for j in path if j in locked and whole.joints[j].nv == 1]

    def require_length(self, q: Array, called: str) -> None:
        """Raise a ConfigurationError unless ``q`` is (..., nq)."""
        whole = int(self.source.full_model.nq)
        if q.ndim == 0 or q.shape[-1] != whole:
            raise ConfigurationError(
                f"{called} needs the whole model's {whole} values, got shape {q.shape}",
                lengths=(whole,),
            )

    def q_of(self, full_q: Array) -> Array:
        """Return joint vectors (..., n) of configurations (..., nq) of the whole model."""
        # ConfigurationError if a held joint is elsewhere. Angles are in (-pi, pi].
        whole = self.source.full_model
        kept = self.source.kept
        values = np.stack([self._value(j, full_q) for j in kept], axis=-1)
        names = [whole.names[j] for j in kept]
        q = values[..., [names.index(name) for name in self.joints]]
        for held in self.held():
            self._require(held, q, self._value(held.index, full_q))
        return q

    def held(self) -> list[Held]:
        """Joints between base and tip that have no value in q."""
        whole, joints, found = self.source.full_model, np.array(self.joints), []
        for row, j in enumerate(self.source.kept):
            if self.coupling is not None and whole.names[j] not in self.joints:
                share = self.coupling.matrix[row]
                leaders = " and ".join(map(repr, joints[share != 0].tolist())) or "a locked joint"
                why = f"follows {leaders} in the description"
                found.append((j, share, self.coupling.offset[row], why))
        rest, at = np.zeros(len(joints)), self.source.reference
        for j in self._on_the_way():
            found.append((j, rest, self._value(j, at), "is locked in this arm"))
        return [
            Held(
                whole.names[j],
                j,
                row,
                float(offset),
                whole.joints[j].shortname().startswith("JointModelP"),
                whole.joints[j].nq == 2,
                why,
            )
            for j, row, offset, why in found
        ]

    def full_q(self, q: Array, others: Array) -> Array:
        """Configurations (..., nq): ``others`` (nq,) with the arm at q (..., n)."""
        whole = self.source.full_model
        values = self.values(q)
        out = np.broadcast_to(others, (*q.shape[:-1], whole.nq)).copy()
        for row, j in enumerate(self.source.kept):
            i, value = whole.joints[j].idx_q, values[..., row]
            if whole.joints[j].nq == 2:
                out[..., i], out[..., i + 1] = np.cos(value), np.sin(value)
            else:
                out[..., i] = value
        return out

    def _value(self, joint: int, full_q: Array) -> Array:
        """Plain value of a joint with one degree of freedom, radians or metres."""
        whole = self.source.full_model
        entry = whole.joints[joint]
        i = entry.idx_q
        if entry.nq == 1:
            return np.asarray(full_q[..., i])
        c, s = full_q[..., i], full_q[..., i + 1]
        if not (np.abs(np.hypot(c, s) - 1) <= _UNIT).all():
            name = whole.names[joint]
            raise ConfigurationError(
                f"q of continuous joint {name!r} must be its cosine and sine "
                f"(entries {i} and {i + 1} of the whole model's {whole.nq})",
                joint=name,
            )
        return np.asarray(np.arctan2(s, c))

    def _require(self, held: Held, q: Array, value: Array) -> None:
        wrong = np.abs(held.off(q, value)) > ALIKE
        if not wrong.any():
            return
        here, there = float(value[wrong][0]), float(q[wrong][0] @ held.row + held.offset)
        raise ConfigurationError(
            f"joint {held.name!r} {held.why} and belongs at {there:g}, but the whole model's q "
            f"has it at {here:g}: give the arm's own {len(self.joints)} values, or load the arm "
            "with that joint as it is",
            joint=held.name,
            value=here,
            limits=(there, there),
        )
