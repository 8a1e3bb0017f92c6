"""What falls are like: which rule broke first, and the energy of the impact. Ours.

After a fall has begun the servos hold their last targets until the top of the trunk is
as low as where it lies. The kinetic energy until then is at most

    E <= m g (h - h_down) + E_0                                                    (1)

with the CoM at h where it stands and at h_down in the end, and E_0 the energy of the
walk and of the push.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np

from gaitchain.analysis.fall_cause import explain
from gaitchain.analysis.simulated_walk import run_schedule
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.qualification import Stratum
from gaitchain.gait.schedule import Schedule
from gaitchain.messages import CONTROL_PERIOD_S, GRAVITY, Array
from gaitchain.sim.world import World
from gaitchain.walker.walker import Walker

UNKNOWN = "no rule broke before"
_LYING = 0.55  # of the larger one of the trunk's depth and width
_DOWN_S = 3.0  # after which whatever lies lies
_TRUNK = 1  # number of its body


class Fall(NamedTuple):
    """One fall."""

    cause: str
    """The rule that broke first, see `gaitchain explain`."""
    kinetic_j: float
    """Largest kinetic energy on the way down [J]."""
    head_mps: float
    """Largest speed of the top of the trunk on the way down [m/s]."""
    seconds: float
    """From being recognised as a fall until the trunk was down [s]."""


@dataclass(frozen=True)
class FallsReport:
    """What falls of one origin are like."""

    origin: str
    """Where they come from."""
    walks: int
    """Among which they were."""
    falls: int
    """Of these walks."""
    measured: int
    """Of these falls; what follows is of them."""
    causes: tuple[tuple[str, int], ...]
    """(rule that broke first, falls), the most frequent one first."""
    kinetic_j: tuple[float, float] | None
    """Median and largest kinetic energy on the way down [J]; None without a fall."""
    head_mps: tuple[float, float] | None
    """Median and largest speed of the top of the trunk [m/s]; None without a fall."""


@dataclass(frozen=True)
class Drop:
    """What a robot has to lose by its height."""

    mass_kg: float
    com_m: float
    """Height of the CoM where it stands [m]."""
    potential_j: float
    """m g h: no fall to the floor that it stands on releases more [J]."""


class Watched(NamedTuple):
    """One walk that was watched for a fall."""

    fall: Fall | None


def watch_fall(library: GaitLibrary, world: World, schedule: Schedule) -> Watched:
    """Walk a schedule with a record; measure the fall if there is one.

    Args:
        library: a qualified library.
        world: the world.
        schedule: the commands.
    """
    backend = MujocoBackend(library.robot, world)
    record = run_schedule(Walker(library), backend, schedule)
    if record.fell_at_s is None:
        return Watched(None)
    cause = explain(library.robot, record).cause
    down = _go_down(library, backend)
    return Watched(Fall(cause.rule.value if cause else UNKNOWN, *down))


def potential_drop(library: GaitLibrary) -> Drop:
    """Return what a robot's height is worth."""
    backend = MujocoBackend(library.robot)
    backend.connect(Walker(library).stand)
    mass = float(backend.model.body_mass.sum())
    height = float(backend.data.subtree_com[_TRUNK, 2])
    return Drop(mass, height, mass * GRAVITY * height)


def judge_falls(
    origin: str, watched: Sequence[Watched], among: Stratum | None = None
) -> FallsReport:
    """Combine the falls of one origin.

    Args:
        origin: where they come from.
        watched: the walks that were watched for them.
        among: all walks, if only some of them were watched, such as those that fell.
    """
    falls = [w.fall for w in watched if w.fall is not None]
    walks, fell = len(watched), len(falls)
    if among is not None:
        walks, fell = among.walks, among.falls
    causes = Counter(fall.cause for fall in falls).most_common()
    return FallsReport(
        origin,
        walks,
        fell,
        len(falls),
        tuple(causes),
        _middle_and_most([fall.kinetic_j for fall in falls]),
        _middle_and_most([fall.head_mps for fall in falls]),
    )


def _go_down(library: GaitLibrary, backend: MujocoBackend) -> tuple[float, ...]:
    """Let a robot fall; return largest energy [J], speed of its top [m/s], time [s]."""
    data, reduced = backend.data, library.robot.reduced
    low = _LYING * max(reduced.trunk_depth, reduced.trunk_width)
    energy = speed = 0.0
    for tick in range(round(_DOWN_S / CONTROL_PERIOD_S)):
        mujoco.mj_energyVel(backend.model, data)
        top, rate = _top(backend, reduced.trunk_length)
        energy, speed = max(energy, float(data.energy[1])), max(speed, rate)
        if top <= low:
            return energy, speed, tick * CONTROL_PERIOD_S
        backend.hold()
    return energy, speed, _DOWN_S


def _top(backend: MujocoBackend, length: float) -> tuple[float, float]:
    """Return height [m] and speed [m/s] of the top of the trunk."""
    data = backend.data
    arm: Array = data.xmat[_TRUNK].reshape(3, 3) @ [0.0, 0.0, length]
    twist = np.zeros(6)
    body = mujoco.mjtObj.mjOBJ_XBODY
    mujoco.mj_objectVelocity(backend.model, data, body, _TRUNK, twist, 0)
    rate = twist[3:] + np.cross(twist[:3], arm)
    return float(data.xpos[_TRUNK, 2] + arm[2]), float(np.linalg.norm(rate))


def _middle_and_most(values: Sequence[float]) -> tuple[float, float] | None:
    return (float(np.median(values)), max(values)) if values else None
