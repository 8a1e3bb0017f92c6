"""Servos whose play, friction and resolution were published, as fields of a `World`.

Torques are parts of the stall torque, as a `World` has them; a robot's torque and speed
limits are taken for its servos' stall torque and no-load speed. What nobody published
is nominal, as of an ideal servo. Simulated only: no motor of ours was measured.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

_STEP_DEG = 360.0 / 4096.0  # encoder of 12 bit


class KnownServo(NamedTuple):
    """A servo as its maker and others measured it."""

    stall_n_m: float
    no_load_rad_s: float
    backlash_deg: float = 0.0
    dry_n_m: float = 0.0
    stribeck_n_m: float = 0.0
    """Friction at rest beyond the dry one."""
    viscous: float = 0.0
    """[N m s/rad]"""
    step_deg: float = _STEP_DEG
    """Of encoder and target."""

    @property
    def numbers(self) -> dict[str, float]:
        """Fields of a `World`."""
        return {
            "backlash_deg": self.backlash_deg,
            "dry_friction": self.dry_n_m / self.stall_n_m,
            "stiction": self.stribeck_n_m / self.dry_n_m if self.dry_n_m else 0.0,
            "viscous_friction": self.viscous * self.no_load_rad_s / self.stall_n_m,
            "no_load": 1.0,
            "target_step_deg": self.step_deg,
            "encoder_step_deg": self.step_deg,
        }


def _rpm(speed: float) -> float:
    return speed * math.tau / 60.0


KNOWN_SERVOS: Mapping[str, KnownServo] = {
    # [Robotis], 12 V, backlash 20 arcmin; friction: model M1 of [Duclusaud24].
    "mx106": KnownServo(8.4, _rpm(45.0), 0.33, 0.1035, 0.0, 0.0352),
    # The next three: [Robotis], 12 V, backlash 15 arcmin; friction is not published.
    "xm430-w350": KnownServo(4.1, _rpm(46.0), 0.25),
    "xh430-w350": KnownServo(3.4, _rpm(30.0), 0.25),
    "xm540-w270": KnownServo(10.6, _rpm(30.0), 0.25),
    # Stall torque and speed at 5 V by the motor of model M2 of [Duclusaud24]; [Robotis]
    # publishes no backlash.
    "xl330-m288": KnownServo(0.528, 13.1, 0.0, 0.0186, 0.0011, 0.00405),
    # 7.4 V, 19.5 kg cm, 52 rpm by [DFRobot]; friction: model M2 of [Duclusaud24]; play
    # as measured in [SO-ARM100], where its maker says at most 0.5 deg.
    "sts3215": KnownServo(1.91, _rpm(52.0), 1.0, 0.0382, 0.0262, 0.0667),
}
"""By name."""
