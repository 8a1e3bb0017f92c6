"""Shape of a robot's steps relative to its size: time, crouch, step height, gains."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from gaitchain.gait.motion import Timing
from gaitchain.messages import CONTROL_PERIOD_S
from gaitchain.robot.robot import Robot

LEG = 0.592
"""Leg length of the robot for which the numbers below were found [m]."""

ARRIVAL = (0.08, 0.1)
"""How the swing foot arrives at kp_3, as `strides.ARRIVAL_COLUMNS`."""


@dataclass(frozen=True)
class StrideShape:
    """The numbers of a walk by strides that a search in physics may change."""

    step_s: float = 0.46
    """T for a leg of length `LEG` [s]; it scales with sqrt(leg / g)."""
    hip_height: float = 0.86
    """Hips above the ankles, part of the leg: long strides need bent knees."""
    stance: float = 1.0
    """Lateral distance of the ankles, part of that in which the robot's file stands."""
    lift: float = 0.066
    """Step height, part of the leg."""
    share: float = 0.5
    """Part of the swing path completed when the foot is highest."""
    share_rate: float = 1.4
    """Rate of `share` at that moment, per single support."""
    balance: Mapping[str, float] = field(default_factory=dict)
    """Factors on the gains that are derived from the robot."""

    def passing(self, leg_length: float) -> tuple[float, float, float]:
        """Return how the swing foot passes kp_2, as `strides.PASSING_COLUMNS`.

        Args:
            leg_length: leg length of the robot [m].
        """
        return self.share, self.share_rate, self.lift * leg_length

    def timing(self, robot: Robot, period_s: float = CONTROL_PERIOD_S) -> Timing:
        """Return a robot's step times.

        The step and its single support are whole control periods; the moment when the
        swing foot is highest need not be.

        Args:
            robot: the robot.
            period_s: control period [s].
        """
        factor = math.sqrt(robot.reduced.leg_length / LEG)
        step, single = (
            period_s * max(round(factor * time / period_s), 2)
            for time in (self.step_s, SINGLE_SHARE * self.step_s)
        )
        rise = _RISE * single
        return Timing(step, rise, single - rise)


SINGLE_SHARE = 0.415 / 0.46
"""Part of the step in single support."""
_RISE = 0.215 / 0.415  # part of the single support until the swing foot is highest

BOX_SHAPE = StrideShape(
    step_s=0.36,
    balance={"counter_swing": 3.0, "trunk": 1.4, "ankle": 0.7},
)
"""Shape for a robot of boxes, which is not searched by default: short steps, with which
it withstands pushes and blocks best, and gains for them (`docs/results.md`)."""

MODEL_SHAPE = StrideShape(
    step_s=0.425,
    hip_height=0.87,
    lift=0.068,
    share=0.445,
    share_rate=1.24,
    balance={
        "ankle": 0.25,
        "trunk": 1.65,
        "swing_tilt": 1.26,
        "inertia": 0.8,
        "far_zone": 0.7,
        "error_filter": 0.62,
        "foot_zmp": 0.77,
    },
)
"""Shape for a robot that was read from its model: the start of its own search."""
