"""`gaitchain explain`: the sentence, the table, the JSON and the timeline."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from standing_record import record as standing

from gaitchain.analysis.fall_cause import explain
from gaitchain.analysis.record_file import save_record
from gaitchain.analysis.rules import Rule
from gaitchain.cli.console import plain_json
from gaitchain.cli.explain import run
from gaitchain.cli.options import Explain
from gaitchain.errors import CommandError, RecordError
from gaitchain.figures.timeline import plot_timeline
from gaitchain.gait.motion import Timing
from gaitchain.robot.box_robot import load_box_robot

RES = load_box_robot("res")
PNG = b"\x89PNG\r\n\x1a\n"


@pytest.fixture(autouse=True)
def wide(monkeypatch):
    """Tables are not folded."""
    monkeypatch.setenv("COLUMNS", "200")


def walk_with(**changes):
    """Standing for 3 s, the weight going from foot to foot as in walking."""
    rows = 300
    phase = np.linspace(0.0, 6.0 * math.pi, rows)
    share = 0.5 + 0.5 * np.stack([np.sin(phase), -np.sin(phase)], axis=1)
    values = {
        "robot": RES,
        "timing": Timing(1.0, 0.3, 0.3),
        "foot_load": RES.reduced.mass * 9.81 * np.clip(share, 0.03, 1.0),
        "support": np.repeat(["ls", "lr", "rs", "rl", "stand"], rows // 5),
    }
    return standing(np.zeros(rows), **{**values, **changes})


def fallen(**changes):
    """A robot that was pushed and whose left knee gave way."""
    torque = np.zeros((300, 12))
    torque[220:, 3] = 120.0
    walk = walk_with(
        torque=torque, fell_at_s=3.0, events=((2.1, "a push of 9 N s"),), **changes
    )
    walk.tilt[220:, 0] = np.linspace(0.0, 0.8, 80) ** 2
    return walk


def options(path, output=None):
    return Explain(run=path, output=output)


def test_the_number_of_a_fall_is_of_logs(tmp_path):
    save_record(fallen(), tmp_path / "walk.rec")
    with pytest.raises(CommandError, match="--fall: of a log of `serve`"):
        run(replace(options(tmp_path), fall=3))
    assert not (tmp_path / "timeline.png").exists()


def test_a_fall_is_explained(tmp_path, capsys):
    save_record(fallen(), tmp_path / "walk.rec")
    code, why = run(options(tmp_path))
    assert code == 0
    out = capsys.readouterr().out
    lines = out.splitlines()
    assert lines[0] == (
        "The robot fell at 3.00 s after a push of 9 N s: torque saturation at "
        "left_knee came first, 0.80 s before the fall, 120.0 N m (limit 120.0 N m); "
        "try a weaker disturbance (`gaitchain push` finds what it withstands), or "
        "hip_height up (straighter knees), or joint_torque_limit up."
    )
    order = [out.index(w) for w in ("a push of 9 N s ", "(the cause)", "the fall ")]
    assert order == sorted(order)
    assert (tmp_path / "timeline.png").read_bytes().startswith(PNG)
    assert str(tmp_path / "timeline.png") in out
    assert json.loads(json.dumps(plain_json(why))) == plain_json(why)
    assert why["cause"]["rule"] == "torque saturation"
    assert why["cause"]["joint"] == "left_knee"
    assert why["cause"]["time_s"] == pytest.approx(2.2)
    assert why["cause"] in why["findings"]
    assert why["fell_at_s"] == 3.0
    assert why["events"] == [[2.1, "a push of 9 N s"]]
    assert why["sentence"] == lines[0]


def test_a_record_by_its_name_and_a_picture_by_another(tmp_path):
    save_record(fallen(), tmp_path / "some.rec")
    picture = tmp_path / "pictures" / "why.png"
    assert run(options(tmp_path / "some.rec", picture))[0] == 0
    assert picture.read_bytes().startswith(PNG)
    assert not (tmp_path / "timeline.png").exists()


def test_a_walk_that_held_says_so_and_lists_what_broke(tmp_path, capsys):
    contact = np.zeros(300, dtype=bool)
    contact[100:110] = True
    save_record(walk_with(self_contact=contact), tmp_path / "walk.rec")
    assert run(options(tmp_path))[0] == 0
    out = capsys.readouterr().out
    assert out.startswith("The robot did not fall; one rule broke, once.")
    assert "self collision" in out
    assert "100 ms" in out
    assert "the fall" not in out


def test_what_to_try_is_told_once_for_a_rule_that_broke_at_two_joints(tmp_path, capsys):
    torque = np.zeros((300, 12))
    torque[100:150, [3, 9]] = 120.0
    save_record(walk_with(torque=torque), tmp_path / "walk.rec")
    assert run(options(tmp_path))[0] == 0
    table, advice = capsys.readouterr().out.split("What to try")
    assert table.count("torque saturation") == 2
    assert advice.count("torque saturation") == 1


def test_a_walk_without_fault_has_no_table(tmp_path, capsys):
    save_record(walk_with(), tmp_path / "walk.rec")
    assert run(options(tmp_path))[0] == 0
    out = capsys.readouterr().out
    assert out.startswith("The robot did not fall; no rule broke.")
    assert "what to try" not in out


def test_what_cannot_be_explained_is_refused(tmp_path):
    (tmp_path / "res.gait").touch()
    for name, what in (("", "walk.rec: no such file"), ("res.gait", "a gait library")):
        with pytest.raises(CommandError, match=f"{what}; explain reads the folder"):
            run(options(tmp_path / name))
    (tmp_path / "walk.rec").write_bytes(b"not a record")
    with pytest.raises(RecordError, match="not the record of a walk"):
        run(options(tmp_path))
    save_record(walk_with(robot=None), tmp_path / "walk.rec")
    with pytest.raises(CommandError, match="which robot walked"):
        run(options(tmp_path))
    save_record(walk_with(), tmp_path / "walk.rec")
    with pytest.raises(CommandError, match="cannot be written"):
        run(options(tmp_path, tmp_path))


@pytest.mark.slow
@pytest.mark.parametrize("rows", [1, 2, 300])
def test_the_timeline_of_any_record_can_be_drawn(rows, tmp_path):
    for i, fell_at_s in enumerate((None, 0.01 * rows)):
        walk = standing(np.zeros(rows), fell_at_s=fell_at_s)
        if rows == 2:  # in the air
            nowhere = np.full((2, 2), math.nan)
            walk = replace(walk, foot_load=np.zeros((2, 2)), zmp=nowhere)
        path = tmp_path / f"{i}.png"
        plot_timeline(explain(RES, walk), walk, RES, path)
        assert path.read_bytes().startswith(PNG)


def test_the_timeline_shows_estimates_and_many_broken_rules(tmp_path):
    torque = np.zeros((300, 12))
    torque[200:] = 120.0
    estimate = np.full((300, 2), 0.1)
    walk = replace(fallen(), torque=torque, estimated_tilt=estimate)
    explanation = explain(RES, walk)
    assert len({f.what for f in explanation.findings}) > 10
    assert explanation.cause.rule is Rule.ESTIMATOR
    plot_timeline(explanation, walk, RES, tmp_path / "many.png")
    assert (tmp_path / "many.png").read_bytes().startswith(PNG)
