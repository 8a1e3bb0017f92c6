"""The range of commands that a library can hold for long without a fall."""

from collections.abc import Iterator
from dataclasses import replace

from gaitchain.build.families import build_of
from gaitchain.build.trial import Trial, run_trials, without_caution
from gaitchain.build.workers import Crew
from gaitchain.gait.command_range import CommandRange
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.schedule import Segment
from gaitchain.messages import Command

PARTS = tuple(i / 20 for i in range(20, 2, -1))
"""Parts of an end of the range, tried in this order until one passes."""
_SECONDS = 20.0
_RUNS = 12  # walks of each command, each in a different world
_SEED = 2**33  # above the seeds of a user's trial and of the gate
_SEEDS = 4096  # seeds reserved for each build
_AXES = ("vx", "vy", "yaw_rate")


def hold_steady(library: GaitLibrary, crew: Crew) -> GaitLibrary:
    """Reduce the range of commands to speeds that are held for long without a fall.

    Random schedules rarely stay long at one end of the range. An end at which the robot
    falls is tried again at a lower speed. The steps are kept: a speed that cannot be
    held may still be possible for a step or two.

    Args:
        library: a library with its verdicts on steps.
        crew: processes and worlds.

    Returns:
        The library with its `steady` range.
    """
    span = library.command_range
    left = build_of(library.poses).steady_ends(span)
    if not left:
        return library
    tried = without_caution(library)
    held = {(axis, end): 0.0 for axis in range(3) for end in range(2)}
    for turn, part in enumerate(PARTS):
        if not left:
            break
        stage = "walking on and on" + (f", round {turn + 1}" * (turn > 0))
        walks = _walk(tried, left, part, crew, turn)
        tracked = crew.track(stage, walks, len(left) * _RUNS)
        fell = {key for key, held_on in tracked if not held_on}
        for axis, end in set(left) - fell:
            held[axis, end] = part * span.ends[axis][end]
        left = [key for key in left if key in fell]
    ends = [(held[axis, 0], held[axis, 1]) for axis in range(3)]
    return replace(library, steady=CommandRange(*ends))


def _walk(
    library: GaitLibrary,
    ends: list[tuple[int, int]],
    part: float,
    crew: Crew,
    turn: int,
) -> Iterator[tuple[tuple[int, int], bool]]:
    """Yield for each walk (axis, low or high end) and whether it did not fall."""
    worlds = crew.worlds.harder().but(push_ns=0.0)
    for axis, end in ends:
        speed = part * library.command_range.ends[axis][end]
        segment = Segment(Command(**{_AXES[axis]: speed}), _SECONDS)
        trial = Trial(
            library, worlds=worlds, schedule=(segment,), require_qualified=False
        )
        seed = _SEED + _SEEDS * library.config.seed + 64 * turn + 2 * axis + end
        trials = run_trials(trial, _RUNS, seed, crew.workers)
        for run in trials:
            yield (axis, end), not run.fell
