"""A robot that differs from its file in ways that are not told. Ours.

What is found out about it has to come from its log, as with a robot on a bench. It is
drawn once by its seed: walks differ in their noise and their commands only.
"""

from typing import Any

import numpy as np

_BANK = 0x41D  # of seeds: no other robot or world has these draws
_GAINS, _OFFSETS_DEG, _COM_M, _TILT_DEG = 0.4, 2.0, 0.02, 2.0
_DELAY_S, _BACKLASH_DEG = (0.0, 0.04), (0.0, 1.5)
_FLOOR, _DRY, _STICTION, _VISCOUS = (0.6, 1.0), (0.0, 0.03), (0.0, 1.0), (0.0, 0.05)
_NOISE = 1.0


def draw_hidden_robot(seed: int) -> dict[str, Any]:
    """Return the fields of `World` of a hidden robot.

    Servo gains are off by up to 40 % each, targets late by up to 40 ms, gears have up
    to 1.5 deg of play, encoders are off by up to 2 deg, the trunk's CoM by up to 2 cm
    along each axis, the IMU is turned by up to 2 deg; the servos have friction, the
    floor another one, and all sensors noise.

    Args:
        seed: of the robot.
    """
    rng = np.random.default_rng((_BANK, seed))

    def between(span: tuple[float, float]) -> float:
        return float(rng.uniform(*span))

    return {
        "plant_seed": int(rng.integers(2**63)),
        "gain_error": _GAINS,
        "encoder_offset_deg": _OFFSETS_DEG,
        "com_m": _COM_M,
        "imu_tilt_deg": _TILT_DEG,
        "delay_s": between(_DELAY_S),
        "backlash_deg": between(_BACKLASH_DEG),
        "friction": between(_FLOOR),
        "dry_friction": between(_DRY),
        "stiction": between(_STICTION),
        "viscous_friction": between(_VISCOUS),
        # Key poses' trials draw these anew for each walk: here it is one robot.
        "servo_gain": 1.0,
        "mass": 1.0,
        "model_error": 0.0,
        "noise": _NOISE,
        "doubt": 0.0,
    }
