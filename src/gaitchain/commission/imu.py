"""Whether gyro and accelerometer are mounted as the calibration says."""

import math
from collections.abc import Callable

import numpy as np

from gaitchain.backends.base import Backend
from gaitchain.commission.bench import Bench, Fault, Verdict, no_go
from gaitchain.live.clock import Pacer
from gaitchain.messages import GRAVITY, Array
from gaitchain.walker.upright import MOST_TILT_DEG, nearest_axis, tilt_deg

_READS = 25
_LEAST_READS = 5  # that tell a stuck IMU
_OFF = 1.0  # m/s^2; a robot held by hand sways a little
_MOST_RATE = 5.0  # deg/s; larger than the bias of a gyro
_LEAST_TIP_DEG = 8.0
_GYRO_OFF = 0.3  # part of a tip that the gyro may miss: hands do not turn it evenly
_AXES = "xyz"
# What a person does, the axis along which gravity then shows, and its sign.
_TIPS = (("forward", 0, -1), ("to its left", 1, -1))
_GYRO_TODO = "correct imu.gyro_scale and its sign, or its address and format"
_AXES_TODO = (
    "correct imu.axes in the calibration: the IMU's axes ahead, to the left, and up"
)
_SILENT = Fault(
    "the IMU does not answer, or with what are no numbers",
    "check its cable, id and format",
)
_STUCK_TODO = (
    "switch the IMU's supply off and on; look whether its program measures, and "
    "whether imu.gyro and imu.accelerometer are the addresses of what it measures"
)


def check_imu(bench: Bench) -> Verdict:
    """Read the IMU upright, then tipped forward and to the left by a person."""
    if bench.calibration.imu is None:
        said = "no IMU in the calibration: the robot can only walk open loop"
        return Verdict("skipped", said, "add a table [imu], or serve with --open-loop")
    with bench.robot() as backend:
        bench.person.ready("Hold the trunk upright and still, torque is off")
        came = _felt(bench, backend)
        rate, up = mean_of(came)
        figures: dict[str, object] = {"upright_m_s2": up.tolist()}
        wrong = faults_at_rest(came)
        if not wrong and bench.person.present:
            wrong = _tip(bench, backend, rate, up, figures)
    if wrong:
        return no_go(wrong, figures)
    turned = (
        "" if bench.person.present else "; nobody tipped it: x and y are not checked"
    )
    tilt = tilt_deg(up)
    said = f"upright within {tilt:.0f} deg, {np.linalg.norm(up):.2f} m/s^2{turned}"
    return Verdict("go", said, measured=figures)


def samples(
    read: Callable[[], tuple[Array, Array]],
    wait: Callable[[], object],
    silent: Callable[[], bool] = lambda: False,
) -> Array:
    """Return rates [rad/s] and accelerations [m/s^2] that came, (N, 2, 3).

    Args:
        read: the IMU once; NaN where nothing came.
        wait: for the next read.
        silent: whether nothing more is expected, asked where nothing came.
    """
    came = []
    for _ in range(_READS):
        wait()
        both = np.array(read())
        if np.isfinite(both).all():
            came.append(both)
        elif silent():
            break
    return np.reshape(came, (-1, 2, 3))


def mean_of(came: Array) -> tuple[Array, Array]:
    """Return mean rate (3,) and acceleration (3,) of (N, 2, 3); NaN without any."""
    rate, up = np.mean(came, axis=0) if len(came) else np.full((2, 3), np.nan)
    return rate, up


def faults_at_rest(came: Array) -> list[Fault]:
    """Describe what is wrong with an IMU that is upright and still.

    Args:
        came: (N, 2, 3) by `samples`.
    """
    if not len(came):
        return [_SILENT]
    return _stuck(came) + _implausible(*mean_of(came))


def _tip(
    bench: Bench, backend: Backend, bias: Array, up: Array, figures: dict[str, object]
) -> list[Fault]:
    """Have a person tip the trunk forward and to the left, and judge what is felt.

    Args:
        bench: the bench.
        backend: the robot.
        bias: (3,) what the gyro shows at rest [rad/s].
        up: (3,) acceleration of the upright trunk [m/s^2].
        figures: of the verdict; what is felt is added.
    """
    before = up
    for how, axis, sign in _TIPS:
        turn = _Turn(bench, backend, bias)
        tip = f"Tip the trunk {how} by 20 deg and hold it there"
        bench.person.ready(tip, turn.look)
        _, pull = mean_of(_felt(bench, backend))
        figures[f"tipped {how} m_s2"] = pull.tolist()
        wrong = _tipped(how, axis, sign, pull)
        wrong = wrong or _turned(how, before, pull, turn.angle)
        if wrong:
            return wrong
        before = pull
    return []


class _Turn:
    """How far the trunk has turned, by its gyro."""

    def __init__(self, bench: Bench, backend: Backend, bias: Array) -> None:
        """Take what the gyro shows at rest, (3,) [rad/s]."""
        self._clock, self._backend, self._bias = bench.clock, backend, bias
        self._at_s, self._rate = bench.clock.now(), np.zeros(3)
        self.angle = np.zeros(3)
        """(3,) about the trunk's axes [rad]."""

    def look(self) -> None:
        """Read the gyro, and add how far it has turned since the last time."""
        seen, now_s = self._backend.read().angular_velocity, self._clock.now()
        if np.isfinite(seen).all():
            rate = seen - self._bias
            self.angle += 0.5 * (rate + self._rate) * (now_s - self._at_s)
            self._at_s, self._rate = now_s, rate


def _felt(bench: Bench, backend: Backend) -> Array:
    """Return the samples of a control period each."""

    def read() -> tuple[Array, Array]:
        seen = backend.read()
        return seen.angular_velocity, seen.acceleration

    return samples(read, Pacer(bench.clock, bench.period_s).wait)


def _stuck(came: Array) -> list[Fault]:
    """Describe an IMU that says the same in each of (N, 2, 3); one at rest has noise.

    Few answers tell nothing of that.
    """
    if len(came) < _LEAST_READS or np.ptp(came, axis=0).any():
        return []
    said = f"the IMU is stuck: each of {len(came)} reads shows the same to the last bit"
    return [Fault(said, _STUCK_TODO)]


def _implausible(turning: Array, pulling: Array) -> list[Fault]:
    """Describe signals that are impossible at rest and upright, and what to check.

    Args:
        turning: (3,) mean angular velocity in the trunk's axes [rad/s].
        pulling: (3,) mean acceleration in the trunk's axes [m/s^2].
    """
    wrong = []
    size, tilt = float(np.linalg.norm(pulling)), tilt_deg(pulling)
    rate = float(np.degrees(np.abs(turning)).max())
    if not abs(size - GRAVITY) <= _OFF:
        wrong.append(
            Fault(
                f"the acceleration is {size:.2f} m/s^2 long, at rest {GRAVITY}",
                "check accelerometer_scale, its address and format, and that nobody "
                "moves the robot",
            )
        )
    elif tilt > MOST_TILT_DEG:
        where = nearest_axis(pulling)
        wrong.append(
            Fault(
                f"up is near the trunk's {where}, {tilt:.0f} deg from its z",
                f"hold the trunk upright, or {_AXES_TODO}",
            )
        )
    if not rate <= _MOST_RATE:
        wrong.append(
            Fault(
                f"it turns by {rate:.1f} deg/s, at rest {_MOST_RATE:g} at most",
                "check gyro_scale, its address and format, and that nobody moves the "
                "robot",
            )
        )
    return wrong


def _tipped(how: str, axis: int, sign: int, pulling: Array) -> list[Fault]:
    """Describe what is wrong with the acceleration of a tipped trunk."""
    flat = np.array([pulling[0], pulling[1], 0.0])
    wanted = f"{'-' if sign < 0 else '+'}{_AXES[axis]}"
    if not np.isfinite(pulling).all():
        return [_SILENT]
    if tilt_deg(pulling) < _LEAST_TIP_DEG:
        said = f"tipped {how}, it shows {tilt_deg(pulling):.0f} deg"
        least = f"tip it by {_LEAST_TIP_DEG:g} deg at least"
        return [Fault(said, f"begin again with --from imu, and {least}")]
    if nearest_axis(flat) != wanted:
        said = f"tipped {how}, gravity shows at {nearest_axis(flat)}, not at {wanted}"
        return [Fault(said, _AXES_TODO)]
    return []


def _turned(how: str, before: Array, after: Array, angle: Array) -> list[Fault]:
    """Describe what is wrong with the gyro of a trunk that was tipped.

    Gravity turns in the trunk as far as the trunk turns, the other way.

    Args:
        how: it was tipped.
        before: (3,) acceleration before [m/s^2].
        after: (3,) the same after it.
        angle: (3,) integral of the gyro in between [rad].
    """
    across = np.cross(after, before)
    size = float(np.linalg.norm(across))
    tipped = math.atan2(size, float(before @ after))
    shown = float(angle @ across) / size
    if abs(shown - tipped) <= _GYRO_OFF * tipped:
        return []
    said = (
        f"tipped {how} by {math.degrees(tipped):.0f} deg as gravity shows, and by "
        f"{math.degrees(shown):.0f} deg as the gyro does; within "
        f"{100 * _GYRO_OFF:.0f} % is right"
    )
    return [Fault(said, _GYRO_TODO)]
