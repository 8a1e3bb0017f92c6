"""The place and attitude of the trunk, as the legs and the gyro tell it."""

from typing import NamedTuple


class Odometry(NamedTuple):
    """The trunk's pose over the floor, and how sure it is.

    The origin is on the floor between the feet as they stood at the start, x ahead and
    y to the left. The floor is taken as level: the height is that of the trunk over the
    lowest sole.
    """

    place: tuple[float, float, float]
    """Of the pelvis frame's origin [m]."""
    attitude: tuple[float, float, float]
    """Roll, pitch, yaw: R_z(yaw) R_y(pitch) R_x(roll) [rad]."""
    velocity: tuple[float, float, float]
    """Over the floor, in the trunk's frame [m/s]."""
    covariance: tuple[float, float, float, float, float, float]
    """Of the place and heading: xx, xy, yy, x yaw, y yaw, yaw yaw [m^2, m rad, rad^2].
    """
    distance: float
    """Length of the way so far [m]."""
