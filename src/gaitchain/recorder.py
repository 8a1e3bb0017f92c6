"""Record a walk on the simulator, tick by tick.

The recorder copies MuJoCo's arrays at each tick, and works out the columns of the
record at the end, for all rows in one go.
"""

import math
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.biped import Biped
from gaitchain.generator import Decision
from gaitchain.kinematics import Array
from gaitchain.messages import Command, PanelMessage
from gaitchain.motion import Timing
from gaitchain.poses import STAND
from gaitchain.record import Limit, WalkRecord
from gaitchain.zmp import GRAVITY, Support

_UNLOADED = 0.02  # of the weight; a sole with less is off the ground
_AIR_ROWS = 5  # off the ground for so many rows and back: a landing
_SLEW = 1  # where MuJoCo keeps a servo's speed limit in its dynprm
_UNKNOWN = math.nan, math.nan
_AS_COPIED = ("time_s", "target", "torque", "qpos", "tilt", "foot_height")


class Plan(Protocol):
    """What the recorder reads off a walker at each tick.

    It may also have `estimate` (None, or with `roll` and `pitch` [rad]) and
    `planned_zmp` (None, or (2,) in the support-foot frame of `zmp` [m]).
    """

    @property
    def standing(self) -> bool:
        """Whether the robot is to stand still."""

    @property
    def support(self) -> Support:
        """The planned support region, when not standing."""

    @property
    def decision(self) -> Decision | None:
        """The latest decision."""

    @property
    def panel(self) -> PanelMessage | None:
        """The primitive components of the key pose that comes next."""


class Recorder:
    """The columns of a walk's record, filled tick by tick."""

    def __init__(self, biped: Biped, backend: MujocoBackend, rows: int = 1024) -> None:
        """Make room for a number of rows; more of them make room for themselves."""
        data, model = backend.data, backend.model
        sources = {
            "qpos": data.qpos,
            "qvel": data.qvel,
            "torque": data.actuator_force,
            "place": data.xpos,
            "turn": data.xmat,
            "wrench": data.cfrc_ext,
            "twist": data.cvel,
            "com": data.subtree_com[1],
        }
        told = {
            "time_s": (),
            "target": (model.nu,),
            "tilt": (2,),
            "foot_height": (2,),
            "self_contact": (),
            "estimate": (2,),
            "planned_zmp": (2,),
        }
        shapes = {**{n: a.shape for n, a in sources.items()}, **told}
        self._raw = {n: np.empty((max(rows, 1), *s)) for n, s in shapes.items()}
        # MuJoCo's arrays stay where they are: looked up once, not at each tick.
        self._copies = tuple((self._raw[n], a) for n, a in sources.items())
        self._told = tuple(self._raw[n] for n in told)
        self._biped, self._backend = biped, backend
        self._feet = [model.body(f"{side}_foot").id for side in ("left", "right")]
        self._least_force = _UNLOADED * float(model.body_mass.sum()) * GRAVITY
        self._support: list[str] = []
        self._key_pose: list[tuple[int, int]] = []
        self._decisions: list[tuple[float, Decision, PanelMessage]] = []

    def add(self, time_s: float, target: Array, plan: Plan) -> None:
        """Record the robot as it is now, before it is told the target."""
        row = len(self._support)
        if row == len(self._told[0]):
            for column in self._raw.values():
                column.resize((2 * row, *column.shape[1:]), refcheck=False)
        for column, source in self._copies:
            column[row] = source
        times, targets, tilts, heights, contacts, estimates, zmps = self._told
        times[row], targets[row] = time_s, target
        tilts[row], heights[row] = self._backend.tilt, self._backend.sole_heights()
        contacts[row] = self._backend.self_contact
        estimate = getattr(plan, "estimate", None)
        estimates[row] = (
            _UNKNOWN if estimate is None else (estimate.roll, estimate.pitch)
        )
        planned_zmp = getattr(plan, "planned_zmp", None)
        zmps[row] = _UNKNOWN if planned_zmp is None else planned_zmp
        self._support.append("stand" if plan.standing else plan.support.value)
        self._note(time_s, plan.decision, plan.panel)

    def _note(
        self, time_s: float, decision: Decision | None, panel: PanelMessage | None
    ) -> None:
        if decision is None or panel is None:
            self._key_pose.append((0, STAND))
            return
        self._key_pose.append((decision.layer, decision.pose))
        if not self._decisions or self._decisions[-1][1] is not decision:
            self._decisions.append((time_s, decision, panel))

    def record(
        self,
        step_ticks: tuple[int, ...],
        fell_at_s: float | None,
        timing: Timing | None = None,
        events: tuple[tuple[float, str], ...] = (),
        commands: tuple[tuple[float, Command], ...] = (),
    ) -> WalkRecord:
        """Return what was recorded; see `WalkRecord` for the arguments."""
        rows, model = len(self._support), self._backend.model
        raw = {name: column[:rows].copy() for name, column in self._raw.items()}
        support = np.array(self._support)
        soles = _soles(self._biped, raw, self._feet)
        wrench = raw["wrench"][:, self._feet]
        return WalkRecord(
            **{name: raw[name] for name in _AS_COPIED},
            **soles,
            joint_position=raw["qpos"][:, 7:].copy(),
            joint_velocity=raw["qvel"][:, 6:].copy(),
            zmp=_zmp(wrench.sum(axis=1), raw["com"], self._least_force),
            planned_zmp=_in_world(raw["planned_zmp"], soles["feet"], support),
            foot_load=wrench[..., 5],
            touch_down=_landings(wrench[..., 5] > self._least_force),
            estimated_tilt=raw["estimate"],
            self_contact=raw["self_contact"] > 0.0,
            support=support,
            key_pose=np.array(self._key_pose, dtype=np.int64),
            step_ticks=step_ticks,
            fell_at_s=fell_at_s,
            decisions=tuple(self._decisions),
            biped=self._biped,
            timing=timing,
            torque_limit=_limit(model.actuator_forcerange[:, 1]),
            speed_limit=_limit(model.actuator_dynprm[:, _SLEW]),
            events=events,
            commands=commands,
        )


def _limit(each: Array) -> Limit:
    """Return one limit where all joints have the same."""
    values = tuple(each.tolist())
    return values[0] if len(set(values)) == 1 else values


def _soles(biped: Biped, raw: dict[str, Array], feet: list[int]) -> dict[str, Array]:
    """Return where the feet are, how high the soles, and how fast their centres."""
    place, twist = raw["place"][:, feet], raw["twist"][:, feet]
    turn = raw["turn"][:, feet].reshape(-1, 2, 3, 3)
    centre = place + turn @ [biped.sole_offset, 0.0, -biped.ankle_height]
    # MuJoCo's twist is that of the point of the foot at the robot's CoM.
    arm = centre - raw["com"][:, None]
    velocity = twist[..., 3:] + np.cross(twist[..., :3], arm)
    yaw = np.arctan2(turn[..., 1, 0], turn[..., 0, 0])
    half = 0.5 * np.array([biped.sole_length, biped.sole_width])
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
    return {
        "soles": centre[..., None, :2]
        + corners @ np.swapaxes(turn[..., :2, :2], -1, -2),
        "feet": np.concatenate([place[..., :2], yaw[..., None]], axis=-1),
        "foot_speed": np.linalg.norm(velocity[..., :2], axis=-1),
    }


def _zmp(wrench: Array, com: Array, least_force: float) -> Array:
    """As `MujocoBackend.zmp`: the wrench is about the CoM; move it to the floor."""
    (x, y, z), force = com.T, wrench[:, 3:]
    on_ground = force[:, 2] >= least_force
    lift = np.where(on_ground, force[:, 2], np.nan)
    ahead = x - (wrench[:, 1] + z * force[:, 0]) / lift
    left = y + (wrench[:, 0] - z * force[:, 1]) / lift
    return np.stack([ahead, left], axis=-1)


def _in_world(planned: Array, feet: Array, support: NDArray[np.str_]) -> Array:
    """Move the planned ZMP from the support-foot frame to the foot that supports."""
    right = np.char.startswith(support, "r")
    foot = feet[np.arange(len(feet)), right.astype(int)]
    x, y = planned[:, 0], np.where(right, -1.0, 1.0) * planned[:, 1]
    cos, sin = np.cos(foot[:, 2]), np.sin(foot[:, 2])
    return np.asarray(
        foot[:, :2] + np.stack([cos * x - sin * y, sin * x + cos * y], -1)
    )


def _landings(on_ground: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return in which row each foot comes back from the air, (N, 2)."""
    before = np.ones((_AIR_ROWS, 2), dtype=np.bool_)  # the walk begins standing
    padded = np.concatenate([before, on_ground])
    rows = len(on_ground)
    recent = np.any([padded[i : i + rows] for i in range(_AIR_ROWS)], axis=0)
    return np.asarray(on_ground & ~recent)
