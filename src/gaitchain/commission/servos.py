"""Bus and ids, directions, offsets: whether the servos are those of the calibration."""

from collections.abc import Sequence

import numpy as np

from gaitchain.backends.servos.bus import ServoBus
from gaitchain.backends.servos.bus_load import BusLoad
from gaitchain.backends.servos.guide import joint_words
from gaitchain.backends.servos.make import make_named
from gaitchain.commission.bench import Bench, Fault, Verdict, no_go
from gaitchain.commission.lateness import lateness
from gaitchain.errors import BackendError
from gaitchain.live.exercise import swing
from gaitchain.live.joint_mover import JointMover
from gaitchain.messages import Array

_WIGGLE_DEG, _SPEED = 8.0, 0.5  # of one joint, rad/s
_LEAST_MOVED, _MOST_OTHERS = 0.5, 0.35  # parts of the wiggle
_HOLD_S = 0.3
_MOST_OFF_DEG = 4.0  # between target and encoder of a leg that hangs
_SCAN_PATIENCE_S = 0.05
_LOOK = {
    True: (
        "Are both legs straight, feet side by side, toes ahead, soles level, within a "
        "degree or two?"
    ),
    False: "Does the robot stand as its library does, soles level, knees equal?",
}
_SIGN = (
    "in the calibration, change the sign of a joint that went the other way, and the "
    "ids of joints that moved for each other; or calibrate again"
)
_BLOCKED = "see whether it rubs or is blocked; raise its pwm_limit a little"
_IDS = "look in the calibration whether ids are those of other joints"
_TOGETHER = f"see whether something ties these joints; {_IDS}"


def check_bus(bench: Bench) -> Verdict:
    """Find every servo with its model and mode; all torques are turned off."""
    try:
        with bench.robot() as backend:
            load = backend.load
            heats = backend.temperatures()
    except BackendError as error:
        strangers = _strangers(bench)
        others = f"; {strangers}" if strangers else ""
        todo = f"mend that, and begin again; {bench.torque}"
        return Verdict("no-go", f"{error}{others}", todo)
    return _in_time(bench, load, len(heats))


def _in_time(bench: Bench, load: BusLoad, count: int) -> Verdict:
    """Judge a sound bus by its bytes and by how late answers come.

    Args:
        bench: the bench, its servos no longer connected.
        load: packets of a control period.
        count: number of servos.
    """
    late = lateness(bench)
    how = "fast sync reads" if load.fast else "sync reads"
    said = (
        f"{count} servos as calibrated, torque off; {how}, by their bytes "
        f"{1e3 * load.period_s:.1f} of {1e3 * bench.period_s:.1f} ms of each period on "
        f"the bus; {late.said or 'how late answers come is not known'}"
    )
    figures = {
        "servos": count,
        "fast_sync_read": load.fast,
        "bus_ms": 1e3 * load.period_s,
        "answer_ms": 1e3 * late.load.turn_s if late.known else None,
    }
    if late.full:
        return Verdict("no-go", said, f"{late.todo}; then begin again", figures)
    return Verdict("go", said, measured=figures)


def _strangers(bench: Bench) -> str:
    """Say which ids answer that the calibration does not name."""
    known = {joint.id for joint in bench.calibration.joints.values()}
    if bench.calibration.imu is not None:
        known.add(bench.calibration.imu.id)
    bus = ServoBus(
        bench.port,
        bench.calibration.baud,
        _SCAN_PATIENCE_S,
        make=make_named(bench.calibration.make),
    )
    try:
        bus.open()
        others = [number for number in bus.scan() if number not in known]
    except BackendError:
        return ""
    finally:
        bus.close()
    if not others:
        return ""
    return f"id {', '.join(map(str, others))} answers, which no joint has"


def check_directions(bench: Bench) -> Verdict:
    """Turn joint after joint by 8 deg: by the encoders, and by the person's eyes."""
    words = joint_words(bench.library.robot.legs)
    wrong: list[Fault] = []
    moved_deg: dict[str, float] = {}
    with bench.robot() as backend:
        robot = bench.within(backend)
        rest, upper = swing(robot).targets[0], np.asarray(robot.legs.upper)
        mover = bench.mover(backend, "the wiggle")
        mover.begin()
        mover.go(rest)
        for joint, (name, how) in enumerate(words.items()):
            bench.progress("joints wiggle", joint + 1, len(words))
            bench.screen.point(joint, name)
            turned, way = _wiggle(mover, joint, rest, upper)
            moved_deg[name] = float(way * turned[joint])
            found = _by_encoders(list(words), joint, way * turned)
            found = found or _by_eyes(bench, mover, (name, how), way)
            if found:
                wrong.append(found)
        bench.screen.clear()
    figures = {"moved_deg": moved_deg, "seen": bench.person.present}
    if wrong:
        return no_go(wrong, figures)
    eyes = "seen" if bench.person.present else "by the encoders alone: nobody looked"
    said = f"each of {len(words)} joints moved alone and the right way, {eyes}"
    return Verdict("go", said, measured=figures)


def _wiggle(
    mover: JointMover, joint: int, rest: Array, upper: Array
) -> tuple[Array, int]:
    """Turn one joint there and back twice.

    Returns:
        (2 n,) by how much the joints were turned [deg], and which way was asked for.
    """
    size = np.radians(_WIGGLE_DEG)
    way = 1 if rest[joint] + size <= upper[joint] else -1
    there = rest.copy()
    there[joint] += way * size
    before = mover.hold(_HOLD_S)
    mover.go(there, _SPEED)
    after = mover.hold(_HOLD_S)
    for goal in (rest, there, rest):
        mover.go(goal, _SPEED)
    return np.degrees(after - before), way


def _by_encoders(names: Sequence[str], joint: int, turned: Array) -> Fault | None:
    """Say what the encoders show that should not be.

    Args:
        names: of the joints.
        joint: which one was to turn.
        turned: (2 n,) by how much each turned, in the way that was asked for [deg].
    """
    name, others = names[joint], np.abs(turned)
    if not turned[joint] >= _LEAST_MOVED * _WIGGLE_DEG:
        return Fault(
            f"{name} turned by {turned[joint]:.1f} of {_WIGGLE_DEG:g} deg: blocked, "
            "too weak for its torque limit, or not the servo of this id",
            f"{_BLOCKED}; {_IDS}",
        )
    others[joint] = 0.0
    most = int(np.nanargmax(others))
    if others[most] > _MOST_OTHERS * _WIGGLE_DEG:
        said = f"with {name} {names[most]} turned by {others[most]:.1f} deg, too"
        return Fault(said, _TOGETHER)
    return None


def _by_eyes(
    bench: Bench, mover: JointMover, words: tuple[str, str], way: int
) -> Fault | None:
    """Say that the person saw something else.

    Args:
        bench: the bench.
        mover: holds the robot while the person is asked.
        words: name of the joint, and how it goes up.
        way: +1 if it went up, -1 if it went down.
    """
    (name, how), other = words, "" if way > 0 else "the other way round, "
    asked = f"{name} went and came back twice. Did it {other}{how}?"
    if bench.person.confirms(asked, mover.stay):
        return None
    return Fault(f"{name}: not as it should ({how})", _SIGN)


def check_offsets(bench: Bench) -> Verdict:
    """Bring the hung legs to a pose that a person can judge: straight, or standing."""
    with bench.robot() as backend:
        legs = bench.within(backend).legs
        straight = bool(np.all((legs.lower <= 0.0) & (legs.upper >= 0.0)))
        pose = np.zeros(len(legs.joint_names)) if straight else np.asarray(legs.stand)
        mover = bench.mover(backend, "the check of the offsets")
        mover.begin()
        mover.go(pose)
        off = np.degrees(mover.hold(2.0 * _HOLD_S) - mover.target)
        worst = int(np.nanargmax(np.abs(off)))
        if abs(off[worst]) > _MOST_OFF_DEG:
            return _stays_off(legs.joint_names[worst], float(off[worst]))
        seen = bench.person.confirms(_LOOK[straight], mover.stay)
    figures = {"worst_deg": float(off[worst]), "seen": bench.person.present}
    if not seen:
        todo = "calibrate again, or correct the offset of the joint that is off"
        which = "of joint angles 0" if straight else "in which the library stands"
        return Verdict("no-go", f"the pose is not the one {which}", todo, figures)
    eyes = "" if bench.person.present else "; nobody looked: the zeros are not checked"
    said = f"joints within {abs(off[worst]):.1f} deg of their targets{eyes}"
    return Verdict("go", said, measured=figures)


def _stays_off(name: str, off_deg: float) -> Verdict:
    """Return the verdict on a joint that does not get to its target."""
    return Verdict(
        "no-go",
        f"{name} stays {off_deg:.1f} deg from its target, at most {_MOST_OFF_DEG:g}",
        _BLOCKED,
        {"worst_deg": off_deg},
    )
