"""Building libraries of key poses, the paper's gait."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gaitchain.balance.pose_joints import PoseJoints
from gaitchain.build.gait_build import Candidates, Draw, GaitBuild
from gaitchain.build.grid import PAPER_GRID
from gaitchain.build.keypose_rollout import walk_key_poses
from gaitchain.build.keypose_sway import most_sway
from gaitchain.build.step_meter import StepTerms
from gaitchain.chain.expectation import expected_costs, path_costs
from gaitchain.chain.layered_chain import IntArray
from gaitchain.chain.policy import Regret, forbid, regret
from gaitchain.chain.pruning import all_gaits
from gaitchain.chain.sampling import Mask
from gaitchain.errors import LibraryError
from gaitchain.gait.command_range import CommandRange
from gaitchain.gait.keypose.cost import PlannedCost
from gaitchain.gait.keypose.feasibility import feasible_edges
from gaitchain.gait.keypose.key_poses import KeyPoses
from gaitchain.gait.keypose.presets import PRESETS, draw_candidates
from gaitchain.gait.keypose.weight_shift import weight_shift
from gaitchain.gait.motion import Timing
from gaitchain.messages import Array
from gaitchain.sim.robot_faults import unsure_fields
from gaitchain.sim.world import World
from gaitchain.sim.world_range import WorldRange

_SAMPLE = 10_000  # gaits from which the expected costs are estimated
_MOST_GAITS = 2_000_000  # whose planned costs are compared


class KeyPoseBuild(GaitBuild):
    """Key poses: boxes are trained in open loop, other robots with feedback."""

    grid = PAPER_GRID

    def draw(self, draw: Draw) -> Candidates:
        """Draw key poses of the preset, and check every pair of them.

        Args:
            draw: config, robot and randomness; nothing is searched.

        Raises:
            LibraryError: the preset's steps do not join.
            GaitchainError: see `GaitBuild.draw`.
        """
        config, robot = draw.config, draw.robot
        preset, joints = str(config.preset), PoseJoints(robot)
        own, sways = Timing(), None
        if not robot.of_boxes and preset == PRESETS["default"].name:
            step_s = own.step if config.step_s is None else config.step_s
            shift = weight_shift(robot, most_sway(joints), step_s)
            own, sways = shift.timing, (shift.sway, shift.most)
        timing, counts = config.scaled_timing(own), config.poses_per_layer
        poses = draw_candidates(robot, preset, draw.poses, timing, counts, sways)
        if not poses.closed:
            raise LibraryError(
                f"preset {preset!r} is not closed: kp_4 is not the next step's kp_1, "
                "so no walk can be made of it; use 'default'"
            )
        edges = feasible_edges(poses, timing, joints.reached)
        return Candidates(poses, timing, edges, None)

    def roll_out(
        self, poses: KeyPoses, timing: Timing, gaits: NDArray[np.int64], world: World
    ) -> StepTerms:
        """See `walk_key_poses`."""
        return walk_key_poses(poses, timing, gaits, world)

    def training_worlds(self, poses: KeyPoses, speed_limit: float | None) -> WorldRange:
        """See `GaitBuild`; friction, servo gain and mass vary.

        Of an identified robot what is left unknown is drawn in place of the last two.
        """
        return WorldRange(speed_limit_deg_s=speed_limit, **unsure_fields(poses.robot))

    def trial_worlds(self) -> tuple[WorldRange, Mapping[str, Any]]:
        """See `GaitBuild`; as in training, but for what is unknown of a robot."""
        return WorldRange(), {}

    def planned_cost(self, poses: KeyPoses, timing: Timing, gaits: IntArray) -> Array:
        """See `cost.PlannedCost`."""
        return PlannedCost(poses, timing)(gaits)

    def planned_regret(
        self, poses: KeyPoses, timing: Timing, edges: tuple[Mask, ...], seed: int
    ) -> Regret | None:
        """Compute the regret against the best of all feasible gaits.

        The planned cost of every gait can be computed; the expected costs of the edges
        are estimated from a sample of them.

        Args:
            poses: the candidates.
            timing: the step's times.
            edges: masks of the feasible edges.
            seed: seed of the sample.

        Returns:
            The regret; None where there are more than 2 million gaits.
        """
        if math.prod(poses.counts) > _MOST_GAITS:
            return None  # the figure is for information: the build is worth more
        gaits = all_gaits(poses.counts, limit=_MOST_GAITS)
        for layer, mask in enumerate(edges):
            gaits = gaits[mask[gaits[:, layer], gaits[:, layer + 1]]]
        costs = self.planned_cost(poses, timing, gaits)
        sample = np.random.default_rng(seed).integers(len(gaits), size=_SAMPLE)
        learned = expected_costs(poses.counts, gaits[sample], costs[sample])
        ahead = path_costs(poses.counts, gaits[sample], costs[sample])
        return regret(forbid(learned.cost, edges), forbid(ahead, edges), gaits, costs)

    def steady_ends(self, most: CommandRange) -> list[tuple[int, int]]:
        """Return none: the range consists of measured cycles, which can repeat."""
        return []


KEY_POSE_BUILD = KeyPoseBuild()
