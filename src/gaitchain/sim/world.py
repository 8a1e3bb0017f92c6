"""The world around the robot: its floor, servos, sensors and mishaps, numbers only.

Everything random in a world follows from its seed: the errors of the model, the blocks
on the floor and the noise of the sensors, each from a stream of its own.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from numbers import Integral, Real

import numpy as np

from gaitchain.errors import CommandError
from gaitchain.messages import Array

CLEAR_RADIUS_M = 0.4
"""No block within this distance of where the robot starts [m]."""
_MODEL, _BLOCKS, NOISE_STREAM = range(3)  # streams of random numbers

# Blocks: one in each cell of a lattice, which covers about a third of the floor.
_AREA_X, _AREA_Y = (-2.0, 12.0), (-3.0, 3.0)
_CELLS_X, _CELLS_Y = 42, 18
_SIDE = (0.1, 0.3)
_REACH = 0.5 * math.hypot(_SIDE[1], _SIDE[1])  # from a block's centre to its corners

# Allowed values, both ends included.
_WORLD_LIMITS = {
    "friction": (0.0, 10.0),
    "servo_gain": (0.0, 100.0),
    "mass": (0.01, 100.0),
    "timestep": (1e-5, 0.01),
    "torque_limit": (1e-3, 100.0),
    "model_error": (0.0, 0.5),
    "delay_s": (0.0, 1.0),
    "noise": (0.0, 100.0),
    "blocks_m": (0.0, 0.1),
    "slope_deg": (-45.0, 45.0),
    "contact_s": (0.002, 0.2),
}
_PUSH_LIMITS = {
    "impulse_ns": (0.0, 1e4),
    "direction_deg": (-360.0, 360.0),
    "at_s": (0.0, 1e6),
    "duration_s": (1e-3, 60.0),
}


@dataclass(frozen=True)
class Push:
    """A constant force on the trunk's centre of mass for a while, along the floor."""

    impulse_ns: float
    """Force times duration [N s]."""
    direction_deg: float
    """As the trunk faces: 0 is pushed forward, +90 to the left [deg]."""
    at_s: float
    """When it begins, since the walk began (`MujocoBackend.start_clock`) [s]."""
    duration_s: float = 0.1
    """[s]"""

    def __post_init__(self) -> None:
        """Refuse what cannot be.

        Raises:
            CommandError: a number is outside its limits.
        """
        _check(self, _PUSH_LIMITS)

    def impulse_within(self, start_s: float, end_s: float) -> float:
        """Return the part of the impulse that falls into an interval [N s]."""
        end = min(end_s, self.at_s + self.duration_s)
        overlap = max(0.0, end - max(start_s, self.at_s))
        return self.impulse_ns * overlap / self.duration_s


@dataclass(frozen=True)
class World:
    """What the floor, the servos and the sensors are like: the physics around the plan.

    The defaults are the nominal world: level and even floor, perfect model and sensors.
    """

    friction: float = 0.8
    servo_gain: float = 1.0
    """Factor on the servos' stiffness and damping."""
    mass: float = 1.0
    """Factor on every mass and inertia."""
    timestep: float = 0.002
    """Step of the simulation [s]."""
    torque_limit: float = 1.0
    """Factor on the joints' torque limits."""
    model_error: float = 0.0
    """Part by which each link differs from the robot's file, uniformly within +- this.

    Mass and inertia each by a factor; the CoM is shifted along each of the link's axes
    by up to this part of half the box's side, so along a link by up to this part of
    half its length.
    """
    seed: int = 0
    """Of model errors, blocks and sensor noise."""
    delay_s: float = 0.0
    """Servos receive targets this much late, rounded to whole time steps [s]."""
    noise: float = 0.0
    """Level of the sensors' noise: 0 is perfect, 1 a cheap robot, see `noise`."""
    blocks_m: float = 0.0
    """Height of the highest of the flat blocks on the floor, 0 for none [m].

    See `strew_blocks`.
    """
    slope_deg: float = 0.0
    """Slope of the floor, positive uphill in +x [deg].

    The floor stays z = 0 and gravity tilts, which is the same physics: positions along
    the floor keep their meaning, the sensors see the true vertical.
    """
    contact_s: float = 0.02
    """Time constant of floor and blocks, on which touching soles settle [s].

    Smaller is harder; below two steps of the simulation it counts as two of them.
    """
    speed_limit_deg_s: float | None = None
    """Speed limit of the servos' set-points [deg/s].

    None is the robot's own; `math.inf` lets set-points jump.
    """
    push: tuple[Push, ...] = ()
    foot_sensors: bool = False
    """Whether the robot measures the load on its soles."""

    def __post_init__(self) -> None:
        """Refuse what cannot be.

        Raises:
            CommandError: a number is outside its limits or no number.
        """
        _check(self, _WORLD_LIMITS)
        if not _is_whole(self.seed) or self.seed < 0:
            raise CommandError(f"seed is {self.seed!r}, must be a whole number >= 0")
        speed = self.speed_limit_deg_s
        if speed is not None and not (_is_number(speed) and speed >= 1.0):
            raise CommandError(
                f"speed_limit_deg_s is {speed!r}, must be at least 1, inf for no "
                "limit, or None for the robot's own"
            )
        if not isinstance(self.foot_sensors, bool):
            raise CommandError(
                f"foot_sensors is {self.foot_sensors!r}, must be True or False"
            )
        pushes = self.push
        if not (isinstance(pushes, tuple) and all(isinstance(p, Push) for p in pushes)):
            raise CommandError(f"push is {pushes!r}, must be a tuple of Push")

    @property
    def delay_steps(self) -> int:
        """Time steps by which targets are late."""
        return round(self.delay_s / self.timestep)

    @property
    def up(self) -> Array:
        """The true vertical in the floor's frame, (3,) unit vector."""
        slope = math.radians(self.slope_deg)
        return np.array([math.sin(slope), 0.0, math.cos(slope)])


def draw_link_errors(world: World, links: int) -> Array:
    """Draw how far each link is off, within +- the model error.

    Args:
        world: its model error and seed.
        links: number of links.

    Returns:
        (links, 5) parts: of mass, of inertia, of the box's half sides for the CoM.
    """
    error = world.model_error
    return stream_of(world, _MODEL).uniform(-error, error, (links, 5))


def strew_blocks(world: World) -> Array:
    """Strew flat blocks over the floor, x from -2 to 12 m and y from -3 to 3 m.

    Sides are 0.1 to 0.3 m, headings and places random, heights uniform up to the
    world's. They cover about a third of the area, and nothing within 0.4 m of the
    origin, where the robot starts. Where blocks overlap the higher one counts.

    Args:
        world: its blocks' height and seed.

    Returns:
        (n, 6) centre x, y [m], yaw [rad], half sides [m] and height [m]; n = 0 for
        a world without blocks.
    """
    rng = stream_of(world, _BLOCKS)
    x, y = np.linspace(*_AREA_X, _CELLS_X + 1), np.linspace(*_AREA_Y, _CELLS_Y + 1)
    corners = np.stack(np.meshgrid(x[:-1], y[:-1]), axis=-1).reshape(-1, 2)
    n = len(corners)
    centres = corners + rng.random((n, 2)) * [x[1] - x[0], y[1] - y[0]]
    yaw = rng.uniform(0.0, math.pi, n)
    halves = 0.5 * rng.uniform(*_SIDE, (n, 2))
    heights = world.blocks_m * (1.0 - rng.random(n))  # never 0
    blocks = np.column_stack([centres, yaw, halves, heights])
    reach = np.hypot(*centres.T) - np.hypot(*halves.T)
    keep = (reach > CLEAR_RADIUS_M) & (world.blocks_m > 0.0)
    return np.asarray(blocks[keep])


def floor_heights(blocks: Array, points: Array) -> Array:
    """Return the height of the floor, or of the highest block, at points.

    Args:
        blocks: (n, 6) as `strew_blocks` returns them.
        points: (..., 2) x, y [m].

    Returns:
        (...) heights [m].
    """
    spread = points.reshape(-1, 2)
    low, high = spread.min(axis=0) - _REACH, spread.max(axis=0) + _REACH
    centres = blocks[:, :2]
    # Most are too far away to look at each point.
    blocks = blocks[((centres >= low) & (centres <= high)).all(axis=1)]
    off = points[..., None, :] - blocks[:, :2]
    cos, sin = np.cos(blocks[:, 2]), np.sin(blocks[:, 2])
    along = np.abs(cos * off[..., 0] + sin * off[..., 1])
    across = np.abs(cos * off[..., 1] - sin * off[..., 0])
    inside = (along <= blocks[:, 3]) & (across <= blocks[:, 4])
    heights = np.where(inside, blocks[:, 5], 0.0)
    return np.asarray(np.max(heights, axis=-1, initial=0.0))


def stream_of(world: World, stream: int) -> np.random.Generator:
    """Return one of a world's streams of random numbers, from its beginning."""
    return np.random.default_rng((int(world.seed), stream))


def _check(numbers: object, limits: Mapping[str, tuple[float, float]]) -> None:
    for name, (low, high) in limits.items():
        value = getattr(numbers, name)
        if not (_is_number(value) and low <= value <= high):
            raise CommandError(f"{name} is {value!r}, must be {low:g} to {high:g}")


def _is_number(value: object) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)


def _is_whole(value: object) -> bool:
    return isinstance(value, Integral) and not isinstance(value, bool)
