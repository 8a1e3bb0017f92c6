"""How much the physics varies from walk to walk."""

import math
from dataclasses import dataclass

import numpy as np

from gaitchain.gait.keypose.key_poses import KeyPoses
from gaitchain.gait.stride.strides import StridePoses
from gaitchain.messages import GRAVITY
from gaitchain.sim.world import Push, World

_PUSHED = 0.5  # of the walks
_PUSH_SHARE = 0.1  # of m sqrt(g h)


@dataclass(frozen=True)
class WorldRange:
    """How much the physics varies from walk to walk, uniformly."""

    friction: tuple[float, float] = (0.6, 1.0)
    servo_gain: tuple[float, float] = (0.9, 1.1)
    mass: tuple[float, float] = (0.95, 1.05)
    model_error: float = 0.0
    """Of each link, see `World`."""
    delay_s: tuple[float, float] = (0.0, 0.0)
    push_ns: float = 0.0
    """Strongest push, in half of the walks, at any time of its first four seconds."""
    speed_limit_deg_s: float | None = None
    """Of the servos; None is the robot's own."""

    def draw(self, rng: np.random.Generator) -> World:
        """Draw one world."""
        friction, gain, mass = (
            float(rng.uniform(*span))
            for span in (self.friction, self.servo_gain, self.mass)
        )
        if not (self.model_error or self.push_ns or any(self.delay_s)):
            limit = self.speed_limit_deg_s
            return World(friction, gain, mass, speed_limit_deg_s=limit)
        push = Push(
            impulse_ns=float(rng.uniform(0.0, self.push_ns)),
            direction_deg=float(rng.uniform(-180.0, 180.0)),
            at_s=float(rng.uniform(0.5, 4.0)),
        )
        return World(
            friction,
            gain,
            mass,
            model_error=self.model_error,
            delay_s=float(rng.uniform(*self.delay_s)),
            seed=int(rng.integers(2**31)),
            push=(push,) if rng.random() < _PUSHED else (),
            speed_limit_deg_s=self.speed_limit_deg_s,
        )


def training_worlds(
    poses: KeyPoses | StridePoses, speed_limit_deg_s: float | None = None
) -> WorldRange:
    """Return the worlds that a robot's library is trained and tested in.

    A dynamic walk balances, so it is also given model errors, delays and pushes of up
    to 0.1 m sqrt(g h).
    """
    if isinstance(poses, KeyPoses):
        return WorldRange(speed_limit_deg_s=speed_limit_deg_s)
    height = poses.hip_height + poses.biped.ankle_height
    return WorldRange(
        mass=(0.95, 1.05),
        model_error=0.05,
        delay_s=(0.0, 0.01),
        push_ns=_PUSH_SHARE * poses.biped.mass * math.sqrt(GRAVITY * height),
        speed_limit_deg_s=speed_limit_deg_s,
    )
