"""What the loop publishes and what it can be asked: typed messages between processes.

They travel as MessagePack (`encode`, `decode_telemetry`, `decode_request`). NaN stands
for what a robot did not measure. Arrays are tuples of numbers, joints in the order of
the library's `robot.legs.joint_names`.
"""

import math
import re
from enum import StrEnum

import msgspec
from msgspec import UNSET, UnsetType
from msgspec.structs import replace

from gaitchain.backends.base import (
    TORQUE_UNIT,
    Disturbances,
    Numbers,
    PunchesState,
    Truth,
)
from gaitchain.messages import Command
from gaitchain.sim.push import Push
from gaitchain.sim.world import Arms
from gaitchain.walker.footsteps import Footstep
from gaitchain.walker.odometry import Odometry
from gaitchain.walker.place import Place


class Mode(StrEnum):
    """What the loop does with the robot."""

    OFF = "off"
    """Torque off. `Start` makes it rise."""
    RISING = "rising"
    """On the way, slowly, from where its joints are to the standing pose."""
    GETTING_UP = "getting_up"
    """On the way from lying to standing, with all joints; torque off if that fails."""
    STANDING = "standing"
    """Standing, ready for a command."""
    WALKING = "walking"
    SAFE = "safe"
    """Something is wrong: it holds still, or goes slowly to the standing pose, and
    holds that. `Reset` after the reason is gone."""
    STOPPED = "stopped"
    """Emergency stop, or a fall: torque off until `Reset`; or no robot in reach, which
    is then tried again from time to time."""


UNPLANNED = (Mode.OFF, Mode.STOPPED, Mode.GETTING_UP)
"""Modes in which no foot is planned to support the robot, and no walk is judged."""


class TroubleKind(StrEnum):
    """Why the robot is SAFE or STOPPED."""

    FALL = "fall"
    LYING = "lying"
    """It lay there when it was asked to start: no fall of now."""
    EMERGENCY_STOP = "emergency_stop"
    SENSORS = "sensors"
    """Silent, late, stuck, or not to be believed."""
    JOINTS = "joints"
    """At the torque limit, far from the target, running away, or let go."""
    LINK = "link"
    """The robot cannot be reached."""
    WALKER = "walker"
    """The walker raised an error."""


class Event(msgspec.Struct, frozen=True):
    """Something worth knowing that happened once."""

    time_s: float
    """On the loop's clock, since it began [s]."""
    stamp_ns: int
    """UNIX time [ns]."""
    kind: str
    """mode, command, sensor, link, overrun, push, world, part, or log."""
    text: str
    """What and why, with the value and the limit."""


class Choice(msgspec.Struct, frozen=True):
    """The key pose that the robot moves to, and why this one."""

    key_moment: str
    """kp_1 to kp_4."""
    layer: int
    """0 for kp_1."""
    pose: int
    """Number of the pose in its layer."""
    target: int
    """Pose in which the step is to end."""
    cost: float
    """Expected cost of going on through the pose."""
    runners_up: tuple[tuple[int, float], ...]
    """(pose, cost) of the other candidates, cheapest first."""
    left_support: bool
    """Whether the left foot bears the robot."""
    primitives: dict[str, float]
    """Components of Swing, Lift and Move that make the pose [m, rad]."""
    sizes: tuple[tuple[float, float], ...] = ()
    """(part of the command range, expected cost to go) of the sizes that the step of a
    disturbed walk can have, the chosen one first; empty where nothing disturbs it."""
    ends: tuple[tuple[int, float], ...] = ()
    """(pose, cost) in which the step may end, the chosen one first: the expected cost,
    and the squared distance to what the command asks for. Empty where the command alone
    says how it ends."""
    expected: tuple[float, ...] = ()
    """Of the cost of each of `ends`, what walking there is expected to cost, from 0 to
    1 for each edge of the chain; the rest is how far it is off the command: 1 where it
    is off by 5 % of the leg, or by 0.1 rad."""


class Going(msgspec.Struct, frozen=True):
    """Where the driver sent the robot, and how far it is."""

    goal: Place | None
    """The place where it is to stand in the end; None by footsteps."""
    places_left: int
    """How many, this one and those after it; 0 by footsteps."""
    footsteps_left: int
    """How many have not begun."""
    distance_m: float
    """Rest of the way, from place to place; NaN by footsteps [m]."""
    turn_rad: float
    """From the heading now to that of the goal, to the left; NaN by footsteps [rad]."""
    arrived: bool
    """Whether the robot stands there."""


class Pace(msgspec.Struct, frozen=True):
    """How well the loop keeps its rate."""

    period_s: float
    """Control period [s]."""
    ticks: int
    """Control periods since the loop began."""
    overruns: int
    """Ticks that ended after the next was due."""
    late_p99_s: float
    """How late ticks begin: 99 of 100 are not later, of the last 1000 [s]."""
    late_max_s: float
    """Since the loop began [s]."""
    busy_p99_s: float
    """What a tick takes [s]."""
    rate_hz: float | None = None
    """Ticks a second, over the last 1000; None before there are two [Hz]."""


class ReplayState(msgspec.Struct, frozen=True):
    """How far a log is played."""

    at_s: float
    """From its beginning, long silences cut short [s]."""
    length_s: float
    """Of all of it [s]."""
    speed: float
    """Times as fast as it was."""
    playing: bool
    """Whether it plays; false while it is paused, and at its end."""
    where: str = ""
    """Its file and the place in it, in words."""
    jumps: int = 0
    """How often it was begun or sought: what was told before the last time does not
    lead here."""
    leads: bool = False
    """Whether this row is not shown: it is passed on the way to the one that was
    sought, as it led to the fall since which the robot lies there."""


class LoopState(msgspec.Struct, frozen=True, kw_only=True):
    """The loop and the robot in one control period, as everybody may see them."""

    time_s: float
    """On the loop's clock, since it began [s]."""
    mode: Mode
    reason: str
    """Why this mode; what to do about it if something is wrong."""
    trouble: TroubleKind | None = None
    """What kind of reason it is, where the mode is safe or stopped."""
    driver: str
    """Who may drive; empty if nobody does."""
    asked: tuple[float, float, float]
    """vx, vy, yaw rate that the driver asked for [m/s, m/s, rad/s]."""
    command: tuple[float, float, float]
    """What of it is carried out."""
    crouch_asked: float = 0.0
    """Hips below their usual height that the driver asked for [m]."""
    crouch: float = 0.0
    """What of it is carried out [m]."""
    note: str
    """Why the two differ, if they do."""
    status: str
    """What is wrong with the sensors, if anything."""
    joint_position: Numbers
    """In the order of the library's joints [rad]. What was identified of encoders and
    IMU is taken out of this and of all that follows: axes are those of the file."""
    joint_velocity: Numbers
    """[rad/s]"""
    joint_target: Numbers
    """[rad]"""
    joint_load: Numbers
    """What the motors bear, NaN where it is not measured [`load_unit`]."""
    load_unit: str = TORQUE_UNIT
    """N m, or A where servos measure currents."""
    estimated_tilt: tuple[float, float]
    """Roll and pitch as the loop estimates them [rad]."""
    support: str
    """rs, rl, ls, lr or stand, as in `WalkRecord`; "" where nothing is planned: the
    robot is limp, or gets up."""
    steps: int
    """Begun so far."""
    choice: Choice | None
    """The key pose that the robot moves to, and why this one."""
    pace: Pace
    """How well the loop keeps its rate."""
    disturbances: Disturbances | None = None
    """What disturbs a simulated robot besides pushes; None for a real one."""
    replay: ReplayState | None = None
    """Where a log is that is played in place of a loop; None for a loop."""
    place: Place | None = None
    """Middle between the feet, and heading, from where the robot stood at its start or
    last reset, as its own steps tell [m, m, rad]; None by key poses. Of a robot that
    got up it goes on from where it fell."""
    feet: tuple[Place, Place] | None = None
    """Left and right ankle, in the same frame."""
    going: Going | None = None
    """Where the driver sent it; None where it follows commands."""
    can_get_up: bool = False
    """Whether it lies there and knows a way up."""


class Telemetry(LoopState, frozen=True, kw_only=True):
    """All that the loop publishes of one control period."""

    stamp_ns: int
    """UNIX time [ns]."""
    number: int = 0
    """Of this row, 1 for the loop's first; who misses some has lost rows."""
    angular_velocity: Numbers
    """(3,) gyro, trunk's frame [rad/s]."""
    acceleration: Numbers
    """(3,) accelerometer, trunk's frame [m/s^2]."""
    planned_zmp: tuple[float, float]
    """In the support-foot frame, NaN while unknown [m]."""
    link_sent: int
    """Requests to the robot since it was connected."""
    link_lost: int
    """Of them, those without a sound answer."""
    link_note: str
    """What is wrong with the link to the robot now."""
    link_holds: bool = False
    """Whether motors may have torque although the robot was let go."""
    supply_v: float | None = None
    """Voltage of the motors' supply, None where it is not measured [V]."""
    odometry: Odometry | None = None
    """Where the trunk is by legs and gyro; None where nothing estimates it."""
    truth: Truth | None = None
    """In simulation, at most 100 times a second."""
    events: tuple[Event, ...] = ()
    """What happened since the telemetry before."""
    recalled: tuple[Event, ...] | None = None
    """What happened before that, repeated for a reader who asked (`Recall`), and where
    a log is played from elsewhere; None else."""
    refused: tuple[str, ...] = ()
    """Of requests since the telemetry before those that are not carried out, by
    `refusal`, a few at most; `events` tell of many alike once."""

    @property
    def joint_torque(self) -> Numbers:
        """Torques [N m]; NaN where none or something else is measured."""
        known = self.load_unit == TORQUE_UNIT
        return self.joint_load if known else (math.nan,) * len(self.joint_load)

    @property
    def fell(self) -> bool:
        """Whether the loop stopped because the robot fell."""
        return self.mode is Mode.STOPPED and self.trouble is TroubleKind.FALL

    @property
    def down(self) -> bool:
        """Whether it lies there since a fall, or is getting up; if that fails, too."""
        return self.fell or self.mode is Mode.GETTING_UP

    @property
    def leads(self) -> bool:
        """Whether it is not to be shown, see `ReplayState.leads`."""
        return self.replay is not None and self.replay.leads


class DriverRequest(msgspec.Struct, frozen=True):
    """What somebody asks for."""

    driver: str
    """Who; the first one drives until it lets go or is silent."""


class Drive(DriverRequest, frozen=True, tag=True):
    """Ask for a motion; to be repeated within the command time-out."""

    vx: float = 0.0
    """[m/s]"""
    vy: float = 0.0
    """[m/s]"""
    yaw_rate: float = 0.0
    """[rad/s]"""
    crouch: float = 0.0
    """[m]"""

    @property
    def command(self) -> Command:
        """What is asked for."""
        return Command(self.vx, self.vy, self.yaw_rate, self.crouch)


class GoTo(DriverRequest, frozen=True, tag=True):
    """Walk to places, one after another, and stand at the last one.

    It lasts until another command, a stop, or until the driver is lost; who repeats it
    remains the driver.
    """

    places: tuple[Place, ...]
    """In the frame of `LoopState.place`; on the way the robot does not stand."""
    crouch: float = 0.0
    """Hips lower by this on the way [m]."""


class FollowSteps(DriverRequest, frozen=True, tag=True):
    """Make these footsteps from a stand, then stand; it lasts as `GoTo` does."""

    steps: tuple[Footstep, ...]
    """In the frame of `LoopState.place`, left and right by turns."""


Errand = GoTo | FollowSteps
"""What a robot is sent to do, rather than driven."""


class LetGo(DriverRequest, frozen=True, tag=True):
    """Let another one drive; the robot stops walking."""


class Start(DriverRequest, frozen=True, tag=True):
    """Torque on, up to the standing pose."""


class Stop(DriverRequest, frozen=True, tag=True):
    """Stop walking and stand; while it gets up, torque off. Anybody may ask."""


class Rest(DriverRequest, frozen=True, tag=True):
    """Torque off, from standing."""


class EmergencyStop(DriverRequest, frozen=True, tag=True):
    """Torque off at once; anybody may ask."""


class Reset(DriverRequest, frozen=True, tag=True):
    """Leave SAFE or STOPPED; a simulated robot is put back on its feet."""


class GetUp(DriverRequest, frozen=True, tag=True):
    """Get up after a fall, with all joints."""


class PushRobot(DriverRequest, frozen=True, tag=True):
    """Push a body of a simulated robot for 0.1 s."""

    impulse_ns: float
    """[N s]"""
    direction_deg: float
    """As the trunk faces: 0 forward, +90 to the left [deg]."""
    elevation_deg: float = Push.elevation_deg
    """Of the force above the floor's plane [deg]."""
    body: str = Push.body
    """Its name, or `sim.bodies.ANY_BODY`."""


class Disturb(DriverRequest, frozen=True, tag=True):
    """Change what disturbs a simulated robot, as `Disturbances`; unset stays as is."""

    punches: PunchesState | UnsetType | None = UNSET
    arms: Arms | UnsetType = UNSET
    payload: float | UnsetType = UNSET

    def changed(self, now: Disturbances) -> Disturbances:
        """Return what is to disturb the robot from now on."""
        asked = {name: getattr(self, name) for name in now.__struct_fields__}
        given = {n: v for n, v in asked.items() if v is not UNSET}
        return replace(now, **given)


class Play(DriverRequest, frozen=True, tag=True):
    """Play a log on, pause it, from elsewhere, or at another speed; unset stays."""

    playing: bool | UnsetType = UNSET
    at_s: float | UnsetType = UNSET
    speed: float | UnsetType = UNSET


class Note(msgspec.Struct, frozen=True, tag=True):
    """Put something into the telemetry's events."""

    kind: str
    text: str


class Recall(msgspec.Struct, frozen=True, tag=True):
    """Repeat the latest events; for a reader that has just come."""


class Shutdown(msgspec.Struct, frozen=True, tag=True):
    """Make the robot safe and end."""


_WORD = re.compile("[A-Z][a-z]+")


def refusal(request: DriverRequest) -> str:
    """Return how the text of a refused request begins; why follows it."""
    words = _WORD.findall(type(request).__name__.removesuffix("Robot"))
    return f"{' '.join(words).lower()} by {request.driver} refused: "


_Torque = Start | Stop | Rest | EmergencyStop | Reset | GetUp
_OfDriver = Drive | Errand | LetGo | _Torque
Request = _OfDriver | PushRobot | Disturb | Play | Note | Recall | Shutdown

encode = msgspec.msgpack.Encoder().encode
"""Encode a telemetry or a request."""
decode_telemetry = msgspec.msgpack.Decoder(Telemetry).decode
"""Decode one; `msgspec.DecodeError` if it is none."""
decode_request = msgspec.msgpack.Decoder(Request).decode
"""Decode one; `msgspec.DecodeError` if it is none."""
