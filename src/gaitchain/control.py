"""Run a walker on the simulator, tick by tick, and record what happens."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gaitchain.backends.mujoco import CONTROL_PERIOD_S, MujocoBackend
from gaitchain.generator import Decision
from gaitchain.kinematics import Array
from gaitchain.messages import PanelMessage
from gaitchain.poses import STAND
from gaitchain.schedule import Schedule, step_commands
from gaitchain.walker import Walker
from gaitchain.zmp import Support

SETTLE_S = 1.0
"""Standing still before the first and after the last step [s]."""


@dataclass(frozen=True, eq=False)
class WalkRecord:
    """A walk in physics, one row per control period, N in all."""

    time_s: Array
    """(N,) since the first step began [s]."""
    target: Array
    """(N, 12) joint targets [rad]."""
    joint_position: Array
    """(N, 12) [rad]."""
    joint_velocity: Array
    """(N, 12) [rad/s]."""
    torque: Array
    """(N, 12) [N m]."""
    qpos: Array
    """(N, 19) MuJoCo generalised positions: base, then joints."""
    zmp: Array
    """(N, 2) measured ZMP in the world, NaN off the ground [m]."""
    feet: Array
    """(N, 2, 3) left and right foot in the world: x, y, yaw [m, m, rad]."""
    support: NDArray[np.str_]
    """(N,) planned support: "rs", "rl", "ls", "lr", or "stand"."""
    key_pose: NDArray[np.int64]
    """(N, 2) key moment (0 for kp_1) and pose that the robot is moving to."""
    step_ticks: tuple[int, ...]
    """Row at which each step began, and the row after the last."""
    fell_at_s: float | None
    decisions: tuple[tuple[float, Decision, PanelMessage], ...] = ()
    """(time [s], decision, primitive components) of each key pose, in order."""


def run_schedule(
    walker: Walker, backend: MujocoBackend, schedule: Schedule
) -> WalkRecord:
    """Walk a schedule from standing to standing, or until the robot falls.

    Args:
        walker: a fresh walker.
        backend: the simulator.
        schedule: the speeds.

    Returns:
        The record; it ends at the fall if there is one.
    """
    timing = walker.generator.library.timing
    commands = step_commands(schedule)
    ticks_per_step = round(timing.step / CONTROL_PERIOD_S)
    settle = round(SETTLE_S / CONTROL_PERIOD_S)
    steps = len(commands) - 1
    log = _Log()
    backend.connect(walker.stand)
    for _ in range(settle):
        backend.write(walker.stand)
    walker.follow(commands)
    start_s = backend.read().time
    fell_at_s = None
    for tick in range(steps * ticks_per_step + settle):
        sensors = backend.read()
        targets = walker.step(sensors)
        log.add(sensors.time - start_s, targets.position, walker, backend)
        backend.write(targets.position)
        if backend.fallen:
            fell_at_s = (tick + 1) * CONTROL_PERIOD_S
            break
    step_ticks = tuple(i * ticks_per_step for i in range(steps + 1))
    return log.record(step_ticks, fell_at_s)


class _Log:
    """Rows of a record, collected tick by tick."""

    def __init__(self) -> None:
        self._rows: dict[str, list[Array]] = {
            name: []
            for name in (
                "target",
                "joint_position",
                "joint_velocity",
                "torque",
                "qpos",
                "zmp",
                "feet",
            )
        }
        self._time_s: list[float] = []
        self._support: list[str] = []
        self._key_pose: list[tuple[int, int]] = []
        self._decisions: list[tuple[float, Decision, PanelMessage]] = []

    def add(
        self, time_s: float, target: Array, walker: Walker, backend: MujocoBackend
    ) -> None:
        data, rows = backend.data, self._rows
        self._time_s.append(time_s)
        rows["target"].append(target)
        rows["joint_position"].append(data.qpos[7:].copy())
        rows["joint_velocity"].append(data.qvel[6:].copy())
        rows["torque"].append(data.actuator_force.copy())
        rows["qpos"].append(data.qpos.copy())
        rows["zmp"].append(backend.zmp())
        rows["feet"].append(
            np.column_stack([backend.foot_positions()[:, :2], backend.foot_yaws()])
        )
        planned: Support | None = None if walker.standing else walker.support
        self._support.append("stand" if planned is None else planned.value)
        decision, panel = walker.decision, walker.panel
        if decision is None or panel is None:
            self._key_pose.append((0, STAND))
            return
        self._key_pose.append((decision.layer, decision.pose))
        if not self._decisions or self._decisions[-1][1] is not decision:
            self._decisions.append((time_s, decision, panel))

    def record(
        self, step_ticks: tuple[int, ...], fell_at_s: float | None
    ) -> WalkRecord:
        return WalkRecord(
            time_s=np.array(self._time_s),
            support=np.array(self._support),
            key_pose=np.array(self._key_pose, dtype=np.int64),
            decisions=tuple(self._decisions),
            step_ticks=step_ticks,
            fell_at_s=fell_at_s,
            **{name: np.array(rows) for name, rows in self._rows.items()},
        )
