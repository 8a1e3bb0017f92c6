"""Strides online: the stride generator gives the targets of the walk controller."""

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

from gaitchain.balance.feedforward import Effort
from gaitchain.balance.state import DOUBLE, SETTLE, SINGLE, Attitude
from gaitchain.chain.recovery import AHEAD, errors_of, own_after
from gaitchain.errors import CommandError
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.step_target import Landing, Step, StepTarget
from gaitchain.gait.stride.strides import StridePoses
from gaitchain.gait.zmp import Support
from gaitchain.messages import Array, Command, JointTargets, PanelMessage, Sensors
from gaitchain.walker.footsteps import Footstep, check_footsteps, landing_from
from gaitchain.walker.gait import EndedStep, Gait
from gaitchain.walker.generator import ChainState
from gaitchain.walker.place import ORIGIN, Place
from gaitchain.walker.step_size import StepSize
from gaitchain.walker.stride_generator import StrideGenerator
from gaitchain.walker.stride_setup import make_walk

_NOTED = 0.9  # of the command: smaller reductions are not reported
_SMALLEST = 0.01  # part of a command that is left: nothing at all would be a stop
_MISPLACED = 0.05  # of the leg: feet further from side by side are corrected by a step


class StrideGait(Gait):
    """Walk by strides under feedback, as the commands select them."""

    rest_s = 1.0  # for the estimates of the vertical and the gyro bias
    generator_kind = StrideGenerator
    generator: StrideGenerator

    def _prepare(
        self, library: GaitLibrary, *, feedback: bool, period_s: float
    ) -> None:
        """See `Gait`."""
        self._poses = library.poses_as(StridePoses)
        self._walk = make_walk(self._poses, library.timing, period_s, feedback=feedback)
        self._sagittal = library.robot.legs.sagittal
        self._leg = library.robot.reduced.leg_length
        self.step_size = StepSize(
            library.recovery if feedback else None, errors_of(library.usual_spread)
        )

    def reset(self, at: Place = ORIGIN) -> None:
        """See `Gait.reset`."""
        super().reset(at)
        self._walk.reset()
        self._walk.attitude = Attitude(yaw=at.yaw)
        self.step_size.reset()
        self._carried_out = 1.0  # part of the command
        self._room = 1.0  # the same, for what the legs can do in a crouch
        self._usual_error = self._usual_slip = 0.0  # of this step [m, rad]
        # What is usual of this robot beyond sound ones.
        self._own_off = 0.0
        self._slips = False  # what disturbed the walk last was a foot that slipped
        self._foot_heading = 0.0
        self._ticks = 0  # control periods since the latest step began
        self._stood = 0  # control periods on a stop with a command to come
        half = 0.5 * self._poses.stance
        self._feet = {side: at.moved(0.0, side * half) for side in (1.0, -1.0)}
        self._counted = self._walk.step
        self._footsteps = deque[Footstep]()

    @property
    def stand(self) -> Array:
        """(2 n,) joint angles of the standing pose [rad]."""
        return self._walk.stand

    @property
    def stand_targets(self) -> Array:
        """See `Gait.stand_targets`; the legs bear the weight of the robot."""
        return self._walk.stand_targets

    @property
    def support(self) -> Support:
        """Planned support region; valid while walking."""
        left = self._walk.side > 0
        if self._walk.phase == SINGLE:
            return Support.LEFT_SINGLE if left else Support.RIGHT_SINGLE
        return Support.LEFT_TO_RIGHT if left else Support.RIGHT_TO_LEFT

    @property
    def standing(self) -> bool:
        """Whether the robot stands still."""
        return self._walk.standing

    @property
    def stepping(self) -> bool:
        """See `Gait.stepping`."""
        return self._walk.phase in (SINGLE, DOUBLE)

    @property
    def settling(self) -> bool:
        """See `Gait.settling`."""
        return self._walk.phase == SETTLE

    @property
    def note(self) -> str:
        """Reason why the executed command differs from the given one, or empty."""
        if self.standing or self._carried_out > _NOTED:
            return self._changed
        part = 10 * round(10.0 * self._carried_out)
        why = "its feet slip" if self._slips else "disturbed"
        slowed = f"{why}: walks at {part} % of the command"
        return f"{self._changed}; {slowed}" if self._changed else slowed

    @property
    def estimate(self) -> Attitude:
        """Estimated orientation of the trunk."""
        return self._walk.attitude

    @property
    def gyro_bias(self) -> Array:
        """See `Gait.gyro_bias`."""
        return self._walk.gyro_bias

    @property
    def planned_zmp(self) -> Array | None:
        """(2,) planned ZMP in the support-foot frame [m]; None while standing."""
        return None if self.standing else self._walk.zmp

    def step(self, sensors: Sensors) -> JointTargets:
        """Compute the joint targets; call once per control period."""
        walk = self._walk
        self._ticks += 1
        self._pass_stop()
        walk.sense(sensors)
        walk.crouch = self._commands[0].crouch
        if walk.feedback and walk.catch():
            self._begin_walk(left_support=walk.side > 0)
        elif walk.standing and self._wants_to_step:
            self._leave_stand()
        if walk.phase in (SINGLE, DOUBLE) and not walk.wants_stride:
            self._pass_key_moments()
        targets = walk.drive(sensors, self._next_target)
        if walk.step is not None and walk.step is not self._counted:
            self._place_foot(walk.step)
        return JointTargets(self.joint_names, targets)

    @property
    def effort(self) -> Effort:
        """What the latest targets need of motors, beside their angles."""
        return self._walk.effort

    @property
    def place(self) -> Place:
        """Middle between the feet, and the trunk's heading; see `Walker.place`."""
        return self._between(self._feet)

    @property
    def stop_place(self) -> Place:
        """See `Gait.stop_place`."""
        if not self.stepping:
            return self.place
        walk, before = self._walk, self.place
        support, landing = self._feet[walk.side], walk.state.landing
        landed = support.moved(landing.x, walk.side * landing.y)
        landed = landed._replace(yaw=support.yaw - walk.side * landing.yaw)
        beside = landed.moved(0.0, 0.5 * walk.side * self._poses.stance)
        ahead, left, _ = beside.seen_from(before)
        x, y = self.generator.library.slides.steps.of_step(0.5 * ahead, 0.5 * left)
        return beside.moved(2.0 * x, 2.0 * y)  # in this step and the one beside it

    def _between(self, feet: Mapping[float, Place]) -> Place:
        left, right = feet.values()
        middle = 0.5 * (left.x + right.x), 0.5 * (left.y + right.y)
        return Place(*middle, self._walk.attitude.yaw)

    @property
    def feet(self) -> tuple[Place, Place]:
        """See `Gait.feet`."""
        return self._feet[1.0], self._feet[-1.0]

    def _place_foot(self, made: Step) -> None:
        """Put down the foot that has just become the support foot.

        The gyro gives the feet's headings, so a foot that turned on the ground counts.
        """
        walk = self._walk
        heading = walk.support_heading
        stood = self._feet[-walk.side]._replace(yaw=heading - made.turn)
        landed = stood.moved(made.ahead, made.left)
        self._feet = self._with_slide(landed._replace(yaw=heading))
        self._counted = made

    def _with_slide(self, landed: Place) -> dict[float, Place]:
        """Return both feet's places, after what they usually slide in such a step.

        Args:
            landed: place of the support foot, which has just landed.
        """
        feet, before = {**self._feet, self._walk.side: landed}, self.place
        here = self._between(feet)
        ahead, left, _ = here.seen_from(before)
        slides = self.generator.library.slides.steps
        x, y, _ = here.moved(*slides.of_step(ahead, left))
        return {
            side: foot._replace(x=foot.x + x - here.x, y=foot.y + y - here.y)
            for side, foot in feet.items()
        }

    def follow_steps(self, steps: Sequence[Footstep]) -> None:
        """Make given footsteps; see `Walker.follow_steps`.

        Args:
            steps: places of the feet in the frame of `place`, one foot after the other.

        Raises:
            CommandError: the robot does not stand, or a step is none that it can make.
        """
        if not self.standing:
            raise CommandError(
                "footsteps begin from a stand; stop first, and wait until it stands"
            )
        check_footsteps(self.generator, self._feet, steps, self._poses.stance)
        low = min(self._commands[0].crouch, self._deepest(steps))
        self.command(Command(crouch=low))  # what is above it was not walked
        self._footsteps = deque(steps)

    def _deepest(self, steps: Sequence[Footstep]) -> float:
        """Return how low the hips can go in each of some footsteps [m]."""
        library, feet, found = self.generator.library, dict(self._feet), []
        for step in steps:
            landing = landing_from(feet[-step.side], step, self._poses.stance)
            feet[step.side] = step.place
            speed = Command(landing.length / library.timing.step)
            found.append(library.command_range.deepest(speed))
        return min(found)

    def command(self, command: Command) -> Command:
        """See `Gait.command`; footsteps that were to be made are dropped."""
        self._footsteps.clear()
        return super().command(command)

    def follow(self, commands: Sequence[Command]) -> None:
        """See `Gait.follow`; footsteps that were to be made are dropped."""
        super().follow(commands)
        self._footsteps.clear()
        self._stood = 0

    @property
    def footsteps_left(self) -> int:
        """See `Gait.footsteps_left`."""
        return len(self._footsteps)

    @property
    def _wants_to_step(self) -> bool:
        """Whether a standing robot is to leave its stand."""
        stays = self._commands[0].stops and self._in_place
        return bool(self._footsteps) or not stays

    def _pass_stop(self) -> None:
        """Take the next command once a stop was stood on for as long as a step."""
        times = self._walk.times
        waits = self.standing and len(self._commands) > 1 and not self._wants_to_step
        self._stood = self._stood + 1 if waits else 0
        if self._stood >= round(times.step / times.period):
            self._commands.popleft()
            self._stood, self._in_use = 0, False

    def _next_footstep(self, made: Step | None) -> tuple[Landing | None, bool]:
        """Take the next footstep if its foot swings now; return whether it is the last.

        Args:
            made: the step just made, as the legs measured it.
        """
        walk, steps = self._walk, self._footsteps
        if not steps or steps[0].side == walk.side:
            return None, False
        support = self._feet[walk.side]
        if made is not None:  # that foot has just landed, and is not counted yet
            heading = walk.support_heading
            stood = self._feet[-walk.side]._replace(yaw=heading)
            landed = stood.moved(made.ahead, made.left)
            landed = landed._replace(yaw=heading + made.turn)
            support = self._with_slide(landed)[walk.side]
        landing = landing_from(support, steps.popleft(), self._poses.stance)
        return landing, not steps

    @property
    def _in_place(self) -> bool:
        """Whether the feet stand side by side."""
        x, y, yaw = self._walk.state.lift_off
        width, leg = self._poses.stance, self._leg
        off = max(abs(x), abs(y + width)) / leg
        return bool(off < _MISPLACED and abs(yaw) < 2.0 * _MISPLACED)

    def _leave_stand(self) -> None:
        left = self.generator.first_support(self._commands[0])
        if self._footsteps:
            left = not self._footsteps[0].left
        self._walk.begin_shift(left)
        self._begin_walk(left_support=left)

    def _begin_walk(self, *, left_support: bool) -> None:
        """Forget the walk before: no step of this one was made yet."""
        self.state = ChainState(left_support=left_support)
        self._foot_heading = self._walk.attitude.yaw
        self._usual_error = self._usual_slip = 0.0

    def _next_target(self, made: Step | None) -> StepTarget:
        """Choose the step that begins now, given the one just made, if any."""
        self._take_command()
        self.steps += 1
        ticks, self._ticks = self._ticks, 0
        self.ended = None if made is None else self._ended_step()
        if made is not None and self._walk.feedback:
            # By its own periods: a driver's clock may stand, or jump.
            lasted = ticks * self._walk.times.period / self._walk.times.step
            made = self._with_slip(made)._replace(lasted=lasted)
        return self._decide(made)

    def _ended_step(self) -> EndedStep:
        """Return what the step that has just ended was off."""
        was = self._walk.state
        return EndedStep(self.state.first, self.state.target, was.worst, was.slip)

    def _with_slip(self, made: Step) -> Step:
        """Return a measured step relative to its support foot at touch-down.

        The gyro measures how far that foot has turned on the ground since then.
        """
        walk = self._walk
        heading = walk.support_heading
        slipped = math.remainder(heading - self._foot_heading, math.tau)
        self._foot_heading = heading + made.turn
        cos, sin = math.cos(slipped), math.sin(slipped)
        return Step(
            cos * made.ahead - sin * made.left,
            sin * made.ahead + cos * made.left,
            math.remainder(slipped + made.turn, math.tau),
        )

    def _pass_key_moments(self) -> None:
        if self.state.layer == 1 and self._walk.time >= self._walk.times.rise:
            self._walk.target = self._decide()
        if self.state.layer == 2 and self._walk.phase == DOUBLE:
            self._walk.target = self._decide()

    def _decide(self, made: Step | None = None) -> StepTarget:
        """Choose the pose of the next key moment; return the step's target."""
        before, target = self.state, self._walk.target
        if before.layer == 0:
            self._carried_out = self._part_of_command(made)
            self._room = self._room_to_step()
        command = self._commands[0].scaled(self._carried_out * self._room)
        landing, last = None, False
        if before.layer == 0:
            landing, last = self._next_footstep(self._walk.step if made else None)
        self.state, decision = self.generator.advance(
            before, command, made=made, landing=landing, last=last
        )
        self.decision = replace(decision, sizes=tuple(self.step_size.options))
        layer, pose = decision.layer, decision.pose
        if layer == 1:
            self._note_usual()
            target = self._trimmed(pose, self.generator.likely_next(self.state))
            then = self.generator.expected_next(self.state, command)
            target = target._replace(next_width=self._width(then))
        elif layer == 2:
            next_width = target.next_width
            target = self._trimmed(before.pose, pose)._replace(next_width=next_width)
        reference = self._walk.reference
        self._show(partial(self._panel_message, before, target, reference))
        return target

    def _part_of_command(self, made: Step | None) -> float:
        """Choose how much of the command the step that begins now carries out.

        What is usual of the robot itself is learned from steps, not from the shift of
        its weight before them.
        """
        asked = self.generator.library.command_range.share(self._commands[0])
        error, slip = self._off()
        off, most = max(error, slip), self.generator.library.usual_off
        beyond = off - self._own_off
        if beyond >= self.step_size.errors[0]:
            self._slips = slip > error
        if made is not None:
            self._own_off = own_after(self._own_off, off, most, self.steps - 1)
        size = self.step_size.following(beyond, asked)
        return max(size / asked, _SMALLEST) if asked > 0.0 else 1.0

    def _room_to_step(self) -> float:
        """Return the part of the command that the legs can carry out as low as it is.

        A robot that was lower than this speed allows comes up first.
        """
        most, crouch = self.generator.library.command_range, self._walk.state.crouch
        return max(most.room(self._commands[0], crouch), _SMALLEST)

    def _off(self) -> tuple[float, float]:
        """Return what the last step was off beyond the usual of sound robots [legs].

        By its DCM error, and by how far its support foot turned on the ground.
        """
        error = (self._walk.state.worst - self._usual_error) / self._leg
        return error, AHEAD * (self._walk.state.slip - self._usual_slip)

    def _note_usual(self) -> None:
        """Look up what steps between these two strides are usually off."""
        library, pair = self.generator.library, (self.state.first, self.state.target)
        self._usual_error = float(library.pair_error[pair])
        self._usual_slip = float(library.pair_slip[pair])

    def _trimmed(self, passing: int, landing: int) -> StepTarget:
        """Return the step's target, its landing adjusted to the requested motion."""
        target = self._poses.step_target(passing, landing, self.state.target)
        place = self.generator.landing(self.state)
        return target._replace(
            length=place.length,
            width=self._width(place),
            turn=place.turn,
            usual_error=self._usual_error + self._own_off * self._leg,
        )

    def _width(self, landing: Landing) -> float:
        """Return the lateral distance of the ankles [m]."""
        return self._poses.stance + landing.outward

    def _panel_message(
        self, before: ChainState, target: StepTarget, reference: Array
    ) -> PanelMessage:
        times = self._walk.times
        layer = before.layer + 1
        ends = times.rise, times.single, times.step
        joints = dict(zip(self.joint_names, reference.tolist(), strict=True))
        sagittal = set(self._sagittal)
        lift = {"share": target.share, "lift": target.lift, "foot_x": target.length}
        outward = target.width - self._poses.stance
        return PanelMessage(
            key_moment=f"kp_{layer + 1}",
            left_support=before.left_support,
            duration_s=ends[layer - 1] - (0.0, *ends)[layer - 1],
            swing={"outward": outward},
            lift=lift,
            move={"hip_height": times.hip_height, "turn": target.turn},
            frontal={n: q for n, q in joints.items() if n not in sagittal},
            sagittal={n: q for n, q in joints.items() if n in sagittal},
        )
