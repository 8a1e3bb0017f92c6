"""Logs that were cut, damaged, or are none; and what `explain` makes of a log."""

import json
import struct
import tracemalloc
from dataclasses import fields

import numpy as np
import pytest
import zstandard
from commands import call
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.opcode import Opcode
from mcap.records import Chunk
from mcap.writer import Writer
from msgspec.structs import replace
from planned_library import planned_res
from telemetry_factory import FALLEN, GIVEN_UP, event, told, walked

from gaitchain.analysis.fall_cause import explain
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.errors import CommandError, LogError, RecordError
from gaitchain.live.logs.chunks import LARGEST, messages
from gaitchain.live.logs.reader import BEGINNING, read_log
from gaitchain.live.logs.writer import LogFile
from gaitchain.live.messages import Mode
from gaitchain.live.telemetry_record import LONGEST_S, before_fall, record_of
from gaitchain.messages import Command
from gaitchain.walker.walker import Walker

LIBRARY = planned_res()
RES = LIBRARY.robot
CHUNKS, EACH = 4, 6
PUSH = "a push of 40 N s to 90 deg"
BEFORE = (
    "the rows before its first one are in the file of that log before it, and the "
    "cause may be in them"
)


def write(path, rows, each=50, row_before=None):
    file = LogFile(path, LIBRARY, row_before)
    for i, row in enumerate(rows, start=1):
        file.write(row)
        if i % each == 0:
            file.sync()
    file.close()
    return path


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The bytes of a log of four chunks."""
    rows = [told(RES, 0.01 * i, steps=i) for i in range(CHUNKS * EACH)]
    return write(tmp_path_factory.mktemp("whole") / "a.mcap", rows, EACH).read_bytes()


def steps_in(data, folder):
    """Read bytes as a log; return its steps and what was missing, None if refused."""
    path = folder / "damaged.mcap"
    path.write_bytes(data)
    try:
        log = read_log(path)
        found = [row.steps for row in log.telemetries()]
    except LogError as error:
        assert "\n" not in str(error)
        assert str(path) in str(error)
        return None
    assert log.rows == len(found)
    return found, log.damage


def test_a_whole_log_is_read_whole(whole, tmp_path):
    assert steps_in(whole, tmp_path) == (list(range(CHUNKS * EACH)), "")


def test_a_cut_log_gives_what_is_whole_of_it(whole, tmp_path):
    lengths = np.unique(np.linspace(0, len(whole) - 1, 150).astype(int)).tolist()
    before, refused = 0, 0
    for length in [*range(0, 40), *lengths, *range(len(whole) - 40, len(whole))]:
        read = steps_in(whole[:length], tmp_path)
        if read is None:
            refused += 1
            assert before == 0 or length < 40
            continue
        found, damage = read
        assert found == list(range(len(found)))
        assert len(found) % EACH == 0
        before = max(before, len(found))
        # Without the last bytes, nothing but a magic number, it is whole.
        ended = length > len(whole) - 9
        assert damage == (
            "" if ended else f"the end is missing, after {len(found)} rows"
        )
    assert before == CHUNKS * EACH
    assert refused > 40


@settings(max_examples=150)
@given(place=st.integers(0, 10**9), flip=st.integers(1, 255))
def test_a_flipped_byte_does_no_harm(whole, tmp_path_factory, place, flip):
    """Rows are the true ones or missing: checksums tell."""
    data = bytearray(whole)
    data[place % len(data)] ^= flip
    read = steps_in(bytes(data), tmp_path_factory.getbasetemp())
    if read is not None:
        found, _ = read
        assert found == sorted(set(found))
        assert set(found) <= set(range(CHUNKS * EACH))


@settings(max_examples=40)
@given(st.binary(max_size=200), st.integers(0, 2**16))
def test_bytes_put_in_anywhere_do_no_harm(whole, tmp_path_factory, junk, place):
    at = place % len(whole)
    folder = tmp_path_factory.getbasetemp()
    steps_in(whole[:at] + junk + whole[at:], folder)
    steps_in(whole[:8] + junk, folder)


def test_rows_that_never_came_are_counted(tmp_path):
    numbers = [*range(1, 11), *range(311, 321), *range(621, 631), 1, 2]
    rows = [told(RES, 0.004 * n, number=n) for n in numbers]
    log = read_log(write(tmp_path / "gaps.mcap", rows))
    assert len(list(log.telemetries())) == len(rows)
    assert log.lost == 600
    assert log.damage == (
        "600 rows of the loop are not in the log: 2 gaps, 1.2 s at most"
    )


def test_rows_before_a_loops_first_one_are_counted_too(tmp_path):
    numbers = [23, 24, 25, 17, 18, 18, 30]  # of three loops
    rows = [told(RES, 0.004 * n, number=n) for n in numbers]
    log = read_log(write(tmp_path / "first.mcap", rows, row_before=0))
    assert len(list(log.telemetries())) == len(rows)
    assert log.lost == 22 + 16 + 17 + 11
    assert "66 rows of the loop are not in the log: 4 gaps, 0.1 s" in log.damage


@pytest.mark.parametrize(("row_before", "lost"), [(None, 0), (22, 0), (20, 2)])
def test_a_file_misses_only_what_came_after_the_file_before(tmp_path, row_before, lost):
    rows = [told(RES, 0.004 * n, number=n) for n in (23, 24)]
    log = read_log(write(tmp_path / "a.mcap", rows, row_before=row_before))
    assert len(list(log.telemetries())) == 2
    assert log.lost == lost


def test_rows_of_another_robots_size_are_left_out(tmp_path):
    rows = [told(RES, 0.01 * i, steps=i) for i in range(6)]
    rows[1] = replace(rows[1], joint_velocity=(0.0,) * 3)
    rows[2] = replace(rows[2], joint_position=())
    rows[3] = replace(rows[3], acceleration=(0.0,))
    log = read_log(write(tmp_path / "odd.mcap", rows))
    assert [row.steps for row in log.telemetries()] == [0, 4, 5]
    assert log.damage == "3 of its rows cannot be read"
    with pytest.raises(RecordError, match="telemetry of 0 joints"):
        record_of(RES, [replace(row, joint_velocity=()) for row in rows])


def test_a_chunk_is_opened_no_further_than_one_can_be(tmp_path, whole):
    """Whatever size it declares: here a hundred bytes, of 256 MiB of nothing."""
    zeros = zstandard.ZstdCompressor().compress(bytes(256 << 20))
    head = struct.pack("<QQQII", 0, 0, 100, 0, 4)
    body = head + b"zstd" + struct.pack("<Q", len(zeros)) + zeros
    record = b"\x06" + struct.pack("<Q", len(body)) + body
    at = whole.index(b"\x06", whole.index(b"library.gait"))
    while whole[at + 41 : at + 45] != b"zstd":
        at = whole.index(b"\x06", at + 1)
    tracemalloc.start()
    found, damage = steps_in(whole[:at] + 3 * record + whole[at:], tmp_path)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert found == list(range(CHUNKS * EACH))
    assert damage == "3 of its chunks are damaged and left out"
    assert most < 100 << 20


@pytest.mark.parametrize("kind", [0x00, 0x80])
def test_a_chunk_of_what_no_chunk_holds_is_refused_at_once(kind):
    data = (bytes([kind]) + bytes(8)) * 1000
    chunk = Chunk("", data, 0, 0, 0, len(data))
    with pytest.raises(ValueError, match=f"record {kind} of 0 bytes"):
        messages(chunk, "/gaitchain/telemetry", set())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "size", "why"),
    [
        (Opcode.SCHEMA, 0, "of 0 bytes, at least 14 of this kind"),
        (Opcode.CHANNEL, 15, "of 15 bytes, at least 16 of this kind"),
        (Opcode.MESSAGE, 21, "of 21 bytes, at least 22 of this kind"),
        (Opcode.MESSAGE, 22, "more than 200000 records"),
    ],
)
def test_a_chunk_of_tiny_records_is_refused_before_they_fill_the_memory(
    kind, size, why
):
    """A file of 3 kB is enough for 32 MiB of them; none of ours comes near."""
    record = struct.pack("<BQ", kind, size) + bytes(size)
    data = record * (LARGEST // len(record))
    chunk = Chunk("", data, 0, 0, 0, len(data))
    tracemalloc.start()
    with pytest.raises(ValueError, match=why):
        messages(chunk, "/gaitchain/telemetry", {0})
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 32 << 20


def test_a_log_is_read_on_from_any_of_its_chunks(whole, tmp_path):
    path = tmp_path / "a.mcap"
    path.write_bytes(whole[:-9])
    log = read_log(path)
    assert log.mark(99) == BEGINNING  # before the first pass no other one is known
    rows = [row.steps for row in log.telemetries()]
    damage = f"the end is missing, after {CHUNKS * EACH} rows"
    for row in rows:
        mark = log.mark(row)
        assert mark.rows == row - row % EACH
        assert [row.steps for row in log.telemetries(mark)] == rows[mark.rows :]
        assert (log.rows, log.damage) == (len(rows), damage)


def test_one_damaged_chunk_costs_its_own_rows_alone(whole, tmp_path):
    """Also the first, in which the channels are described."""
    places = [i for i in range(len(whole)) if whole.startswith(b"\x28\xb5\x2f\xfd", i)]
    assert len(places) == CHUNKS  # each compressed by zstd
    for chunk, place in enumerate(places):
        data = bytearray(whole)
        data[place + 40] ^= 0xFF
        found, damage = steps_in(bytes(data), tmp_path)
        lost = range(chunk * EACH, (chunk + 1) * EACH)
        assert found == [i for i in range(CHUNKS * EACH) if i not in lost]
        assert damage == "1 of its chunks is damaged and left out"


def foreign(path, encoding="cdr", library=None):
    """An MCAP file of somebody else."""
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        if library is not None:
            writer.add_attachment(0, 0, "library.gait", "", library)
        channel = writer.register_channel("/gaitchain/telemetry", encoding, 0)
        writer.add_message(channel, 1, b"\x93\x01\x02\x03", 1)
        writer.finish()
    return path


def test_what_comes_after_the_end_is_not_read_and_told(whole, tmp_path):
    """As of the files of a log that somebody put together."""
    found, damage = steps_in(whole + whole, tmp_path)
    assert found == list(range(CHUNKS * EACH))
    assert damage == (
        f"{len(whole)} bytes after its end are not read: play each file of a log alone"
    )


def test_what_is_no_log_is_refused_in_one_line(whole, tmp_path):
    path = tmp_path / "a.mcap"
    for words, data in {
        "no MCAP file": b"hello, world, this is no log",
        "no gait library at its beginning": b"",
    }.items():
        path.write_bytes(data)
        with pytest.raises(LogError, match=words):
            read_log(path)
    with pytest.raises(LogError, match="No such file"):
        read_log(tmp_path / "none.mcap")
    with pytest.raises(LogError, match="Is a directory"):
        read_log(tmp_path)
    with pytest.raises(LogError, match="no log of gaitchain"):
        read_log(foreign(path))
    with pytest.raises(LogError, match=r"library\.gait in it: not a gait library"):
        read_log(foreign(path, library=b"nothing"))


def test_telemetry_of_another_version_is_refused(tmp_path):
    known = write(tmp_path / "known.mcap", [told(RES)])
    log = read_log(foreign(tmp_path / "a.mcap", library=read_log(known).library_bytes))
    with pytest.raises(LogError, match="none of its 1 rows can be read"):
        list(log.telemetries())


@pytest.fixture(scope="module")
def fall():
    """A walk that a push ends, at 250 Hz, the truth in every second row."""
    walker, backend = Walker(LIBRARY, period_s=0.004), MujocoBackend(RES, None, 0.004)
    backend.connect(walker.stand)
    for _ in range(250):
        backend.write(walker.step(backend.read()).position)
    walker.command(Command(0.3))
    rows = []
    for row in walked(walker, backend, 1500, period_s=0.004, each=2):
        rows.append(row)
        if len(rows) == 301:
            backend.push(40.0, 90.0)
            rows[-1] = replace(row, events=(event(row.time_s, "push", PUSH),))
    assert rows[-1].mode == Mode.STOPPED
    return rows


def later(rows, by_s, **changes):
    return [
        replace(
            row,
            time_s=row.time_s + by_s,
            events=tuple(replace(e, time_s=e.time_s + by_s) for e in row.events),
            **changes,
        )
        for row in rows
    ]


def test_a_log_explains_what_the_walk_itself_explains(fall, tmp_path):
    """Nothing is lost on the way but digits that no rule asks for."""
    path = write(tmp_path / "fall.mcap", fall)
    log = read_log(path)
    record = record_of(
        log.library.robot, before_fall(log.telemetries()), log.library.timing
    )
    expected = record_of(RES, fall, LIBRARY.timing)
    for field in fields(record):
        one, other = getattr(record, field.name), getattr(expected, field.name)
        if isinstance(one, np.ndarray) and one.dtype.kind == "f":
            np.testing.assert_allclose(one, other, rtol=1e-5, atol=1e-5)
        elif isinstance(one, np.ndarray):
            np.testing.assert_array_equal(one, other)
    why, known = explain(RES, record), explain(RES, expected)
    assert why.sentence == known.sentence
    assert [f.what for f in why.findings] == [f.what for f in known.findings]


@pytest.fixture
def two_falls(fall, tmp_path):
    """A fall, lying there, the same again 20 s later, and a walk that holds."""
    lying = later([fall[-1]] * 3, 10.0)
    return write(
        tmp_path / "walks.mcap",
        [*fall, *lying, *later(fall, 20.0), *later(fall[:100], 40.0)],
    )


def test_the_last_fall_of_a_log_is_explained(fall, two_falls, tmp_path, capsys):
    why = tmp_path / "why.json"
    code, out, err = call(capsys, "explain", two_falls, "--json", why)
    assert (code, err) == (0, "")
    fell_at_s = fall[-1].time_s + 20.0
    assert out.startswith(f"The robot fell at {fell_at_s:.2f} s after {PUSH}: ")
    assert "what to try" in out
    assert json.loads(why.read_text("utf-8"))["fell_at_s"] == pytest.approx(fell_at_s)
    picture = two_falls.with_suffix(".timeline.png")
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert f"{picture}: the timeline" in out


def test_any_fall_of_a_log_can_be_explained(fall, two_falls, capsys):
    rows = before_fall(read_log(two_falls).telemetries(), 1)
    record = record_of(RES, rows, since_s=0.0)
    assert record.fell_at_s == pytest.approx(fall[-1].time_s)
    code, _, err = call(capsys, "explain", two_falls, "--fall", 3)
    assert code == 2
    assert err == "gaitchain: --fall 3: the log has 2 falls\n"


def test_a_log_that_was_cut_is_explained_as_far_as_it_goes(fall, tmp_path, capsys):
    path = write(tmp_path / "fall.mcap", fall)
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    code, out, _ = call(capsys, "explain", path)
    assert code == 0
    assert out.startswith(f"{path}: the end is missing, after ")
    assert "No fall in the rows that are left; " in out
    assert "did not fall" not in out
    empty = write(tmp_path / "empty.mcap", [])
    code, _, err = call(capsys, "explain", empty)
    assert (code, err) == (2, f"gaitchain: {empty}: no telemetry in it\n")


def numbered(rows):
    """The same rows as a loop numbers them."""
    return [replace(row, number=i) for i, row in enumerate(rows, start=1)]


def test_a_file_that_begins_before_a_fall_points_to_the_file_before(
    fall, tmp_path, capsys
):
    """The push, of which nothing is in this file, came one second before the fall."""
    rows = numbered(fall)
    pushed = next(i for i, row in enumerate(rows) if row.events)
    begin = pushed + 20
    path = write(tmp_path / "a-2.mcap", rows[begin:], row_before=begin)
    code, out, err = call(capsys, "explain", path)
    assert (code, err) == (0, "")
    ahead_s = rows[-1].time_s - rows[begin].time_s
    said, sentence = out.splitlines()[:2]
    assert said == f"{path}: it begins {ahead_s:.2f} s before the fall; {BEFORE}"
    assert PUSH not in sentence
    assert " s: in the rows that are left " in sentence


@pytest.mark.parametrize("kept", [1, 2])
def test_a_file_that_begins_at_a_fall_points_to_the_file_before(
    fall, kept, tmp_path, capsys
):
    rows = numbered(fall)[-kept:]
    path = write(tmp_path / "a-2.mcap", rows, row_before=rows[0].number - 1)
    code, _, err = call(capsys, "explain", path)
    few = "no row" if kept == 1 else "one row alone"
    why = f"{few} with the torque on; nothing to explain; {BEFORE}"
    assert (code, err) == (2, f"gaitchain: {path}: {why}\n")


@pytest.mark.parametrize("row_before", [None, 0, 1000])
def test_a_short_file_that_no_rows_of_its_loop_came_before_is_whole(
    fall, row_before, tmp_path, capsys
):
    """Before the last one came rows of a loop that ran before it."""
    rows = numbered(fall[-100:])
    path = write(tmp_path / "a.mcap", rows, row_before=row_before)
    code, out, _ = call(capsys, "explain", path)
    assert code == 0
    assert out.startswith("The robot fell at ")
    assert "that are left" not in out


def test_a_fall_long_after_the_file_began_needs_no_file_before(fall, tmp_path, capsys):
    rows = numbered([told(RES, 0.1 * i) for i in range(20)] + later(fall, 2.0))
    rows = [replace(row, number=row.number + 50) for row in rows]
    path = write(tmp_path / "a-2.mcap", rows, row_before=50)
    code, out, _ = call(capsys, "explain", path)
    assert code == 0
    assert out.startswith(f"The robot fell at {rows[-1].time_s:.2f} s after {PUSH}: ")


def test_a_log_of_a_robot_that_rested_has_nothing_to_explain(tmp_path, capsys):
    rows = numbered([told(RES, 0.1 * i, mode=Mode.OFF) for i in range(20)])
    path = write(tmp_path / "a-16.mcap", rows, row_before=0)
    code, _, err = call(capsys, "explain", path)
    why = "no row with the torque on; nothing to explain"
    assert (code, err) == (2, f"gaitchain: {path}: {why}\n")


def test_of_a_real_robot_the_joints_are_judged(tmp_path, capsys):
    """It has no timeline: where its feet were, nobody knows."""
    fast = [0.0] * 12
    fast[3] = 1.1 * RES.reduced.joint_speed_limit
    rows = [
        told(
            RES,
            0.01 * i,
            mode=Mode.WALKING,
            support="ls" if i % 100 < 50 else "lr",
            joint_velocity=tuple(fast) if i > 280 else (0.0,) * 12,
        )
        for i in range(300)
    ]
    stop = told(RES, 3.0, **FALLEN)
    path = write(tmp_path / "real.mcap", [*rows, stop])
    code, out, _ = call(capsys, "explain", path)
    assert code == 0
    assert out.startswith("The robot fell at 3.00 s: speed saturation at left_knee ")
    assert "no timeline" in out
    assert not [*tmp_path.glob("*.png")]


def test_only_the_last_minute_before_a_fall_is_kept():
    rows = [told(RES, float(i)) for i in range(200)]
    stop = told(RES, 200.0, **FALLEN)
    kept = before_fall([*rows, stop])
    assert kept[-1] == stop
    assert kept[0].time_s == 200.0 - LONGEST_S
    assert before_fall(rows)[0].time_s == 199.0 - LONGEST_S
    assert before_fall([]) == ()


def limp_for(seconds, since_s):
    """A second between two rows."""
    return [told(RES, since_s + i, mode=Mode.OFF) for i in range(seconds)]


def test_of_a_robot_that_was_limp_at_last_the_last_minute_with_torque_is_kept():
    walk = [told(RES, float(i), mode=Mode.WALKING) for i in range(100)]
    off = limp_for(500, 100.0)
    kept = before_fall([*walk, *off])
    assert kept == (*walk[99 - round(LONGEST_S) :], *off[: round(LONGEST_S)])
    assert record_of(RES, kept).time_s[-1] == 99.0 - kept[0].time_s
    # Also where the loop began again, and the robot was limp since.
    assert before_fall([*walk, *off, *limp_for(20, 0.0)]) == kept
    assert before_fall(off) == tuple(off[-round(LONGEST_S) - 1 :])
    anew = [told(RES, 300.0 + i, mode=Mode.WALKING) for i in range(5)]
    assert before_fall([*walk, *off, *anew]) == tuple(anew), "of the run before is none"
    fallen = told(RES, 600.0, **FALLEN)
    assert before_fall([*walk, *off, fallen]) == (fallen,)


def test_a_run_up_ends_at_the_fall_before_and_where_the_loop_began_again():
    stop = [told(RES, t, **FALLEN) for t in (3.0, 4.0, 9.0)]
    early = [told(RES, 0.1 * i) for i in range(30)]
    between = [told(RES, 5.0 + 0.1 * i) for i in range(30)]
    rows = [*early, *stop[:2], *between, stop[2]]
    assert before_fall(rows, 1) == (*early, stop[0])
    assert before_fall(rows) == before_fall(rows, 2) == (*between, stop[2])
    assert before_fall([*rows, *early, stop[0]]) == (*early, stop[0])
    with pytest.raises(CommandError, match="--fall 1: the log has no fall"):
        before_fall(early, 1)
    with pytest.raises(CommandError, match="--fall 2: the log has one fall"):
        before_fall([*early, stop[0]], 2)


def failed_get_up(begin_s):
    """Getting up after a fall, for 2 s, and giving that up."""
    up = [told(RES, begin_s + 0.1 * i, mode=Mode.GETTING_UP) for i in range(20)]
    return [*up, told(RES, begin_s + 2.0, **GIVEN_UP)]


def test_a_get_up_that_fails_is_no_fall_and_no_run_up():
    walk = [told(RES, 0.1 * i, mode=Mode.WALKING) for i in range(30)]
    stop = told(RES, 3.0, **FALLEN)
    rows = [*walk, stop, *failed_get_up(4.0), *failed_get_up(7.0)]
    assert before_fall(rows) == (*walk, stop)
    with pytest.raises(CommandError, match="--fall 2: the log has one fall"):
        before_fall(rows, 2)
    risen = [told(RES, 11.0 + 0.1 * i, mode=Mode.RISING) for i in range(30)]
    again = told(RES, 14.0, **FALLEN)
    assert before_fall([*rows, *risen, again]) == (*risen, again)


def test_a_fall_is_found_in_a_log_from_before_trouble_was_typed(tmp_path, monkeypatch):
    monkeypatch.setattr("gaitchain.live.logs.writer.TYPED_TROUBLE", "1")
    fall = told(RES, 1.0, **{**FALLEN, "trouble": None})
    stop = told(RES, 2.0, mode=Mode.STOPPED, reason="emergency stop by rest")
    path = write(tmp_path / "old.mcap", [told(RES), fall, stop])
    assert [row.fell for row in read_log(path).telemetries()] == [False, True, False]
    monkeypatch.undo()
    path = write(tmp_path / "new.mcap", [told(RES), fall, stop])
    assert not any(row.fell for row in read_log(path).telemetries())
