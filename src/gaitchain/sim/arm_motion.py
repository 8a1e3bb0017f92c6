"""Arms that somebody else moves: the forces of their motion on a simulated trunk. Ours.

The simulated robot has no arms; their mass is part of the trunk's. Two point masses
swing from the shoulders, and the trunk bears the reaction of their acceleration and the
moment of their shifted weight. Their part of the mass is that of people [deLeva96].
"""

import math

import numpy as np

from gaitchain.messages import GRAVITY, Array
from gaitchain.robot.robot import Robot
from gaitchain.sim.world import World
from gaitchain.sim.world_draws import ARMS_STREAM, stream_of

_MASS = 0.05  # of the robot's: one arm
_LENGTH = 0.3  # of the leg: from the shoulder to the arm's CoM
_SHOULDER = (0.35, 0.85)  # of the trunk's length: to the side and up
_LEAST, _MOST = (-1.0, 0.0), (1.0, 1.0)  # rad: aims ahead and outward
_AIM_S = 0.8  # from one aim to the next
_H = 0.005  # s: for the second difference


class ArmMotion:
    """The motion of both arms: from one random aim to the next with minimum jerk."""

    def __init__(self, robot: Robot, world: World) -> None:
        """Hang the arms down; if they move, aims follow from the world's seed."""
        reduced = robot.reduced
        self._mass = _MASS * reduced.mass
        self._weight = -self._mass * GRAVITY * np.array(world.up)
        self._length = _LENGTH * reduced.leg_length
        self._hanging = np.array([0.0, 0.0, -self._length])
        aside, up = (part * reduced.trunk_length for part in _SHOULDER)
        self._shoulders = np.array([[0.0, aside, up], [0.0, -aside, up]])
        self._rng = stream_of(world, ARMS_STREAM)
        self._aims, self._began_s = [np.zeros((2, 2))], 0.0
        self._swings = world.arms == "random"
        self.rest_s = math.inf if self._swings else 0.0
        """From when on the arms hang still [s]."""

    def swing(self, swings: bool, time_s: float) -> None:
        """Move the arms from random aim to aim, or let them hang after the present one.

        Args:
            swings: whether somebody moves them.
            time_s: now, as in `wrench` [s].
        """
        if swings and time_s >= self.rest_s:
            self._aims, self._began_s = [np.zeros((2, 2))], time_s
        elif self._swings and not swings:
            self._aims_until(time_s + _H)
            self.rest_s = self._began_s + (len(self._aims) + 1) * _AIM_S
        self._swings = swings
        self.rest_s = math.inf if swings else self.rest_s

    def wrench(self, time_s: float, turn: Array, com: Array) -> Array:
        """Return what the arms do to the trunk.

        F = -m r'' and M = (s + r - c) x F + (r - r_0) x m g, summed over both arms.

        Args:
            time_s: since the start of the walk [s].
            turn: (3, 3) orientation of the trunk.
            com: (3,) CoM of the body that is acted on, in the trunk's frame [m].

        Returns:
            (6,) force and moment about that CoM, in the world's frame [N, N m].
        """
        if time_s <= self._began_s + _H:
            return np.zeros(6)
        before, now, after = (self._places(time_s + k * _H) for k in (-1, 0, 1))
        force = -self._mass * (after - 2.0 * now + before) / _H**2 @ turn.T
        arm = (self._shoulders + now - com) @ turn.T
        moved = (now - self._hanging) @ turn.T
        moment = np.cross(arm, force) + np.cross(moved, self._weight)
        return np.concatenate([force.sum(axis=0), moment.sum(axis=0)])

    def _places(self, time_s: float) -> Array:
        """Return the arms' CoMs from the shoulders, trunk frame, (2, 3) [m]."""
        part = (time_s - self._began_s) / _AIM_S % 1.0
        smooth = part**3 * (10.0 - 15.0 * part + 6.0 * part**2)
        start, end = self._aims_until(time_s)
        ahead, outward = (start + smooth * (end - start)).T
        aside = np.array([1.0, -1.0]) * np.sin(outward) * np.cos(ahead)
        down = -np.cos(outward) * np.cos(ahead)
        return self._length * np.stack([np.sin(ahead), aside, down], axis=1)

    def _aims_until(self, time_s: float) -> list[Array]:
        """Return the aims before and after a time, those to come drawn as needed."""
        number = int((time_s - self._began_s) // _AIM_S)
        while len(self._aims) < number + 2:
            drawn = self._rng.uniform(_LEAST, _MOST, (2, 2))
            self._aims.append(drawn if self._swings else np.zeros((2, 2)))
        return self._aims[number : number + 2]
