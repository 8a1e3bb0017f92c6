"""Falls made on purpose in physics, one for each cause, and records made by hand."""

import math
from dataclasses import fields, replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from other_robots import resized
from standing_record import record as standing

from gaitchain.analysis.fall_cause import RUN_UP_S, explain
from gaitchain.analysis.recorder import Recorder, observe
from gaitchain.analysis.rule_checks import standing_margins, tracking_errors
from gaitchain.analysis.rules import ADVICE, RECOVERY_S, Rule
from gaitchain.analysis.simulated_walk import run_schedule
from gaitchain.analysis.walk_metrics import fall_cause
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.cli.libraries import shipped_library
from gaitchain.gait.library_file import load_library
from gaitchain.gait.motion import Timing
from gaitchain.gait.schedule import Segment
from gaitchain.gait.stride.family import STRIDES
from gaitchain.gait.zmp import Support, margin, sole_corners, support_polygon
from gaitchain.messages import CONTROL_PERIOD_S, GRAVITY, Command
from gaitchain.robot.box_robot import JOINT_NAMES, load_box_robot
from gaitchain.robot.joint_angles import joint_angles
from gaitchain.sim.push import Push
from gaitchain.sim.world import World
from gaitchain.walker.walker import Walker

RES = load_box_robot("res")
WEIGHT = RES.reduced.mass * GRAVITY
TIMING = Timing(step=2.0, rise=0.6, fall=0.6)


_UNKNOWN = {"estimate": None, "planned_zmp": None}


def joint(name):
    return JOINT_NAMES.index(name)


def fall(move, *, world=None, robot=RES, plan=None, seconds=6.0):
    """Drive the simulator by `move(t, plan, backend)` until the robot falls.

    Returns the record; the robot must fall.
    """
    backend = MujocoBackend(robot, world)
    recorder = Recorder(robot, backend)
    plan = plan or both_feet()
    events = tuple((push.at_s, "a push") for push in (world or World()).push)
    backend.connect(move(0.0, plan, backend))
    for tick in range(round(seconds / CONTROL_PERIOD_S)):
        time_s = tick * CONTROL_PERIOD_S
        target = move(time_s, plan, backend)
        recorder.add(observe(time_s, target, plan, backend))
        backend.write(target)
        if backend.fallen:
            ticks = 0, tick + 1
            return recorder.record(ticks, time_s + CONTROL_PERIOD_S, TIMING, events)
    raise AssertionError(f"no fall in {seconds} s")


def both_feet(**more):
    return SimpleNamespace(
        **{"standing": True, "decision": None, "panel": None, **_UNKNOWN, **more}
    )


def left_foot():
    return SimpleNamespace(
        standing=False,
        support=Support.LEFT_SINGLE,
        decision=None,
        panel=None,
        **_UNKNOWN,
    )


def turned(pose, t, rates, start_s=0.3):
    """A pose, then joints that turn at a rate [deg/s] up to an angle [deg]."""
    target = pose.copy()
    for name, (rate, end) in rates.items():
        moved = min(max(t - start_s, 0.0) * rate, abs(end))
        target[joint(name)] += math.radians(math.copysign(moved, end))
    return target


def crouch(lean_deg):
    """Both feet on the ground, knees bent by twice an angle."""
    lean = math.radians(lean_deg)
    return joint_angles(np.array([lean, -lean, 0.0, -lean, lean, 0.0, 0.0]), True)


def on_left_foot(sway_deg=15.0):
    """Weight over the left foot, the right one lifted by bending that knee."""
    lean, lift, sway = np.radians([25.0, 10.0, sway_deg])
    q = np.array([lean, -lean, 0.0, -lean - lift, lean + lift, sway, sway])
    return joint_angles(q, True)


def lean(angle):
    """Lean forward (negative) or backward by the ankles, slowly."""
    ankles = {f"{side}_ankle_pitch": (8.0, angle) for side in ("left", "right")}
    return lambda t, plan, backend: turned(crouch(12.0), t, ankles)


def splits(t, plan, backend):
    """Spread the legs, soles level."""
    signs = {"left": 1.0, "right": -1.0}
    rates = {f"{side}_hip_roll": (60.0, 75.0 * sign) for side, sign in signs.items()}
    ankles = {
        f"{side}_ankle_roll": (60.0, -75.0 * sign) for side, sign in signs.items()
    }
    return turned(crouch(12.0), t, rates | ankles)


def dash(t, plan, backend):
    """Bend the left knee in no time."""
    rates = {
        "left_knee": (100.0, 40.0),
        "left_hip_pitch": (50.0, -20.0),
        "left_ankle_pitch": (50.0, -20.0),
    }
    return turned(crouch(12.0), t, rates)


def stamp(t, plan, backend):
    """Stretch the lifted leg into the ground in the middle of its swing."""
    rates = {
        "right_knee": (100.0, -65.0),
        "right_hip_pitch": (50.0, 35.0),
        "right_ankle_pitch": (50.0, 30.0),
    }
    return turned(on_left_foot(), t, rates, start_s=0.4)


def hover(t, plan, backend):
    """Sway back to a foot that never landed."""
    if t >= 0.5:
        plan.support = Support.LEFT_TO_RIGHT
    return on_left_foot(15.0 - min(max(t - 1.0, 0.0) * 15.0, 15.0))


def cross(t, plan, backend):
    """Swing the lifted leg through the other one."""
    return turned(on_left_foot(), t, {"right_hip_roll": (100.0, 70.0)}, start_s=0.4)


def deceived(t, plan, backend):
    """Balance by an estimate of the pitch that drifts away."""
    roll, pitch = backend.tilt
    drift = max(t - 0.3, 0.0) * math.radians(12.0)
    plan.estimate = SimpleNamespace(roll=roll, pitch=pitch - drift, yaw=0.0)
    target = crouch(12.0)
    target[[joint("left_ankle_pitch"), joint("right_ankle_pitch")]] += pitch - drift
    return target


def stay(t, plan, backend):
    return crouch(12.0)


def squat(t, plan, backend):
    return crouch(30.0)


WEAK = resized(RES, joint_torque_limit=10.0)
SLOW = resized(RES, joint_speed_limit=math.radians(20.0))
ON_LEFT = {"plan": left_foot}
# What is done to the robot, where, the rule, and (joint, foot, words of the advice).
FALLS = {
    "lean forward": (lean(-25.0), {}, Rule.ZMP, (None, None, "hip_x down")),
    "lean backward": (lean(25.0), {}, Rule.ZMP, (None, None, "hip_x up")),
    "ice": (
        splits,
        {"world": World(friction=0.02)},
        Rule.SLIP,
        (None, "left", "friction up"),
    ),
    "weak robot": (
        squat,
        {"robot": WEAK},
        Rule.TORQUE,
        ("left_knee", None, "joint_torque_limit up"),
    ),
    "weak world": (
        squat,
        {"world": World(torque_limit=0.1)},
        Rule.TORQUE,
        ("left_knee", None, "hip_height up"),
    ),
    "slow robot": (dash, {"robot": SLOW}, Rule.SPEED, ("left_", None, "--step-s up")),
    "slow world": (
        dash,
        {"world": World(speed_limit_deg_s=20.0)},
        Rule.SPEED,
        ("left_", None, "joint_speed_limit up"),
    ),
    "soft servos": (
        stay,
        {"world": World(servo_gain=0.05)},
        Rule.TRACKING,
        ("_knee", None, "servo_stiffness up"),
    ),
    "stamp": (stamp, ON_LEFT, Rule.EARLY, (None, "right", "foot_z up")),
    "hover": (hover, ON_LEFT, Rule.LATE, (None, "right", "hip_height down")),
    "cross": (cross, ON_LEFT, Rule.SELF_COLLISION, (None, None, "sway")),
    "deceived": (
        deceived,
        {"plan": lambda: both_feet(estimate=None)},
        Rule.ESTIMATOR,
        (None, None, "estimator"),
    ),
}


@pytest.mark.parametrize("name", FALLS)
def test_the_cause_of_a_fall_made_on_purpose(name):
    move, world, rule, (where, foot, advice) = FALLS[name]
    world = {**world, "plan": world["plan"]()} if "plan" in world else world
    walk = fall(move, **world)
    explanation = explain(walk.robot, walk)
    cause = explanation.cause
    assert cause.rule is rule
    assert cause.foot == foot
    assert (where is None) == (cause.joint is None)
    assert where is None or where in cause.joint
    assert advice in cause.advice
    assert 0.0 <= cause.time_s <= cause.until_s < walk.fell_at_s
    # The ZMP is the one whose amount is to be above the limit.
    broke = (
        cause.amount < cause.limit if rule is Rule.ZMP else cause.amount >= cause.limit
    )
    assert broke
    line = fall_cause(walk)
    assert f": {cause.what} {cause.how_much}, " in line
    assert line.endswith(f"s before; try {cause.advice}")
    assert cause.what in explanation.sentence
    assert "\n" not in line + explanation.sentence


def test_every_rule_is_tested_and_advised():
    assert {rule for _, _, rule, _ in FALLS.values()} == set(Rule) == set(ADVICE)


def test_the_times_are_those_of_what_was_done():
    """Leaning starts at 0.3 s and takes a second or more to the sole's edge."""
    cause = explain(RES, fall(lean(-25.0))).cause
    assert 1.0 < cause.time_s < 2.5
    late = explain(RES, fall(hover, plan=left_foot())).cause
    assert late.time_s == pytest.approx(0.5)
    assert late.limit == pytest.approx(300.0)
    early = explain(RES, fall(stamp, plan=left_foot())).cause
    assert 0.4 < early.time_s < 0.7
    # Planned at 1.2 s: the fall cut the step short, the timing tells.
    assert early.amount == pytest.approx(1e3 * (1.2 - early.time_s), abs=11.0)


def test_a_push_is_told_and_what_was_broken_before_it_is_not_the_cause():
    push = World(push=(Push(25.0, 0.0, at_s=0.5),))
    walk = fall(stay, world=push)
    explanation = explain(RES, walk)
    assert explanation.events == ((0.5, "a push"),)
    assert explanation.cause.rule is Rule.ZMP
    assert explanation.cause.time_s >= 0.5
    assert " after a push: ZMP" in explanation.sentence
    assert " after a push, " in fall_cause(walk)
    walk.torque[10:, 3] = 120.0  # all along, before and after
    again = explain(RES, walk)
    assert again.cause.rule is Rule.TORQUE
    assert again.cause.time_s == pytest.approx(0.5)
    begun = [f.time_s for f in again.findings if f.rule is Rule.TORQUE]
    assert begun == pytest.approx([0.1, 0.5])


def test_a_walk_that_holds_has_no_cause(library):
    schedule = (
        Segment(Command(0.04), steps=1),
        Segment(Command(0.05), steps=2),
        Segment(Command(0.02), steps=1),
    )
    walk = run_schedule(Walker(library), MujocoBackend(library.robot), schedule)
    explanation = explain(library.robot, walk)
    assert explanation.cause is None
    assert explanation.sentence.startswith("The robot did not fall; ")
    quiet = {Rule.TORQUE, Rule.SPEED, Rule.TRACKING, Rule.SELF_COLLISION}
    assert not quiet & {f.rule for f in explanation.findings}
    assert fall_cause(walk) is None


# Records made by hand.
def test_standing_breaks_no_rule():
    walk = standing(np.zeros(300))
    assert explain(RES, walk).findings == ()
    assert explain(RES, walk).sentence == "The robot did not fall; no rule broke."
    fallen = replace(walk, fell_at_s=3.0)
    assert explain(RES, fallen).cause is None
    assert "no rule broke before" in explain(RES, fallen).sentence


def with_torque(*spells, rows=400, fell_at_s=4.0, joint_index=3, **more):
    torque = np.zeros((rows, 12))
    for begin, end in spells:
        torque[begin:end, joint_index] = 120.0
    return standing(np.zeros(rows), torque=torque, fell_at_s=fell_at_s, **more)


@pytest.mark.parametrize(("ticks", "found"), [(4, 0), (5, 1), (6, 1)])
def test_a_rule_holds_for_a_moment(ticks, found):
    """40 ms of full torque are allowed, 50 ms are not."""
    findings = explain(RES, with_torque((100, 100 + ticks))).findings
    assert len(findings) == found


def test_breaks_close_together_are_one():
    walk = with_torque((100, 110), (135, 150), (200, 210))
    times = [(f.time_s, f.until_s) for f in explain(RES, walk).findings]
    np.testing.assert_allclose(times, [(1.0, 1.49), (2.0, 2.09)])


def test_what_recovered_is_not_the_cause():
    gone = with_torque((100, 110), (390, 400))
    assert explain(RES, gone).cause.time_s == pytest.approx(3.9)
    # A rest of more than 0.3 s within the run-up is a recovery, too.
    rested = with_torque((300, 320), (360, 400))
    assert explain(RES, rested).cause.time_s == pytest.approx(3.6)
    # So long ago that it has nothing to do with the fall.
    old = with_torque((100, 110))
    assert len(explain(RES, old).findings) == 1
    assert explain(RES, old).cause is None
    # Begun long ago and still so.
    lasting = with_torque((100, 400))
    assert explain(RES, lasting).cause.time_s == pytest.approx(1.0)


STEP_S = 0.4  # of the walks that slip


def with_slips(*rows, torque=(350, 400), **more):
    """Feet that slip for 0.1 s from these rows on, in turn; a knee that is weak."""
    speed = np.zeros((400, 2))
    for i, row in enumerate(rows):
        speed[row : row + 10, i % 2] = 0.3
    timing = Timing(step=STEP_S, rise=0.1, fall=0.1)
    return with_torque(torque, foot_speed=speed, timing=timing, **more)


@pytest.mark.parametrize("pause", [0.22, STEP_S - 0.02])
def test_slips_of_each_step_until_the_fall_are_one_run_up(pause):
    """Each spell ends as the foot is lifted: the first one is the cause."""
    walk = with_slips(*range(50, 400, 11 + round(100.0 * pause)), torque=(240, 400))
    cause = explain(RES, walk).cause
    assert cause.rule is Rule.SLIP
    assert cause.time_s == pytest.approx(0.5)


def test_a_step_without_a_slip_is_a_recovery():
    walk = with_slips(50, 90, *range(100 + round(100.0 * STEP_S) + 2, 400, 30))
    cause = explain(RES, walk).cause
    assert (cause.rule, cause.time_s) == (Rule.SLIP, pytest.approx(1.42))


def test_slips_before_a_fall_without_slips_are_not_its_cause():
    """They ended 0.4 s before the knee gave way."""
    cause = explain(RES, with_slips(*range(50, 310, 25))).cause
    assert (cause.rule, cause.time_s) == (Rule.TORQUE, pytest.approx(3.5))


def test_slips_do_not_hide_a_push():
    """The robot slipped in each step, and walked until it was pushed."""
    walk = with_slips(*range(50, 400, 30), torque=(301, 400), events=((3.0, PUSH),))
    why = explain(RES, walk)
    assert (why.cause.rule, why.cause.time_s) == (Rule.TORQUE, pytest.approx(3.01))
    assert f" after {PUSH}: torque" in why.sentence
    calm = replace(walk, events=())
    assert explain(RES, calm).cause.time_s == pytest.approx(0.5)


def test_other_rules_that_break_again_and_again_are_recovered_from():
    """Only a slip ends because its foot is lifted."""
    spells = [(row, row + 10) for row in range(50, 400, 42)]
    assert explain(RES, with_torque(*spells)).cause.time_s > 2.0


@pytest.mark.parametrize("turned", [False, True])
def test_a_speed_that_was_only_asked_for_is_told_as_such(turned):
    """Twice the limit: the knee's target moves so, or the knee itself."""
    rate = 2.0 * RES.reduced.joint_speed_limit
    moved = np.zeros((400, 12))
    moved[350:, 3] = rate * CONTROL_PERIOD_S * np.arange(1, 51)
    speed = np.zeros((400, 12))
    speed[350:, 3] = rate
    changes = {"joint_velocity": speed} if turned else {"target": moved}
    more = {"fell_at_s": 4.0, "joint_position": moved, **changes}
    why = explain(RES, standing(np.zeros(400), **more))
    assert (why.cause.rule, why.cause.asked) == (Rule.SPEED, not turned)
    limit = math.degrees(RES.reduced.joint_speed_limit)
    asked = "" if turned else "asked for "
    assert f", {asked}{2.0 * limit:.0f} deg/s (limit {limit:.0f} deg/s)" in why.sentence


PUSH = "a push of 20 N s"


def test_a_push_is_named_though_the_robot_took_long_to_fall():
    """Nothing broke for a while after it: 1.75 s before the fall, on its way down."""
    walk = with_torque((330, 400), events=((2.25, PUSH),))
    why = explain(RES, walk)
    assert why.cause.time_s == pytest.approx(3.3)
    assert f" after {PUSH}, 1.75 s before the fall: torque saturation" in why.sentence
    assert "try a weaker disturbance (`gaitchain push`" in why.sentence


def test_what_broke_first_after_a_push_is_the_cause():
    walk = with_torque((100, 120), (240, 260), (330, 400), events=((2.25, PUSH),))
    assert explain(RES, walk).cause.time_s == pytest.approx(2.4)


WEAK = "a push of 8 N s"


@pytest.mark.parametrize(
    ("recovers_s", "cause_s"), [(2.3, 3.1), (2.69, 3.1), (2.8, 2.1), (2.99, 2.1)]
)
def test_a_push_that_it_recovered_from_is_not_the_cause(recovers_s, cause_s):
    """Or if rules were still broken when the next one came, it is."""
    spells = (210, round(100.0 * recovers_s)), (310, 400)
    why = explain(RES, with_torque(*spells, events=((2.0, WEAK), (3.0, PUSH))))
    assert why.cause.time_s == pytest.approx(cause_s)
    assert f" after 2 disturbances, the last one {PUSH}: torque" in why.sentence


@pytest.mark.parametrize("weaker_ns", [5.0, 8.0, 11.0])
@pytest.mark.parametrize("vx", [0.0, 0.2])
def test_of_two_pushes_in_physics_the_one_that_felled_it_is_named(weaker_ns, vx):
    """The shipped library withstands the first."""
    shipped = load_library(shipped_library())
    weaker, stronger = Push(weaker_ns, 90.0, 2.0), Push(40.0, 90.0, 3.5)

    def walked(*pushes):
        world, walker = World(push=pushes), Walker(shipped)
        backend = MujocoBackend(shipped.robot, world)
        return run_schedule(walker, backend, (Segment(Command(vx), 6.0),))

    assert walked(weaker).fell_at_s is None
    why = explain(shipped.robot, walked(weaker, stronger))
    assert 3.5 <= why.cause.time_s <= why.fell_at_s
    assert "the last one a push of 40 N s to 90 deg" in why.sentence


def without_rows(walk, begin, end):
    """A record of which some rows were lost."""
    rows = len(walk.time_s)
    columns = {f.name: getattr(walk, f.name) for f in fields(walk)}
    kept = {
        name: np.delete(column, slice(begin, end), axis=0)
        for name, column in columns.items()
        if isinstance(column, np.ndarray) and len(column) == rows
    }
    return replace(walk, **kept)


@pytest.mark.parametrize("lost", [6, 50, 360])
def test_nothing_breaks_where_rows_are_lost(lost):
    """A foot that stood before them and stands after them may have stepped."""
    shipped = load_library(shipped_library())
    backend = MujocoBackend(shipped.robot)
    walk = run_schedule(Walker(shipped), backend, (Segment(Command(0.2), 8.0),))
    assert explain(shipped.robot, walk).findings == ()
    for begin in range(200, 560, 40):
        seen = without_rows(walk, begin, begin + lost)
        assert explain(shipped.robot, seen).findings == ()


def test_a_break_on_both_sides_of_lost_rows_is_two():
    walk = without_rows(with_torque((100, 200)), 140, 160)
    times = [(f.time_s, f.until_s) for f in explain(RES, walk).findings]
    np.testing.assert_allclose(times, [(1.0, 1.39), (1.6, 1.99)])


def test_a_push_of_long_ago_has_nothing_to_do_with_it():
    why = explain(RES, with_torque((350, 400), events=((0.9, PUSH),)))
    assert PUSH not in why.sentence
    assert "disturbance" not in why.sentence


def test_a_push_is_named_where_no_rule_broke():
    why = explain(RES, with_torque(events=((3.5, PUSH),)))
    assert why.sentence == (
        f"The robot fell at 4.00 s after {PUSH}, 0.50 s before the fall; no rule broke "
        "before."
    )


def test_many_punches_are_counted():
    events = tuple((3.0 + 0.1 * i, f"punch {i}") for i in range(5))
    why = explain(RES, with_torque((350, 400), events=events))
    assert " after 5 disturbances, the last one punch 4: torque" in why.sentence


@pytest.mark.parametrize("events", [(), ((3.4, PUSH),)])
def test_a_robot_that_stood_is_not_told_to_walk_slower(events):
    stood = with_torque((350, 400), events=events, commands=((0.0, Command()),))
    walked = with_torque(
        (350, 400), events=events, commands=((0.0, Command(0.3)), (3.8, Command()))
    )
    slow = [
        "slower" in explain(RES, replace(walk, gait=STRIDES.name)).cause.advice
        for walk in (stood, walked)
    ]
    assert slow == [False, True]


@pytest.mark.parametrize(
    ("gait", "stood", "advice"),
    [
        (STRIDES.name, False, "a slower command aside, or less turning"),
        (STRIDES.name, True, "floor, load and servos: it stood"),
        ("", False, "sway down, or the bound of sideways steps"),
        ("", True, "sway down"),
    ],
)
def test_a_robot_that_stood_is_not_told_to_turn_or_step_less(gait, stood, advice):
    touching = np.arange(400) >= 350
    command = Command() if stood else Command(yaw_rate=0.3)
    walk = standing(np.zeros(400), fell_at_s=4.0, self_contact=touching)
    walk = replace(walk, gait=gait, commands=((0.0, command),))
    assert explain(RES, walk).cause.advice == advice


def test_of_two_at_once_the_upstream_one_leads():
    walk = with_torque((350, 400))
    estimate = np.zeros((400, 2))
    estimate[350:, 0] = 0.2
    both = replace(walk, estimated_tilt=estimate)
    assert [f.rule for f in explain(RES, both).findings] == [
        Rule.ESTIMATOR,
        Rule.TORQUE,
    ]
    assert explain(RES, both).cause.amount == pytest.approx(math.degrees(0.2))


def test_what_comes_after_the_fall_is_left_out():
    walk = with_torque((350, 400), fell_at_s=3.0, events=((2.0, "a"), (3.5, "b")))
    assert explain(RES, walk).findings == ()
    assert explain(RES, walk).events == ((2.0, "a"),)


def test_sag_under_load_is_no_lag():
    """5 deg of error with the torque that a spring of the servo's stiffness has."""
    error = np.radians(5.0)
    target = np.zeros((100, 12))
    target[:, 3] = error
    torque = RES.reduced.servo_stiffness * target
    sagging = standing(np.zeros(100), target=target, torque=torque)
    np.testing.assert_allclose(tracking_errors(RES, sagging), 0.0, atol=1e-12)
    lagging = replace(sagging, torque=np.zeros((100, 12)))
    np.testing.assert_allclose(tracking_errors(RES, lagging)[1:, 3], error)
    assert {f.rule for f in explain(RES, sagging).findings} == set()
    (lag,) = explain(RES, lagging).findings
    assert (lag.rule, lag.joint) == (Rule.TRACKING, "left_knee")
    assert lag.amount == pytest.approx(5.0)


@settings(max_examples=50)
@given(
    st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.floats(-3.0, 3.0), st.integers(1, 3)
)
def test_margins_are_those_of_the_hull(x, y, yaw, loaded):
    """As `zmp.margin` of the support polygon, inside it; outside, negative as well."""
    feet = [(0.0, 0.1), (0.15, -0.08)]
    soles = [sole_corners(RES, feet[0]), sole_corners(RES, feet[1], yaw)]
    down = [bool(loaded & 1), bool(loaded & 2)]
    walk = standing(
        np.zeros(1),
        zmp=np.array([[x, y]]),
        soles=np.array([soles]),
        foot_load=np.array([[0.5 * WEIGHT * d for d in down]]),
    )
    polygon = support_polygon([s for s, d in zip(soles, down, strict=True) if d])
    (found,), expected = standing_margins(RES, walk), margin(np.array([x, y]), polygon)
    if expected >= 0.0:
        assert found == pytest.approx(expected, abs=1e-12)
    else:
        assert found <= expected + 1e-12


def test_in_the_air_there_is_no_margin():
    walk = standing(np.zeros(2), foot_load=np.zeros((2, 2)))
    assert np.isnan(standing_margins(RES, walk)).all()


def broken_walk(rows, seed, fell_at_s, pushes=()):
    """A record in which anything may break at any time."""
    rng = np.random.default_rng(seed)

    def spells(shape, scale):
        """Blocks of 20 rows that are zero, or up to a scale."""
        blocks = rng.random((rows // 20 + 1, *shape))
        return np.repeat(np.where(blocks > 0.6, scale * blocks, 0.0), 20, axis=0)[:rows]

    support = rng.choice(["stand", "ls", "lr", "rs", "rl"], rows // 30 + 1)
    return standing(
        np.zeros(rows),
        torque=spells((12,), 130.0),
        target=spells((12,), 0.3),
        foot_load=spells((2,), WEIGHT),
        foot_speed=spells((2,), 0.3),
        zmp=spells((2,), 0.3),
        self_contact=spells((), 1.0) > 0.9,
        estimated_tilt=spells((2,), 0.2),
        support=np.repeat(support, 30)[:rows],
        fell_at_s=fell_at_s,
        events=tuple((time_s, "a push") for time_s in pushes),
    )


@settings(max_examples=60)
@given(
    st.integers(1, 300),
    st.integers(0, 2**32 - 1),
    st.none() | st.floats(0.0, 3.0),
    st.lists(st.floats(0.0, 3.0)),
)
def test_findings_are_in_order_and_before_the_fall(rows, seed, fell_at_s, pushes):
    walk = broken_walk(rows, seed, fell_at_s, pushes)
    explanation = explain(RES, walk)
    findings = explanation.findings
    times = [f.time_s for f in findings]
    assert times == sorted(times)
    assert all(f.time_s <= f.until_s for f in findings)
    assert all(f.joint in {None, *JOINT_NAMES} for f in findings)
    assert all(math.isfinite(f.amount) for f in findings)
    if fell_at_s is None:
        assert explanation.cause is None
        return
    # A fall in the first control period leaves one row.
    assert all(f.until_s < max(fell_at_s, CONTROL_PERIOD_S) for f in findings)
    if explanation.cause is None:
        late = fell_at_s - max((f.until_s for f in findings), default=-math.inf)
        assert late > min(RUN_UP_S, RECOVERY_S)
    else:
        assert explanation.cause in findings


@settings(max_examples=20)
@given(st.integers(1, 300), st.integers(0, 2**32 - 1), st.integers(0, 100))
def test_what_the_robot_did_lying_down_changes_nothing(rows, seed, more):
    """Rows after the fall are not looked at."""
    fallen = broken_walk(rows, seed, rows * CONTROL_PERIOD_S)
    longer = standing(np.zeros(rows + more), fell_at_s=fallen.fell_at_s)
    for name in ("torque", "target", "foot_load", "foot_speed", "zmp", "support"):
        getattr(longer, name)[:rows] = getattr(fallen, name)
    longer.self_contact[:rows] = fallen.self_contact
    longer.estimated_tilt[:rows] = fallen.estimated_tilt
    assert explain(RES, longer).findings == explain(RES, fallen).findings


def test_a_stride_gait_that_falls_before_its_first_step_is_advised_as_strides(brisk):
    """A standing robot, pushed over: no key pose says which gait it is."""
    push = Push(200.0, 0.0, 0.0)
    walk = run_schedule(
        Walker(brisk),
        MujocoBackend(brisk.robot, World(push=(push,))),
        (Segment(Command(), 2.0),),
    )
    assert walk.fell_at_s is not None
    advice = " ".join(f.advice for f in explain(brisk.robot, walk).findings)
    assert advice
    assert "hip_x" not in advice
    assert "foot_z" not in advice
