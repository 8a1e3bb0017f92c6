"""Files of the package that are given for each other are told by what they are."""

import re

import numpy as np
import pytest
from mcap.writer import Writer
from standing_record import record as by_hand

from gaitchain.analysis.record_file import load_record, save_record
from gaitchain.cli.files import check_replaced
from gaitchain.cli.libraries import shipped_library
from gaitchain.errors import CommandError, GaitchainError
from gaitchain.gait.file_kind import INDEX_HEADS, kind_of
from gaitchain.gait.get_up import GetUp, TimedPose, Way, save_get_up
from gaitchain.gait.library_file import load_library
from gaitchain.identify.log import ExerciseLog, Measured, MotionLog, load_log, save_log
from gaitchain.live.exercise import Motion
from gaitchain.robot.box_robot import load_box_robot

RES = load_box_robot("res")
READERS = {
    "a gait library": load_library,
    "the record of a walk": load_record,
    "the log of an exercise": load_log,
}


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """One of each kind."""
    folder = tmp_path_factory.mktemp("files")
    record, log = folder / "walk.rec", folder / "mine.log"
    save_record(by_hand(np.zeros(5), robot=RES), record)
    rows, joints = 200, RES.legs.joint_names
    shown = np.zeros((rows, len(joints)))
    times_s = 0.01 * np.arange(rows)
    measured = Measured(shown, shown[:, :3], shown[:, :3], times_s, 0.0 * times_s)
    parts = (MotionLog(Motion("held", shown), measured),)
    save_log(ExerciseLog(RES.name, RES.fingerprint, joints, 0.01, parts), log)
    return dict(zip(READERS, (shipped_library(), record, log), strict=True))


@pytest.mark.parametrize("wanted", READERS)
def test_a_file_of_another_kind_is_told_as_what_it_is(files, wanted):
    READERS[wanted](files[wanted])
    for kind in READERS.keys() - {wanted}:
        words = rf"{re.escape(str(files[kind]))}: .*\b{kind}\b"
        with pytest.raises(GaitchainError, match=words):
            READERS[wanted](files[kind])


@pytest.mark.parametrize("wanted", READERS)
def test_a_file_is_replaced_by_one_of_its_own_kind_alone(files, wanted, tmp_path):
    other, empty = tmp_path / "notes.txt", tmp_path / "empty"
    other.write_text("mine", "utf-8")
    empty.touch()
    for path in (files[wanted], empty, tmp_path / "new", None):
        check_replaced(path, "it", wanted)
    for path in (*(files[kind] for kind in files if kind != wanted), other):
        with pytest.raises(CommandError, match="; name another file for it"):
            check_replaced(path, "it", wanted)


def test_what_a_file_is_can_be_asked_without_reading_it(files, tmp_path):
    for kind, path in files.items():
        assert kind_of(path) == kind
    damaged = tmp_path / "a"
    for data in (b"", b"{}", b"\xff" * 20, (2).to_bytes(8, "little") + b"[]"):
        damaged.write_bytes(data)
        assert kind_of(damaged) is None
    assert kind_of(tmp_path) is None


@pytest.mark.parametrize("kind", ["the log of a run", "a file of ways up"])
def test_logs_and_ways_up_are_known_by_how_they_begin(kind, tmp_path):
    log, ways = tmp_path / "a.mcap", tmp_path / "a.getup"
    with log.open("wb") as file:
        writer = Writer(file)
        writer.start()
        writer.finish()
    way = Way((TimedPose(0.1, (0.0,)),), 0, 1)
    save_get_up(GetUp("toy", "0", ("a",), (0.0,), {"front": way}), ways)
    path = {"the log of a run": log, "a file of ways up": ways}[kind]
    assert kind_of(path) == kind
    check_replaced(path, "it", kind)
    with pytest.raises(CommandError, match=f"{kind}; name another file for it"):
        check_replaced(path, "it", "a gait library")


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ('{"joints": [], "true_period_s": 0.7}', "the polynomials of motions"),
        (INDEX_HEADS + "\n", "the index of motions"),
    ],
)
def test_exports_are_known_by_how_they_begin(text, kind, tmp_path):
    path = tmp_path / "a"
    path.write_text(text, "utf-8")
    assert kind_of(path) == kind
    check_replaced(path, "it", kind)
    with pytest.raises(CommandError, match=f"{kind}; name another file for it"):
        check_replaced(path, "it")
    path.write_text(text[:20], "utf-8")
    assert kind_of(path) is None


def test_other_json_may_be_replaced(tmp_path):
    path = tmp_path / "results.json"
    for text in ("{}", '{"qualification": 1, "supports": 2}', "[1]", '{"ways": ', "7"):
        path.write_text(text, "utf-8")
        assert kind_of(path) is None
