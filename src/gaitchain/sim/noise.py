"""Noise of the robot's sensors, drawn from the seed of its world."""

import numpy as np

from gaitchain.messages import Array
from gaitchain.sim.world import World
from gaitchain.sim.world_draws import NOISE_STREAM, stream_of


class SensorNoise:
    """Sensor errors: white Gaussian noise, and a constant bias of the gyro.

    Standard deviations at level 1: joint position 0.001 rad, joint velocity
    0.05 rad/s, gyro 0.02 rad/s, accelerometer 0.3 m/s^2. The gyro's bias is
    0.005 rad/s with a random sign on each axis. Other levels are in proportion. The
    sole loads have no noise.
    """

    joint_position: Array
    """(n,) [rad]"""
    joint_velocity: Array
    """(n,) [rad/s]"""
    angular_velocity: Array
    """(3,) [rad/s]"""
    acceleration: Array
    """(3,) [m/s^2]"""

    def __init__(self, world: World, joints: int = 12) -> None:
        """Seed the generator by the world and draw the first errors."""
        self._rng = stream_of(world, NOISE_STREAM)
        sizes = [joints, joints, 3, 3]
        self._scale = world.noise * np.repeat([0.001, 0.05, 0.02, 0.3], sizes)
        errors = self._errors = np.zeros(sum(sizes))
        # Views, so that one draw renews all four.
        (
            self.joint_position,
            self.joint_velocity,
            self.angular_velocity,
            self.acceleration,
        ) = np.split(errors, np.cumsum(sizes)[:-1])
        self._bias = np.zeros(sum(sizes))
        bias = world.noise * 0.005 * self._rng.choice([-1.0, 1.0], 3)
        self._bias[2 * joints : 2 * joints + 3] = bias
        self.draw()

    def draw(self) -> None:
        """Replace the errors by new ones."""
        self._rng.standard_normal(out=self._errors)
        self._errors *= self._scale
        self._errors += self._bias
