"""One control period, told: the telemetry of the loop."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from gaitchain.backends.base import Backend
from gaitchain.live.messages import Choice, Event, Mode, Pace, Telemetry, Truth
from gaitchain.messages import Array, Command, PanelMessage, Sensors
from gaitchain.walker.generator import Decision
from gaitchain.walker.walker import Walker

if TYPE_CHECKING:
    from gaitchain.backends.mujoco import MujocoBackend

TRUTH_S = 0.01
"""The simulator's truth is told so often [s]."""
_RUNNERS_UP = 8
_UNKNOWN = math.nan, math.nan


class Moment(NamedTuple):
    """What the loop itself knows of a control period."""

    time_s: float
    stamp_ns: int
    mode: Mode
    reason: str
    driver: str
    asked: Command
    command: Command
    sensors: Sensors
    target: Array
    status: str
    pace: Pace
    events: Sequence[Event]
    recalled: Sequence[Event] = ()


class Reporter:
    """Turns what the loop knows into telemetry."""

    def __init__(
        self,
        walker: Walker,
        backend: Backend,
        period_s: float,
        simulator: "MujocoBackend | None" = None,
    ) -> None:
        """Look at a loop's walker and backend.

        Args:
            walker: of the loop.
            backend: of the loop.
            period_s: control period [s].
            simulator: the backend, if it is one that knows the truth.
        """
        self._walker, self._backend, self._simulator = walker, backend, simulator
        self._truth_ticks, self._told = max(1, round(TRUTH_S / period_s)), 0
        self._decision: Decision | None = None
        self._choice: Choice | None = None

    def report(self, now: Moment) -> Telemetry:
        """Return the telemetry of this control period."""
        walker, health = self._walker, self._backend.health()
        estimate, zmp = walker.gait.estimate, walker.gait.planned_zmp
        whole = self._told % self._truth_ticks == 0
        self._told += 1
        return Telemetry(
            time_s=now.time_s,
            stamp_ns=now.stamp_ns,
            mode=now.mode,
            reason=now.reason,
            driver=now.driver,
            asked=_speeds(now.asked),
            command=_speeds(now.command),
            note=walker.note,
            status=now.status,
            joint_position=_numbers(now.sensors.joint_position),
            joint_velocity=_numbers(now.sensors.joint_velocity),
            joint_target=_numbers(now.target),
            joint_load=_numbers(self._backend.loads()),
            load_unit=self._backend.load_unit,
            angular_velocity=_numbers(now.sensors.angular_velocity),
            acceleration=_numbers(now.sensors.acceleration),
            estimated_tilt=(estimate.roll, estimate.pitch) if estimate else _UNKNOWN,
            planned_zmp=_UNKNOWN if zmp is None else (float(zmp[0]), float(zmp[1])),
            support="stand" if walker.standing else walker.gait.support.value,
            steps=walker.gait.steps,
            choice=self._chosen(walker.decision, walker.gait.panel),
            pace=now.pace,
            link_sent=health.sent,
            link_lost=health.lost,
            link_note=health.note,
            truth=truth_of(self._simulator) if self._simulator and whole else None,
            events=tuple(now.events),
            recalled=tuple(now.recalled),
        )

    def _chosen(
        self, decision: Decision | None, panel: PanelMessage | None
    ) -> Choice | None:
        """Tell a decision; the same one is not worked out again."""
        if decision is None or panel is None:
            return None
        if decision is not self._decision:
            self._decision = decision
            self._choice = Choice(
                key_moment=panel.key_moment,
                layer=decision.layer,
                pose=int(decision.pose),
                target=int(decision.target),
                cost=float(decision.cost),
                runners_up=tuple(
                    (int(pose), float(cost))
                    for pose, cost in decision.runners_up[:_RUNNERS_UP]
                ),
                left_support=bool(panel.left_support),
                primitives={
                    name: float(value)
                    for part in (panel.move, panel.lift, panel.swing)
                    for name, value in part.items()
                },
            )
        return self._choice


def truth_of(simulator: "MujocoBackend") -> Truth:
    """Copy what the simulator knows of the robot now."""
    data, feet = simulator.data, simulator.feet
    return Truth(
        qpos=_numbers(data.qpos),
        qvel=_numbers(data.qvel),
        place=_numbers(data.xpos[feet]),
        turn=_numbers(data.xmat[feet]),
        wrench=_numbers(data.cfrc_ext[feet]),
        twist=_numbers(data.cvel[feet]),
        com=_numbers(data.subtree_com[1]),
        tilt=simulator.tilt,
        foot_height=_numbers(simulator.sole_heights()),
        self_contact=simulator.self_contact,
    )


def _numbers(values: Array) -> tuple[float, ...]:
    return tuple(np.ravel(values).tolist())


def _speeds(command: Command) -> tuple[float, float, float]:
    return command.vx, command.vy, command.yaw_rate
