"""Random parts of a world, drawn from its seed: errors of the model, blocks, noise.

Each has its own stream of random numbers, so that switching one on does not change the
others.
"""

import math

import numpy as np

from gaitchain.messages import Array
from gaitchain.sim.world import World

CLEAR_RADIUS_M = 0.4
"""Radius without blocks around the robot's start [m]."""
NOISE_SD = 0.001, 0.05, 0.02, 0.3
"""Standard deviations of sensors at noise level 1: joint position [rad], joint velocity
[rad/s], gyro [rad/s], accelerometer [m/s^2]."""
NOISE_BIAS = 0.005
"""What the gyro shows at rest at noise level 1, each axis [rad/s]."""
# Streams of random numbers.
_MODEL, _BLOCKS, _NOISE, PUNCHES_STREAM, ARMS_STREAM, PUSHES_STREAM = range(6)
JITTER_STREAM, _ENCODERS, _IMU_TILT, _IMU_AT, _IMU_SCALE, _COM, _GAINS = range(6, 13)
_IMU_BIAS, DOUBT_STREAM = 13, 14
_OF_IMU = {_IMU_TILT, _IMU_AT, _IMU_SCALE, _IMU_BIAS}
_OF_ROBOT = {_MODEL, _ENCODERS, _COM, _GAINS, DOUBT_STREAM, *_OF_IMU}

# One block in each cell of a lattice; together they cover about a third of the floor.
_AREA_X, _AREA_Y = (-2.0, 12.0), (-3.0, 3.0)
_CELLS_X, _CELLS_Y = 42, 18
_SIDE = (0.1, 0.3)
_REACH = 0.5 * math.hypot(_SIDE[1], _SIDE[1])  # from a block's centre to its corners


def draw_link_errors(world: World, links: int) -> Array:
    """Draw the relative errors of each link, uniformly within +- the model error.

    Args:
        world: the world, with model error and seed.
        links: number of links.

    Returns:
        (links, 5) relative errors: mass, inertia, and CoM shift in x, y, z as parts of
        half the sides of the link's equivalent box.
    """
    error = world.model_error
    return stream_of(world, _MODEL).uniform(-error, error, (links, 5))


def draw_gains(world: World, joints: int) -> Array:
    """Draw the factor on stiffness and damping of each servo, (n,)."""
    error = world.gain_error
    drawn = 1.0 + stream_of(world, _GAINS).uniform(-error, error, joints)
    return np.asarray(world.servo_gain * drawn)


def draw_encoder_offsets(world: World, joints: int) -> Array:
    """Draw by how much each encoder shows more than the joint's angle, (n,) [rad]."""
    most = math.radians(world.encoder_offset_deg)
    return stream_of(world, _ENCODERS).uniform(-most, most, joints)


def draw_imu_tilt(world: World) -> Array:
    """Draw by how much the IMU is turned about each axis of the trunk, (3,) [rad]."""
    most = math.radians(world.imu_tilt_deg)
    return stream_of(world, _IMU_TILT).uniform(-most, most, 3)


def draw_imu_place(world: World) -> Array:
    """Draw how far the IMU is from its place in the trunk, (3,) [m]."""
    most = world.imu_offset_m
    return stream_of(world, _IMU_AT).uniform(-most, most, 3)


def draw_imu_scales(world: World) -> Array:
    """Draw what gyro and accelerometer show of the true value, (2, 3)."""
    most = world.imu_scale
    return 1.0 + stream_of(world, _IMU_SCALE).uniform(-most, most, (2, 3))


def draw_imu_biases(world: World) -> Array:
    """Draw what the IMU shows too much, (2, 3): gyro [rad/s], accelerometer [m/s^2]."""
    most = np.array([[math.radians(world.gyro_bias_deg_s)], [world.accelerometer_bias]])
    return np.asarray(most * stream_of(world, _IMU_BIAS).uniform(-1.0, 1.0, (2, 3)))


def draw_com_shift(world: World) -> Array:
    """Draw how far the trunk's CoM is from its place, (3,) [m]."""
    return stream_of(world, _COM).uniform(-world.com_m, world.com_m, 3)


def draw_blocks(world: World) -> Array:
    """Draw flat blocks on the floor, x from -2 to 12 m and y from -3 to 3 m.

    Sides are 0.1 to 0.3 m, headings and positions random, heights uniform up to
    `World.blocks_m`. They cover about a third of the area, but nothing within 0.4 m of
    the origin, where the robot starts. Where blocks overlap, the higher one counts.

    Args:
        world: the world, with block height and seed.

    Returns:
        (n, 6) centre x, y [m], yaw [rad], half sides [m] and height [m]; n = 0 in a
        world without blocks.
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
        blocks: (n, 6) as `draw_blocks` returns them.
        points: (..., 2) x, y [m].

    Returns:
        (...) heights [m].
    """
    spread = points.reshape(-1, 2)
    low, high = spread.min(axis=0) - _REACH, spread.max(axis=0) + _REACH
    centres = blocks[:, :2]
    # Most blocks are far from all points: skip them before the exact check.
    blocks = blocks[((centres >= low) & (centres <= high)).all(axis=1)]
    off = points[..., None, :] - blocks[:, :2]
    cos, sin = np.cos(blocks[:, 2]), np.sin(blocks[:, 2])
    along = np.abs(cos * off[..., 0] + sin * off[..., 1])
    across = np.abs(cos * off[..., 1] - sin * off[..., 0])
    inside = (along <= blocks[:, 3]) & (across <= blocks[:, 4])
    heights = np.where(inside, blocks[:, 5], 0.0)
    return np.asarray(np.max(heights, axis=-1, initial=0.0))


def stream_of(world: World, stream: int) -> np.random.Generator:
    """Return a new generator for one of a world's streams of random numbers."""
    own = stream in _OF_ROBOT and world.plant_seed is not None
    seed = world.plant_seed if own else world.seed
    return np.random.default_rng((int(seed or 0), stream))


class SensorNoise:
    """Sensor errors: white Gaussian noise, and a constant bias of the gyro.

    At level 1 it has the standard deviations `NOISE_SD`, and the gyro's bias is
    0.005 rad/s with a random sign on each axis. Other levels are in proportion. The
    sole loads have no noise.
    """

    joint_position: Array
    """(n,) [rad]"""
    joint_velocity: Array
    """(n,) [rad/s]"""
    angular_velocity: Array
    """(3,) [rad/s]"""
    acceleration: Array
    """(3,) [m/s^2]"""

    def __init__(self, world: World, joints: int = 12) -> None:
        """Seed the generator by the world and draw the first errors."""
        self._rng = stream_of(world, _NOISE)
        sizes = [joints, joints, 3, 3]
        self._scale = world.noise * np.repeat(NOISE_SD, sizes)
        errors = self._errors = np.zeros(sum(sizes))
        # Views, so that one draw renews all four.
        (
            self.joint_position,
            self.joint_velocity,
            self.angular_velocity,
            self.acceleration,
        ) = np.split(errors, np.cumsum(sizes)[:-1])
        self._bias = np.zeros(sum(sizes))
        bias = world.noise * NOISE_BIAS * self._rng.choice([-1.0, 1.0], 3)
        self._bias[2 * joints : 2 * joints + 3] = bias
        self.draw()

    def draw(self) -> None:
        """Replace the errors by new ones."""
        self._rng.standard_normal(out=self._errors)
        self._errors *= self._scale
        self._errors += self._bias
