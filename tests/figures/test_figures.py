"""The numbers behind the figures, not their pixels."""

import json
import subprocess
import sys
from contextlib import contextmanager
from dataclasses import replace
from itertools import pairwise, product
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from gaitchain.analysis.simulated_walk import run_schedule
from gaitchain.analysis.walk_metrics import percent, zmp_margins
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.cli import figures, run
from gaitchain.errors import CommandError, GaitchainError, RenderError
from gaitchain.figures import snapshots
from gaitchain.figures import walk as overview
from gaitchain.figures.chain import figure_6, figure_7, regret_table
from gaitchain.figures.footing import figure_11
from gaitchain.figures.joints import figure_8
from gaitchain.figures.robustness import plot_pass_rates, plot_pushes
from gaitchain.figures.snapshots import figure_9, stand_on_floor
from gaitchain.figures.steps import outline, step_plan, walked_steps
from gaitchain.figures.sticks import figure_10
from gaitchain.figures.style import drawing
from gaitchain.figures.walk import plot_walk
from gaitchain.gait.family import STAND
from gaitchain.gait.qualification import CellReport
from gaitchain.gait.schedule import Segment
from gaitchain.gait.zmp import to_world
from gaitchain.messages import Command
from gaitchain.robot.box_robot import JOINT_NAMES, load_box_robot
from gaitchain.robot.kinematics import points
from gaitchain.sim.model import build_model
from gaitchain.walker.walker import Walker


def test_names_in_any_script_are_drawn_without_a_word(tmp_path):
    """Warnings are errors here; no font that comes with matplotlib has Chinese."""
    with drawing(tmp_path / "name.png", 2.0, 1.0) as figure:
        figure.suptitle("\u673a\u5668\u4eba")
    assert (tmp_path / "name.png").stat().st_size > 500


@pytest.fixture(scope="module")
def walk(library):
    speed = sum(library.speed_range) / 2.0
    schedule = (
        Segment(Command(speed), steps=1),
        Segment(Command(speed), steps=4),
        Segment(Command(speed), steps=1),
    )
    walker = Walker(library, require_qualified=False)
    return run_schedule(walker, MujocoBackend(library.robot), schedule), schedule


@pytest.fixture(scope="module")
def record(walk):
    return walk[0]


@pytest.fixture(scope="module")
def six(tmp_path_factory):
    out = tmp_path_factory.mktemp("six")
    return figure_6(out), out


@pytest.fixture(scope="module")
def seven(tmp_path_factory):
    out = tmp_path_factory.mktemp("seven")
    return figure_7(out), out


def written(out, name, result):
    """Check the pair of files of a figure."""
    data = json.loads((out / f"{name}.json").read_text(encoding="utf-8"))
    assert data == result
    assert data["ours"]
    assert data["paper"]["text"]
    picture(out / f"{name}.png")


def picture(path):
    data = path.read_bytes()
    assert data.startswith(b"\x89PNG")
    assert len(data) > 20_000


@pytest.mark.slow
def test_fig_6_has_its_files_and_keys(six):
    result, out = six
    written(out, "fig06", result)
    assert result["epsilon"] == [round(1 + 0.2 * i, 1) for i in range(11)]
    assert (result["seeds"], result["samples"]) == (20, 100)
    for base in ("log_base_10", "log_base_2"):
        assert len(result[base]["layer2"]) == len(result[base]["layer3"]) == 11
    assert result["independent_gaits_at_eps_3"] >= 1


@pytest.mark.slow
@pytest.mark.parametrize(("layer", "most_at_3"), [("layer2", 7), ("layer3", 5)])
def test_fig_6_keeps_nearly_all_at_1_and_falls_between_2_and_3(six, layer, most_at_3):
    kept = dict(zip(six[0]["epsilon"], six[0][layer], strict=True))
    assert kept[1.0] >= 9.0
    falling = [kept[e] for e in (2.0, 2.2, 2.4, 2.6, 2.8, 3.0)]
    assert np.all(np.diff(falling) < 0.0)
    assert kept[3.0] <= most_at_3


@pytest.mark.slow
def test_fig_6_keeps_more_the_smaller_the_base_makes_a_distance(six):
    # One distance in base b is the natural one divided by ln b.
    for layer in ("layer2", "layer3"):
        ten, e, two = (
            np.array(r[layer])
            for r in (six[0]["log_base_10"], six[0], six[0]["log_base_2"])
        )
        assert np.all(ten <= e)
        assert np.all(e <= two)


def test_fig_7_rises_with_the_samples(seven):
    result, out = seven
    written(out, "fig07", result)
    assert result["samples"] == [20, 70, 120, 170, 220, 270, 320, 370, 400]
    for layer in ("layer2", "layer3"):
        kept = result[layer]
        assert kept[0] < kept[1] < kept[2]
        assert min(kept[3:]) > kept[1]
        assert kept[-1] >= 8.0


@pytest.mark.slow
def test_looking_ahead_regrets_little_once_the_gaits_are_known(tmp_path):
    result = regret_table(tmp_path)
    assert json.loads((tmp_path / "regret.json").read_text()) == result
    few, many = (result["regret"][n] for n in ("100", "2000"))
    assert many["look_ahead"]["mean"] <= 0.05
    for policy in ("greedy", "look_ahead"):
        assert many[policy]["mean"] < few[policy]["mean"]
    assert result["gaits"] == 2500


def test_no_seeds_is_an_error(tmp_path):
    with pytest.raises(CommandError, match="0 seeds"):
        figure_6(tmp_path, seeds=0)


def test_a_figure_that_cannot_be_written_is_an_error(tmp_path):
    (tmp_path / "taken").touch()
    with pytest.raises(CommandError, match="cannot be written"):
        figure_7(tmp_path / "taken", seeds=1)


def test_nothing_to_draw_is_an_error(tmp_path):
    with pytest.raises(CommandError, match=r"a\.png: no pushes to draw"):
        plot_pushes([], "RES", 71.0, tmp_path / "a.png")
    unwalked = CellReport("nominal", "nominal", True, (), 0, 0, {}, (0, 0))
    for cells in ([], [unwalked]):
        with pytest.raises(CommandError, match=r"a\.png: no walks to draw"):
            plot_pass_rates(cells, "RES", tmp_path / "a.png")


def test_importing_the_figures_loads_no_matplotlib():
    code = (
        "import sys, gaitchain.cli.figures, gaitchain.cli.walk, gaitchain.cli.push;"
        "sys.exit('matplotlib' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_steps_follow_the_record(record, library):
    steps = walked_steps(record)
    timing = library.timing
    for step in steps:
        times = record.time_s[list(step.moments[:3])] - record.time_s[step.moments[0]]
        assert times == pytest.approx(timing.key_times[:3], abs=1e-9)
        assert step.left_support == (step.number % 2 == 1)
        q = [library.poses.q[layer][n] for layer, n in enumerate(step.gait)]
        assert np.all(np.isfinite(q))
    for before, after in pairwise(steps):
        assert before.gait[-1] == after.gait[0]  # kp_4 is the next kp_1


def planned(*steps):
    """Rows of a walk: of each step its poses of kp_2 to kp_4, then rows of standing."""
    moving, support, ticks = [], [], [0]
    for number, (poses, stands) in enumerate(steps):
        for layer, pose in enumerate(poses, start=1):
            moving += 10 * [(layer, pose)]
        support += len(poses) * 10 * [("ls", "rs")[number % 2]] + stands * ["stand"]
        moving += stands * [(0, STAND)]
        ticks.append(len(moving))
    return SimpleNamespace(
        time_s=0.01 * np.arange(len(moving)),
        key_pose=np.array(moving),
        support=np.array(support),
        step_ticks=tuple(ticks),
    )


def test_a_walk_that_stops_on_its_way_has_all_its_steps():
    """The last one before the stop was lost, and the next one began where it had."""
    walk = ((4, 8, 12), 0), ((8, 1, 2), 0), ((2, 3, 5), 6), ((7, 8, 9), 0)
    found = walked_steps(planned(*walk))
    assert [step.gait for step in found] == [
        (0, 4, 8, 12),
        (12, 8, 1, 2),
        (2, 2, 3, 5),
        (0, 7, 8, 9),
    ]
    assert [step.moments[-1] for step in found] == [30, 60, 90, 126]
    assert [step.number for step in found] == [1, 2, 3, 4]


def test_after_a_step_that_was_not_finished_a_walk_begins_anew():
    found = walked_steps(planned(((4, 8, 12), 0), ((8, 1), 0), ((2, 3, 5), 0)))
    assert [step.gait for step in found] == [(0, 4, 8, 12), (0, 2, 3, 5)]


def test_no_finished_step_is_an_error(record):
    short = replace(record, time_s=record.time_s[:10])
    with pytest.raises(CommandError, match="no finished step"):
        walked_steps(short)


def test_the_planned_swing_foot_lands_where_the_plan_is_moved_to(record, library):
    """Both feet of the plan, moved with the support foot, are near the real ones."""
    step = walked_steps(record)[0]
    pose = library.poses.q[3][step.gait[3]]
    ankle = points(library.robot.reduced, pose)[-1, :2]
    row = step.moments[3] - 1
    moved = to_world(ankle, record.feet[row, step.support_foot], step.left_support)
    real = record.feet[row, 1 - step.support_foot, :2]
    assert np.linalg.norm(moved - real) < 0.05


def test_both_plans_agree_at_the_key_moments_of_a_smooth_gait(record, library):
    """The interpolation passes the mean of the two accelerations' ZMPs."""
    step, times = walked_steps(record)[0], np.array(library.timing.key_times)
    before, _ = step_plan(library, step, times[1:3] - 1e-9)
    after, _ = step_plan(library, step, times[1:3] + 1e-9)
    _, fast = step_plan(library, step, times[1:3])
    assert fast == pytest.approx(0.5 * (before + after), abs=0.01)


def test_fig_8_stays_within_the_limits(tmp_path, record, library):
    result = figure_8(tmp_path, record, library.robot)
    written(tmp_path, "fig08", result)
    assert set(result["angle_deg"]) == set(JOINT_NAMES)
    assert all(len(a) == len(result["time_s"]) for a in result["angle_deg"].values())
    assert result["max_angle_deg"] <= 80.0
    assert result["max_speed_deg_s"] <= 150.0
    most = np.degrees(np.abs(record.joint_position).max())
    assert result["max_angle_deg"] == pytest.approx(most, abs=0.01)


def test_fig_9_shows_the_zmp(tmp_path, record, library):
    try:
        result = figure_9(tmp_path, record, library.robot)
    except RenderError as error:  # no GL library
        pytest.skip(str(error))
    written(tmp_path, "fig09", result)
    assert len(result["time_s"]) == len(result["zmp_m"]) >= 3
    assert result["key_moment"][:3] == ["kp_1", "kp_2", "kp_3"]


def test_fig_9_without_opengl_says_what_to_install(
    tmp_path, record, library, monkeypatch
):
    def missing():
        raise ImportError("no EGL")

    monkeypatch.setattr(snapshots, "_gl_class", missing)
    with pytest.raises(GaitchainError, match="libegl1 libopengl0 libgl1-mesa-dri"):
        figure_9(tmp_path, record, library.robot)


def test_a_figure_that_is_missing_alone_is_an_error(tmp_path, monkeypatch, capsys):
    def missing():
        raise RenderError("no OpenGL")

    monkeypatch.setattr(figures, "_walk_jobs", lambda *of: {9: missing})
    words = ["figures", "--out", str(tmp_path), "--seeds", "2"]
    assert run([*words, "--only", "9"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.endswith("gaitchain: no OpenGL\n")
    assert run([*words, "--only", "6,9"]) == 0  # the others need none
    assert "Fig. 9 is missing: no OpenGL" in capsys.readouterr().out


def test_fig_10_shows_the_gait(tmp_path, record, library):
    gait = walked_steps(record)[-1].gait
    result = figure_10(tmp_path, library, gait)
    written(tmp_path, "fig10", result)
    feet = [library.poses.foot_x[layer][n] for layer, n in enumerate(gait)]
    path = np.array(result["swing_ankle_path_m"])
    assert path[[0, -1], 0] == pytest.approx([feet[0], feet[3]], abs=1e-4)
    assert result["sway_deg"][1] == max(result["sway_deg"])


@pytest.mark.parametrize(
    "gait", [(0, 0, 0), (0, 0, 0, 99), (0, 0.5, 0, 0), (0, 1.0, 0, 0)]
)
def test_fig_10_refuses_a_gait_that_is_not_there(tmp_path, library, gait):
    with pytest.raises(CommandError, match="one pose per key moment"):
        figure_10(tmp_path, library, gait)


def test_fig_11_counts_what_the_margins_say(tmp_path, record, library):
    result = figure_11(tmp_path, record, library)
    written(tmp_path, "fig11", result)
    steps = [s for s in walked_steps(record) if s.number in (2, 3, 4, 5)]
    rows = slice(steps[0].rows.start, steps[-1].rows.stop)
    margins = zmp_margins(library.robot, record)[rows]
    assert result["fraction_inside"] == pytest.approx(np.mean(margins >= 0), abs=1e-4)
    expected = ["rs", "rl", "ls", "lr"] * 2
    assert result["support_sequence"] == expected[: len(result["support_sequence"])]
    assert result["interpolated_to_multi_link_rms_mm"] > 0.0
    assert list(result["margin_quantiles_mm"].values()) == sorted(
        result["margin_quantiles_mm"].values()
    )


def test_the_overview_shows_a_walk_and_a_fall(tmp_path, walk, library):
    record, schedule = walk
    plot_walk(record, library.robot, schedule, tmp_path / "walk.png")
    picture(tmp_path / "walk.png")
    begun = 150  # rows, half of the first step
    fall = replace(
        record,
        fell_at_s=1.5,
        **{
            name: getattr(record, name)[:begun]
            for name in (
                "time_s",
                "joint_position",
                "joint_velocity",
                "target",
                "torque",
                "qpos",
                "zmp",
                "feet",
                "support",
                "key_pose",
            )
        },
    )
    plot_walk(fall, library.robot, schedule, tmp_path / "fall.png")
    picture(tmp_path / "fall.png")


@pytest.fixture
def shown(monkeypatch):
    """The figures that were drawn, to look at their lines."""
    figures, drawing = [], overview.drawing

    @contextmanager
    def kept(*size):
        with drawing(*size) as figure:
            figures.append(figure)
            yield figure

    monkeypatch.setattr(overview, "drawing", kept)
    return figures


def lines(figure, label):
    """The lines of the row whose axis is labelled so, by their names."""
    (axes,) = [a for a in figure.axes if a.get_ylabel().startswith(label)]
    return {line.get_label(): line for line in axes.lines}


def test_the_overview_of_a_timed_walk_shows_each_speed_and_its_command(
    tmp_path, record, library, shown
):
    # The paper's walk goes ahead, turning a little, whatever it is said to be asked.
    asked = Command(0.05, 0.0, 0.1), Command(0.0, 0.02, 0.0)
    schedule = tuple(Segment(command, 3.0) for command in asked)
    pushed = replace(record, events=((2.0, "a push"),), commands=())
    plot_walk(pushed, library.robot, schedule, tmp_path / "walk.png")
    picture(tmp_path / "walk.png")
    (figure,) = shown
    ahead, left, turning = (lines(figure, n) for n in ("ahead", "to the", "turning"))
    cases = (ahead, (0.05, 0.0)), (left, (0.0, 0.02)), (turning, (0.1, 0.0))
    for row, values in cases:
        commanded = row["commanded"].get_ydata()
        assert commanded.tolist() == [*values, 0.0, 0.0]  # and a stop at the end
        assert row["commanded"].get_xdata()[:3].tolist() == [0.0, 3.0, 6.0]
        assert row["a push"].get_xdata() == [2.0, 2.0]
    cycle = 2.0 * library.timing.step
    time_s, speed = ahead["base, mean over a cycle"].get_data()
    begin, end = (
        np.interp(time_s + 0.5 * sign * cycle, record.time_s, record.qpos[:, 0])
        for sign in (-1.0, 1.0)
    )
    assert speed == pytest.approx((end - begin) / cycle, abs=5e-3)


def test_a_long_schedule_is_cut_at_a_segment(tmp_path, record, library, shown):
    schedule = tuple(Segment(Command(0.0125, 0.0, 0.1), 1.0) for _ in range(9))
    plot_walk(record, library.robot, schedule, tmp_path / "walk.png")
    title, _ = shown[0].get_suptitle().split("\n")
    kept, rest = title.removeprefix(f"{library.robot.name}: ").split("; ...")
    assert set(kept.split(";")) == {"0.0125,0,0.1@1"}
    assert rest == " (9 segments)"


def test_a_walk_that_left_its_support_is_not_said_to_be_inside_all_the_time(
    tmp_path, record, library, shown
):
    plot_walk(record, library.robot, (Segment(Command(0.05), steps=4),), tmp_path / "a")
    inside = (zmp_margins(library.robot, record) >= 0.0).mean()
    assert 0.5 < inside < 1.0
    said = f"ZMP inside the planned support {percent(inside)} of the time"
    assert said in shown[0].get_suptitle()


def test_without_a_speed_limit_none_is_drawn(tmp_path, record, library, shown):
    free = replace(record, speed_limit=np.inf)
    plot_walk(
        free, library.robot, (Segment(Command(0.05), steps=4),), tmp_path / "walk.png"
    )
    names = lines(shown[0], "joint speed")
    assert not any(name.startswith("limit") for name in names)


def test_unequal_speed_limits_show_each_joint_against_its_own(
    tmp_path, record, library, shown
):
    limits = np.linspace(2.0, 5.0, 12)
    mixed = replace(record, speed_limit=limits)
    plot_walk(
        mixed, library.robot, (Segment(Command(0.05), steps=4),), tmp_path / "walk.png"
    )
    drawn = lines(shown[0], "joint speed")
    worst = np.max(np.abs(record.joint_velocity) / limits, axis=1)
    assert drawn["nearest joint"].get_ydata() == pytest.approx(worst)
    assert drawn["limit of each"].get_ydata() == pytest.approx([1.0, 1.0])


def test_a_sole_lies_around_its_ankle(library):
    robot = library.robot
    corners = outline(robot, np.array([1.0, -2.0, 0.3]))
    assert corners[0] == pytest.approx(corners[-1])
    centre = corners[:4].mean(axis=0) - [1.0, -2.0]
    assert np.linalg.norm(centre) == pytest.approx(abs(robot.reduced.sole_offset))


def test_a_portrait_stands_on_the_floor():
    """Its soles' lowest corners, as MuJoCo places them, are at z = 0."""
    robot = load_box_robot("res")
    model = build_model(robot)
    data = mujoco.MjData(model)
    stand_on_floor(model, data, robot)
    for side in ("left", "right"):
        sole = data.geom(f"{side}_foot_box")
        corners = np.array(list(product((-1, 1), repeat=3)))
        corners = corners * model.geom(f"{side}_foot_box").size
        lowest = (sole.xpos + corners @ sole.xmat.reshape(3, 3).T)[:, 2].min()
        assert lowest == pytest.approx(0.0, abs=1e-9)
