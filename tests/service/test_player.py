"""A log in the loop's place: its pace, what it can be asked, and how it ends."""

import json
import subprocess
import sys
import threading
from contextlib import closing
from itertools import pairwise

import pytest
from commands import call
from msgspec.structs import replace
from patience import PATIENCE_S, Deadline
from planned_library import planned_res
from telemetry_factory import FALLEN, event, told

from gaitchain.errors import CommandError, LogError
from gaitchain.live.logs.reader import BEGINNING, Log, read_log
from gaitchain.live.logs.writer import LogFile
from gaitchain.live.messages import (
    Drive,
    EmergencyStop,
    Mode,
    Note,
    Play,
    PushRobot,
    Recall,
    Reset,
    Shutdown,
    Start,
    Stop,
)
from gaitchain.service.api_feed import Feed
from gaitchain.service.channel import Asker, Listener, LoopEnd
from gaitchain.service.fall_watch import FallWatch
from gaitchain.service.frame import Framer
from gaitchain.service.player_part import KEPT_EVENTS, Player, run
from gaitchain.service.settings import Settings, save_settings

LIBRARY = planned_res()
RES = LIBRARY.robot


def write(path, rows, each=10_000):
    file = LogFile(path, LIBRARY)
    for number, row in enumerate(rows, start=1):
        file.write(row)
        if number % each == 0:
            file.sync()
    file.close()
    return path


def rows_of(count):
    """Rows of 20 ms, from 5.0 s on; somebody drives."""
    return [
        told(RES, 5.0 + 0.02 * i, steps=i, driver="me", mode=Mode.WALKING)
        for i in range(count)
    ]


class Page:
    """What hears the player, and asks it things, on a clock of its own."""

    def __init__(self, path, log=None):
        self.heard, self.asked, self.now_s = [], [], 100.0
        log = log or read_log(path)
        self.player = Player(log, self, lambda: self.now_s)

    def publish(self, telemetry):
        self.heard.append((self.now_s, telemetry))

    def requests(self):
        asked, self.asked = self.asked, []
        return asked

    def ask(self, *requests):
        self.asked += requests

    def run(self, seconds):
        """Let time go on; return what was heard."""
        self.heard, until_s = [], self.now_s + seconds
        while self.now_s < until_s:
            self.player.tick()
            assert 0.0 <= self.player.wait_s() <= 0.01
            self.now_s += max(self.player.wait_s(), 0.0005)
        return self.heard


@pytest.fixture
def path(tmp_path):
    """A hundred rows; a push, and a fall at the end."""
    rows = rows_of(100)
    rows[30] = replace(rows[30], events=(event(5.6, "push", "a push"),))
    rows[99] = replace(rows[99], **FALLEN)
    return write(tmp_path / "walk.mcap", rows)


def test_a_log_is_played_at_its_own_pace(path):
    heard = Page(path).run(1.99)
    assert [t.steps for _, t in heard] == list(range(100))
    for now_s, t in heard:
        assert now_s - 100.0 == pytest.approx(t.time_s - 5.0, abs=0.002)
        assert t.driver == ""
        assert t.mode == (Mode.WALKING if t.steps < 99 else Mode.STOPPED)
    assert {t.reason for _, t in heard[:-1]} == {""}
    assert heard[50][1].replay.where == "replay of walk.mcap, 1.0 of 2.0 s"
    assert [t.steps for _, t in heard if t.events] == [30]


def test_at_its_end_a_log_pauses_and_goes_on_telling_the_last_row(path):
    page = Page(path)
    *_, (_, last) = page.run(2.0)
    assert last.fell  # whoever explains falls sees this one, too
    heard = page.run(1.0)
    assert len(heard) == pytest.approx(25, abs=2)
    assert {t.steps for _, t in heard} == {99}
    assert {t.reason for _, t in heard} == {FALLEN["reason"]}
    assert {t.replay.where for _, t in heard} == {
        "replay of walk.mcap, paused at 2.0 of 2.0 s, its end"
    }
    page.ask(Start("me"))
    assert page.run(0.5)[0][1].steps == 0


def test_a_log_that_is_cut_says_so_at_its_end(path):
    path.write_bytes(path.read_bytes()[:-9])
    page = Page(path)
    page.run(2.0)
    where = page.run(0.1)[0][1].replay.where
    assert where.endswith(", its end; the end is missing, after 100 rows")


@pytest.mark.parametrize("pause", [Stop("me"), EmergencyStop("me")])
def test_it_pauses_and_goes_on(path, pause):
    page = Page(path)
    before = page.run(0.59)[-1][1].steps
    page.ask(pause)
    still = page.run(10.0)
    assert len(still) > 100  # the loop is not silent
    (shown,) = {t.steps for _, t in still}
    assert shown == before + 1
    assert {t.replay.where for _, t in still} == {
        f"replay of walk.mcap, paused at {0.02 * shown:.1f} of 2.0 s"
    }
    assert not any(t.events for _, t in still)
    page.ask(Start("me"))
    on = page.run(0.5)
    assert [t.steps for _, t in on] == list(range(shown, shown + len(on)))
    assert len(on) == pytest.approx(25, abs=1)
    assert [t.steps for _, t in on if t.events] == [30]


class SlowLog(Log):
    """A log on a slow disk: each row takes time to be read."""

    page = None
    taken = 0

    def telemetries(self, mark=BEGINNING):
        for row in super().telemetries(mark):
            self.taken += 1
            if self.page is not None:
                self.page.now_s += 0.001
            yield row


def slow_page(path):
    """A page whose log has been measured, and is slow from then on."""
    log = read_log(path)
    log.__class__ = SlowLog
    page = Page(path, log)
    log.page, log.taken = page, 0
    return page, log


def test_a_player_is_never_silent_while_it_seeks(tmp_path):
    rows = [told(RES, 0.004 * i, steps=i) for i in range(1200)]
    rows[3] = replace(rows[3], events=(event(0.0, "push", "a push"),))
    page, log = slow_page(write(tmp_path / "long.mcap", rows))  # in one chunk
    page.run(0.01)  # the fourth row is due next
    page.ask(Play("me", at_s=99.0), Note("part", "the viewer part ended"))
    begun_s, heard = page.now_s, page.run(3.0)
    assert log.taken > 1100
    assert {t.steps for _, t in heard} == {3, 1199}
    assert max(b - a for a, b in pairwise([begun_s, *(s for s, _ in heard)])) < 0.1
    assert [e.kind for _, t in heard for e in t.events] == ["part"]


def test_what_is_asked_while_it_seeks_is_heard(tmp_path):
    rows = [told(RES, 0.004 * i, steps=i) for i in range(1200)]
    page, _ = slow_page(write(tmp_path / "long.mcap", rows))
    page.ask(Play("me", at_s=99.0))
    page.run(0.1)
    page.ask(Play("me", playing=False))
    page.run(0.1)
    assert not page.heard[-1][1].replay.playing
    page.ask(Play("me", at_s=0.02))  # another place
    assert page.run(0.2)[-1][1].steps == 5
    page.ask(Play("me", at_s=99.0))
    page.run(0.1)
    page.ask(Reset("me"))
    assert page.run(0.1)[-1][1].steps == 0


def test_chunks_before_the_place_are_not_read(tmp_path):
    page, log = slow_page(write(tmp_path / "a.mcap", rows_of(100), each=10))
    for row in (97, 55, 0, 10, 9):
        log.taken = 0
        page.ask(Play("me", at_s=0.02 * row + 0.01, playing=False))
        assert page.run(0.2)[-1][1].steps == row
        assert log.taken <= 10
        assert page.heard[-1][1].replay.at_s == pytest.approx(0.02 * row)


def test_where_a_log_was_cut_meanwhile_it_is_shown_from_its_beginning(tmp_path):
    path = write(tmp_path / "a.mcap", rows_of(100), each=10)
    page, log = slow_page(path)
    path.write_bytes(path.read_bytes()[: log.mark(55).place])
    page.ask(Play("me", at_s=1.97, playing=False))
    assert page.run(0.2)[-1][1].steps == 0
    page.ask(Play("me", playing=True))
    assert page.run(3.0)[-1][1].steps == 49


def test_a_log_that_is_read_at_the_start_says_how_far(path):
    said = []
    Player(read_log(path), page := Page(path), say=said.append)
    assert said == ["reading the log, 0 rows"]
    page.ask(Shutdown())
    player = Player(read_log(path), page)
    assert player.ended  # nobody waits until all of it is read


def test_reset_begins_again_playing_or_not(path):
    page = Page(path)
    page.run(1.0)
    page.ask(Reset("me"))
    assert [t.steps for _, t in page.run(0.1)][:3] == [0, 1, 2]
    page.ask(Stop("me"), Reset("me"))
    assert {t.steps for _, t in page.run(0.5)} == {0}


def test_a_log_is_sought_paused_and_played_at_another_speed(path):
    page = Page(path)
    page.ask(Play("me", playing=False, at_s=1.21))
    still = page.run(0.5)[-1][1]
    assert still.steps == 60
    assert still.replay.at_s == pytest.approx(1.2)
    assert still.replay.length_s == pytest.approx(1.98)
    assert (still.replay.playing, still.replay.speed) == (False, 1.0)
    page.ask(Play("me", playing=True, speed=0.5))
    assert page.run(0.4)[-1][1].steps == pytest.approx(70, abs=1)
    page.ask(Play("me", at_s=0.0, speed=4.0))
    heard = page.run(0.25)
    assert heard[-1][1].steps == pytest.approx(50, abs=5)
    assert [t.steps for _, t in heard if t.events] == [30]  # none is passed over
    page.ask(Play("me", at_s=99.0, playing=False))
    assert page.run(0.1)[-1][1].steps == 99


@pytest.fixture(scope="module")
def long(tmp_path_factory):
    """Twenty seconds: pushes at 1, 17 and 19.8 s, a fall at 18 s, and it lies there."""
    rows = [*rows_of(901), *(replace(r, **FALLEN) for r in rows_of(1000)[901:])]
    rows[900] = replace(rows[900], **FALLEN)
    for row in (50, 850, 990):
        pushed = event(rows[row].time_s, "push", f"push of row {row}")
        rows[row] = replace(rows[row], events=(pushed,))
    return write(tmp_path_factory.mktemp("long") / "long.mcap", rows, each=100)


def pushes(feed):
    return [int(event.text.rsplit(" ", 1)[1]) for event in feed.events]


@pytest.mark.parametrize("row", [900, 980])
def test_a_fall_is_explained_where_a_log_is_sought_behind_it(long, row):
    page, watch = Page(long), FallWatch(LIBRARY)
    page.ask(Play("me", at_s=0.02 * row + 0.01, playing=False))
    heard = [t for _, t in page.run(0.5)]
    heard = heard[next(i for i, t in enumerate(heard) if t.leads) :]
    led = [t.steps for t in heard if t.leads]
    assert led == list(range(300, 901 if row > 900 else 900))
    assert {t.steps for t in heard[len(led) :]} == {row}
    assert len({t.replay.jumps for t in heard}) == 1
    for t in heard:
        watch.take(t)
    watch.close()
    assert watch.latest.time_s == pytest.approx(5.0 + 0.02 * 900)
    assert "push of row 850" in watch.latest.sentence
    assert "replay" not in watch.latest.sentence


def test_what_leads_to_a_fall_is_heard_whole_and_not_shown(long, tmp_path):
    """Through the channel of the parts: faster, rows just before the fall are lost."""
    watch, ended = FallWatch(LIBRARY), threading.Event()
    feed = Feed(tmp_path, watch, PATIENCE_S)
    shown, heard = [], []
    take = watch.take
    watch.take = lambda row: (heard.append(row.steps), take(row))

    def play():
        with closing(LoopEnd(tmp_path)) as port:
            player = Player(read_log(long), port, playing=False)
            while not ended.is_set():
                player.tick()
                ended.wait(player.wait_s())

    playing = threading.Thread(target=play)
    playing.start()
    feed.start()
    try:
        deadline = Deadline()
        with closing(Asker(tmp_path)) as asker:
            while not (feed.latest and asker.ask(Play("me", at_s=19.5))):
                assert not deadline.passed()
            while feed.latest.steps < 975:
                shown.append(feed.latest.steps)
                assert not ended.wait(0.001) and not deadline.passed()
    finally:
        ended.set()
        playing.join()
        feed.close()
    assert set(shown) == {0}
    assert [s for s in heard if 300 <= s <= 900] == list(range(300, 901))
    assert watch.latest.time_s == pytest.approx(5.0 + 0.02 * 900)


def test_of_a_robot_that_lies_long_nothing_is_read_but_what_is_sought(tmp_path):
    rows = [*rows_of(51), *(replace(r, **FALLEN) for r in rows_of(4_000)[51:])]
    rows[50] = replace(rows[50], **FALLEN)
    page = Page(write(tmp_path / "long.mcap", rows, each=100))
    read, reads = [], type(page.player._log).telemetries

    def counted(log, *args):
        for row in reads(log, *args):
            read.append(row.steps)
            yield row

    page.player._log = Counted(page.player._log, counted)
    page.ask(Play("me", at_s=79.0))
    assert page.run(0.5)[-1][1].steps >= 3_900
    assert len(read) < 500


class Counted:
    """A log whose reads are counted."""

    def __init__(self, log, telemetries):
        self._log, self._telemetries = log, telemetries

    def __getattr__(self, name):
        return getattr(self._log, name)

    def telemetries(self, *args):
        return self._telemetries(self._log, *args)


def test_nothing_is_passed_on_where_a_robot_that_fell_is_up_again(tmp_path):
    fallen = [replace(row, **FALLEN) for row in rows_of(60)]
    rows = [*rows_of(30), *fallen[30:], *rows_of(90)[60:]]
    page = Page(write(tmp_path / "up.mcap", rows))
    page.ask(Play("me", at_s=1.61, playing=False))
    assert {t.steps for _, t in page.run(0.5)} == {80}


def test_events_up_to_the_place_are_there_wherever_a_log_is_sought(long, tmp_path):
    page, watch = Page(long), FallWatch(LIBRARY)
    feed = Feed(tmp_path, watch, 1.0)

    def after(seconds, *requests):
        page.ask(*requests)
        for _, row in page.run(seconds):
            feed.hear(row)
        assert not feed.misses
        return pushes(feed)

    with closing(watch):
        assert after(0.1) == []
        assert after(0.2, Play("me", at_s=18.5)) == [50, 850]
        assert after(0.2, Play("me", at_s=1.0, playing=False)) == [50]
        assert after(0.2, Play("me", at_s=0.9)) == []
        assert after(0.5, Play("me", playing=True)) == [50]
        assert after(0.5, Play("me", at_s=19.9)) == [50, 850, 990]
        assert after(0.1, Reset("me")) == []


def test_who_comes_later_is_told_what_happened_by_then(path):
    page = Page(path)
    page.run(0.5)
    page.ask(Recall())
    assert [t.recalled for _, t in page.run(0.05) if t.recalled is not None] == [()]
    page.run(0.2)
    page.ask(Recall())
    (recalled,) = (t.recalled for _, t in page.run(0.05) if t.recalled is not None)
    assert [event.text for event in recalled] == ["a push"]


def test_as_many_events_are_told_again_as_are_kept(tmp_path):
    rows = [
        replace(row, events=(event(row.time_s, "world", str(row.steps)),))
        for row in rows_of(KEPT_EVENTS + 30)
    ]
    page = Page(write(tmp_path / "a.mcap", rows))
    page.ask(Play("me", at_s=99.0, playing=False))
    recalled = [t.recalled for _, t in page.run(0.2) if t.recalled]
    assert [int(e.text) for e in recalled[-1]] == list(range(30, KEPT_EVENTS + 30))


def test_a_frame_tells_the_place_in_the_log_beside_the_reason(path):
    page = Page(path)
    page.run(0.1)
    framer = Framer(RES, LIBRARY.command_range, "simulation")
    *_, (_, row) = page.run(0.01)
    where = row.replay.where
    for own, told_so in (("", where), ("link lost", f"link lost ({where})")):
        frame = json.loads(framer.json(replace(row, reason=own), (), None))
        assert frame["reason"] == told_so


def test_at_its_end_a_log_plays_from_the_beginning(path):
    page = Page(path)
    page.run(3.0)
    page.ask(Play("me", playing=True))
    assert page.run(0.2)[-1][1].steps < 20


def test_a_log_that_nobody_watches_yet_waits(path):
    player = Player(read_log(path), page := Page(path), lambda: 0.0, playing=False)
    for _ in range(20):
        player.tick()
    assert {t.steps for _, t in page.heard} == {0}


def test_nobody_drives_a_log(path):
    page = Page(path)
    page.ask(Drive("me", 0.3), PushRobot("me", 9.0, 0.0), Start("me"))
    heard = page.run(0.5)
    assert {t.command for _, t in heard} == {(0.0, 0.0, 0.0)}
    assert not page.player.ended
    page.ask(Shutdown())
    page.run(0.01)
    assert page.player.ended


def test_what_other_parts_have_to_say_is_passed_on_once(path):
    page = Page(path)
    page.ask(Note("part", "the viewer part ended with signal 9 and was started again"))
    events = [e for _, t in page.run(0.5) for e in t.events]
    assert [e.kind for e in events] == ["part"]


def test_a_loop_that_began_again_and_a_long_silence_are_played(tmp_path):
    times = [0.0, 0.1, 60.0, 60.1, 0.0, 0.1]
    rows = [told(RES, t, steps=i) for i, t in enumerate(times)]
    heard = Page(write(tmp_path / "odd.mcap", rows)).run(1.35)
    at = [now_s - 100.0 for now_s, t in heard]
    assert [t.steps for _, t in heard][:6] == list(range(6))
    assert at[:6] == pytest.approx([0.0, 0.1, 1.1, 1.2, 1.2, 1.3], abs=0.01)


def test_a_player_that_was_held_up_does_not_race(path):
    page = Page(path)
    page.run(0.1)
    page.now_s += 5.0
    heard = page.run(0.5)
    assert len(heard) == pytest.approx(25, abs=3)


def test_an_empty_log_cannot_be_played(tmp_path):
    with pytest.raises(LogError, match="no telemetry in it to play"):
        Page(write(tmp_path / "empty.mcap", []))


def test_the_part_plays_over_the_loops_own_wires(path, tmp_path):
    folder = tmp_path / "service"
    folder.mkdir()
    save_settings(Settings(library="unused", replay=str(path)), folder)
    listener, asker = Listener(folder), Asker(folder)
    command = [sys.executable, "-m", "gaitchain.service.part", "player", str(folder)]
    with subprocess.Popen(command, stdin=subprocess.PIPE) as process:
        first = listener.next(PATIENCE_S)
        assert first is not None
        while not asker.ask(Stop("me")):
            assert listener.next(PATIENCE_S) is not None
        deadline = Deadline()
        while "paused" not in (shown := listener.next(PATIENCE_S)).replay.where:
            assert not deadline.passed()
        assert shown.steps >= first.steps
        process.stdin.close()
        assert process.wait(PATIENCE_S) == 0
    listener.close()
    asker.close()


def test_a_part_without_a_log_to_play_says_so(tmp_path):
    save_settings(Settings(library="unused"), tmp_path)
    with pytest.raises(CommandError, match="gaitchain replay"):
        run(tmp_path, threading.Event())


def test_replay_refuses_what_it_cannot_play(path, tmp_path, capsys):
    code, _, err = call(capsys, "replay", tmp_path / "none.mcap")
    assert (code, err.count("\n")) == (2, 1)
    assert "none.mcap: no such file; replay plays a log" in err
    code, _, err = call(capsys, "replay", path, "--port", 70000)
    assert code == 2
    assert "--port 70000: give 0 to 65535" in err
    assert call(capsys, "replay", "--help")[0] == 0


def test_replay_names_the_files_that_are_left_of_a_log(tmp_path, capsys):
    for number in (9, 10, 11):
        (tmp_path / f"a-{number}.mcap").touch()
    for command, more in (("replay", "replay plays a"), ("explain", "explain reads")):
        code, _, err = call(capsys, command, tmp_path / "a.mcap")
        assert code == 2
        names = f"{tmp_path / 'a-9.mcap'} to a-11.mcap"
        assert f"{tmp_path / 'a.mcap'}: no such file, only {names}; {more}" in err


def test_replay_draws_no_other_robot_than_that_of_the_log(path, toy_path, capsys):
    code, _, err = call(capsys, "replay", path, "--robot", toy_path)
    assert (code, err.count("\n")) == (2, 1)
    assert f"is not {RES.name} as in {path}; they differ in" in err
    words = "replay", path, "--robot", "res", "--profile", "none.toml"
    code, _, err = call(capsys, *words)
    assert (code, err.count("\n")) == (2, 1)
    assert "profile none.toml: res is a robot of boxes" in err
    words = "replay", path, "--robot", toy_path, "--profile", "none.toml"
    code, _, err = call(capsys, *words)
    assert (code, err.count("\n")) == (2, 1)
    assert "none.toml" in err
