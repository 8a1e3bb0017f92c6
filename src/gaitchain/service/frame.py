"""One frame of the telemetry stream: what a page shows of robot and loop."""

from collections.abc import Sequence

import msgspec
import numpy as np

from gaitchain.balance.leg_kinematics import legs_of, posture
from gaitchain.live.messages import Choice, Pace, Telemetry
from gaitchain.live.scene import Scene, Stage
from gaitchain.robot.box_robot import anatomy_of
from gaitchain.robot.reduced_biped import Biped
from gaitchain.service.schemas import Fall, Link, NumberedEvent

_TOLD = 10  # latest events in each frame; their numbers say which are new
Measured = tuple[float | None, ...]


class Frame(msgspec.Struct, frozen=True, tag_field="type", tag="frame"):
    """Robot and loop at one moment; null for what nobody measured."""

    time_s: float
    """On the loop's clock [s]."""
    mode: str
    """off, rising, standing, walking, safe or stopped."""
    reason: str
    """Why this mode; what to do about it if something is wrong."""
    driver: str
    """Who may drive; empty if nobody does."""
    asked: tuple[float, float, float]
    """vx, vy, yaw rate [m/s, m/s, rad/s]."""
    command: tuple[float, float, float]
    """What of it is carried out."""
    note: str
    """Why the two differ, if they do."""
    status: str
    """What is wrong with the sensors, if anything."""
    joint_position: Measured
    """In the order of the library's joints [rad]."""
    joint_velocity: Measured
    """[rad/s]"""
    joint_target: Measured
    """[rad]"""
    joint_load: Measured
    """[`load_unit`]"""
    load_unit: str
    """N m, or A where servos measure currents."""
    tilt: tuple[float | None, float | None]
    """Roll and pitch as the loop believes [rad]."""
    support: str
    """rs, rl, ls, lr or stand."""
    steps: int
    """Begun so far."""
    choice: Choice | None
    """The key pose that the robot moves to, and why this one."""
    scene: Scene
    """Where robot, soles, ZMP and support region are."""
    pace: Pace
    """How well the loop keeps its rate."""
    link: Link
    events: tuple[NumberedEvent, ...]
    """The latest ones."""
    fall: str | None
    """Why the robot lies on the floor, if it does."""
    simulated: bool


class Framer:
    """Makes frames of one robot's telemetry, and the JSON of each once."""

    def __init__(self, biped: Biped, *, simulated: bool) -> None:
        """Take the robot.

        Args:
            biped: the robot.
            simulated: whether it is one that may be pushed.
        """
        self._stage, self._simulated = Stage(biped), simulated
        # Where there is no machine code yet it is made now, not while serving.
        posture(legs_of(biped), np.array(anatomy_of(biped).stand))
        self._made: tuple[Telemetry, Fall | None, bytes] | None = None

    def json(
        self,
        telemetry: Telemetry,
        events: Sequence[NumberedEvent],
        fall: Fall | None,
    ) -> bytes:
        """Return a frame as JSON; the latest one is kept for who asks next."""
        made = self._made
        if made is not None and made[0] is telemetry and made[1] is fall:
            return made[2]
        encoded = msgspec.json.encode(self.frame(telemetry, events, fall))
        self._made = telemetry, fall, encoded
        return encoded

    def frame(
        self,
        telemetry: Telemetry,
        events: Sequence[NumberedEvent],
        fall: Fall | None,
    ) -> Frame:
        """Return a frame.

        Args:
            telemetry: of the loop.
            events: up to now, the latest last.
            fall: the last one.
        """
        t = telemetry
        return Frame(
            time_s=t.time_s,
            mode=t.mode.value,
            reason=t.reason,
            driver=t.driver,
            asked=t.asked,
            command=t.command,
            note=t.note,
            status=t.status,
            joint_position=t.joint_position,
            joint_velocity=t.joint_velocity,
            joint_target=t.joint_target,
            joint_load=t.joint_load,
            load_unit=t.load_unit,
            tilt=t.estimated_tilt,
            support=t.support,
            steps=t.steps,
            choice=t.choice,
            scene=self._stage.scene(t),
            pace=t.pace,
            link=Link(t.link_sent, t.link_lost, t.link_note),
            events=tuple(events[-_TOLD:]),
            fall=fall.sentence if fall is not None and t.fell else None,
            simulated=self._simulated,
        )
