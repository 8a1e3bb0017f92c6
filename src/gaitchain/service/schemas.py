"""The messages of the HTTP API: what clients send (Pydantic) and get (msgspec)."""

from collections.abc import Iterable, Mapping
from typing import Annotated, Any, Literal

import msgspec
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

from gaitchain.backends.base import Disturbances, PunchesState
from gaitchain.gait.limits import Limits, declared
from gaitchain.live.messages import (
    Choice,
    Going,
    LoopState,
    Pace,
    ReplayState,
    Telemetry,
)
from gaitchain.live.scene import Scene
from gaitchain.service.settings import TOKEN_LENGTHS, RobotKind
from gaitchain.sim.push import Punches, Push
from gaitchain.sim.world import DISTURBANCES, Arms, World

_PART = "Part of the most in that direction, of %s."
DRIVER_PATTERN = "^[A-Za-z0-9._-]{1,64}$"
_SHOWN, _LONGEST = 60, 500  # characters of a bad value, and of all that is said
# Where Pydantic found a value, at first: says nothing to who sent it.
_PLACES = (
    *("body", "query", "header", "drive", "steer", "go_to", "follow_steps"),
    *("push", "disturb", "replay"),
)
_FURTHEST_M, _MOST_TURN, _MOST_STEPS = 1000.0, 1000.0, 200
_SLOWEST, _FASTEST = 0.1, 10.0  # of a replay; the page has the same
PUSH_LIMITS: dict[str, Limits] = declared(Push, Limits)
PUNCH_LIMITS: dict[str, Limits] = declared(Punches, Limits)
WORLD_LIMITS = {n: d.limits for n, d in DISTURBANCES.items() if d.limits is not None}
"""Limits of the numbers of pushes, punches and worlds, by field."""


class _Strict(BaseModel):
    """Nothing is converted, nothing unknown is let through, every number is finite."""

    model_config = ConfigDict(
        strict=True, extra="forbid", allow_inf_nan=False, frozen=True
    )


class Motion(_Strict):
    """What the robot is asked to do; all three speeds 0 stop it."""

    vx: float = Field(default=0.0, description="Speed ahead [m/s].")
    vy: float = Field(default=0.0, description="Speed to the left [m/s].")
    yaw_rate: float = Field(default=0.0, description="Turning to the left [rad/s].")
    crouch: float = Field(
        default=0.0, description="Hips below their usual height, less at speed [m]."
    )


class Steering(_Strict):
    """How far the wheel is pulled each way; all three 0 stop the robot."""

    ahead: float = Field(default=0.0, ge=-1.0, le=1.0, description=_PART % "vx")
    left: float = Field(default=0.0, ge=-1.0, le=1.0, description=_PART % "vy")
    turn: float = Field(default=0.0, ge=-1.0, le=1.0, description=_PART % "yaw_rate")
    most: float = Field(
        default=1.0,
        gt=0.0,
        le=1.0,
        description="How much of the range the three share; more is scaled down.",
    )
    crouch: float = Field(
        default=0.0,
        ge=0.0,
        le=1.0,
        description="Part of the lowest that the hips go; less is done at speed.",
    )


class _PlaceRequest(_Strict):
    """A place on the floor with a heading, in the frame of a frame's `place`."""

    x: float = Field(
        description="From where the robot stood at its start or last reset, the way it "
        "faced then [m].",
        ge=-_FURTHEST_M,
        le=_FURTHEST_M,
    )
    y: float = Field(
        description="To the left of that [m].", ge=-_FURTHEST_M, le=_FURTHEST_M
    )
    yaw: float = Field(
        default=0.0,
        description="Heading there, to the left [rad].",
        ge=-_MOST_TURN,
        le=_MOST_TURN,
    )


class GoalRequest(_PlaceRequest):
    """Where the middle between the feet is to be, and the heading."""

    crouch: float = Field(
        default=0.0, ge=0.0, le=1.0, description="Part of the lowest, on the way."
    )


class FootstepRequest(_PlaceRequest):
    """Where the ankle of a foot is to land."""

    left: bool = Field(description="Whether it is the left foot.")


class FootstepsRequest(_Strict):
    """Footsteps from a stand, left and right by turns."""

    steps: list[FootstepRequest] = Field(min_length=1, max_length=_MOST_STEPS)


class PushRequest(_Strict):
    """A push of a body of a simulated robot, for 0.1 s."""

    impulse_ns: float = Field(gt=0.0, description="Impulse [N s].")
    direction_deg: float = Field(
        default=0.0,
        description="As the trunk faces: 0 forward, 90 to the left [deg].",
        ge=PUSH_LIMITS["direction_deg"].low,
        le=PUSH_LIMITS["direction_deg"].high,
    )
    elevation_deg: float = Field(
        default=Push.elevation_deg,
        description="Of the force above the floor's plane [deg].",
        ge=PUSH_LIMITS["elevation_deg"].low,
        le=PUSH_LIMITS["elevation_deg"].high,
    )
    body: str = Field(
        default=Push.body,
        description="One of the library's `bodies`, or any: drawn by its mass.",
    )


class PunchesRequest(_Strict):
    """Pushes of random size, on random bodies, in random directions in space."""

    most_ns: float = Field(gt=0.0, description="Largest impulse [N s].")
    every_s: float = Field(
        default=Punches.every_s,
        description="From one to the next [s].",
        ge=PUNCH_LIMITS["every_s"].low,
        le=PUNCH_LIMITS["every_s"].high,
    )


class DisturbanceRequest(_Strict):
    """What is to disturb a simulated robot; null takes it away, left out it stays."""

    punches: PunchesRequest | None = Field(
        default=None, description="Punches from now on."
    )
    arms: Arms | None = Field(default=None, description=DISTURBANCES["arms"].help)
    payload: float | None = Field(
        default=None,
        description=DISTURBANCES["payload"].help,
        ge=WORLD_LIMITS["payload"].low,
        le=WORLD_LIMITS["payload"].high,
    )

    @property
    def changes(self) -> dict[str, Any]:
        """What is given, as fields of `live.messages.Disturb`."""
        names = self.model_fields_set & DisturbanceRequest.model_fields.keys()
        given = {name: getattr(self, name) for name in names}
        if self.punches is not None:
            given["punches"] = PunchesState(self.punches.most_ns, self.punches.every_s)
        return {n: getattr(World, n) if v is None else v for n, v in given.items()}


class ReplayRequest(_Strict):
    """How a log is to be played; what is left out stays as it is."""

    playing: bool | None = Field(default=None, description="Whether it plays.")
    at_s: float | None = Field(
        default=None,
        ge=0.0,
        description="From its beginning; beyond its end, its end [s].",
    )
    speed: float | None = Field(
        default=None,
        ge=_SLOWEST,
        le=_FASTEST,
        description=f"Times as fast as it was, {_SLOWEST:g} to {_FASTEST:g}.",
    )


class Login(_Strict):
    """The token that the server was started with."""

    token: str = Field(
        max_length=TOKEN_LENGTHS[1], description="As `serve` was given it."
    )


class DriveMessage(Motion):
    """Ask for a motion; to be repeated at 10 Hz, for it counts for 0.5 s."""

    type: Literal["drive"]


class SteerMessage(Steering):
    """Ask for parts of the library's range; to be repeated as a motion is."""

    type: Literal["steer"]


class GoToMessage(GoalRequest):
    """Walk to a place; to be repeated within 3 s, as who is silent is lost."""

    type: Literal["go_to"]


class FollowStepsMessage(FootstepsRequest):
    """Make footsteps; to be repeated as a place is."""

    type: Literal["follow_steps"]


class PushMessage(PushRequest):
    """Push a simulated robot."""

    type: Literal["push"]


class DisturbMessage(DisturbanceRequest):
    """Change what disturbs a simulated robot."""

    type: Literal["disturb"]


class ReplayMessage(ReplayRequest):
    """Play a log otherwise."""

    type: Literal["replay"]


class ActMessage(_Strict):
    """Ask for what needs no numbers."""

    type: Literal[
        "stop", "start", "rest", "reset", "get_up", "emergency_stop", "let_go"
    ]


_Wishes = PushMessage | DisturbMessage | ReplayMessage
_Ways = DriveMessage | SteerMessage | GoToMessage | FollowStepsMessage
AnyMessage = _Ways | _Wishes | ActMessage
MESSAGES: TypeAdapter[AnyMessage] = TypeAdapter(
    Annotated[AnyMessage, Field(discriminator="type")]
)
"""Reads the messages of the telemetry stream."""


class _AnyStop(BaseModel):
    """A stop, whatever else is said with it."""

    model_config = ConfigDict(strict=True, extra="ignore")

    type: Literal["stop", "emergency_stop"]


STOPS = TypeAdapter(_AnyStop)
"""Finds a stop in a message of the stream that is otherwise wrong."""


class Problem(msgspec.Struct, frozen=True):
    """Why a request was refused."""

    detail: str
    """What is wrong, with the value and the limit."""


class Complaint(msgspec.Struct, frozen=True, tag_field="type", tag="error"):
    """What was wrong with a message on the stream, or with the robot's loop."""

    detail: str
    """What is wrong, with the value and the limit."""


class Asked(msgspec.Struct, frozen=True):
    """What was passed on to the loop. Telemetry shows what came of it."""

    asked: str
    """What for: drive, stop, push and so on."""
    driver: str
    """By whom."""


class NumberedEvent(msgspec.Struct, frozen=True):
    """An event of the loop; numbers rise by one from the start of this server."""

    number: int
    """Of this event."""
    time_s: float
    """On the loop's clock [s]."""
    stamp_ns: int
    """UNIX time [ns]."""
    kind: str
    """mode, command, sensor, link, overrun, push, world, part, or log."""
    text: str
    """What and why, with the value and the limit."""


class Events(msgspec.Struct, frozen=True):
    """The latest events, oldest first."""

    events: tuple[NumberedEvent, ...]


class Cause(msgspec.Struct, frozen=True):
    """The first rule that broke on the way to a fall."""

    rule: str
    """With the joint or the foot."""
    time_s: float
    """When it began to, on the loop's clock [s]."""
    amount: float | None
    """What was measured, in `unit`."""
    limit: float | None
    """What the rule allows, in `unit`."""
    unit: str
    """Of the amount and the limit."""
    advice: str
    """What to change, and how."""


class Fall(msgspec.Struct, frozen=True):
    """Why the robot fell last."""

    sentence: str
    """What happened, and what to change."""
    time_s: float
    """On the loop's clock [s]."""
    stamp_ns: int
    """UNIX time [ns]."""
    cause: Cause | None
    """None where no rule broke, or too little is known."""


class LinkState(msgspec.Struct, frozen=True):
    """The link to the robot, since it was connected."""

    sent: int
    """Requests to the robot."""
    lost: int
    """Of them, those without a sound answer."""
    note: str
    """What is wrong with the link now; empty if nothing is."""
    holds: bool
    """Whether motors may have torque although the robot was let go."""
    supply_v: float | None
    """Voltage of the motors' supply, None where it is not measured [V]."""

    @classmethod
    def of(cls, t: Telemetry) -> "LinkState":
        """Return the link as telemetry tells of it."""
        return cls(t.link_sent, t.link_lost, t.link_note, t.link_holds, t.supply_v)


class LoopHealth(msgspec.Struct, frozen=True):
    """How the loop does."""

    mode: str
    """One of `Mode`."""
    reason: str
    """Why this mode; what to do about it if something is wrong."""
    pace: Pace
    """How well it keeps its rate."""


class Health(msgspec.Struct, frozen=True):
    """How loop, link and stream do."""

    loop: LoopHealth | None
    """None if the loop is silent."""
    link: LinkState | None
    """None if the loop is silent."""
    clients: int
    """Of the telemetry stream."""
    viewers: int
    """Of the 3-D view."""
    dropped_frames: int
    """That slow clients did not get, since the server began."""


class TelemetryFrame(
    LoopState, frozen=True, kw_only=True, tag_field="type", tag="frame"
):
    """Robot and loop at one moment; null for what nobody measured."""

    asked_parts: tuple[float, float, float]
    """`asked` as signed parts of the most that the library walks each way."""
    scene: Scene
    """Where robot, soles, ZMP and support region are."""
    link: LinkState
    """The link to the robot."""
    events: tuple[NumberedEvent, ...]
    """The latest ones."""
    fall: str | None
    """Why the robot lies on the floor, if it does."""
    simulated: bool
    """Whether physics moves it, and it can be pushed."""
    kind: RobotKind
    """What moves: a simulated robot, nothing (mock), emulated servos or real ones; a
    log does not tell of any other than a simulated one."""
    view: int | None
    """Which process draws the 3-D view; null while none does. A socket of the view that
    was opened for another one is dead."""


class JointInfo(msgspec.Struct, frozen=True):
    """A leg joint and its limits."""

    name: str
    lower: float
    """Least angle [rad]."""
    upper: float
    """Largest angle [rad]."""
    speed: float | None
    """Largest speed [rad/s]; None for no limit."""
    torque: float | None
    """Largest torque of the servo [N m]; None where it is not known."""


class PoseInfo(msgspec.Struct, frozen=True):
    """A key pose."""

    index: int
    """Of the pose in its layer, as edges name it."""
    primitives: dict[str, float]
    """Components of Swing, Lift and Move [m, rad]."""


class LayerInfo(msgspec.Struct, frozen=True):
    """The key poses of a key moment."""

    key_moment: str
    poses: tuple[PoseInfo, ...]


class EdgeInfo(msgspec.Struct, frozen=True, rename={"from_": "from"}):
    """A way from a key pose to one of the next key moment that may be taken."""

    layer: int
    """Of the pose that it leaves, 0 for kp_1."""
    from_: int
    """Pose that it leaves."""
    to: int
    """Pose that it leads to, of the next layer."""
    cost: float
    """Expected cost of a gait through it."""


class TimingInfo(msgspec.Struct, frozen=True):
    """Planned times."""

    step: float
    """Of one step [s]."""


class RangeInfo(msgspec.Struct, frozen=True):
    """Least and most of each speed alone, which share the range; and of a crouch."""

    vx: tuple[float, float]
    """Back and ahead [m/s]."""
    vy: tuple[float, float]
    """To the right and to the left [m/s]."""
    yaw_rate: tuple[float, float]
    """Turning to the right and to the left [rad/s]."""
    crouch: tuple[float, float]
    """Most in place, and at the fastest ahead or back [m]."""


class DisturbanceLimits(msgspec.Struct, frozen=True):
    """What may disturb a simulated robot, and how much."""

    impulse_ns: float
    """Hardest push and punch [N s]."""
    bodies: tuple[str, ...]
    """That can be pushed."""
    elevation_deg: tuple[float, float]
    """Least and most of a push [deg]."""
    every_s: tuple[float, float]
    """Least and most between two punches [s]."""
    payload: tuple[float, float]
    """Least and most, part of the robot's mass."""


class LibraryInfo(msgspec.Struct, frozen=True):
    """Robot, limits and Markov chain of a gait library."""

    name: str
    """Of the robot."""
    fingerprint: str
    """Of the robot."""
    qualified: bool
    """Whether physics passed it."""
    mass_kg: float
    """Of the robot [kg]."""
    joints: tuple[JointInfo, ...]
    command_range: RangeInfo
    layers: tuple[LayerInfo, ...]
    edges: tuple[EdgeInfo, ...]
    timing: TimingInfo
    sole: tuple[tuple[float, float], ...]
    """Corners, from under the ankle: ahead, to the left [m]."""
    disturbances: DisturbanceLimits | None
    """None where the robot is not simulated."""


ANSWERS: tuple[type[msgspec.Struct], ...] = (
    *(Problem, Complaint, Asked, NumberedEvent, Events, Cause, Fall),
    *(LinkState, LoopHealth, Health, TelemetryFrame, Choice, Scene, Pace),
    *(Disturbances, PunchesState, DisturbanceLimits, ReplayState, Going),
    *(JointInfo, PoseInfo, LayerInfo, EdgeInfo, TimingInfo, RangeInfo, LibraryInfo),
)
"""All that the server sends."""


def fault_text(errors: Iterable[Mapping[str, Any]]) -> str:
    """Say in one line what is wrong with a request.

    Args:
        errors: of a Pydantic `ValidationError`.
    """
    text = "; ".join(map(_fault, errors))[:_LONGEST] or "cannot be read"
    return text.encode(errors="backslashreplace").decode()  # names may be no Unicode


def unread_text(cause: BaseException | None) -> str:
    """Say in one line why a body cannot be read, which is no matter of its syntax.

    Args:
        cause: what Python's JSON reader raised.
    """
    match cause:
        case RecursionError():
            return "the body is nested too deeply: requests have three levels at most"
        case UnicodeDecodeError():
            return f"the body is no text in {cause.encoding}, at byte {cause.start}"
        case ValueError():  # Python's own limit
            return "a number in the body has too many digits"
    return "the body cannot be read as JSON"


def _fault(error: Mapping[str, Any]) -> str:
    if error["type"] == "json_invalid":
        return f"not JSON: {error['ctx']['error']}"
    if isinstance(error.get("input"), bytes):  # FastAPI has not read it as JSON
        return "the body: send it with Content-Type: application/json"
    loc = error.get("loc", ())
    place = loc[1:] if loc and loc[0] in _PLACES else loc
    where = ".".join(str(part)[:_SHOWN] for part in place)
    what, value = error["msg"], error.get("input")
    shown = "" if value is None or isinstance(value, dict | list) else _short(value)
    named = f"{where} {shown}".strip()
    return f"{named}: {what}" if named else str(what)


def _short(value: object) -> str:
    try:
        text = repr(value)
    except ValueError:  # an integer of too many digits
        return "a huge number"
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."
