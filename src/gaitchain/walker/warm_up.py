"""Machine code of a whole walk, made before the first step of a robot."""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from gaitchain.balance.bounds import inside, sane
from gaitchain.balance.compiled import COMPILED
from gaitchain.gait.library import GaitLibrary
from gaitchain.messages import GRAVITY, Array, Command, JointTargets, Sensors

_STANDS = 5  # control periods: what a standing robot learns is compiled as well
_STEPS = 4
_LONGEST_S = 15.0
_warm: set[tuple[str, bool]] = set()  # kinds of walk whose code this process has


class _Gait(Protocol):
    @property
    def stand(self) -> Array: ...
    @property
    def steps(self) -> int: ...
    def command(self, command: Command) -> Command: ...
    def step(self, sensors: Sensors) -> JointTargets: ...


def warm_up(
    make: Callable[[], _Gait], library: GaitLibrary, period_s: float, *, feedback: bool
) -> None:
    """Walk some steps on perfect servos, so that no step of a real walk compiles.

    Once in a process for each kind of walk: some 10 s of CPU where nothing is in the
    cache on disk, less than a second where it is, and 50 ms for the walk itself.

    Args:
        make: makes a gait that is not used for anything else.
        library: its library.
        period_s: control period [s].
        feedback: whether the gait balances.
    """
    kind = library.family.name, feedback
    if not COMPILED or kind in _warm:
        return
    gait, upright = make(), np.array([0.0, 0.0, GRAVITY])
    position = gait.stand
    rates, gyro = np.zeros(len(position)), np.zeros(3)
    sane(position, rates, gyro, upright, 1.0)
    inside(position, position, position)
    for tick in range(round(_LONGEST_S / period_s)):
        if tick == _STANDS:
            gait.command(_some_motion(library))
        targets = gait.step(Sensors(tick * period_s, position, rates, gyro, upright))
        rates = (targets.position - position) / period_s
        position = targets.position
        if gait.steps >= _STEPS:
            break
    _warm.add(kind)


def _some_motion(library: GaitLibrary) -> Command:
    """Return half of the most that a library can do in some direction."""
    span = library.command_range
    for name in ("vx", "vy", "yaw_rate"):
        far = max(getattr(span, name), key=abs)
        if far:
            return Command(**{name: 0.5 * far})
    return Command()
