"""Trials in a robot's own model, by which a library is judged. Ours."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

from gaitchain.analysis.base_motion import Stretch, achieved, along, own_motion
from gaitchain.analysis.simulated_walk import run_unrecorded
from gaitchain.backends.model import ModelBackend, OfRobot
from gaitchain.build.jobs import run_jobs
from gaitchain.build.own_floor import SoleContacts, sole_contacts
from gaitchain.build.own_model import (
    of_its_file,
    own_model,
    own_spec,
    use_implicit_integrator,
)
from gaitchain.build.trial import Trial, TrialRun, draw_schedule, draw_world
from gaitchain.build.workers import available_cores
from gaitchain.discover.servos import sum_actuators
from gaitchain.discover.tendons import pulling_at
from gaitchain.errors import CommandError
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.qualification import OwnModel
from gaitchain.gait.schedule import Schedule, format_schedule, lowered
from gaitchain.messages import CONTROL_PERIOD_S, Array
from gaitchain.robot.leg_model import LegModel
from gaitchain.robot.robot import Robot
from gaitchain.sim.stability import (
    explicit_stiffness,
    most_stiffness,
)
from gaitchain.sim.world import DISTURBANCES, World
from gaitchain.walker.walker import Walker

KNOWN = ("slope_deg", "servo_gain", "model_error")
"""Fields of a `World` that a robot's own model has; all else is the file's."""
_SAME_GAINS = 1e-3
_OF_MODEL = {
    "friction": ("friction of the soles", 1.0),
    "contact_s": ("time constant of the contacts [ms]", 1000.0),
    "timestep_s": ("time step [ms]", 1000.0),
    "joints": ("number of joints", 1.0),
    "actuators": ("number of actuators", 1.0),
}
_STANDS = round(1.0 / CONTROL_PERIOD_S)  # control periods for which a model must stand


def run_own_trials(
    trial: Trial, file: str | Path, runs: int, seed: int, workers: int | None = None
) -> Iterator[TrialRun]:
    """Walk the trials of `run_trials` in the robot's own model.

    The masses of all links differ from the file's as in any trial. Only falls, the way
    walked and its speed are measured, as the model tells nothing else of itself;
    speeds are those along a schedule of one command, in its second half. Worlds have
    what such a model has of them.

    Args:
        trial: settings of the runs.
        file: the robot's MJCF or URDF, or its name in a collection.
        runs: number of walks.
        seed: seed of schedules and worlds.
        workers: number of processes; all cores by default.

    Returns:
        One result per run, in order, independent of the workers; they are walked as
        they are asked for.

    Raises:
        CommandError: a disturbance cannot be made there, or the file is not that of the
            library's robot.
    """
    check_possible(trial.fixed, _option)
    if trial.library.robot.identified is not None:
        raise CommandError(
            f"{trial.library.robot.name} was identified and is not that of {file} "
            "any more; walk the library from which that was done"
        )
    _backend(trial.library, file, World())
    jobs = [(trial, str(file), (seed, i)) for i in range(runs)]
    return run_jobs(_run, jobs, TrialRun, workers or available_cores())


def check_possible(fixed: Iterable[str], option: Callable[[str], str]) -> None:
    """Refuse disturbances that a robot's own model does not have.

    Args:
        fixed: fields of a `World`.
        option: returns the option by which a field was given, without dashes.

    Raises:
        CommandError: one cannot be made there.
    """
    unknown = [name for name in fixed if name not in KNOWN]
    if unknown:
        able = ", ".join(f"--{_option(name)}" for name in KNOWN)
        raise CommandError(
            f"--{option(unknown[0])} is not possible in the robot's own model, whose "
            f"floor, contacts and servos are its file's; possible are {able}"
        )


def describe_own_model(file: str | Path, library: GaitLibrary) -> OwnModel:
    """Return what is simulated.

    Args:
        file: see `run_own_trials`.
        library: of that robot.

    Raises:
        CommandError: the file is that of another robot, or cannot be simulated.
    """
    backend, contacts, _ = _standing(file, library)
    model, alone = backend.model, own_spec(file, library.robot)
    return OwnModel(
        joints=model.njnt - 1,
        actuators=model.nu,
        timestep_s=float(model.opt.timestep),
        friction=contacts.friction,
        contact_s=contacts.contact_s,
        integrator=backend.integrator,
        parted=len(alone.parted),
        step=alone.step,
        left_out=len(pulling_at(alone.spec, library.robot.legs.joint_names)),
        gains=backend.gains,
    )


def changes_since_gate(file: str | Path, library: GaitLibrary) -> str:
    """Say what of a robot's model is otherwise than in the one that the gate walked.

    Args:
        file: see `run_own_trials`.
        library: of that robot.

    Returns:
        A sentence; empty if all is as it was, or none was walked.

    Raises:
        CommandError: the file is that of another robot, or cannot be simulated.
    """
    own = library.qualification.own
    if own is None or own.model is None:
        return ""
    walked, now = own.model, describe_own_model(file, library)
    found = [
        f"{what} {scale * getattr(now, name):g} ({scale * getattr(walked, name):g})"
        for name, (what, scale) in _OF_MODEL.items()
        if not math.isclose(getattr(now, name), getattr(walked, name), rel_tol=1e-6)
    ]
    if not found:
        return ""
    return (
        f"{file} differs from the model that the library was qualified in, in "
        f"{', '.join(found)}"
    )


def own_fault(file: str | Path, robot: Robot) -> str:
    """Return what keeps libraries of a robot from being walked in the file's own model.

    Such a library may be qualified all the same, so that this is said and no error.

    Args:
        file: see `run_own_trials`.
        robot: that was found in it.

    Returns:
        A sentence; empty if nothing does, and where a file is no model of it: of a
        robot of boxes, or one that was identified.
    """
    if robot.boxes or robot.identified is not None:
        return ""
    try:
        fell_at_s = _standing(file, _Owner(robot)).fell_at_s
    except CommandError as error:
        return f"A library will not be walked in the robot's own model: {error}."
    if fell_at_s is None:
        return ""
    return (
        "In the robot's own model it does nothing but stand and falls, at "
        f"{fell_at_s:.2f} s: compare the servos, masses and contacts of the file with "
        "what was found."
    )


class _Owner(NamedTuple):
    """A robot without a library."""

    robot: Robot


class _Standing(NamedTuple):
    """A robot in its own model, in which it was told to stand."""

    backend: _Tracked
    contacts: SoleContacts
    fell_at_s: float | None
    """None if it stood."""


def _standing(file: str | Path, library: OfRobot) -> _Standing:
    """Let a robot stand in its own model."""
    backend = _backend(library, file, World())
    with of_its_file(file, library):
        contacts = sole_contacts(backend)
        return _Standing(backend, contacts, _stand_still(backend))


class _Tracked(ModelBackend):
    """Notes where the robot was in each control period."""

    integrator = ""
    """Why it is not the file's; empty if it is."""
    gains = ""
    """Of the legs' servos, and the file's; empty if they are the same."""

    def connect(self, position: Array) -> None:
        super().connect(position)
        self.track = [self._pelvis()]

    def write(self, position: Array) -> None:
        super().write(position)
        self.track.append(self._pelvis())

    def _pelvis(self) -> Array:
        """Return place in the world [m] and quaternion of the pelvis frame, (7,)."""
        base, found = self.data.qpos[self._free : self._free + 7], np.empty(7)
        mujoco.mju_rotVecQuat(found[:3], self._at, base[3:])
        found[:3] += base[:3]
        mujoco.mju_mat2Quat(found[3:], self._turn.ravel())
        mujoco.mju_mulQuat(found[3:], base[3:], found[3:].copy())
        return found


def _backend(library: OfRobot, file: str | Path, world: World) -> _Tracked:
    """Return the robot in its own model."""
    with of_its_file(file, library):
        model = own_model(file, library.robot, world)
        backend = _Tracked(model, library, servo_gain=world.servo_gain)
        backend.integrator = use_implicit_integrator(backend.model)
        backend.gains = _replaced_gains(model, library.robot.legs)
        return backend


def _replaced_gains(model: mujoco.MjModel, legs: LegModel) -> str:
    """Say which stiffness legs have in place of the file's, which is not theirs.

    Args:
        model: of the file, before its servos are set.
        legs: of the library's robot.
    """
    joints = [model.joint(name).id for name in legs.joint_names]
    own = np.array([sum_actuators(model, joint).stiffness for joint in joints])
    if not own.any() or np.allclose(own, legs.stiffness, rtol=_SAME_GAINS):
        return ""
    return f"{_span(legs.stiffness)} N m/rad in place of the file's {_span(own)}"


def _span(numbers: Array) -> str:
    low, high = f"{numbers.min():.3g}", f"{numbers.max():.3g}"
    return low if low == high else f"{low} to {high}"


def _stand_still(backend: _Tracked) -> float | None:
    """Return when a robot falls that does nothing but stand [s]; None if it stands.

    Raises:
        CommandError: its physics diverges; with the joint that shakes, and what would
            hold it.
    """
    stand = np.array(backend.read().joint_position)
    backend.connect(stand)
    fell_at_s = None
    for period in range(_STANDS):
        backend.write(stand)
        if backend.diverged:
            raise CommandError(_why_diverged(backend.model))
        if backend.fallen and fell_at_s is None:
            fell_at_s = (period + 1) * CONTROL_PERIOD_S
    return fell_at_s


def _why_diverged(model: mujoco.MjModel) -> str:
    """Say which joint shakes in a model whose physics diverged."""
    (ratio, joint), most = explicit_stiffness(model), most_stiffness(model)
    step_ms = 1000.0 * float(model.opt.timestep)
    said = f"standing, its physics diverges within {_STANDS * CONTROL_PERIOD_S:g} s"
    if ratio <= most:
        return f"{said} with time steps of {step_ms:g} ms; see whether less helps"
    return (
        f"{said}: at {step_ms:g} ms the servo of {joint} shakes it (stiffness x time "
        f"step^2 / inertia is {ratio:.3g}, at most {most:g} holds without damping); "
        f"give the joint {ratio / most:.2g} times its inertia (armature), its servo "
        f"{100.0 * most / ratio:.2g} % of its stiffness, or the file time steps of "
        f"{step_ms * math.sqrt(most / ratio):.2g} ms"
    )


def _run(trial: Trial, file: str, seed: tuple[int, int]) -> TrialRun:
    library, rng = trial.library, np.random.default_rng(seed)
    schedule = lowered(trial.schedule or draw_schedule(trial, rng), trial.crouch)
    world = draw_world(library, seed, rng, trial.worlds, trial.fixed)
    backend = _backend(library, file, world)
    walker = Walker(
        library,
        trial.policy,
        feedback=trial.feedback,
        require_qualified=trial.require_qualified,
        joint_names=backend.joint_names,
    )
    walked = run_unrecorded(walker, backend, schedule)
    fell = walked.fell_at_s is not None
    how = "the physics diverged" if backend.diverged else "fell"
    cause = f"{how} at {walked.fell_at_s:.1f} s" if fell else None
    return TrialRun(
        seed=seed,
        schedule=format_schedule(schedule),
        fell=fell,
        cause=cause,
        speed_error_mps=None,
        distance_m=float(np.hypot(*backend.base_position[:2])),
        last_step=(walker.gait.state.first, walker.gait.state.target),
        speed_mps=None if fell else speed_along(backend.track, schedule),
        world=_of_it(world),
    )


def _of_it(world: World) -> World:
    """Return a world with what the robot's own model has of it."""
    return World(seed=world.seed, **{name: getattr(world, name) for name in KNOWN})


def speed_along(track: Sequence[Array], schedule: Schedule) -> float | None:
    """Return the speed along one timed command over its second half [m/s].

    Args:
        track: (7,) place [m] and quaternion of the pelvis, each control period.
        schedule: what was walked.

    Returns:
        The speed; None for other schedules, and for a command that goes nowhere.
    """
    seconds, command = schedule[0].duration_s, schedule[0].command
    if len(schedule) > 1 or not seconds:
        return None
    motion = own_motion(np.array(track))
    last = len(motion) - 1
    half = Stretch(
        command, last - max(round(0.5 * seconds / CONTROL_PERIOD_S), 1), last
    )
    speed = along(command, achieved(motion, half))
    return None if math.isnan(speed) else speed


def _option(name: str) -> str:
    return DISTURBANCES[name].option.replace("_", "-")
