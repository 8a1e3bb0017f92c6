"""Whether the part that draws the 3-D view is alive, with a clock in hand."""

import os

import pytest

from gaitchain.service.pulse import Pulse
from gaitchain.service.sight import Sight, SightBeat


class Hand:
    """A clock that is set."""

    def __init__(self):
        self.time_s = 100.0

    def __call__(self):
        return self.time_s


def test_a_part_that_beats_is_seen_and_one_that_is_silent_is_not(tmp_path):
    clock = Hand()
    sight = Sight(tmp_path, clock)
    assert sight.drawn_by is None
    part = SightBeat(tmp_path)
    assert sight.drawn_by is None  # it draws nothing yet
    for _ in range(5):
        part.beat()
        assert sight.drawn_by == os.getpid()
        clock.time_s += 1.0
        assert sight.drawn_by == os.getpid()
    clock.time_s += 2.5
    assert sight.drawn_by is None
    part.beat()
    assert sight.drawn_by == os.getpid()
    part.close()
    assert sight.drawn_by is None


def test_another_process_is_another_number(tmp_path):
    clock = Hand()
    sight, part = Sight(tmp_path, clock), SightBeat(tmp_path)
    part.beat()
    first = sight.drawn_by
    other = Pulse(tmp_path, "view")  # killed and started within a moment
    other.keep("7")
    other.beat()
    assert (first, sight.drawn_by) == (os.getpid(), 7)


def test_an_api_that_is_started_again_waits_for_a_beat(tmp_path):
    part = SightBeat(tmp_path)
    part.beat()
    sight = Sight(tmp_path, Hand())
    assert sight.drawn_by is None
    part.beat()
    assert sight.drawn_by == os.getpid()


@pytest.mark.parametrize("started", ["api", "view"])
def test_a_file_that_a_cleaner_took_is_put_back(tmp_path, started):
    """Whichever of the two is started after that finds the other."""
    clock = Hand()
    beat, sight = SightBeat(tmp_path), Sight(tmp_path, clock)
    beat.beat()
    assert sight.drawn_by == os.getpid()
    (tmp_path / "view").unlink()
    if started == "api":
        sight = Sight(tmp_path, clock)
    else:
        beat = SightBeat(tmp_path)
    clock.time_s += 10.0
    for _ in range(2):
        beat.beat()
        seen = sight.drawn_by
    assert seen == os.getpid()


def test_without_its_folder_the_view_goes_on(tmp_path):
    """The page may still ask, and the view still draw; nothing ends by that."""
    clock, folder = Hand(), tmp_path / "service"
    folder.mkdir()
    beat, sight = SightBeat(folder), Sight(folder, clock)
    (folder / "view").unlink()
    folder.rmdir()
    for _ in range(2):
        beat.beat()
        assert sight.drawn_by == os.getpid()
        clock.time_s += 10.0
