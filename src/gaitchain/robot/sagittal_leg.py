"""The leg in its own plane: the angles of hip, knee and ankle that hold it, and loads.

A closed form for limits that are asked for without a simulator. Joints about other axes
are at 0, soles level and the trunk upright; the full chain is `balance.leg_kinematics`.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gaitchain.errors import UnreachableError
from gaitchain.robot.leg_model import MOSTLY, LegModel

_Plane = complex
"""A vector ahead + 1j up; turned by an angle about y, heel up, by exp(-1j angle)."""


class Bend(NamedTuple):
    """How a leg is bent."""

    hip: float
    """[rad]"""
    knee: float
    """[rad]"""
    ankle: float
    """[rad]"""
    fold: float
    """Between thigh and shank, 0 for a straight leg [rad]."""
    knee_ahead: float
    """Of the ankle point [m]."""


@dataclass(frozen=True)
class SagittalLeg:
    """The left leg between its hip's and its ankle's pitch joints."""

    joints: tuple[int, int, int]
    """Hip, knee and ankle among the joints of a leg."""
    signs: tuple[float, float, float]
    """+1 where the joint turns about +y."""
    hip_at: _Plane
    """From the pelvis [m]."""
    thigh: _Plane
    """Hip to knee, all joints at 0 [m]."""
    shank: _Plane
    """Knee to ankle joint, likewise [m]."""
    foot: _Plane
    """Ankle joint to ankle point, sole level [m]."""
    level: float
    """Sum of the pitches with which the sole is level [rad]."""
    forward: float
    """+1 or -1: the way the knee bends."""

    def bend(self, ahead: float, height: float) -> Bend:
        """Return the angles with which the pelvis is there, sole level.

        Out of reach the leg is straight, and points there.

        Args:
            ahead: pelvis ahead of the ankle point [m].
            height: above it [m].

        Raises:
            UnreachableError: the leg cannot be as short.
        """
        way = -complex(ahead, height) - self.hip_at - self.foot
        long, short = abs(self.thigh), abs(self.shank)
        cosine = (abs(way) ** 2 - long**2 - short**2) / (2.0 * long * short)
        if cosine < -1.0:
            raise UnreachableError(f"{abs(way):.4f} m from hip to ankle: too near")
        fold = math.acos(min(cosine, 1.0))
        straight = math.remainder(_pitch(self.thigh) - _pitch(self.shank), math.tau)
        knee = straight + self.forward * fold
        leg = self.thigh + self.shank * _turn(knee)
        hip = math.remainder(_pitch(way) - _pitch(leg), math.tau)
        ankle = math.remainder(self.level - hip - knee, math.tau)
        pitches = zip(self.signs, (hip, knee, ankle), strict=True)
        q = [sign * pitch for sign, pitch in pitches]
        at = complex(ahead, height) + self.hip_at + self.thigh * _turn(hip)
        return Bend(q[0], q[1], q[2], fold, at.real)

    def stands_ahead(self, legs: LegModel) -> float:
        """Return how far the pelvis is ahead of the ankle point in the stand [m]."""
        hip, knee, _ = (
            sign * float(legs.stand[j])
            for sign, j in zip(self.signs, self.joints, strict=True)
        )
        leg = self.thigh * _turn(hip) + self.shank * _turn(hip + knee)
        return -(self.hip_at + leg + self.foot).real

    def within(
        self, legs: LegModel, bend: Bend, parts: tuple[float, float, float]
    ) -> bool:
        """Return whether all three angles are in a part of their joints' ranges.

        Args:
            legs: the joints.
            bend: the angles.
            parts: for hip, knee and ankle, about the middle of the range.
        """
        for angle, joint, part in zip(bend[:3], self.joints, parts, strict=True):
            low, high = float(legs.lower[joint]), float(legs.upper[joint])
            if abs(angle - 0.5 * (low + high)) > part * 0.5 * (high - low):
                return False
        return True


def sagittal_leg(legs: LegModel) -> SagittalLeg | None:
    """Return the left leg of a model in its plane; None where it does not have one."""
    y, knee = legs.axis[0, :, 1], legs.knee
    about_y = np.flatnonzero(np.abs(y) > MOSTLY).tolist()
    if knee not in about_y or not about_y[0] < knee < about_y[-1]:
        return None
    at_knee = about_y.index(knee)
    hip, ankle = about_y[at_knee - 1], about_y[at_knee + 1]
    joints = hip, knee, ankle
    signs = _sign(y[hip]), _sign(y[knee]), _sign(y[ankle])
    stand = [s * float(legs.stand[j]) for s, j in zip(signs, joints, strict=True)]
    level = sum(stand)
    at = [complex(v[0], v[2]) for v in legs.at[0]]
    thigh, shank = sum(at[hip + 1 : knee + 1]), sum(at[knee + 1 : ankle + 1])
    sole = sum(at[ankle + 1 :], complex(legs.foot_at[0, 0], legs.foot_at[0, 2]))
    straight = math.remainder(_pitch(thigh) - _pitch(shank), math.tau)
    bent = math.remainder(stand[1] - straight, math.tau)
    return SagittalLeg(
        joints=joints,
        signs=signs,
        hip_at=sum(at[: hip + 1]),
        thigh=thigh,
        shank=shank,
        foot=sole * _turn(level),
        level=level,
        forward=math.copysign(1.0, bent),
    )


def _sign(value: float) -> float:
    return math.copysign(1.0, value)


def _turn(pitch: float) -> complex:
    return complex(math.cos(pitch), -math.sin(pitch))


def _pitch(vector: complex) -> float:
    """Return the angle about y that turns straight ahead into a direction [rad]."""
    return -math.atan2(vector.imag, vector.real)
