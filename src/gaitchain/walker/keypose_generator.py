"""The online gait generator: which key pose next, and why. No clock, no I/O.

At each kp_1 the command chooses the pose in which the step shall end, by the forward
motion that physics measured; at every key moment the chain chooses the next pose on
the way there. All choices are worked out when the generator is made, so deciding is
looking up.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gaitchain.chain.layered_chain import FloatArray
from gaitchain.errors import CommandError, LibraryError
from gaitchain.gait.keypose.key_poses import STAND
from gaitchain.gait.keypose.primitives import PARAMETERS
from gaitchain.gait.library import GaitLibrary
from gaitchain.messages import Command, PanelMessage
from gaitchain.robot.box_robot import JOINT_NAMES
from gaitchain.robot.joint_angles import FRONTAL_JOINTS, SAGITTAL_JOINTS, joint_angles
from gaitchain.walker.policy_table import Policy, pair_costs, ranked_choices, safe_pairs

_SPEED_TOLERANCE = 0.05  # so much of the speed off weighs like a cost of 1
_LATE_STOP = 1e6  # cost of each step that a stop comes late: outweighs all else


@dataclass(frozen=True)
class GaitState:
    """Where the walk is in the chain."""

    layer: int = 0
    """Key moment reached, 0 for kp_1."""
    pose: int = STAND
    first: int = STAND
    """The pose at which this step began."""
    target: int = STAND
    """The pose in which this step is to end."""
    left_support: bool = True
    command: float = 0.0
    """Speed commanded for this step [m/s]."""
    behind: float = 0.0
    """Commanded minus expected motion since the command last changed [m]."""


@dataclass(frozen=True)
class Decision:
    """The next key pose and the reasons for it."""

    layer: int
    """Key moment of the chosen pose, 0 for kp_1; 0 also while standing still."""
    pose: int
    cost: float
    """Expected cost of going on through the chosen pose to the end of the step."""
    runners_up: tuple[tuple[int, float], ...]
    """(pose, cost) of the other candidates, cheapest first."""
    target: int
    """Pose in which the step is to end."""
    speed: float
    """Forward speed that physics measured for this step [m/s]."""


class Generator:
    """Choose the next key pose of a qualified library for the commanded speed."""

    def __init__(self, library: GaitLibrary, policy: Policy = "look_ahead") -> None:
        """Work out all choices.

        Args:
            library: the gaits.
            policy: "greedy" weighs the next edge alone (the paper), "look_ahead" the
                whole way to the end of the step.

        Raises:
            LibraryError: physics passed no walk.
        """
        allowed, self._steps_to_stand = safe_pairs(library)
        self._slowest, fastest = library.speed_range
        if fastest <= 0.0 or not allowed[STAND].any():
            raise LibraryError(
                "the library holds no walk: physics passed no step from standing, or "
                "no steady one; build it with more walks or other candidates"
            )
        self.library = library
        self._choices = ranked_choices(library, policy)
        self._path_cost = np.where(allowed, pair_costs(library), np.inf)
        self._advance = np.where(allowed, library.pair_advance, 0.0)
        self._walking = self._path_cost.copy()
        self._walking[:, STAND] = np.inf

    def clamp(self, command: Command) -> tuple[Command, str]:
        """Bring a command into the library's range.

        Returns:
            The command that will be carried out, and a note if it is another one.
        """
        low, high = self.library.speed_range
        if not command.vx > 0.0:  # also when it is not a number
            note = "" if command.vx == 0.0 else f"{command.vx:g} m/s is no way on: stop"
            return Command(0.0), note
        vx = min(max(command.vx, low), high)
        note = (
            ""
            if vx == command.vx
            else f"{command.vx:g} m/s is outside {low:.3f} to {high:.3f} m/s: {vx:.3f}"
        )
        return Command(vx), note

    def advance(
        self, state: GaitState, command: Command, upcoming: Sequence[Command] = ()
    ) -> tuple[GaitState, Decision]:
        """Decide on the next key pose.

        Args:
            state: the key moment and pose that the robot has reached.
            command: the speed asked for; it counts from the next kp_1 on.
            upcoming: commands of the steps after this one, as far as known.

        Returns:
            The state after the move, and the decision.

        Raises:
            CommandError: the state is no pose of the library, or no way leads on.
        """
        self._check(state)
        if state.layer == 0:
            vx = command.vx if command.vx > 0.0 else 0.0  # also if it is not a number
            if vx == 0.0 and state.pose == STAND:
                standing = Decision(0, STAND, 0.0, (), STAND, 0.0)
                return replace(state, target=STAND, command=0.0, behind=0.0), standing
            state = self._begin_step(state, vx, upcoming)
        options = self._choices[state.target][state.layer][state.pose]
        if not options:
            raise CommandError(
                f"no way leads from pose {state.pose} of layer {state.layer + 1} to "
                f"pose {state.target}; begin at layer 1"
            )
        pose, cost = options[0]
        layer = state.layer + 1
        speed = float(self._advance[state.first, state.target])
        decision = Decision(
            layer, pose, cost, options[1:], state.target, speed / self._period
        )
        if layer == len(self.library.chain.transitions):
            # kp_4 with the roles exchanged is kp_1 of the next step.
            layer, left = 0, not state.left_support
            return replace(state, layer=0, pose=pose, left_support=left), decision
        return replace(state, layer=layer, pose=pose), decision

    def panel_message(self, state: GaitState, decision: Decision) -> PanelMessage:
        """Return the primitive components and joint angles of the chosen pose.

        Args:
            state: the state before the decision.
            decision: what was decided.
        """
        poses, layer = self.library.key_poses, decision.layer
        timing = self.library.timing
        values = poses.parameters[layer][decision.pose].tolist()
        parameters = dict(zip(PARAMETERS, values, strict=True))
        angles = joint_angles(poses.q[layer][decision.pose], state.left_support)
        joints = dict(zip(JOINT_NAMES, angles.tolist(), strict=True))
        return PanelMessage(
            key_moment=f"kp_{layer + 1}",
            left_support=state.left_support,
            duration_s=timing.segments[layer - 1] if layer else timing.step,
            swing={"sway": parameters["sway"]},
            lift={name: parameters[name] for name in ("foot_x", "foot_z")},
            move={name: parameters[name] for name in ("hip_x", "hip_height")},
            frontal={name: joints[name] for name in FRONTAL_JOINTS},
            sagittal={name: joints[name] for name in SAGITTAL_JOINTS},
        )

    def _check(self, state: GaitState) -> None:
        sizes = self.library.chain.layer_sizes
        inside = (
            0 <= state.layer < len(sizes) - 1
            and 0 <= state.pose < sizes[state.layer]
            and 0 <= state.target < sizes[-1]
        )
        if not inside:
            raise CommandError(
                f"pose {state.pose} of layer {state.layer + 1} on the way to pose "
                f"{state.target}: layers 1 to 4 have {sizes} poses"
            )

    @property
    def _period(self) -> float:
        return self.library.timing.step

    def _begin_step(
        self, state: GaitState, vx: float, upcoming: Sequence[Command]
    ) -> GaitState:
        behind = state.behind if vx == state.command else 0.0
        wanted = vx * self._period + behind
        stops_next = bool(upcoming) and upcoming[0].vx == 0.0
        costs = self._step_costs(vx, stops_next, behind)[state.pose]
        if upcoming:
            costs = costs + self._costs_ahead(upcoming)
        target = int(np.argmin(costs))
        behind = wanted - float(self._advance[state.pose, target])
        return replace(
            state, first=state.pose, target=target, command=vx, behind=behind
        )

    def _step_costs(self, vx: float, stops_next: bool, behind: float) -> FloatArray:
        """(N_1, N_4) cost of each step: off the speed, and off the ZMP."""
        stop = vx == 0.0
        base = self._path_cost if stop or stops_next else self._walking
        # A speed below the slowest walk (a half step's) is not held more exactly.
        scale = _SPEED_TOLERANCE * max(vx, self._slowest) * self._period
        costs = base + ((self._advance - vx * self._period - behind) / scale) ** 2
        if stop:
            costs = costs + _LATE_STOP * self._steps_to_stand
        return np.asarray(costs)

    def _costs_ahead(self, upcoming: Sequence[Command]) -> FloatArray:
        """(N_4,) least cost of the known commands to come, from each pose."""
        ahead = np.zeros(self._advance.shape[1])
        for i in reversed(range(len(upcoming))):
            vx = upcoming[i].vx
            stops_next = i + 1 < len(upcoming) and upcoming[i + 1].vx == 0.0
            costs = self._step_costs(vx, stops_next, behind=0.0)
            here = (costs + ahead).min(axis=1)
            if vx == 0.0:
                here = here + _LATE_STOP
                here[STAND] = ahead[STAND]
            ahead = here
        return ahead
