"""Compilation of all code of a walk before the robot's first step."""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from gaitchain.balance.bounds import inside, sane
from gaitchain.balance.compiled import COMPILED
from gaitchain.gait.library import GaitLibrary
from gaitchain.messages import GRAVITY, Array, Command, JointTargets, Sensors

_STANDS = 5  # control periods of standing, which compile the estimators at rest
_STEPS = 4
_LONGEST_S = 15.0
_warm: set[tuple[str, bool]] = set()  # family and feedback of the walks compiled so far


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
    """Walk a few steps with ideal servos, so that nothing compiles during a real walk.

    Runs once per process for each family, with and without feedback. It needs about
    a minute of CPU without the cache on disk, less than 1 s with it, and 50 ms for the
    walk itself.

    Args:
        make: creates a gait that is used for nothing else.
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
    sane(position, rates, gyro, upright, np.ones(4))
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
    """Return half of the library's fastest command along one axis."""
    span = library.command_range
    for name in ("vx", "vy", "yaw_rate"):
        far = max(getattr(span, name), key=abs)
        if far:
            return Command(**{name: 0.5 * far})
    return Command()
