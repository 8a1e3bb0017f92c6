"""Pacer, lease, guard, tilt and moves alone, with arithmetic done by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from live_robot import SteppedClock, library

from gaitchain.errors import CommandError
from gaitchain.gait.get_up import GetUp, TimedPose, Way
from gaitchain.live.clock import Pacer
from gaitchain.live.driver_lease import DriverLease
from gaitchain.live.getting_up import GettingUp
from gaitchain.live.guard import Bounds, Guard, TiltSense
from gaitchain.live.joint_motion import JointLimiter, SmoothMove
from gaitchain.live.messages import Drive, FollowSteps, GoTo, TroubleKind
from gaitchain.live.safe_backend import Backoff
from gaitchain.messages import GRAVITY, Command, Sensors
from gaitchain.walker.footsteps import Footstep
from gaitchain.walker.place import Place
from gaitchain.walker.riser import Riser, Rising

COUNT = 12
angles = st.lists(st.floats(-1.0, 1.0), min_size=COUNT, max_size=COUNT)


def sensors(time=0.0, gyro=(0.0, 0.0, 0.0), acceleration=(0.0, 0.0, 9.81), joint=0.0):
    position = np.full(COUNT, joint)
    return Sensors(
        time, position, np.zeros(COUNT), np.array(gyro), np.array(acceleration)
    )


def legs():
    return library().robot.legs


def guard():
    return Guard(legs(), has_imu=True)


def judge(watch, measured, *, seconds, loads=None, target=None, moving=False):
    """Show the same kind of measurement for some time; return the last verdict."""
    loads = np.full(COUNT, np.nan) if loads is None else loads
    target = measured.joint_position if target is None else target
    verdict = None
    for tick in range(round(seconds / 0.01)):
        now = replace(measured, time=0.01 * tick)
        verdict = watch.judge(now, loads, target, 0.01, moving=moving)
    return verdict


def test_pacer_counts_ticks_that_take_too_long():
    clock = SteppedClock()
    pacer = Pacer(clock, 0.01)
    for tick in range(100):
        pacer.wait()
        clock.time_s += 0.015 if tick in (20, 40) else 0.002
    pacer.wait()
    assert pacer.pace.ticks == 101
    assert pacer.pace.overruns == 2
    assert pacer.pace.late_max_s == pytest.approx(0.005)
    assert pacer.pace.busy_p99_s >= 0.002


def test_pacer_measures_its_rate_by_its_own_ticks():
    clock = SteppedClock()
    pacer = Pacer(clock, 0.004)
    rates = []
    for _ in range(1300):
        pacer.wait()
        clock.time_s += 0.002
        rates.append(pacer.pace.rate_hz)
    assert rates[0] is None
    assert rates[60:] == pytest.approx([250.0] * 1240)
    for _ in range(1000):  # too slow for its period from now on
        pacer.wait()
        clock.time_s += 0.005
        rates.append(pacer.pace.rate_hz)
    assert rates[-1] == pytest.approx(200.0, rel=0.02)


def test_pacer_does_not_hurry_after_a_long_pause():
    clock = SteppedClock()
    pacer = Pacer(clock, 0.01)
    pacer.wait()
    clock.time_s += 10.0
    assert pacer.wait() == pytest.approx(9.99)
    assert pacer.wait() == pytest.approx(0.0)
    before = clock.time_s
    pacer.wait()
    assert clock.time_s - before == pytest.approx(0.01)


def test_pacer_goes_on_when_the_clock_goes_back():
    clock = SteppedClock()
    pacer = Pacer(clock, 0.01)
    for _ in range(5):
        pacer.wait()
    clock.time_s -= 100.0
    before = clock.time_s
    for _ in range(5):
        pacer.wait()
    assert clock.time_s - before < 0.1


def test_lease_ages_the_command_before_the_driver():
    lease = DriverLease()
    assert lease.drive(Drive("me", 0.2), 0.0)
    lease.expire(0.4)
    assert lease.asked.vx == 0.2
    lease.expire(0.6)
    assert lease.asked.stops
    assert lease.timed_out
    assert not lease.drive(Drive("you", 0.1), 2.0)
    assert lease.acquire("me", 2.0)
    lease.expire(2.1)
    assert lease.asked.stops
    lease.expire(5.1)
    assert lease.drive(Drive("you", 0.1), 5.1)


@pytest.mark.parametrize("lost", ["let go", "silent"])
def test_a_stop_outlives_the_lease_of_whom_it_stopped(lost):
    """A driver whose socket was lost and is back goes on sending what it sent."""
    lease = DriverLease()
    lease.drive(Drive("me", 0.2), 0.0)
    lease.stop()
    lease.let_go("me") if lost == "let go" else lease.expire(3.1)
    assert lease.driver == ""
    lease.drive(Drive("me", 0.2), 4.0)
    assert lease.asked.stops
    lease.drive(Drive("me"), 4.1)
    lease.drive(Drive("me", 0.2), 4.2)
    assert lease.asked.vx == 0.2


def test_a_stop_holds_for_a_driver_that_was_lost_just_before():
    lease = DriverLease()
    lease.drive(Drive("me", 0.2), 0.0)
    lease.let_go("me")
    lease.stop()
    lease.drive(Drive("me", 0.2), 0.1)
    assert lease.asked.stops


def test_a_stop_holds_for_whom_it_stopped_alone():
    lease = DriverLease()
    lease.drive(Drive("me", 0.2), 0.0)
    lease.stop()
    lease.let_go("me")
    lease.drive(Drive("you", 0.1), 0.1)
    assert lease.asked.vx == 0.1
    lease.let_go("you")
    lease.drive(Drive("me", 0.2), 0.2)  # not by the other one's way
    assert lease.asked.stops
    lease.let_go("me")
    lease.drive(Drive("you", 0.1), 0.3)
    assert not lease.drive(Drive("me"), 0.4)
    assert lease.asked.vx == 0.1
    assert not lease.bars("me")  # a zero counts, whoever drives


def test_names_of_drivers_cannot_fill_the_memory():
    lease = DriverLease()
    for number in range(1000):
        lease.drive(Drive(f"driver-{number}", 0.1), 0.0)
        lease.stop()
        lease.let_go(f"driver-{number}")
    assert lease.bars("driver-999")
    assert len(lease._barred) < 100


LOW = Command(crouch=0.05)
AWAY = GoTo("me", (Place(2.0),), crouch=0.05)
STEPS = FollowSteps("me", (Footstep(True, 0.1, 0.1),))


@pytest.mark.parametrize("wish", [Drive("me", 0.1, crouch=0.05), AWAY])
def test_a_silent_driver_and_a_stop_leave_the_robot_as_low_as_it_is(wish):
    lease = DriverLease()

    def asked():
        lease.acquire("me", 0.0)
        lease.drive(wish, 0.0) if isinstance(wish, Drive) else lease.send(wish)

    asked()
    lease.expire(3.1)
    assert (lease.driver, lease.errand, lease.asked) == ("", None, LOW)
    asked()
    lease.stop()
    assert (lease.errand, lease.asked) == (None, LOW)
    lease.drive(Drive("me", 0.1), 0.0)  # goes on asking, heedless of the stop
    assert lease.asked == LOW
    lease.let_go("me")
    assert lease.asked == Command()


def test_an_errand_leaves_the_robot_as_low_as_the_one_before():
    lease = DriverLease()
    lease.drive(Drive("me", 0.1, crouch=0.05), 0.0)
    lease.send(STEPS)
    assert lease.asked == LOW
    lease.send(AWAY)
    lease.send(STEPS)
    assert lease.asked == LOW
    lease.send(GoTo("me", (Place(1.0),)))  # which is refused
    lease.drop()
    assert lease.asked == LOW
    lease.stop(limp=True)
    assert lease.asked == Command()


class Jointed:
    """A robot that stands upright, its joints at 1, 2 and 3 rad."""

    whole_joint_names = "left", "right", "arm"

    def engage(self):
        pass

    def where_whole(self):
        return np.array([1.0, 2.0, 3.0])

    def read_whole(self):
        upright, still = np.array([0.0, 0.0, GRAVITY]), np.zeros(3)
        return Sensors(0.0, self.where_whole(), still, still, upright)


def riser_of(**stand):
    pose = tuple(stand.values())
    way = Way((TimedPose(0.5, pose),), 1, 1)
    return Riser(GetUp("toy", "f", tuple(stand), pose, {"front": way}))


def test_joints_are_those_of_the_way_whatever_their_order():
    up = GettingUp(Jointed(), ("left", "right"))
    up.riser = riser_of(arm=3.0, left=1.0, right=2.0)
    up.begin()
    while (state := up.step()) is Rising.STRAIGHTENING:
        np.testing.assert_allclose(up.target, [1.0, 2.0, 3.0])
    assert (state, up.riser.tries) == (Rising.UP, 1)
    np.testing.assert_allclose(up.of_legs, [1.0, 2.0])


@pytest.mark.parametrize(
    ("stand", "says"),
    [
        ({"left": 1.0, "right": 2.0}, "the robot's 3: it lacks arm; "),
        ({"left": 1.0, "right": 2.0, "neck": 3.0}, "it has neck and lacks arm; "),
    ],
)
def test_a_way_of_other_joints_is_refused_before_it_is_needed(stand, says):
    up = GettingUp(Jointed(), ("left", "right"))
    with pytest.raises(CommandError, match=says):
        up.riser = riser_of(**stand)
    assert not up.able


def test_a_retry_comes_ever_less_often():
    retry = Backoff()
    assert retry.due(0.0)
    assert [retry.failed(5.0) for _ in range(6)] == [1.0, 2.0, 4.0, 8.0, 10.0, 10.0]
    assert not retry.due(14.9)
    assert retry.due(15.0)
    retry.cancel()
    assert not retry.due(1e9)
    assert retry.failed(0.0) == 1.0


@given(angles, angles)
def test_move_starts_ends_and_keeps_its_speed(start, end):
    start, end = np.array(start), np.array(end)
    move = SmoothMove(start, end, speed=0.5)
    times = np.linspace(0.0, 10.0, 500)
    path = np.array([move.at(t) for t in times])
    assert path[0] == pytest.approx(start)
    assert path[-1] == pytest.approx(end)
    assert np.abs(np.diff(path, axis=0)).max() <= 0.5 * (times[1] - times[0]) + 1e-9
    assert move.done(10.0)


@given(angles, angles)
def test_limiter_keeps_targets_within_range_and_speed(before, target):
    robot = legs()
    limiter = JointLimiter(robot, 0.01)
    before = np.clip(before, robot.lower, robot.upper)
    kept, told = limiter.limit(3.0 * np.array(target), before)
    assert (kept >= robot.lower).all()
    assert (kept <= robot.upper).all()
    assert (np.abs(kept - before) <= robot.speed_limit * 0.01 + 1e-12).all()
    beyond = np.abs(3.0 * np.array(target)) > robot.upper
    assert bool(told) == beyond.any()


def test_limiter_leads_a_joint_back_into_its_range_slowly():
    robot, before = legs(), np.zeros(COUNT)
    before[1] = robot.upper[1] + 0.3
    kept, _ = JointLimiter(robot, 0.01).limit(np.full(COUNT, np.nan), before)
    assert (kept == before).all()
    kept, _ = JointLimiter(robot, 0.01).limit(np.zeros(COUNT), before)
    assert kept[1] == pytest.approx(before[1] - 0.01 * robot.speed_limit[1])


def test_limiter_names_joint_angle_and_range():
    target = np.zeros(COUNT)
    target[0] = math.radians(200.0)
    _, told = JointLimiter(legs(), 0.01).limit(target, np.zeros(COUNT))
    assert legs().joint_names[0] in told
    assert "200 deg" in told
    assert "-80 to 80" in told


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_limiter_keeps_the_joints_in_range_whatever_their_encoders_show(sign):
    """Targets and servos' ends are as encoders show them, the robot's are angles."""
    robot, offset = legs(), np.zeros(COUNT)
    offset[0] = sign * math.radians(4.0)
    limiter = JointLimiter(robot, 1.0, offset=offset)
    for end in (robot.lower, robot.upper):
        assert limiter.beyond(end + offset) == ""
        kept, told = limiter.limit(end * 1.5 + offset, np.array(end + offset))
        assert kept == pytest.approx(end + offset)
        assert "120 deg, its range is -80 to 80" in told
    servos = np.array(robot.lower), np.array(robot.upper)  # as encoders show them
    far = robot.upper + 0.5 + offset
    told = JointLimiter(robot, 1.0, servos, offset).beyond(far)
    assert f"its range is {'-80 to 76' if sign > 0.0 else '-76 to 80'}" in told


@pytest.mark.parametrize("axis, rate", [(0, 0.5), (1, -0.5), (0, -1.0)])
def test_tilt_follows_the_gyro_when_the_accelerometer_is_shaken(axis, rate):
    sense, gyro = TiltSense(), np.zeros(3)
    sense.feel(sensors(), 0.01)
    gyro[axis] = rate
    for _ in range(100):
        tilt = sense.feel(sensors(gyro=gyro, acceleration=(20.0, 0.0, 30.0)), 0.01)
    assert tilt == pytest.approx(abs(rate), abs=0.01)


def test_tilt_comes_from_gravity_in_the_long_run():
    sense = TiltSense()
    sense.feel(sensors(), 0.01)
    leaning = 9.81 * np.array([math.sin(0.4), 0.0, math.cos(0.4)])
    for _ in range(500):
        tilt = sense.feel(sensors(acceleration=leaning), 0.01)
    assert tilt == pytest.approx(0.4, abs=1e-3)


def test_a_guard_that_sees_nothing_wrong_says_nothing():
    assert judge(guard(), sensors(), seconds=10.0) is None


def test_a_leaning_trunk_has_fallen():
    watch, angle = guard(), math.radians(55.0)
    lying = 9.81 * np.array([math.sin(angle), 0.0, math.cos(angle)])
    verdict = judge(watch, sensors(acceleration=lying), seconds=0.1)
    assert verdict is not None
    assert verdict.kind is TroubleKind.FALL
    assert "55 deg, limit 50" in verdict.reason


def test_overload_is_named_after_its_time():
    watch, loads = guard(), np.zeros(COUNT)
    loads[5] = -1.5 * legs().torque_limit[5]
    moving = [sensors(time=i) for i in range(300)]
    verdicts = [
        watch.judge(s, loads, s.joint_position, 0.01, moving=False) for s in moving
    ]
    first = next(i for i, verdict in enumerate(verdicts) if verdict is not None)
    assert first == pytest.approx(100, abs=1)
    assert verdicts[first].reason.startswith(f"{legs().joint_names[5]} is at its")
    assert verdicts[first].kind is TroubleKind.JOINTS


@pytest.mark.parametrize(("part", "trips"), [(0.97, False), (0.99, True)])
def test_a_joint_is_at_its_limit_from_98_percent_on(part, trips):
    loads = np.zeros(COUNT)
    loads[5] = part * legs().torque_limit[5]
    verdict = judge(guard(), sensors(), seconds=1.1, loads=loads)
    assert (verdict is not None) == trips


@pytest.mark.parametrize(
    ("times", "seconds", "trips"),
    [(2.9, 1.0, False), (3.1, 0.08, False), (3.1, 0.12, True)],
)
def test_a_joint_runs_away_at_three_times_its_speed_limit(times, seconds, trips):
    measured = sensors()
    measured.joint_velocity[3] = -times * legs().speed_limit[3]
    verdict = judge(guard(), measured, seconds=seconds)
    assert (verdict is not None) == trips
    if trips:
        assert verdict.reason.startswith(f"{legs().joint_names[3]} runs away")


def test_a_joint_that_does_not_follow_is_named():
    watch, target = guard(), np.zeros(COUNT)
    target[2] = math.radians(40.0)
    found = None
    for i in range(60):
        s = sensors(time=i)
        found = watch.judge(s, np.zeros(COUNT), target, 0.01, moving=False)
    assert found is not None
    assert found.reason.startswith(f"{legs().joint_names[2]} does not follow")


def test_mending_fills_single_joints_with_their_last_number():
    watch = guard()
    assert watch.mend(sensors(joint=np.nan), 0.01) is None
    watch.mend(sensors(joint=0.3), 0.01)
    spoiled = sensors(joint=0.5)
    spoiled.joint_position[4] = np.nan
    mended = watch.mend(spoiled, 0.01)
    assert mended.joint_position[4] == 0.3
    assert (np.delete(mended.joint_position, 4) == 0.5).all()


@pytest.mark.parametrize("rate", [-999.0, 300.0, 38.0])
def test_one_sample_of_the_gyro_is_no_fall(rate):
    """An hour at 1 kHz has 3.6 million samples; one turned the torque off."""
    watch = guard()
    for tick in range(100):
        gyro = (0.0, rate if tick == 50 else 0.1 * (tick % 2), 0.0)
        now = watch.mend(sensors(0.01 * tick, gyro, joint=1e-6 * tick), 0.01)
        position = now.joint_position
        found = watch.judge(now, np.zeros(COUNT), position, 0.01, moving=True)
        assert found is None


def test_a_fall_that_begins_with_a_jump_is_seen_one_sample_later():
    watch, seen = guard(), []
    for tick in range(40):
        gyro = (12.0 if tick >= 10 else 0.0, 0.0, 0.0)
        now = watch.mend(sensors(0.01 * tick, gyro, (0.0, 0.0, 30.0)), 0.01)
        if not tick:
            now = watch.mend(sensors(), 0.01)  # gravity, once
        position = now.joint_position
        seen.append(watch.judge(now, np.zeros(COUNT), position, 0.01, moving=False))
    first = next(tick for tick, found in enumerate(seen) if found is not None)
    assert seen[first].kind is TroubleKind.FALL
    periods = math.radians(50.0) / 0.12
    assert first == pytest.approx(10 + periods + 1, abs=1)


def test_bounds_can_be_set():
    watch = Guard(legs(), has_imu=True, bounds=Bounds(tilt=math.radians(10.0)))
    leaning = 9.81 * np.array([math.sin(0.3), 0.0, math.cos(0.3)])
    found = judge(watch, sensors(acceleration=leaning), seconds=0.1)
    assert found.kind is TroubleKind.FALL
