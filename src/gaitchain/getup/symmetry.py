"""Which joints of a robot mirror each other, from where they are in its model."""

from typing import NamedTuple

import numpy as np

from gaitchain.messages import Array

_NEAR = 0.02  # of the robot's height: between an axis and the mirrored one
_ALONG = 0.95  # cosine between them
_MIRROR = np.array([1.0, -1.0, 1.0])


class Pair(NamedTuple):
    """A joint on the left and its like on the right; twice the same in the middle."""

    left: int
    right: int
    sign: float
    """Of the right angle where both sides do the same."""


def mirrored_pairs(at: Array, axes: Array, height: float) -> tuple[Pair, ...]:
    """Return the joints whose motion a robot can mirror.

    A rotation about an axis a is mirrored, at the plane y = 0, into one about
    (-a_x, a_y, -a_z). A joint in the middle is its own mirror image if it pitches.

    Args:
        at: (n, 3) joints' places, x ahead, y to the left, from the middle plane [m].
        axes: (n, 3) their axes, of length 1.
        height: of the robot [m].
    """
    near, pairs = _NEAR * height, []
    for left in np.flatnonzero(at[:, 1] > -near):
        off = np.linalg.norm(at - at[left] * _MIRROR, axis=1)
        along = axes @ (-axes[left] * _MIRROR)
        fits = (off < near) & (np.abs(along) > _ALONG)
        if at[left, 1] < near:
            fits &= (np.arange(len(at)) == left) & (along > 0.0)
        if fits.any():
            right = int(np.argmin(np.where(fits, off, np.inf)))
            pairs.append(Pair(int(left), right, float(np.sign(along[right]))))
    return tuple(pairs)
