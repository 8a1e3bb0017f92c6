"""The paper's walk online: key poses at fixed times, joined by cubic segments."""

import math
from dataclasses import replace
from functools import partial

import numpy as np

from gaitchain.balance.keypose_lead import KeyposeLead
from gaitchain.balance.pose_joints import PoseJoints
from gaitchain.balance.state import Attitude
from gaitchain.gait.family import STAND
from gaitchain.gait.keypose.key_poses import KeyPoses
from gaitchain.gait.keypose.primitives import PARAMETERS
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.motion import SplineSegment, State, Timing
from gaitchain.gait.zmp import Support, support_at
from gaitchain.messages import Array, Command, JointTargets, PanelMessage, Sensors
from gaitchain.walker.gait import Gait
from gaitchain.walker.generator import ChainState, Decision
from gaitchain.walker.keypose_feedback import AnkleBalance, make_balance
from gaitchain.walker.keypose_generator import KeyposeGenerator
from gaitchain.walker.place import ORIGIN, Place

# Sums of control periods have rounding errors: a key moment this close is reached [s].
_TIME_SLACK_S = 1e-6
_LONGEST_GAP_S = 10.0


class KeyposeGait(Gait):
    """Follow the segments between key poses that the commands select."""

    generator_kind = KeyposeGenerator

    def _prepare(
        self, library: GaitLibrary, *, feedback: bool, period_s: float
    ) -> None:
        """See `Gait`."""
        self._poses, self._timing = library.poses_as(KeyPoses), library.timing
        self._joints = PoseJoints(library.robot)
        self._feedback, self._period_s = feedback, period_s
        rest = self._poses.q[0][STAND]
        self._rest = self._joints.angles(rest, left_support=True)
        lead = KeyposeLead(library.robot, self._rest, period_s)
        self._stand = lead.targets(self._rest, left=True)

    def reset(self, at: Place = ORIGIN) -> None:
        """See `Gait.reset`; where it stands is not measured."""
        super().reset(at)
        self._lead = KeyposeLead(self._poses.robot, self._rest, self._period_s)
        self._balance = self._make_balance() if self._feedback else None
        self._started = False
        self._clock_ahead_s = 0.0
        self._time_s = self._segment_start_s = self._step_start_s = 0.0
        self._left_support = True
        self._segment = self._hold()

    @property
    def stand(self) -> Array:
        """(2 n,) joint angles of the standing pose [rad]."""
        return self._rest

    @property
    def stand_targets(self) -> Array:
        """(2 n,) servo targets that keep the standing pose [rad]."""
        return self._stand

    @property
    def estimate(self) -> Attitude | None:
        """Estimated orientation of the trunk; None without feedback."""
        return None if self._balance is None else self._balance.attitude

    @property
    def planned_zmp(self) -> Array | None:
        """None: this gait plans joint angles and no ZMP."""
        return None

    @property
    def standing(self) -> bool:
        """Whether the robot stands still with its feet side by side."""
        return self.decision is None or self.decision.layer == 0

    def _clamp_step(self, command: Command) -> tuple[Command, str]:
        """Clamp a command for one step; a half step may be slower than any walk."""
        slowest = self.generator.library.speed_range[0]
        if not 0.0 < command.vx < slowest:
            return self.generator.clamp(command)
        done, note = self.generator.clamp(replace(command, vx=slowest))
        return replace(done, vx=command.vx), note

    @property
    def support(self) -> Support:
        """Planned support region at the latest `step`; valid while walking."""
        elapsed = self._time_s - self._step_start_s + _TIME_SLACK_S
        return support_at(self._timing, elapsed, self._left_support)

    def step(self, sensors: Sensors) -> JointTargets:
        """Compute the joint targets; call once per control period.

        If the sensors' time is not finite, runs backward or jumps by more than 10 s, no
        time passes in the walk.
        """
        self._update_time(sensors.time)
        if not self._started:
            self._started = True
            self._segment_start_s = self._step_start_s = self._time_s
            self._next_segment()
        while self._elapsed >= self._segment.duration_s - _TIME_SLACK_S:
            self._segment_start_s += self._segment.duration_s
            self._next_segment()
        q = self._segment.q(self._elapsed)
        planned = self._joints.angles(q, self._left_support)
        if self._balance is None:
            led = self._lead.targets(planned, left=self._left_support)
            return JointTargets(self.joint_names, led)
        single = self.support in (Support.LEFT_SINGLE, Support.RIGHT_SINGLE)
        targets = self._balance.correct(
            planned,
            sensors,
            left=self._left_support,
            single=single,
            still=self.standing,
        )
        return JointTargets(self.joint_names, targets)

    def _make_balance(self) -> AnkleBalance:
        hip_height = float(self._poses.parameters[0][STAND][1])
        robot = self._poses.robot
        return make_balance(robot, hip_height, self._period_s, self._rest)

    def _update_time(self, clock_s: float) -> None:
        if not math.isfinite(clock_s):
            return
        time_s = clock_s - self._clock_ahead_s
        passed_s = time_s - self._time_s
        if self._started and not 0.0 <= passed_s <= _LONGEST_GAP_S:
            self._clock_ahead_s += passed_s
        else:
            self._time_s = time_s

    @property
    def _elapsed(self) -> float:
        return self._time_s - self._segment_start_s

    def _next_segment(self) -> None:
        before = self.state
        if before.layer == 0:
            self._take_command()
            self._step_start_s = self._segment_start_s
            self._left_support = before.left_support
        command, *upcoming = self._commands
        self.state, decision = self.generator.advance(before, command, upcoming)
        self.decision = decision
        self.steps += before.layer == 0 and decision.layer > 0
        self._show(partial(panel_message, self._poses, self._timing, before, decision))
        self._segment = (
            self._hold() if decision.layer == 0 else self._move(before.pose, decision)
        )

    def _move(self, pose: int, decision: Decision) -> SplineSegment:
        layer = decision.layer
        duration_s = self._timing.segments[layer - 1]
        start = self._key_state(layer - 1, pose)
        return SplineSegment(duration_s, start, self._key_state(layer, decision.pose))

    def _hold(self) -> SplineSegment:
        stand = self._key_state(0, STAND)
        return SplineSegment(self._timing.step, stand, stand)

    def _key_state(self, layer: int, pose: int) -> State:
        poses = self._poses
        return State(poses.q[layer][pose], poses.dq[layer][pose], np.zeros(7))


def panel_message(
    poses: KeyPoses, timing: Timing, before: ChainState, decision: Decision
) -> PanelMessage:
    """Return the primitive components and joint angles of the chosen pose.

    Args:
        poses: the candidates.
        timing: the step's times.
        before: the state before the decision.
        decision: the decision that chose the pose.
    """
    layer, left = decision.layer, before.left_support
    values = poses.parameters[layer][decision.pose].tolist()
    parameters = dict(zip(PARAMETERS, values, strict=True))
    legs = poses.robot.legs
    angles = PoseJoints(poses.robot).angles(poses.q[layer][decision.pose], left)
    joints = dict(zip(legs.joint_names, angles.tolist(), strict=True))
    return PanelMessage(
        key_moment=f"kp_{layer + 1}",
        left_support=left,
        duration_s=timing.segments[layer - 1] if layer else timing.step,
        swing={"sway": parameters["sway"]},
        lift={name: parameters[name] for name in ("foot_x", "foot_z")},
        move={name: parameters[name] for name in ("hip_x", "hip_height")},
        frontal={n: joints[n] for n in legs.joint_names if n not in legs.sagittal},
        sagittal={n: joints[n] for n in legs.sagittal},
    )
