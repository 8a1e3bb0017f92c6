"""Key poses as a family of gaits: file, command range, schedules of a qualification."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gaitchain.gait.command_range import CommandRange
from gaitchain.gait.family import LAYERS, Arrays, GaitFamily
from gaitchain.gait.keypose.cost import PlannedCost
from gaitchain.gait.keypose.key_poses import KeyPoses
from gaitchain.gait.keypose.primitives import PARAMETERS
from gaitchain.gait.motion import Timing
from gaitchain.gait.schedule import (
    PAPER_WALK,
    Schedule,
    Segment,
    parse_schedule,
    random_steps,
)
from gaitchain.messages import Array, Command
from gaitchain.robot.robot import Robot

_PAPER_PART = 0.75  # of the top speed: what the paper's 0.08 m/s is for RES
_SAME_POSE = 1e-9  # rad: tolerance between a stored pose and the composed one
# Schedules of two steps per entry: position in the range of speeds, or None to stand.
_SPEEDS: dict[str, tuple[tuple[float | None, ...], ...]] = {
    "slow": ((0.0, 0.0, 0.0), (0.2, 0.2, 0.2)),
    "middle": ((0.4, 0.4, 0.4), (0.6, 0.6, 0.6)),
    "fast": ((0.8, 0.8, 0.8), (1.0, 1.0, 1.0)),
    "changes": ((0.0, 1.0, 0.0, 1.0), (1.0, 0.5, 0.0, 0.5)),
    "stop and start": ((1.0, None, 1.0), (0.5, None, 0.0)),
}


class KeyPoseGait(GaitFamily):
    """Key poses made of primitives, joined by cubic segments: the paper's walk."""

    name = "key poses"
    presets = ("default", "table1")
    balanced = False
    counts_steps = True
    directed = True
    cover_walks = 150
    recovery_walks = 0

    def columns(self) -> tuple[tuple[str, ...], ...]:
        """Return the parameters of the primitives for every layer."""
        return (PARAMETERS,) * LAYERS

    def stored(self, poses: KeyPoses) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """See `GaitFamily.stored`; the poses are stored to check the primitives."""
        rates = {f"rates_{i}": r for i, r in enumerate(poses.rates, start=1)}
        angles = {f"pose_{i}": q for i, q in enumerate(poses.q, start=1)}
        return {"closed": poses.closed}, rates | angles

    def restored(
        self, robot: Robot, facts: Mapping[str, Any], arrays: Arrays
    ) -> KeyPoses:
        """See `GaitFamily.restored`."""
        parameters, rates, angles = (
            tuple(arrays[f"{name}_{i + 1}"] for i in range(LAYERS))
            for name in ("parameters", "rates", "pose")
        )
        poses = KeyPoses(robot, parameters, rates, bool(facts["closed"]))
        for i, (stored, q) in enumerate(zip(angles, poses.q, strict=True), start=1):
            off = np.abs(stored - q).max()
            if not off < _SAME_POSE:
                raise ValueError(
                    f"a pose of layer {i} is {off:.2g} rad away from what its "
                    "primitives compose"
                )
        return poses

    def command_range(
        self,
        poses: KeyPoses,
        cycles: NDArray[np.bool_],
        advance: Array,
        step_s: float,
    ) -> CommandRange:
        """See `GaitFamily`; straight ahead only, by the speeds measured in physics."""
        if not cycles.any():
            return CommandRange((0.0, 0.0))
        speeds = (advance + advance.T)[cycles] / (2.0 * step_s)
        return CommandRange((float(speeds.min()), float(speeds.max())))

    def random_schedule(
        self, rng: np.random.Generator, most: CommandRange, seconds: float
    ) -> Schedule:
        """See `schedule.random_steps`; `seconds` is not used."""
        return random_steps(rng, *most.vx)

    def courses(self, most: CommandRange) -> Iterator[tuple[str, Schedule]]:
        """Yield slow, middle and fast walks, changes of speed and stops."""
        for group, courses in _SPEEDS.items():
            yield from ((group, _course(course, *most.vx)) for course in courses)

    def demonstration(self, most: CommandRange) -> Schedule:
        """Return the paper's walk (Sec. VI-B), for other robots as a part of theirs."""
        paper, (low, high) = parse_schedule(PAPER_WALK, steps=True), most.vx
        fastest = max(segment.command.vx for segment in paper)
        if low <= fastest <= high:
            return paper
        share = max(_PAPER_PART * high, low) / fastest
        return tuple(
            replace(s, command=Command(round(share * s.command.vx, 4))) for s in paper
        )

    def describe(
        self, poses: KeyPoses, timing: Timing, gaits: NDArray[np.int64]
    ) -> list[tuple[str, str]]:
        """Describe the jump of the joint velocities at heel contact."""
        impact = PlannedCost(poses, timing).impact[gaits[:, 2], gaits[:, 3]]
        if not impact.size:
            return []
        return [("landing impact", f"{impact.min():.2f} to {impact.max():.2f} rad/s")]


KEY_POSES = KeyPoseGait()


def _course(course: tuple[float | None, ...], low: float, high: float) -> Schedule:
    """Return a schedule with a half step first and last."""
    speeds = [0.0 if c is None else low + c * (high - low) for c in course]
    middle = [Segment(Command(speed), steps=2) for speed in speeds]
    half = max(low, 0.5 * speeds[0]), max(low, 0.25 * speeds[-1])
    first, last = (Segment(Command(speed), steps=1) for speed in half)
    return first, *middle, last
