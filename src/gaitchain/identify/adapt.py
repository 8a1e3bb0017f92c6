"""A library for the robot that was identified: the same steps, qualified anew. Ours."""

from dataclasses import replace

from gaitchain.build.command_envelope import hold_steady
from gaitchain.build.families import build_of
from gaitchain.build.gate import gate
from gaitchain.build.workers import Crew
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.qualification import Qualification
from gaitchain.identify.fit import Fit


def adapt(library: GaitLibrary, fit: Fit, crew: Crew) -> GaitLibrary:
    """Return a library whose robot is the identified one, as far as its steps hold.

    The ends of its range and random schedules are walked by that robot, in worlds with
    what the fit leaves unknown of it.

    Args:
        library: of the file's robot, or of one that was identified before.
        fit: what was identified.
        crew: processes and progress.
    """
    robot = library.robot.as_identified(fit.identified)
    poses = replace(library.poses, robot=robot)  # type: ignore[type-var]
    moved = replace(
        library, poses=poses, qualification=Qualification(), grid=None, steady=None
    )
    config = library.config
    worlds = build_of(poses).training_worlds(poses, config.speed_limit_deg_s)
    crew = replace(crew, worlds=worlds)
    held = hold_steady(moved, crew)
    return gate(held, config.gate_runs, config.gate_share, config.seed, crew)
