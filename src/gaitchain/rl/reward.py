"""What a walk is worth in each control period: tracking, upright, calm actions."""

import math

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.messages import CONTROL_PERIOD_S, GRAVITY, Array, Command
from gaitchain.robot.robot import Robot

_SMOOTHING_S = 0.5  # about a cycle of steps, within which any walk sways
# Errors at which tracking is worth exp(-1), of sqrt(g l) and of sqrt(g / l): 0.1 m/s
# and 0.3 rad/s of RES.
_SPEED, _TURN = 0.0415, 0.0737
_ACTION, _CHANGE, _FALL = 0.05, 0.05, 100.0


class Reward:
    """r = exp(-(e_v / a)^2) + 0.5 exp(-(e_w / b)^2) - actions - 100 at a fall.

    e_v [m/s] and e_w [rad/s] are the errors of the trunk's velocity in the direction of
    its heading and of its yaw rate, both through a low-pass of 0.5 s, which begins with
    the robot at rest. For a leg l, a = 0.0415 sqrt(g l) and b = 0.0737 sqrt(g / l): 0.1
    m/s and 0.3 rad/s of RES. Actions cost 0.05 times their mean square, and 0.05 times
    that of their change. The weights are ours.
    """

    def __init__(self, command: Command, robot: Robot, backend: MujocoBackend) -> None:
        """Begin an episode.

        Args:
            command: what is to be walked.
            robot: the one that walks.
            backend: the simulator, of which the reward takes the ground truth.
        """
        self._command, self._backend = command, backend
        leg = robot.reduced.leg_length
        self._speed_off = _SPEED * math.sqrt(GRAVITY * leg)
        self._turn_off = _TURN * math.sqrt(GRAVITY / leg)
        self._x, self._y = backend.data.qpos[:2].tolist()
        self._heading = backend.heading
        self._speed, self._aside, self._turn = 0.0, 0.0, 0.0

    def parts(self, action: Array, change: Array) -> dict[str, float]:
        """Return the parts of the reward after one control period; they add up.

        Args:
            action: (a,) in [-1, 1].
            change: (a,) from the action before.
        """
        self._follow()
        vx, vy, yaw_rate = self._command.motion
        off = math.hypot(self._speed - vx, self._aside - vy)
        turned = self._turn - yaw_rate
        return {
            "reward_speed": math.exp(-((off / self._speed_off) ** 2)),
            "reward_turn": 0.5 * math.exp(-((turned / self._turn_off) ** 2)),
            "reward_action": -_ACTION * float((action**2).mean()),
            "reward_change": -_CHANGE * float((change**2).mean()),
            "reward_fall": -_FALL if self._backend.fallen else 0.0,
        }

    def _follow(self) -> None:
        """Measure the velocity of this period, and smooth it."""
        x, y = self._backend.data.qpos[:2].tolist()
        dx, dy, heading = x - self._x, y - self._y, self._backend.heading
        turned = math.remainder(heading - self._heading, 2.0 * math.pi)
        cos, sin = math.cos(heading), math.sin(heading)
        part = CONTROL_PERIOD_S / _SMOOTHING_S
        rates = (cos * dx + sin * dy, cos * dy - sin * dx, turned)
        now = [rate / CONTROL_PERIOD_S for rate in rates]
        self._speed += part * (now[0] - self._speed)
        self._aside += part * (now[1] - self._aside)
        self._turn += part * (now[2] - self._turn)
        self._x, self._y, self._heading = x, y, heading
