"""The telemetry of the loop, built from what walker, backend and loop know."""

import math

from gaitchain.analysis.recorder import planned_support, planned_zmp
from gaitchain.backends.base import numbers
from gaitchain.live.event_log import EventLog
from gaitchain.live.messages import UNPLANNED, Choice, Pace, Telemetry
from gaitchain.live.modes import BALANCED, ModeMachine
from gaitchain.live.safe_backend import SafeBackend
from gaitchain.messages import PanelMessage, Sensors
from gaitchain.walker.generator import Decision
from gaitchain.walker.mounting import Mounting
from gaitchain.walker.odometry import Odometry
from gaitchain.walker.walker import Walker

TRUTH_S = 0.01
"""Between two rows with the simulator's truth [s]."""
_RUNNERS_UP = 8
_UNKNOWN = math.nan, math.nan


class TelemetryBuilder:
    """Builds the telemetry of each control period."""

    def __init__(
        self,
        walker: Walker,
        backend: SafeBackend,
        modes: ModeMachine,
        events: EventLog,
        period_s: float,
    ) -> None:
        """Look at a loop's parts.

        Args:
            walker: of the loop.
            backend: of the loop.
            modes: of the loop.
            events: of the loop; they are taken by the telemetry that is built.
            period_s: control period [s].
        """
        self._walker, self._backend = walker, backend
        found = walker.library.robot.identified
        self._mounting = None if found is None else Mounting(found)
        self._modes, self._events = modes, events
        self._truth_ticks, self._built = max(1, round(TRUTH_S / period_s)), 0
        self._decision: Decision | None = None
        self._choice: Choice | None = None

    def build(self, sensors: Sensors, status: str, pace: Pace) -> Telemetry:
        """Return the telemetry of this control period.

        Args:
            sensors: what is known of the robot, NaN where nothing is.
            status: what is wrong with that, if anything.
            pace: how well the loop keeps its rate.
        """
        walker, modes, health = self._walker, self._modes, self._backend.health()
        target = modes.target
        if self._mounting is not None:  # who draws it knows the robot of the file
            sensors = self._mounting.sensed(sensors)
            target = self._mounting.angles(target)
        planned = modes.mode not in UNPLANNED
        simulator, whole = self._backend.simulator, not self._built % self._truth_ticks
        self._built += 1
        return Telemetry(
            time_s=self._events.time_s(),
            stamp_ns=self._events.stamp_ns(),
            number=self._built,
            mode=modes.mode,
            reason=modes.reason,
            trouble=modes.trouble,
            driver=modes.lease.driver,
            asked=modes.lease.asked.motion,
            command=modes.command.motion,
            crouch_asked=modes.lease.crouch,
            crouch=modes.command.crouch,
            note=walker.note if modes.mode in BALANCED else "",
            status=status,
            joint_position=numbers(sensors.joint_position),
            joint_velocity=numbers(sensors.joint_velocity),
            joint_target=numbers(target),
            joint_load=numbers(self._backend.loads()),
            load_unit=self._backend.load_unit,
            angular_velocity=numbers(sensors.angular_velocity),
            acceleration=numbers(sensors.acceleration),
            estimated_tilt=walker.tilt or _UNKNOWN,
            planned_zmp=planned_zmp(walker.gait) if planned else _UNKNOWN,
            support=planned_support(walker.gait) if planned else "",
            steps=walker.gait.steps,
            choice=self._chosen(walker.decision, walker.gait.panel),
            pace=pace,
            disturbances=simulator.disturbances if simulator else None,
            link_sent=health.sent,
            link_lost=health.lost,
            link_note=health.note,
            link_holds=health.holds,
            supply_v=health.supply_v,
            odometry=self._odometry(),
            place=walker.place,
            feet=walker.feet,
            going=modes.trip.going,
            can_get_up=modes.can_get_up,
            truth=simulator.truth() if simulator and whole else None,
            recalled=self._events.recalled(),
            events=self._events.take(),
            refused=self._events.take_refused(),
        )

    def _odometry(self) -> Odometry | None:
        """Return where the trunk is; a robot that is not balanced does not move on."""
        found = self._walker.odometry
        if found is None or self._modes.mode in BALANCED:
            return found
        return found._replace(velocity=(0.0, 0.0, 0.0))

    def _chosen(
        self, decision: Decision | None, panel: PanelMessage | None
    ) -> Choice | None:
        """Return a decision for the wire; the same one is not worked out again."""
        if decision is None or panel is None:
            return None
        if decision is not self._decision:
            self._decision, self._choice = decision, choice_of(decision, panel)
        return self._choice


def choice_of(decision: Decision, panel: PanelMessage) -> Choice:
    """Return a decision as telemetry carries it; `decision_of` is the way back."""
    return Choice(
        key_moment=panel.key_moment,
        layer=decision.layer,
        pose=int(decision.pose),
        target=int(decision.target),
        cost=float(decision.cost),
        runners_up=tuple(
            (int(pose), float(cost)) for pose, cost in decision.runners_up[:_RUNNERS_UP]
        ),
        left_support=bool(panel.left_support),
        primitives={
            name: float(value)
            for part in (panel.move, panel.lift, panel.swing)
            for name, value in part.items()
        },
        sizes=tuple((float(size), float(cost)) for size, cost in decision.sizes),
        ends=decision.ends,
        expected=decision.expected,
    )
