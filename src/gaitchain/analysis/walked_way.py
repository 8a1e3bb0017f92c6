"""The way of a simulated walk: as the robot measures it, and as it was."""

from itertools import pairwise
from typing import NamedTuple

from gaitchain.analysis.simulated_walk import Walked, WatchedLoop
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.gait.schedule import Segment
from gaitchain.messages import CONTROL_PERIOD_S, Array
from gaitchain.walker.place import Place
from gaitchain.walker.walker import Walker


class Way(NamedTuple):
    """A way, each part of it in the heading in which it ended."""

    steps: int
    """How many it took."""
    told: tuple[float, float]
    """What was measured ahead and to the left [m]."""
    true: tuple[float, float]
    """What was walked [m]."""


class Ways(NamedTuple):
    """The way of one walk, measured in two ways."""

    steps: Way
    """Of the middle between the feet, by `Walker.place`."""
    trunk: Way
    """Of the trunk, by `Walker.odometry`."""


def walk_measured(
    walker: Walker, backend: MujocoBackend, segment: Segment
) -> tuple[Walked, Ways | None]:
    """Walk with one command, without a stop at the end.

    Args:
        walker: in its initial state.
        backend: the simulator.
        segment: the command and its seconds.

    Returns:
        The walk, and its way from the end of the first step on to that of the last one;
        None where the robot does not measure it.
    """
    walker.keep_odometry()
    loop = _Measured(walker, backend)
    loop.give([(0.0, segment.command)])
    loop.run_until(round(segment.duration_s / CONTROL_PERIOD_S))
    return loop.walked(), loop.ways()


class _Measured(WatchedLoop):
    """The control loop, which notes where the robot is as each step ends."""

    def __init__(self, walker: Walker, backend: MujocoBackend) -> None:
        super().__init__(walker, backend)
        self._simulator = backend
        self._seen: list[tuple[Place, Place, Place, Place]] = []

    def note(self, time_s: float, target: Array) -> None:
        """Note the places by steps and by the trunk, told and true, of an ended step.

        All have the heading of the trunk, as it is told or true.
        """
        before = len(self.ended)
        super().note(time_s, target)
        walker, simulator = self.walker, self._simulator
        by_steps, by_trunk = walker.place, walker.odometry
        if len(self.ended) == before or by_steps is None or by_trunk is None:
            return
        x, y = by_trunk.place[:2]
        feet = simulator.foot_positions().mean(axis=0).tolist()
        base = simulator.data.qpos[:2].tolist()
        self._seen.append(
            (
                by_steps,
                Place(feet[0], feet[1], simulator.heading),
                Place(x, y, by_steps.yaw),
                Place(base[0], base[1], simulator.heading),
            )
        )

    def ways(self) -> Ways | None:
        """Add up what was noted."""
        if len(self._seen) < 2:
            return None
        by_steps, feet, by_trunk, base = map(_added, zip(*self._seen, strict=True))
        steps = len(self._seen) - 1
        return Ways(Way(steps, by_steps, feet), Way(steps, by_trunk, base))


def _added(places: tuple[Place, ...]) -> tuple[float, float]:
    """Add up the way, ahead and to the left of where each part of it ends [m]."""
    ahead = left = 0.0
    for before, after in pairwise(places):
        moved = after.seen_from(before._replace(yaw=after.yaw))
        ahead, left = ahead + moved.x, left + moved.y
    return ahead, left
