"""The numbers that a fit looks for, and what is believed of them before. Ours."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from gaitchain.messages import Array
from gaitchain.robot.identified import Identified


class Prior(NamedTuple):
    """What is believed of a number before a log is read."""

    mean: float
    sd: float
    """Standard deviation."""
    least: float
    most: float
    unit: str
    scale: float = 1.0
    """From the number to its unit."""
    alike: float = 0.0
    """Correlation of two joints' numbers."""


_DEG = float(np.degrees(1.0))
# Deviations are those of robots that people build and files that they write: servos a
# quarter stiffer or softer, horns set to a degree or two, a battery moved. Gears of one
# make wear alike, but for the one that was hit.
_OF_JOINT = {
    "gain": Prior(1.0, 0.25, 0.2, 4.0, "%", 100.0),
    "offset": Prior(0.0, 0.026, -0.3, 0.3, "deg", _DEG),
    "damping": Prior(1.0, 0.15, 0.2, 5.0, "%", 100.0, alike=0.8),
    "backlash_deg": Prior(0.5, 0.6, 0.0, 5.0, "deg", alike=0.9),
    "dry_friction": Prior(0.01, 0.02, 0.0, 0.3, "%", 100.0, alike=0.9),
}
_OF_AXIS = {
    "com": Prior(0.0, 0.015, -0.2, 0.2, "mm", 1000.0),
    "tilt": Prior(0.0, 0.026, -0.3, 0.3, "deg", _DEG),
}
_OF_ALL = {
    "delay_s": Prior(0.015, 0.02, 0.0, 0.15, "ms", 1000.0),
    "stiction": Prior(0.3, 0.5, 0.0, 5.0, "%", 100.0),
    "viscous_friction": Prior(0.02, 0.04, 0.0, 0.5, "%", 100.0),
}
_OF_TRUNK = {
    "trunk_mass": Prior(1.0, 0.1, 0.3, 3.0, "%", 100.0),
    "imu_delay_s": Prior(0.0, 0.01, 0.0, 0.15, "ms", 1000.0),
}
OF_JOINTS = tuple(_OF_JOINT)
"""Names of the numbers that each joint has its own of."""
OF_SERVOS = tuple(_OF_ALL)
"""Names of the numbers that all servos have in common."""
OF_IMU = "tilt", "imu_delay_s"
"""Names of the numbers that nothing but an IMU shows."""
OF_STAND = "com", "trunk_mass"
"""Names of the numbers that a trunk hides which is held."""
OF_ZEROS = "offset", "tilt", "lean"
"""Names of the numbers that say where zero is: of encoders, IMU and trunk."""
_PLAY = _OF_JOINT["backlash_deg"]
USUAL_PLAY_RAD = (_PLAY.mean + 2.5 * _PLAY.sd) / _DEG
"""Most play that usual gears have, 2.5 deviations: 2 deg [rad]."""
_LEAN = Prior(0.0, 0.035, -0.3, 0.3, "deg", _DEG)
_AXES = "xyz"


@dataclass(frozen=True)
class Parameter:
    """One number of the fit."""

    name: str
    """Field of `Identified`, or "lean" for the attitude of a trunk that is held."""
    index: int | None
    """In its array; None for a number by itself."""
    of: str
    """Joint or axis that it is of, empty for all servos."""
    prior: Prior

    def show(self, value: float) -> float:
        """Return a value in its unit."""
        return self.prior.scale * value


class Parameters:
    """All numbers of a fit, in one vector of deviations from what was believed."""

    def __init__(self, joint_names: Sequence[str]) -> None:
        """List them.

        Args:
            joint_names: (2 n,) leg joints.
        """
        arrays = {name: list(joint_names) for name in _OF_JOINT}
        arrays |= {name: list(_AXES) for name in _OF_AXIS}
        priors = _OF_JOINT | _OF_AXIS
        self.all = [
            Parameter(name, i, of, priors[name])
            for name, owners in arrays.items()
            for i, of in enumerate(owners)
        ]
        single = _OF_ALL | _OF_TRUNK
        self.all += [Parameter(n, None, "", b) for n, b in single.items()]
        self.all += [Parameter("lean", i, _AXES[i], _LEAN) for i in range(2)]
        columns = np.array([p.prior[:4] for p in self.all]).T
        self._mean, self._sd, least, most = columns
        self.least = (least - self._mean) / self._sd
        """Bounds of the vector."""
        self.most = (most - self._mean) / self._sd
        self._alike = np.array([p.prior.alike for p in self.all])
        kinds = [(p.name, 0 if p.prior.alike else i) for i, p in enumerate(self.all)]
        self._kind = np.array([kinds.index(kind) for kind in kinds])

    def places(self, *names: str) -> list[int]:
        """Return where the numbers of those names are in the vector, name by name."""
        return [i for n in names for i, p in enumerate(self.all) if p.name == n]

    def own(self, joint: int) -> list[int]:
        """Return where a joint's own numbers are in the vector."""
        return [
            i
            for i, p in enumerate(self.all)
            if p.name in OF_JOINTS and p.index == joint
        ]

    def correlation(self) -> Array:
        """Return what is believed of the vector's correlations, (P, P)."""
        same = self._kind == self._kind[:, None]
        return np.where(np.eye(len(same), dtype=bool), 1.0, self._alike * same)

    def draw(self, count: int, rng: np.random.Generator) -> tuple[Array, Array]:
        """Draw numbers with deviations of 1 and that correlation, in two parts.

        Args:
            count: how many vectors.
            rng: source of randomness.

        Returns:
            (count, P) what joints that are alike have in common, and each number that
            is like no other; (count, P) what each joint has of its own. Their sum has
            the correlation.
        """
        common = rng.standard_normal((count, len(self.all)))[:, self._kind]
        single = rng.standard_normal((count, len(self.all)))
        own = np.sqrt(np.where(self._alike > 0.0, 1.0 - self._alike, 0.0))
        return np.sqrt(1.0 - own**2) * common, own * single

    def anew(
        self, places: Sequence[int], mean: Array, covariance: Array
    ) -> tuple[Array, Array]:
        """Return mean and covariance with some numbers as believed before any log.

        Args:
            places: of the numbers in the vector; of those that joints are believed to
                have alike, too, nothing is kept of what others tell.
            mean: (P,) of the vector.
            covariance: (P, P).
        """
        own, mean, covariance = list(places), mean.copy(), covariance.copy()
        mean[own] = covariance[own] = covariance[:, own] = 0.0
        covariance[own, own] = 1.0
        return mean, covariance

    def without(self, vector: Array, *names: str) -> Array:
        """Return a vector in which the numbers of those names are the least."""
        vector, own = vector.copy(), self.places(*names)
        vector[own] = self.least[own]
        return vector

    def values(self, vector: Array) -> Array:
        """Return the numbers in their own units."""
        return np.asarray(self._mean + self._sd * vector)

    def read(self, vector: Array) -> tuple[Identified, Array]:
        """Return what a vector says of the robot, and how its trunk leaned (2,)."""
        found: dict[str, Any] = {}
        for parameter, value in zip(
            self.all, self.values(vector).tolist(), strict=True
        ):
            if parameter.index is None:
                found[parameter.name] = value
            else:
                found.setdefault(parameter.name, []).append(value)
        lean = np.array(found.pop("lean"))
        arrays = {n: np.array(v) for n, v in found.items() if isinstance(v, list)}
        return Identified(**{**found, **arrays}), lean
