"""Make the frames of the telemetry stream: the state of robot and loop for the page."""

from collections.abc import Sequence

import msgspec

from gaitchain.gait.command_range import CommandRange
from gaitchain.live.messages import LoopState, Telemetry
from gaitchain.live.scene import Stage
from gaitchain.messages import Command
from gaitchain.robot.robot import Robot
from gaitchain.service.schemas import (
    Fall,
    LinkState,
    NumberedEvent,
    TelemetryFrame,
)
from gaitchain.service.settings import RobotKind

_LATEST = 10  # events in each frame; their numbers say which are new


class Framer:
    """Makes frames of one robot's telemetry, and the JSON of each once."""

    def __init__(self, robot: Robot, span: CommandRange, kind: RobotKind) -> None:
        """Take the robot.

        Args:
            robot: the robot.
            span: what its library walks.
            kind: what moves; a log tells by itself where it is of a simulated one.
        """
        self._stage, self._span, self._kind = Stage(robot), span, kind
        self._made: tuple[Telemetry, Fall | None, int | None, bytes] | None = None

    def json(
        self,
        telemetry: Telemetry,
        events: Sequence[NumberedEvent],
        fall: Fall | None,
        view: int | None = None,
    ) -> bytes:
        """Return a frame as JSON; the latest one is kept for who asks next.

        Args:
            telemetry: of the loop.
            events: up to now, the latest last.
            fall: the last one.
            view: which process draws the 3-D view, if one does.
        """
        made, t = self._made, telemetry
        if made is not None and made[0] is t and made[1] is fall and made[2] == view:
            return made[3]
        kind = self._kind if t.disturbances is None else "simulation"
        state = {name: getattr(t, name) for name in LoopState.__struct_fields__}
        frame = TelemetryFrame(
            **state | {"reason": _reason(t)},
            asked_parts=self._span.parts(Command(*t.asked)),
            scene=self._stage.scene(t),
            link=LinkState.of(t),
            events=tuple(events[-_LATEST:]),
            fall=fall.sentence if fall is not None and t.fell else None,
            simulated=kind == "simulation",
            kind=kind,
            view=view,
        )
        encoded = msgspec.json.encode(frame)
        self._made = t, fall, view, encoded
        return encoded


def _reason(telemetry: Telemetry) -> str:
    """Return why this mode, in a replay with the place in the log."""
    own, replay = telemetry.reason, telemetry.replay
    if replay is None or not replay.where:
        return own
    return f"{own} ({replay.where})" if own else replay.where
