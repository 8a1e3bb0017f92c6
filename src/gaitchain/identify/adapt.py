"""A library for the robot that was identified: the same steps, qualified anew. Ours."""

from dataclasses import replace

import numpy as np

from gaitchain.build.command_envelope import hold_steady
from gaitchain.build.families import build_of
from gaitchain.build.gate import gate
from gaitchain.build.usual_errors import learn_usual_off
from gaitchain.build.workers import Crew
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.qualification import Qualification
from gaitchain.identify.fit import Fit


def adapt(library: GaitLibrary, fit: Fit, crew: Crew) -> GaitLibrary:
    """Return a library whose robot is the identified one, as far as its steps hold.

    What its steps are usually off, the ends of its range and random schedules are
    walked by that robot, in worlds with what the fit leaves unknown of it. What tests
    took away from the file's robot stays away: fewer walks are made here than there,
    and none in the robot's own model.

    Args:
        library: of the file's robot, or of one that was identified before.
        fit: what was identified.
        crew: processes and progress.

    Returns:
        The library with the verdict of the gate alone; its range is not wider than
        before.
    """
    robot = library.robot.as_identified(fit.identified)
    poses = replace(library.poses, robot=robot)  # type: ignore[type-var]
    plain = replace(_without_grid(library), poses=poses)
    moved = replace(plain, qualification=Qualification())
    config = library.config
    worlds = build_of(poses).training_worlds(poses, config.speed_limit_deg_s)
    crew = replace(crew, worlds=worlds)
    # A robot whose steps are always off by more than its file's slows down for nothing.
    usual = learn_usual_off(moved, np.random.default_rng(config.seed), crew)
    held = hold_steady(usual, crew)
    return gate(held, config.gate_runs, config.gate_share, config.seed, crew)


def _without_grid(library: GaitLibrary) -> GaitLibrary:
    """Return the library without the worlds of a grid; steps that it forbade fell."""
    if library.grid is None:
        return library
    runs = library.pair_runs + library.grid.forbidden  # a run that did not pass
    return replace(library, pair_runs=np.asarray(runs), grid=None)
