"""Detect what must stop a walk: silent sensors, a fall, overload, a joint that strays.

The guard judges what is measured and moves nothing. The loop acts on what it finds: a
fall turns the torque off, anything else makes the robot hold still.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from gaitchain.live.messages import TroubleKind
from gaitchain.messages import GRAVITY, Array, Sensors
from gaitchain.robot.leg_model import LegModel
from gaitchain.walker.sensor_check import LIMITS, GyroCheck, below, mended

_UNFELT_S = 1.0  # time for which no plausible gravity may be measured [s]
_SETTLING_S = 0.5  # how fast the accelerometer corrects the gyro
# Beyond this deviation from g the accelerometer is not used for the tilt [m/s^2].
_SHAKEN = 3.0


@dataclass(frozen=True)
class Bounds:
    """Limits beyond which the guard reports trouble."""

    silent_s: float = 0.25
    """So long a robot, a joint or the IMU may say nothing, or the same again [s]."""
    tilt: float = math.radians(50.0)
    """A trunk that leans further has fallen [rad]."""
    overload: float = 0.98
    """Part of the torque limit that counts as the limit."""
    overload_s: float = 1.0
    """So long a joint may be at its torque limit [s]."""
    astray: float = math.radians(30.0)
    """A joint further from its target does not follow [rad]."""
    astray_s: float = 0.5
    """So long it may be [s]."""
    speeding: float = 3.0
    """A joint faster than this times its speed limit runs away."""
    speeding_s: float = 0.1
    """So long it may be [s]."""


class Trouble(NamedTuple):
    """What is wrong."""

    kind: TroubleKind
    reason: str


class TiltSense:
    """The vertical in the trunk's frame, by gyro and accelerometer alone.

    On purpose not the estimator that the walk balances by: what guards it shall not
    share its mistakes.
    """

    def __init__(self) -> None:
        """Know nothing yet."""
        self._up: Array | None = None

    @property
    def felt(self) -> bool:
        """Whether gravity was felt yet."""
        return self._up is not None

    def feel(self, sensors: Sensors, elapsed_s: float) -> float:
        """Return the trunk's angle from the vertical [rad], 0 until it was felt.

        Args:
            sensors: whole numbers all.
            elapsed_s: since the sensors before [s].
        """
        acceleration = sensors.acceleration
        size = math.sqrt(float(acceleration @ acceleration))
        resting = abs(size - GRAVITY) < _SHAKEN
        if self._up is None:
            if not resting:
                return 0.0
            self._up = acceleration / size
        # A vector at rest turns against the trunk.
        up = self._up - np.cross(sensors.angular_velocity, self._up) * elapsed_s
        if resting:
            up = up + (acceleration / size - up) * min(elapsed_s / _SETTLING_S, 1.0)
        self._up = up / max(math.sqrt(float(up @ up)), 1e-6)
        return math.acos(min(max(float(self._up[2]), -1.0), 1.0))


class Guard:
    """Watch one robot, control period by control period."""

    def __init__(
        self, legs: LegModel, *, has_imu: bool, bounds: Bounds | None = None
    ) -> None:
        """Watch from now on; see `reset`.

        Args:
            legs: names and limits of the joints.
            has_imu: whether gyro and accelerometer measure anything.
            bounds: limits.
        """
        self._names = legs.joint_names
        self._torque = np.asarray(legs.torque_limit, dtype=float)
        self._speed = np.asarray(legs.speed_limit, dtype=float)
        self.bounds = bounds or Bounds()
        self.reset(has_imu=has_imu)

    def reset(self, *, has_imu: bool) -> None:
        """Forget what was, as when the robot was put back on its feet."""
        self._has_imu = has_imu
        count = len(self._names)
        self._tilt = TiltSense()
        self._gyro_check = GyroCheck()
        self._silent = np.zeros(count)  # for how long, each joint [s]
        self._strained = np.zeros((3, count))  # overloaded, astray, speeding
        self._imu_silent = self._stuck = self._late = self._unfelt = 0.0
        self._good: Sensors | None = None
        self._before: Sensors | None = None

    def mend(self, sensors: Sensors, elapsed_s: float) -> Sensors | None:
        """Put the last good number where one is missing; remember for how long.

        So does a single sample of the gyro that jumps: it would look like a fall.

        Args:
            sensors: as measured, NaN or absurd where nothing sound came.
            elapsed_s: since the control period before [s].

        Returns:
            Whole numbers; None if there never was a good one.
        """
        position, velocity = sensors.joint_position, sensors.joint_velocity
        joints = (np.abs(position) < LIMITS["joint_position"]) & (
            np.abs(velocity) < LIMITS["joint_velocity"]
        )
        self._silent = np.where(joints, 0.0, self._silent + elapsed_s)
        imu = ("angular_velocity", "acceleration")
        felt = all(below(getattr(sensors, name), LIMITS[name]) for name in imu)
        self._imu_silent = 0.0 if felt else self._imu_silent + elapsed_s
        good = self._good
        if good is None:
            self._good = sensors if felt and joints.all() else None
            return self._good
        whole = mended(sensors, good, 0.0)  # a clock without a number is late
        self._good = self._gyro_check.believed(whole)
        return self._good

    def judge(
        self,
        sensors: Sensors,
        loads: Array,
        target: Array,
        elapsed_s: float,
        *,
        moving: bool,
    ) -> Trouble | None:
        """Return what is wrong, if anything.

        Args:
            sensors: what `mend` returned.
            loads: (2 n,) torques, NaN where unknown [N m].
            target: (2 n,) joint targets of the control period before [rad].
            elapsed_s: since then [s].
            moving: whether measurements must change from period to period.
        """
        tilt = self._tilt.feel(sensors, elapsed_s) if self._has_imu else 0.0
        lost = self._has_imu and not self._tilt.felt
        self._unfelt = self._unfelt + elapsed_s if lost else 0.0
        if tilt > self.bounds.tilt:
            return Trouble(
                TroubleKind.FALL,
                f"fell: the trunk leans by {math.degrees(tilt):.0f} deg, limit "
                f"{math.degrees(self.bounds.tilt):.0f}",
            )
        self._age(sensors, loads, target, elapsed_s, moving)
        return self.silence() or self._strain() or self._implausible(sensors)

    def lying(self, sensors: Sensors | None, elapsed_s: float) -> Trouble | None:
        """Follow how a limp robot leans; return that it lies there, if it does.

        Args:
            sensors: what `mend` returned.
            elapsed_s: since the sensors before [s].
        """
        if sensors is None or not self._has_imu:
            return None
        tilt, most = self._tilt.feel(sensors, elapsed_s), self.bounds.tilt
        if tilt <= most:
            return None
        return Trouble(
            TroubleKind.LYING,
            f"lies there: the trunk leans by {math.degrees(tilt):.0f} deg, limit "
            f"{math.degrees(most):.0f}",
        )

    def _age(
        self,
        sensors: Sensors,
        loads: Array,
        target: Array,
        elapsed_s: float,
        moving: bool,
    ) -> None:
        """Count for how long each thing has been wrong."""
        bounds, stands_still = self.bounds, moving and self._same(sensors)
        self._stuck = self._stuck + elapsed_s if stands_still else 0.0
        late = self._before is not None and sensors.time == self._before.time
        self._late = self._late + elapsed_s if late else 0.0
        self._before = sensors
        heavy = np.abs(loads) > bounds.overload * self._torque  # NaN is not
        off = np.abs(target - sensors.joint_position) > bounds.astray
        fast = np.abs(sensors.joint_velocity) > bounds.speeding * self._speed
        self._strained = np.where([heavy, off, fast], self._strained + elapsed_s, 0.0)

    def _same(self, sensors: Sensors) -> bool:
        """Whether joints, or the IMU, say to the last digit what they said before."""
        before = self._before
        if before is None:
            return False
        joints = bool((sensors.joint_position == before.joint_position).all())
        turning = (sensors.angular_velocity == before.angular_velocity).all()
        pulling = (sensors.acceleration == before.acceleration).all()
        return joints or (self._has_imu and bool(turning and pulling))

    def silence(self) -> Trouble | None:
        """Return what has said nothing for too long."""
        limit = self.bounds.silent_s
        if self._silent.min() > limit:
            said = f"the robot has not answered for {self._silent.min():.2f} s"
        elif self._silent.max() > limit:
            joint = self._names[int(self._silent.argmax())]
            said = f"{joint} has not answered for {self._silent.max():.2f} s"
        elif self._imu_silent > limit:
            said = f"the IMU has not answered for {self._imu_silent:.2f} s"
        elif self._late > limit:
            said = f"the sensors are late: nothing new for {self._late:.2f} s"
        elif self._stuck > limit:
            said = f"the sensors are stuck: the same numbers for {self._stuck:.2f} s"
        else:
            return None
        return Trouble(TroubleKind.SENSORS, f"{said}, limit {limit:g} s")

    def _implausible(self, sensors: Sensors) -> Trouble | None:
        if self._unfelt < _UNFELT_S:
            return None
        size = float(np.linalg.norm(sensors.acceleration))
        return Trouble(
            TroubleKind.SENSORS,
            f"the accelerometer says {size:.1f} m/s^2, at rest about 9.8: a fall would "
            "not be seen",
        )

    def _strain(self) -> Trouble | None:
        bounds = self.bounds
        rules = (
            (bounds.overload_s, "is at its torque limit"),
            (bounds.astray_s, "does not follow its target"),
            (bounds.speeding_s, "runs away"),
        )
        for times, (limit_s, what) in zip(self._strained, rules, strict=True):
            if times.max() > limit_s:
                joint = self._names[int(times.argmax())]
                said = f"{joint} {what} for {times.max():.2f} s"
                return Trouble(TroubleKind.JOINTS, said)
        return None
