"""Rows of a log's sensors, and what replays miss of them. Ours.

Columns are those of 2 n joints, of the gyro and of the accelerometer.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gaitchain.identify.log import Measured
from gaitchain.messages import Array

IMU = 6
"""Columns of gyro and accelerometer, the last ones."""
BLOCK = 25
"""Rows whose mean shows how alike residuals are."""
_LEAST_SD = (2e-4, 2e-3, 0.03)  # of joints, gyro and accelerometer


def sensor_kinds(tables: Sequence[Array]) -> tuple[Array, Array, Array]:
    """Return the columns of joints, gyro and accelerometer."""
    table = np.concatenate(tables)
    return table[:, :-IMU], table[:, -IMU:-3], table[:, -3:]


def rms(tables: Sequence[Array]) -> tuple[float | None, ...]:
    """Return what replays miss of joints, gyro, accelerometer; None of what is not."""
    there = [kind[np.isfinite(kind)] for kind in sensor_kinds(tables)]
    return tuple(float(np.sqrt(np.mean(k**2))) if k.size else None for k in there)


def columns(seen: Measured, rows: int) -> Array:
    """Return the rows of all sensors, (N, 2 n + 6); NaN after a fall.

    Args:
        seen: what was measured, of a robot or in a replay.
        rows: N, of the whole motion.
    """
    shown = np.hstack([seen.joint_position, seen.angular_velocity, seen.acceleration])
    table = np.full((rows, shown.shape[1]), np.nan)
    table[: len(shown)] = shown
    return table


def unbiased(table: Array) -> Array:
    """Return the rows without the gyro's mean, as it has a bias; NaN stays NaN."""
    table, gyro = table.copy(), slice(-IMU, -3)
    there = np.isfinite(table[:, gyro])
    total = np.where(there, table[:, gyro], 0.0).sum(axis=0)
    table[:, gyro] -= total / np.maximum(there.sum(axis=0), 1)
    return table


def weights_of(table: Array, present: NDArray[np.bool_]) -> Array:
    """Return 1 / s of each sensor by its residuals, as if all rows were independent.

    Args:
        table: (N, 2 n + 6) residuals, 0 where nothing was measured.
        present: (N, 2 n + 6) where something was.
    """
    sd, alike = spread(table, present)
    return np.asarray(1.0 / (sd * np.sqrt(alike)))


def spread(table: Array, present: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return the size of each sensor's residuals, and how alike they are.

    Of white noise the latter is 1; of what changes slowly, the rows of a block.

    Args:
        table: (N, 2 n + 6) residuals, 0 where nothing was measured.
        present: (N, 2 n + 6) where something was.
    """
    joints = table.shape[1] - IMU
    least = np.repeat(_LEAST_SD, [joints, 3, 3])
    square = np.sum(table**2, axis=0) / np.maximum(present.sum(axis=0), 1)
    sd = np.maximum(np.sqrt(square), least)
    whole = len(table) // BLOCK * BLOCK
    sums = table[:whole].reshape(-1, BLOCK, table.shape[1]).sum(axis=1)
    rows = np.maximum(present[:whole].sum(axis=0), 1)
    return sd, np.maximum(np.sum(sums**2, axis=0) / rows / sd**2, 1.0)
