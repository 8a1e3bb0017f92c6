"""Say why a robot holds no walk, and what would let it: the same walks in other worlds.

Ours.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gaitchain.analysis.fall_cause import explain
from gaitchain.analysis.simulated_walk import run_schedule
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.build.command_envelope import PARTS
from gaitchain.build.jobs import run_jobs
from gaitchain.build.seed_banks import NO_WALK
from gaitchain.build.trial import Trial, draw_world, without_caution
from gaitchain.build.workers import Crew
from gaitchain.errors import LibraryError
from gaitchain.gait.family import STAND
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.schedule import Segment
from gaitchain.messages import Command
from gaitchain.walker.walker import Walker

_RUNS, _SECONDS = 12, 20.0  # walks in each kind of world
_PART = 0.5  # of the speed that single steps reach
_HELP = 2  # walks that have to hold more, to be worth a change
_ENOUGH = 0.75  # part of the walks that has to hold, so that another build is worth it
_SERVOS = {"servos half as stiff": 0.5, "servos twice as stiff": 2.0}
_CHANGES: Mapping[str, Mapping[str, float]] = {
    **{name: {"servo_gain": gain} for name, gain in _SERVOS.items()},
    "torque limits twice as high": {"torque_limit": 2.0},
    "friction 1.2 under the soles": {"friction": 1.2},
    "targets that come without delay": {"delay_s": 0.0},
    "half the mass": {"mass": 0.5},
    "links exactly as in the file": {"model_error": 0.0},
}


class NoWalkError(LibraryError):
    """A robot holds no walk."""

    def __init__(self, why: str, servo_gain: float | None = None) -> None:
        """Say why.

        Args:
            why: the message.
            servo_gain: part of its servos' stiffness and damping with which it might.
        """
        super().__init__(why)
        self.servo_gain = servo_gain


class _End(NamedTuple):
    """How a walk ended."""

    fell: bool
    rule: str
    """The rule that broke first."""
    advice: str
    """What to turn."""


def check_walks(library: GaitLibrary, crew: Crew) -> None:
    """Refuse a library that holds no speed ahead.

    Args:
        library: with its verdicts on steps, and its `steady` range.
        crew: processes and worlds.

    Raises:
        NoWalkError: it holds none; the message says what falls and what would help.
    """
    if library.command_range.vx[1] > 0.0:
        return
    untried = replace(library, steady=None)
    most = untried.command_range.vx[1]
    found = (
        f"even at {PARTS[-1] * most:.2g} m/s, of walks of {_SECONDS:g} s in different "
        "worlds some end in a fall"
    )
    if not most or not library.allowed_pairs[STAND].any():
        found, untried = _no_step(library), _as_if_passed(untried)
        most = untried.command_range.vx[1]
    gain = library.robot.servo_gain
    tried = "" if gain == 1.0 else f" with servos {_times(gain)}"
    found = f"{library.robot.name} holds no walk{tried}: {found}"
    if not most:
        raise NoWalkError(
            f"{found}; it has no steps ahead of which walks could be made"
        )
    why, held = _why(untried, _PART * most, crew)
    best = max(_SERVOS, key=held.__getitem__)
    raise NoWalkError(
        f"{found}. {why}",
        servo_gain=_SERVOS[best] if held[best] >= _ENOUGH * _RUNS else None,
    )


def _times(gain: float) -> str:
    return f"{gain:g} times as stiff as in its file"


def _no_step(library: GaitLibrary) -> str:
    """Say how often the robot fell in single steps."""
    fell = int((library.pair_passes < library.pair_runs).sum())
    walked = int((library.pair_runs > 0).sum())
    return (
        "physics passed no step from a stand that can be repeated; the robot fell in "
        f"{fell} of {walked} different steps"
    )


def _as_if_passed(library: GaitLibrary) -> GaitLibrary:
    """Return a library that makes every step that was walked, falls or not."""
    return replace(library, pair_passes=library.pair_runs)


def _why(
    library: GaitLibrary, speed: float, crew: Crew
) -> tuple[str, Mapping[str, int]]:
    """Walk at a speed in hard worlds, then in the same ones with one change each.

    Returns:
        What was found, and how many walks held with each change.
    """
    own, changed = _walk_all(library, speed, crew)
    held = _held(own)
    with_change = {name: _held(ends) for name, ends in changed.items()}
    falls = [end for end in own if end.fell]
    rules = Counter(f"{end.rule} (try {end.advice})" for end in falls if end.rule)
    often = "; ".join(f"{n} times {rule}" for rule, n in rules.most_common(2))
    help_by = sorted(with_change.items(), key=lambda of: of[::-1], reverse=True)
    said_of = _named(library.robot.servo_gain)
    worth = [f"{said_of[name]}, {n}" for name, n in help_by if n >= held + _HELP]
    said = (
        f"At {speed:.2g} m/s {len(falls)} of {_RUNS} walks fall; what broke first: "
        f"{often or 'no rule'}. With one change hold, of {_RUNS}: "
        f"{'; '.join(worth) or 'no more with ' + ', '.join(said_of.values())}"
    )
    return said, with_change


def _walk_all(
    library: GaitLibrary, speed: float, crew: Crew
) -> tuple[list[_End], Mapping[str, list[_End]]]:
    """Walk at a speed; return how the walks ended, as it is and with each change."""
    worlds = crew.worlds.harder().but(push_ns=0.0)
    command = Segment(Command(speed), _SECONDS)
    trial = Trial(
        without_caution(library), worlds=worlds, schedule=(command,),
        require_qualified=False,
    )  # fmt: skip
    trials = [trial, *(replace(trial, fixed=fixed) for fixed in _CHANGES.values())]
    seed = NO_WALK.first(library.config.seed)
    jobs = [(each, (seed, i)) for each in trials for i in range(_RUNS)]
    walked = run_jobs(_walk, jobs, _End, crew.workers)
    ends = list(crew.track("asking why it does not walk", walked, len(jobs)))
    own, *changed = (ends[i : i + _RUNS] for i in range(0, len(ends), _RUNS))
    return own, dict(zip(_CHANGES, changed, strict=True))


def _held(ends: Sequence[_End]) -> int:
    return sum(not end.fell for end in ends)


def _named(gain: float) -> Mapping[str, str]:
    """Return what each change is called on a robot with a part of its file's gains."""
    names = {name: name for name in _CHANGES}
    if gain != 1.0:
        names |= {name: f"servos {_times(gain * by)}" for name, by in _SERVOS.items()}
    return names


def _walk(trial: Trial, seed: tuple[int, int]) -> _End:
    """Walk a trial; return how it ended."""
    library = trial.library
    assert trial.schedule is not None
    rng = np.random.default_rng(seed)
    world = draw_world(library, seed, rng, trial.worlds, trial.fixed)
    walker = Walker(library, require_qualified=False)
    backend = MujocoBackend(library.robot, world)
    record = run_schedule(walker, backend, trial.schedule)
    cause = explain(library.robot, record).cause
    fell = record.fell_at_s is not None
    return _End(fell, cause.what, cause.advice) if cause else _End(fell, "", "")
