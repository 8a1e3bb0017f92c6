"""Strides as a family of gaits: file, command range, schedules of a qualification."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gaitchain.gait.command_range import CommandRange
from gaitchain.gait.family import LAYERS, Arrays, GaitFamily
from gaitchain.gait.motion import Timing
from gaitchain.gait.schedule import Schedule, Segment, random_commands, show_walk
from gaitchain.gait.stride.crouch import deepest_crouch
from gaitchain.gait.stride.presets import STRIDE_PRESETS
from gaitchain.gait.stride.strides import COLUMNS, StridePoses
from gaitchain.messages import Array, Command
from gaitchain.robot.robot import Robot

_STOP_S = 2.5
_ALONE_S = 4.0
_ALONE = (("ahead", "back"), ("left", "right"), ("turn left", "turn right"))
# Segments: parts of the limits ahead, to the left and around, and seconds.
_Course = tuple[tuple[float, float, float, float], ...]
_TOGETHER: dict[str, tuple[_Course, ...]] = {
    "mixed": (
        ((0.5, 0.5, 0.0, 2.0), (0.5, 0.0, -0.5, 2.0), (-0.5, 0.0, 0.5, 2.0)),
        ((-0.5, -0.5, 0.0, 2.0), (0.4, -0.3, 0.3, 2.0), (0.0, 0.5, -0.5, 2.0)),
    ),
    "stop and start": (
        ((1.0, 0.0, 0.0, 2.0), (0.0, 0.0, 0.0, 1.5), (-1.0, 0.0, 0.0, 2.0)),
        ((0.0, 1.0, 0.0, 2.0), (0.0, 0.0, 0.0, 1.5), (0.5, 0.0, -0.5, 2.0)),
    ),
}


class Strides(GaitFamily):
    """Strides in place of key poses, under feedback. Ours."""

    name = "strides"
    presets = tuple(STRIDE_PRESETS)
    balanced = True
    counts_steps = False
    directed = False
    cover_walks = 400
    recovery_walks = 400

    def columns(self) -> tuple[tuple[str, ...], ...]:
        """See `strides.COLUMNS`."""
        return COLUMNS

    def stored(
        self, poses: StridePoses
    ) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """See `GaitFamily.stored`; strides and shapes are stored for every family."""
        facts = {"hip_height": poses.hip_height, "stance": poses.stance}
        return {**facts, "balance": dict(poses.balance)}, {}

    def restored(
        self, robot: Robot, facts: Mapping[str, Any], arrays: Arrays
    ) -> StridePoses:
        """See `GaitFamily.restored`."""
        parameters = tuple(arrays[f"parameters_{i + 1}"] for i in range(LAYERS))
        balance = {k: float(v) for k, v in dict(facts["balance"]).items()}
        stance = float(facts.get("stance", 0.0))
        height = float(facts["hip_height"])
        return StridePoses(robot, height, parameters, balance, stance)

    def command_range(
        self,
        poses: StridePoses,
        cycles: NDArray[np.bool_],
        advance: Array,
        step_s: float,
    ) -> CommandRange:
        """See `GaitFamily`; sideways and around, the second step closes the first."""
        first, second = np.nonzero(cycles)
        length, outward, turn = poses.strides.T
        straight = (outward == 0.0) & (turn == 0.0)
        aside = (length == 0.0) & (turn == 0.0)
        around = (length == 0.0) & (outward == 0)
        cycle_s = 2.0 * step_s
        ahead = _span(
            (length[first] + length[second]) / cycle_s, straight, first, second
        )
        fastest = step_s * max(map(abs, ahead))
        return CommandRange(
            ahead,
            _span((outward[first] - outward[second]) / cycle_s, aside, first, second),
            _span((turn[first] - turn[second]) / cycle_s, around, first, second),
            (deepest_crouch(poses, 0.0), deepest_crouch(poses, fastest)),
        )

    def random_schedule(
        self, rng: np.random.Generator, most: CommandRange, seconds: float
    ) -> Schedule:
        """See `schedule.random_commands`."""
        return random_commands(rng, most, seconds)

    def courses(self, most: CommandRange) -> Iterator[tuple[str, Schedule]]:
        """Yield each command alone, in full and half, then mixed ones and stops.

        Directions that the library does not have are left out.
        """
        for axis, names in zip(np.eye(3), _ALONE, strict=True):
            for part in (1.0, 0.5, -1.0, -0.5):
                x, y, turn = (part * axis).tolist()
                yield from _course(names[part < 0.0], ((x, y, turn, _ALONE_S),), most)
        for group, walks in _TOGETHER.items():
            for walk in walks:
                yield from _course(group, walk, most)

    def demonstration(self, most: CommandRange) -> Schedule:
        """See `schedule.show_walk`."""
        return show_walk(most)

    def describe(
        self, poses: StridePoses, timing: Timing, gaits: NDArray[np.int64]
    ) -> list[tuple[str, str]]:
        """Describe step height, crouch, stance and gains."""
        lift_mm = 1000.0 * float(poses.parameters[1][:, 2].mean())
        stance = poses.stance / poses.robot.reduced.hip_width
        crouch = poses.hip_height / poses.robot.reduced.leg_length
        gains = ", ".join(
            f"{name} {value:.2f}" for name, value in poses.balance.items()
        )
        share = float(poses.parameters[1][:, 0].mean())
        return [
            ("sole lifted", f"{lift_mm:.0f} mm, highest after {share:.2f} of its way"),
            ("hips", f"{crouch:.3f} of the leg over the ankles"),
            ("feet", f"{poses.stance:.3f} m apart, {stance:.2f} of the file's stance"),
            ("gains, of the derived ones", gains or "as derived"),
        ]


STRIDES = Strides()


def _span(
    speeds: Array,
    kind: NDArray[np.bool_],
    first: NDArray[np.int64],
    second: NDArray[np.int64],
) -> tuple[float, float]:
    """Return the range of the speeds of cycles whose strides are both of a kind."""
    fitting = speeds[kind[first] & kind[second]]
    return (float(fitting.min()), float(fitting.max())) if fitting.size else (0.0, 0.0)


def _course(
    group: str, course: _Course, most: CommandRange
) -> Iterator[tuple[str, Schedule]]:
    """Yield the schedule, unless the library has none of its directions."""
    segments = [Segment(most.at(parts), seconds) for *parts, seconds in course]
    if any(not segment.command.stops for segment in segments):
        yield group, (*segments, Segment(Command(), _STOP_S))
