"""The fit finds what a simulated robot was made with, by its log alone."""

from dataclasses import replace

import numpy as np
import pytest
from exercise_log import LEAN, TRUE, log_of
from other_robots import with_legs
from servo_bench import RES
from small_build import few_steady_walks

from gaitchain.build.journal import Journal
from gaitchain.cli import identify, run
from gaitchain.errors import LogError
from gaitchain.gait.library_file import load_library, save_library
from gaitchain.identify import hung_fit, stand_fit
from gaitchain.identify.fit import Fit, fit_logs
from gaitchain.identify.hung_fit import HungFit
from gaitchain.identify.log import ExerciseLog, Measured, MotionLog, load_log, save_log
from gaitchain.identify.motion_fit import NOISE, Belief
from gaitchain.identify.parameters import OF_ZEROS, Parameters
from gaitchain.identify.sensor_rows import rms, weights_of
from gaitchain.identify.simulated import exercise_hidden, replay
from gaitchain.identify.stand_fit import EXPLAINED, StandFit
from gaitchain.live import exercise as exercises
from gaitchain.live.exercise import Motion, exercise
from gaitchain.messages import CONTROL_PERIOD_S
from gaitchain.robot.identified import UNSURE, Identified
from gaitchain.sim.robot_faults import unsure_fields
from gaitchain.sim.world import World

ROWS = 700


def quiet(stage, done, total):
    pass


@pytest.fixture(scope="module")
def swung():
    """Seven seconds of legs that swing."""
    held = exercise(RES)[0]
    return log_of(Motion("held", held.targets[:ROWS]))


@pytest.fixture(scope="module")
def found(swung):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(hung_fit, "CLIMBS", 20)
        patch.setattr(hung_fit, "REPLAYS", 64)
        patch.setattr(hung_fit, "SURE_REPLAYS", 80)
        return fit_logs(RES, [swung], 1, quiet)


@pytest.mark.slow
def test_what_swings_freely_tells_delay_play_and_loaded_gains(found):
    one = found.identified
    assert one.delay_s == pytest.approx(TRUE.delay_s, abs=0.003)
    np.testing.assert_allclose(one.backlash_deg, TRUE.backlash_deg, atol=0.15)
    loaded = [1, 2, 3, 7, 8, 9]
    np.testing.assert_allclose(one.gain[loaded], TRUE.gain[loaded], rtol=0.15)
    assert found.after[0] < 0.4 * found.before[0]


@pytest.mark.slow
def test_what_the_log_does_not_tell_is_said(found):
    told = {(n.parameter.name, n.parameter.of): n.told for n in found.numbers}
    assert told["delay_s", ""]
    assert not any(told["com", axis] for axis in "xyz"), "the trunk was held"
    left = found.identified.deviations
    assert left["com"] > 0.006
    assert 0.0 < left["gain"] < 0.3
    assert unsure_fields(RES.as_identified(found.identified))["doubt"] == 1.0


def test_what_is_unknown_is_that_of_each_number_in_its_own_unit(found):
    """In the order of the robot's joints, and of the axes."""
    said = [
        number.sd / number.parameter.prior.scale
        for name in UNSURE
        for number in found.numbers
        if number.parameter.name == name
    ]
    unknown = found.identified.unknown
    kept = np.sqrt(np.diag(unknown @ unknown.T))
    np.testing.assert_allclose(kept, said, rtol=1e-2, atol=1e-5)


def test_a_replay_shows_an_imu_that_is_late_between_its_rows():
    """Of whole periods it is that of a world; of half of one what lies between."""
    sway = exercise(RES)[1]
    short = Motion("standing", sway.targets[300:500])
    plain = Identified.of_file(12)

    def seen(late_s, world_s=0.0):
        robot = RES.as_identified(replace(plain, imu_delay_s=late_s))
        return replay(robot, short, LEAN, World(imu_delay_s=world_s))

    prompt, one, half = seen(0.0), seen(CONTROL_PERIOD_S), seen(0.5 * CONTROL_PERIOD_S)
    world = seen(0.0, CONTROL_PERIOD_S)
    for name in ("angular_velocity", "acceleration"):
        now, late = getattr(prompt, name), getattr(one, name)
        np.testing.assert_allclose(late, getattr(world, name), atol=1e-9)
        np.testing.assert_allclose(late[1:], now[:-1], atol=1e-9)
        between = 0.5 * (now[1:] + now[:-1])
        np.testing.assert_allclose(getattr(half, name)[1:], between, atol=1e-9)
    np.testing.assert_array_equal(one.joint_position, prompt.joint_position)


@pytest.fixture
def gentle_sway(monkeypatch):
    """Four seconds of a pelvis that moves a little, its soles on the same edges."""
    monkeypatch.setattr(exercises, "_AHEAD", 0.1)
    monkeypatch.setattr(exercises, "_ASIDE", 0.08)
    monkeypatch.setattr(exercises, "_TURN_RAD", (0.03, 0.03, 0.1))
    monkeypatch.setattr(exercises, "com_from_pelvis", lambda legs, found: np.zeros(3))
    motion = Motion("standing", exercise(RES)[1].targets[200:600])
    monkeypatch.undo()
    return motion


@pytest.mark.slow
def test_a_robot_that_stands_tells_zeros_and_its_com_by_smooth_slopes(
    gentle_sway, monkeypatch
):
    """Through half a degree of play, where the servos are known; and how well.

    In four seconds it does not tell how high the CoM is.
    """
    monkeypatch.setattr(stand_fit, "SMOOTH", 1)
    monkeypatch.setattr(stand_fit, "CLIMBS", 0)
    monkeypatch.setattr(StandFit, "rough", 1.0)
    parameters = Parameters(RES.legs.joint_names)
    sd = np.full(len(parameters.all), 0.02)
    sd[parameters.places("offset", "tilt", "com")] = 1.0
    true = parameters.without(np.zeros(len(sd)), "dry_friction", "stiction")
    true[parameters.places("offset")] = np.resize([0.7, -0.9, 0.4, 0.6, -0.8], 12)
    true[parameters.places("com")] = 0.8, -0.7, 0.5
    right = parameters.read(true)[0]
    motion = StandFit(RES, log_of(gentle_sway, right).parts[0], parameters, 1)
    belief = Belief(np.where(sd < 1.0, true, 0.0), np.diag(sd**2))
    monkeypatch.setattr(motion, "certainty", lambda found, belief: belief.covariance)
    found = motion.fit(belief, np.random.default_rng(0), lambda: None)[0]
    one, began = parameters.read(found)[0], parameters.read(belief.mean)[0]
    np.testing.assert_allclose(one.com[:2], right.com[:2], atol=0.004)
    np.testing.assert_allclose(one.offset, right.offset, atol=np.radians(0.8))
    missed = [motion.missed(RES.as_identified(r), LEAN) for r in (began, one)]
    before, after = (np.sqrt(np.mean(m[:, :12] ** 2)) for m in missed)
    assert after < 0.3 * before
    monkeypatch.undo()
    said = np.sqrt(np.diag(motion.certainty(found, belief)))
    zeros = parameters.places("offset")
    assert 0.2 < np.sqrt(np.mean(((found - true) / said)[zeros] ** 2)) < 1.0
    assert said[zeros].max() < 0.9


@pytest.mark.slow
def test_a_climb_goes_on_where_slopes_end(gentle_sway, monkeypatch):
    """To zeros within what they leave, of servos that have half a degree of play.

    Last digits decide which way it takes. From eight starts that differ by 1e-9 zeros
    end between 0.12 and 0.52 of where they began, 0.32 +- 0.12; what replays miss, at
    0.29 to 0.31 each time.
    """
    monkeypatch.setattr(stand_fit, "SMOOTH", 0)
    parameters = Parameters(RES.legs.joint_names)
    sd, rng = np.full(len(parameters.all), 0.02), np.random.default_rng(4)
    of_stand = parameters.places("offset", "tilt", "com", "trunk_mass")
    sd[of_stand] = 1.0
    true = parameters.without(np.zeros(len(sd)), "dry_friction", "stiction")
    log = log_of(gentle_sway, parameters.read(true)[0])
    motion = StandFit(RES, log.parts[0], parameters, 1)
    around = Belief(true, np.diag(sd**2))
    left = motion.certainty(true, around)
    far = true.copy()
    far[of_stand] = rng.multivariate_normal(true, left)[of_stand]
    monkeypatch.setattr(motion, "certainty", lambda found, belief: left)
    found = motion.fit(Belief(far, around.covariance), rng, lambda: None)[0]
    zeros = parameters.places("offset")
    began, ends = (np.linalg.norm((at - true)[zeros]) for at in (far, found))
    assert ends < 0.8 * began
    robots = [RES.as_identified(parameters.read(at)[0]) for at in (far, found)]
    began, ends = (np.std(motion.missed(robot, LEAN)[:, :12]) for robot in robots)
    assert ends < 0.4 * began
    np.testing.assert_array_equal(np.delete(found - far, of_stand), 0.0)


@pytest.mark.slow
def test_a_trunk_that_pitches_far_tells_how_high_its_com_is(gentle_sway):
    """In four seconds, of servos that are known, what a gentle sway does not."""
    parameters = Parameters(RES.legs.joint_names)
    sd = np.full(len(parameters.all), 0.02)
    sd[parameters.places("offset", "tilt", "com")] = 1.0
    belief = Belief(np.zeros(len(sd)), np.diag(sd**2))
    right = parameters.read(belief.mean)[0]
    whole, said = Motion("standing", exercise(RES)[1].targets[200:600]), []
    for sway in (whole, gentle_sway):
        motion = StandFit(RES, log_of(sway, right).parts[0], parameters, 1)
        covariance = motion.certainty(belief.mean, belief)
        said.append(np.sqrt(np.diag(covariance))[parameters.places("com")])
    assert (said[0] < 0.9 * said[1]).all()
    assert said[0][2] < 0.6 * said[1][2]


@pytest.mark.slow
def test_a_robot_that_stands_tells_how_late_its_imu_is(gentle_sway, monkeypatch):
    """Where all else is known, floor included; one round of replays."""
    monkeypatch.setattr(StandFit, "rough", 1.0)
    parameters = Parameters(RES.legs.joint_names)
    size = len(parameters.all)
    (own,) = [i for i, p in enumerate(parameters.all) if p.name == "imu_delay_s"]
    start, known = np.zeros(size), np.full(size, 1e-4)
    known[own] = 1.0
    believed = parameters.read(start)[0]
    log = log_of(gentle_sway, replace(believed, imu_delay_s=0.02))
    motion = StandFit(RES, log.parts[0], parameters, 1)
    belief, rng = Belief(start, np.diag(known**2)), np.random.default_rng(0)
    found = motion.improve(start, belief, rng)
    covariance = motion.certainty(found, belief)
    assert parameters.read(found)[0].imu_delay_s == pytest.approx(0.02, abs=0.003)
    assert np.sqrt(covariance[own, own]) < 0.3


def test_where_every_replay_falls_that_is_said():
    """Of a file whose trunk is too far ahead to stand."""
    ahead = RES.legs.trunk_com + np.array([0.3, 0.0, 0.0])
    other = with_legs(RES, replace(RES.legs, trunk_com=ahead))
    parameters = Parameters(RES.legs.joint_names)
    size = len(parameters.all)
    sway = Motion("standing", exercise(RES)[1].targets[200:400])
    log = log_of(sway, parameters.read(np.zeros(size))[0])
    motion = StandFit(other, log.parts[0], parameters, 1)
    belief = Belief(np.zeros(size), 1e-4 * np.eye(size))
    with pytest.raises(LogError, match="every replay of the log falls"):
        motion.certainty(belief.mean, belief)


def test_the_damping_of_servos_that_have_none_stays_unknown(monkeypatch):
    """As OP3's, whose file gives all of it to the joints."""
    robot = with_legs(RES, replace(RES.legs, joint_damping=RES.legs.damping))
    names, count = robot.legs.joint_names, len(robot.legs.joint_names)
    seen = Motion("held", exercise(robot)[0].targets[100:300])
    softer = replace(Identified.of_file(count), gain=np.full(count, 0.8))
    part = MotionLog(seen, replay(robot.as_identified(softer), seen, LEAN, World()))
    log = ExerciseLog(robot.name, robot.fingerprint, names, CONTROL_PERIOD_S, (part,))
    monkeypatch.setattr(hung_fit, "CLIMBS", 3)
    monkeypatch.setattr(hung_fit, "REPLAYS", 40)
    monkeypatch.setattr(hung_fit, "SURE_REPLAYS", 76)
    found = fit_logs(robot, [log], 1, quiet)
    np.testing.assert_array_equal(found.identified.damping, np.ones(count))
    damping = [n for n in found.numbers if n.parameter.name == "damping"]
    assert not any(number.told for number in damping)
    assert any(n.told for n in found.numbers if n.parameter.name == "gain")


def test_what_the_right_numbers_leave_is_noise(swung):
    """And with a degree more of play of one joint it is not."""
    parameters = Parameters(RES.legs.joint_names)
    right = np.zeros(len(parameters.all))
    found, lean = parameters.read(right)
    motion = swung.parts[0].motion
    seen = replay(RES.as_identified(found), motion, lean, World(noise=1.0))
    fitted = HungFit(RES, MotionLog(motion, seen), parameters, 1)
    assert fitted.alike(right) < NOISE
    wrong = right.copy()
    wrong[parameters.places("backlash_deg")[2]] += 2.0
    assert fitted.alike(wrong) > EXPLAINED


def test_joints_of_one_make_are_believed_to_be_alike():
    """What is drawn has the correlation that is believed; its parts are as said."""
    parameters = Parameters(RES.legs.joint_names)
    of = [p.name for p in parameters.all]
    play, gain = of.index("backlash_deg"), of.index("gain")
    common, own = parameters.draw(20_000, np.random.default_rng(0))
    drawn = np.corrcoef((common + own).T)
    np.testing.assert_allclose(drawn, parameters.correlation(), atol=0.04)
    assert parameters.correlation()[play, play + 1] == 0.9
    np.testing.assert_allclose((common + own).std(axis=0), 1.0, atol=0.03)
    np.testing.assert_array_equal(common[:, play], common[:, play + 1])
    assert not own[:, gain].any()


def test_of_zeros_hung_legs_tell_nothing(found):
    """As the trunk's attitude would tell the same; servos are told all the same."""
    zeros = [n for n in found.numbers if n.parameter.name in OF_ZEROS]
    assert all(n.value == 0.0 and not n.told for n in zeros)


def test_logs_of_others_are_refused(swung):
    other = replace(swung, fingerprint="0123456789abcdef")
    with pytest.raises(LogError, match="give a log of that robot"):
        fit_logs(RES, [swung, other], 1, quiet)
    with pytest.raises(LogError, match="a replay needs one every 10 ms"):
        fit_logs(RES, [replace(swung, period_s=0.004)], 1, quiet)


def test_a_log_with_gaps_is_refused(swung):
    """As where the computer was held up, and periods were left out."""
    part, times = swung.parts[0], swung.parts[0].measured.time_s.copy()
    times[300:] += 0.05
    gap = replace(part, measured=replace(part.measured, time_s=times))
    with pytest.raises(LogError, match="up to 50 ms late, at most 30 ms can be fitted"):
        fit_logs(RES, [replace(swung, parts=(gap,))], 1, quiet)


def test_residuals_that_are_alike_count_as_few():
    rng = np.random.default_rng(0)
    white = rng.normal(size=(4000, 18))
    alike = np.repeat(white[:40], 100, axis=0)
    present = np.ones(white.shape, dtype=bool)
    many, few = weights_of(white, present), weights_of(alike, present)
    np.testing.assert_allclose(many[:12], 1.0, rtol=0.25)
    assert (few < 0.35 * many).all()


def test_rows_without_a_sensor_are_no_small_residuals():
    rng = np.random.default_rng(0)
    present = rng.random((4000, 18)) < 0.1
    table = np.where(present, rng.normal(size=present.shape), 0.0)
    np.testing.assert_allclose(weights_of(table, present), 1.0, rtol=0.35)


def motion_with(swung, **sensors):
    """Return the fit's motion of a log with other columns."""
    seen = replace(swung.parts[0].measured, **sensors)
    part = replace(swung.parts[0], measured=seen)
    return HungFit(RES, part, Parameters(RES.legs.joint_names), 1)


def test_a_missing_imu_says_nothing(swung):
    nothing = np.full((ROWS, 3), np.nan)
    blind = motion_with(swung, angular_velocity=nothing, acceleration=nothing)
    missed = blind.missed(RES, np.zeros(2))
    assert np.isfinite(missed[:, :12]).all()
    assert np.isnan(missed[:, 12:]).all()


def test_a_lost_packet_of_the_imu_is_one_row(swung):
    """The gyro's mean is that of the rows that came."""
    gyro = swung.parts[0].measured.angular_velocity.copy()
    gyro[100:200] = np.nan
    missed = motion_with(swung, angular_velocity=gyro).missed(RES, np.zeros(2))
    assert np.isnan(missed[100:200, 12:15]).all()
    there = np.delete(missed, np.arange(100, 200), axis=0)
    assert np.isfinite(there).all()
    np.testing.assert_allclose(there[:, 12:15].mean(axis=0), 0.0, atol=1e-12)


def test_what_is_missed_is_that_of_rows_that_came(capsys):
    """None of a sensor that the log does not have, and that is said."""
    missed = np.full((ROWS, 18), np.nan)
    missed[:, :12] = 0.01
    missed[::4, 12:15] = 0.2
    before, after = rms([missed]), rms([missed, missed])
    np.testing.assert_allclose(after[:2], [0.01, 0.2])
    assert after[2] is None
    shown = Fit(TRUE, (), before, after, (("held", missed, missed),))
    assert shown.present == (1.0, 0.25, 0.0)
    identify._show("RES", shown)
    said = capsys.readouterr()
    said = (said.out + said.err).replace("\n", " ")
    assert "0.2 with these (RMS); only 25% of the rows have it" in said
    assert "accelerometer: none in the log" in said


def interrupted_after_the_fit():
    """Return what adds to a journal, and is interrupted before the first walk."""
    add = Journal.add

    def adds(self, piece):
        (_, name, *_), _ = piece
        if name != "round":
            raise KeyboardInterrupt
        add(self, piece)

    return adds


@pytest.mark.slow
def test_a_library_is_fitted_by_the_command_line(tmp_path, monkeypatch, capsys):
    """To the log of a robot like its file; its steps are walked anew, a few.

    Interrupted there it has shown the fit, and goes on with the same one.
    """
    monkeypatch.setattr(hung_fit, "SEARCHES", 1)
    monkeypatch.setattr(hung_fit, "CLIMBS", 0)
    monkeypatch.setattr(hung_fit, "REPLAYS", 60)
    monkeypatch.setattr(hung_fit, "SURE_REPLAYS", 76)
    fits, adapt = [], identify.adapt
    monkeypatch.setattr(
        identify, "adapt", lambda *given: fits.append(given[1]) or adapt(*given)
    )
    log, plain = tmp_path / "a.log", tmp_path / "plain.gait"
    held = exercise(RES)[0]
    short = Motion("held", held.targets[100:300])
    swung = log_of(short, replace(Identified.of_file(12), delay_s=0.01))
    swung.parts[0].measured.turnaround_s[:] = 0.004
    swung.parts[0].measured.turnaround_s[:80] = np.nan, *np.full(79, 0.02)
    save_log(swung, log)
    shipped = load_library("src/gaitchain/data/res.gait")
    few = replace(shipped.config, gate_runs=2, gate_share=0.5)
    save_library(replace(shipped, config=few), plain)
    out, picture = tmp_path / "mine.gait", tmp_path / "fit.png"
    words = ["identify", str(plain), str(log), "-o", str(out), "--workers", "1"]
    words += ["--picture", str(picture)]
    with monkeypatch.context() as patch:
        patch.setattr(Journal, "add", interrupted_after_the_fit())
        assert run(words) == 130
    assert picture.stat().st_size > 10_000
    said = capsys.readouterr().out.replace("\n", " ")
    assert "backlash" in said
    assert "of the delay, 4.0 ms are the bus's" in said
    assert "replay misses the joints by" in said
    assert "mine.gait.identify.jsonl: what is finished; the same command" in said
    assert not out.exists()
    for work in ("_selected", "certainty"):
        again = lambda *given: pytest.fail("fitted again")  # noqa: E731
        monkeypatch.setattr(HungFit, work, again)
    with few_steady_walks():
        assert run(words) in (0, 1)
    assert "going on after" in capsys.readouterr().out
    same = [(f.identified, f.numbers, f.before, f.after) for f in fits]
    assert same[0] == same[1]
    assert not list(tmp_path.glob("*.jsonl"))
    mine = load_library(out, RES)
    assert mine.robot.identified == fits[0].identified
    assert mine.robot.identified.turnaround_s == 0.004
    assert mine.qualification.gate is not None
    assert run(["inspect", str(out)]) == 0


def test_the_help_says_what_is_not_estimated(capsys):
    with pytest.raises(SystemExit):
        run(["identify", "--help"])
    said = " ".join(capsys.readouterr().out.split())
    assert "static and viscous friction, one number for all servos" in said
    assert "Not estimated: the masses of the legs, which stay as in the file" in said


@pytest.mark.parametrize("content", [b"", b"no log at all", None])
def test_no_log_is_no_traceback(content, tmp_path, capsys):
    path = tmp_path / "a.log"
    if content is not None:
        path.write_bytes(content)
    assert run(["identify", "res", str(path), "-o", str(tmp_path / "b.gait")]) == 2
    assert "a.log" in capsys.readouterr().err


def test_no_file_is_written_over_another_of_the_command(swung, tmp_path, capsys):
    path, out = tmp_path / "a.log", str(tmp_path / "b.gait")
    save_log(swung, path)
    before = path.read_bytes()
    assert run(["identify", "res", str(path), "-o", str(path)]) == 2
    assert "a.log: named twice" in capsys.readouterr().err
    copy = tmp_path / "copy.log"
    copy.write_bytes(before)
    for other in (path, copy):
        assert run(["identify", "res", str(path), str(other), "-o", out]) == 2
        said = f"{other}: the same log as {path}; it tells things only once"
        assert said in capsys.readouterr().err
    words = ["identify", "res", str(path), "-o", out, "--json", out]
    assert run(words) == 2
    assert "b.gait: named twice" in capsys.readouterr().err
    words = ["calibrate", "res", "--robot-hidden", "1", "--exercise", out]
    assert run([*words, "--preview", out]) == 2
    assert "b.gait: named twice" in capsys.readouterr().err
    assert run(["identify", "res", str(path), "-o", str(copy)]) == 2
    said = "the log of an exercise; name another file for the library"
    assert said in capsys.readouterr().err
    assert copy.read_bytes() == before
    assert path.read_bytes() == before


def test_a_picture_of_another_kind_is_refused_before_any_work(swung, tmp_path, capsys):
    path = tmp_path / "a.log"
    save_log(swung, path)
    words = ["identify", "res", str(path), "-o", str(tmp_path / "b.gait")]
    for name in ("fit.jpg", "fit"):
        assert run([*words, "--picture", str(tmp_path / name)]) == 2
        assert "pictures are PNG; name it fit.png" in capsys.readouterr().err
    assert run(["push", "res", "-o", str(tmp_path / "push.svg")]) == 2
    assert "name it push.png" in capsys.readouterr().err


@pytest.mark.slow
def test_help_says_that_logs_are_needed(capsys):
    with pytest.raises(SystemExit, match="0"):
        run(["identify", "--help"])
    out = " ".join(capsys.readouterr().out.split())
    assert "LIBRARY LOG [LOG ...]" in out
    assert "[PATH" not in out


def test_the_command_line_writes_the_hidden_robots_log(tmp_path):
    path = tmp_path / "a.log"
    words = ["calibrate", "res", "--exercise", str(path), "--robot-hidden", "4"]
    assert run(words) == 0
    one, other = load_log(path), exercise_hidden(RES, 4)
    for part, same in zip(one.parts, other.parts, strict=True):
        for name, column in vars(part.measured).items():
            np.testing.assert_array_equal(column, getattr(same.measured, name))


def test_measured_rows_are_arrays(swung):
    assert isinstance(swung.parts[0].measured, Measured)
    assert swung.seconds == pytest.approx(ROWS * CONTROL_PERIOD_S)
