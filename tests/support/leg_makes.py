"""Legs of five, six and seven joints."""

import numpy as np
from other_robots import with_legs

from gaitchain.balance.leg_kinematics import legs_of
from gaitchain.balance.rotations import rotation
from gaitchain.robot.box_robot import box_legs, load_box_robot
from gaitchain.robot.leg_model import LegModel

RES = load_box_robot("res")


AXES = {"yaw": (0, 0, 1), "roll": (1, 0, 0), "pitch": (0, 1, 0), "knee": (0, 1, 0)}


SIX = "pitch roll yaw knee pitch roll"


MAKES = (
    SIX,
    "yaw roll pitch knee pitch roll",
    "roll pitch yaw knee roll pitch",
    "yaw pitch roll knee pitch roll",
)


NO_YAW, NO_ANKLE_ROLL = "roll pitch knee pitch roll", "yaw roll pitch knee pitch"


SEVEN = "yaw roll pitch knee pitch yaw roll"


BENT = {"yaw": 0.1, "roll": 0.05, "pitch": -0.5, "knee": 1.0}


def make_legs(make, rng):
    """The legs of `make_robot` as walking online needs them."""
    return legs_of(make_robot(make, rng))


def make_robot(make, rng):
    """Mirrored legs of some make: joints offset by up to 5 cm, axes by 3 deg."""
    kinds = make.split()
    count, knee = len(kinds), kinds.index("knee")
    at = rng.uniform(-0.05, 0.05, (count, 3))
    at[0] += 0.0, 0.1, -0.05
    at[knee, 2] -= rng.uniform(0.2, 0.4)
    at[knee + 1, 2] -= rng.uniform(0.2, 0.4)
    axis = np.array([AXES[k] for k in kinds]) + rng.normal(0.0, 0.03, (count, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    mirror = np.array([1.0, -1.0, 1.0])
    full, both = box_legs(RES.reduced), (2 * count,)
    turn = rotation(*rng.uniform(-0.2, 0.2, 3))
    foot_at = rng.uniform(-0.02, 0.02, 3)
    stand = np.array([BENT[k] for k in kinds])
    lying = np.tile(np.eye(3), (2, count, 1, 1))
    legs = LegModel(
        joint_names=tuple(
            f"{side}_{i}_{k}" for side in "lr" for i, k in enumerate(kinds)
        ),
        knee=knee,
        at=np.stack([at, at * mirror]),
        axis=np.stack([axis, -axis * mirror]),
        com=np.zeros((2, count, 3)),
        inertia=lying,
        link_mass=np.ones((2, count)),
        foot_at=np.stack([foot_at, foot_at * mirror]),
        foot_turn=np.stack([turn, turn]),
        trunk_mass=full.trunk_mass,
        trunk_com=full.trunk_com,
        trunk_inertia=full.trunk_inertia,
        stand=np.tile(stand, 2),
        **{
            name: np.full(both, value)
            for name, value in {
                "lower": -2.5,
                "upper": 2.5,
                "stiffness": 500.0,
                "damping": 5.0,
                "joint_damping": 0.0,
                "torque_limit": 100.0,
                "speed_limit": np.inf,
                "armature": 0.01,
                "friction_loss": 0.0,
            }.items()
        },
    )
    return with_legs(RES, legs)
