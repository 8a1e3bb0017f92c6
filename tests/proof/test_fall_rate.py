"""How often a library falls, walked in physics."""

import re
from dataclasses import replace

import numpy as np
import pytest

from gaitchain.build.grid import Grid, Levels
from gaitchain.build.workers import Crew
from gaitchain.cli.libraries import shipped_library
from gaitchain.errors import CommandError, LibraryError
from gaitchain.gait.library_file import library_bytes, load_library, parse_library
from gaitchain.proof import fall_rate, proof_walks
from gaitchain.proof.fall_rate import check_length, prove, usual_steps
from gaitchain.proof.falls import watch_fall
from gaitchain.proof.proof_walks import CHOSEN, Criterion, ProofWalk
from gaitchain.proof.rate_test import rate_interval, steps_needed
from gaitchain.proof.tally import Tally

LIBRARY = load_library(shipped_library())
BRIEF = Criterion(bound=0.03, seconds=4.0)


GRID = proof_walks.default_grid(LIBRARY)


@pytest.fixture(scope="module", autouse=True)
def few_at_once():
    """Seventeen walks suffice; of 32 that are begun together half would be in vain.

    In a few worlds, which so many walks meet.
    """
    few = replace(GRID, levels=GRID.levels[:4])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(proof_walks, "_BATCH", 18)
        patch.setattr(proof_walks, "default_grid", lambda library: few)
        yield


def crew(workers=2, told=None):
    return Crew(workers, lambda *news: told is None or told.append(news))


@pytest.fixture(scope="module")
def proven():
    told = []
    return prove(LIBRARY, BRIEF, crew(told=told)), told


@pytest.mark.slow
def test_whoever_does_not_fall_is_proven_as_soon_as_it_is_sure(proven):
    library, told = proven
    found = library.qualification.proof
    assert (found.verdict, found.total.falls) == ("below", 0)
    assert (found.fell_in, found.steps.fell_on) == ((), ())
    need = steps_needed(BRIEF.bound)
    assert need <= found.total.steps < need + 20
    usual = usual_steps(LIBRARY, BRIEF)
    assert 0.7 * usual < found.total.steps / found.total.walks <= usual
    promised = steps_needed(BRIEF.bound, length=usual)
    assert abs(found.total.steps - promised) <= usual
    assert 0.0 == found.total.low < found.total.high <= BRIEF.bound
    stages = {stage for stage, _, _ in told}
    assert stages == {"walking for the proof"}
    assert told[0][1:] == (0, 100)
    assert told[-1][1:] == (100, 100)


@pytest.mark.slow
def test_strata_are_all_walks_in_two_ways(proven):
    found = proven[0].qualification.proof
    assert found.chosen is None
    for strata in (found.worlds, found.contacts, found.kinds):
        for name in ("walks", "steps", "falls"):
            parts = sum(getattr(s, name) for s in strata)
            assert parts == getattr(found.total, name)
    assert len(found.contacts) == 2
    assert [s.name for s in found.worlds][:2] == ["nominal", "friction 0.6"]
    assert [s.name for s in found.kinds][:2] == ["nominal", "friction"]
    steps = found.steps
    assert 0 < steps.walked < steps.allowed == LIBRARY.allowed_pairs.sum()
    assert steps.walked + len(steps.never) == steps.allowed
    assert all(0 < s.walked < 10 for s in steps.seldom)
    for first, last in steps.never:
        assert LIBRARY.allowed_pairs[first, last]
    # Who has fewer walks knows less, and so does who speaks of many strata at once.
    assert min(s.high for s in found.contacts) > found.total.high


def test_both_ends_of_all_strata_hold_together():
    """Each of them may be wrong; those of all walks are the test's own."""
    cells = proof_walks.mild_cells(LIBRARY)
    tally = Tally(LIBRARY, cells, 20)
    for world in range(len(cells)):
        for cone, fell in enumerate((True, False)):
            tally.add(ProofWalk(world, cone, [(0, 0)] * 9, fell))
    found = tally.report(BRIEF, "open")
    ends = 2 * (len(found.worlds) + len(found.contacts) + len(found.kinds))
    both, each = [(9, True, 1), (9, False, 1)], 1.0 - 0.05 / ends
    for world in found.worlds:
        assert (world.low, world.high) == rate_interval(both, 20, each)
    for fell, contact in zip((True, False), found.contacts, strict=True):
        own = [(9, fell, len(cells))]
        assert (contact.low, contact.high) == rate_interval(own, 20, each)
    for kind in found.kinds:
        many = kind.walks // 2
        own = [(9, True, many), (9, False, many)]
        assert (kind.low, kind.high) == rate_interval(own, 20, each)
    walks = [(9, True, len(cells)), (9, False, len(cells))]
    assert (found.total.low, found.total.high) == rate_interval(walks, 20, 0.95)


@pytest.mark.slow
def test_it_does_not_depend_on_the_workers_and_stays_in_the_library(proven):
    alone = prove(LIBRARY, BRIEF, crew(1))
    assert alone.qualification.proof == proven[0].qualification.proof
    again = parse_library(library_bytes(alone), "memory")
    assert again.qualification.proof == alone.qualification.proof
    assert again.as_built().qualification.proof is None


@pytest.mark.slow
def test_whoever_falls_is_told_so_and_where(monkeypatch):
    hard = Grid((Levels("push", (0.8,)),), corners=False)
    monkeypatch.setattr(proof_walks, "default_grid", lambda library: hard)
    found = prove(LIBRARY, BRIEF, crew()).qualification.proof
    assert found.verdict == "above"
    assert found.total.low > BRIEF.bound
    calm, pushed = found.worlds
    assert calm.falls == 0 < pushed.falls == found.total.falls
    steps = found.steps.fell_on
    assert sum(s.falls for s in steps) == found.total.falls == len(found.fell_in)
    for s in steps:
        assert LIBRARY.allowed_pairs[s.first, s.last]
        assert 0 < s.falls <= s.walked
        assert 0.0 <= s.low < s.falls / s.walked <= s.high
    plain = LIBRARY.proven(None)
    cells, scale_ns = proof_walks.mild_cells(plain), proof_walks.impulse_unit_ns(plain)
    seed = proof_walks.seed_of(LIBRARY), found.fell_in[0]
    drawn = proof_walks.draw_walk(plain, BRIEF, cells, scale_ns, seed)
    assert watch_fall(plain, drawn.in_world, drawn.schedule).fall is not None


def made_up(monkeypatch, falls, grid=GRID):
    """Walks of 11 steps that only draw; `falls` says of their numbers which fall."""
    numbers = []

    def walk(library, criterion, cells, scale_ns, seed):
        numbers.append(seed[1])
        drawn = proof_walks.draw_walk(library, criterion, cells, scale_ns, seed)
        fell = falls(seed[1], drawn)
        return ProofWalk(drawn.world, drawn.cone, [(0, 0)] * 11, fell)

    monkeypatch.setattr(proof_walks, "_walk", walk)
    monkeypatch.setattr(proof_walks, "default_grid", lambda library: grid)
    return prove(LIBRARY, BRIEF, crew(1)).qualification.proof, numbers


def test_no_verdict_of_below_leaves_a_world_unwalked(monkeypatch):
    """Of all worlds 12 draws met less than a half."""
    proof, numbers = made_up(monkeypatch, lambda number, drawn: False)
    assert (proof.verdict, len(proof.worlds)) == ("below", 33)
    assert all(s.walks for s in (*proof.worlds, *proof.contacts))
    chosen = [n - CHOSEN for n in numbers if n >= CHOSEN]
    names = [s.name for s in proof.worlds]
    assert proof.chosen.names == tuple(names[place] for place in chosen)
    assert len(chosen) == sum(s.walks for s in proof.worlds) - proof.total.walks > 5
    # The verdict, and what is said of all worlds together, is of draws alone.
    assert proof.total.steps == 11 * proof.total.walks
    assert proof.total.steps - 11 < steps_needed(BRIEF.bound, length=11)
    assert proof.all_walks.walks == proof.total.walks + len(chosen)
    for strata in (proof.contacts, proof.kinds):
        assert sum(s.walks for s in strata) == proof.total.walks


def test_a_fall_where_none_was_drawn_counts_against_the_verdict(monkeypatch):
    """The test is not sure any more, and goes on with draws."""
    fell = []

    def falls(number, drawn):
        if number >= CHOSEN and not fell:
            fell.append((number, drawn.world))
        return [(number, drawn.world)] == fell

    proof, numbers = made_up(monkeypatch, falls)
    assert (proof.verdict, proof.total.falls, proof.chosen.falls) == ("below", 0, 1)
    assert proof.fell_in == (fell[0][0],)
    assert proof.worlds[fell[0][1]].falls == proof.all_walks.falls == 1
    assert proof.total.steps > 1.3 * steps_needed(BRIEF.bound, length=11)
    chosen = [n for n in numbers if n >= CHOSEN]
    assert sorted(set(chosen)) == chosen, "each once"


def test_whoever_always_falls_where_none_was_drawn_is_never_proven(monkeypatch):
    """Of all draws one in eight falls, in worlds that the first ones did not meet."""
    plain, _ = made_up(monkeypatch, lambda number, drawn: False)
    unmet = set(plain.chosen.names)
    bad = [i for i, s in enumerate(plain.worlds) if s.name in unmet]
    proof, _ = made_up(monkeypatch, lambda number, drawn: drawn.world in bad)
    assert proof.verdict == "above"
    assert proof.chosen.falls == len(bad)


def test_a_contact_model_that_was_not_drawn_is_walked_in_a_world_that_is(monkeypatch):
    """As no draw leaves one out that is long enough, the tally alone."""
    cells = proof_walks.mild_cells(LIBRARY)
    tally = Tally(LIBRARY, cells, 20)
    for world in range(len(cells)):
        tally.add(ProofWalk(world, 0, [(0, 0)] * 9, fell=False))
    assert tally.missing == [len(cells) + 1]
    drawn = proof_walks.draw_walk(LIBRARY, BRIEF, cells, 1.0, (5, CHOSEN + len(cells)))
    other = proof_walks.draw_walk(
        LIBRARY, BRIEF, cells, 1.0, (5, CHOSEN + len(cells) + 1)
    )
    assert (drawn.cone, other.cone) == (0, 1)
    tally.choose(len(cells) + 1, ProofWalk(other.world, 1, [(0, 0)] * 9, fell=True))
    found = tally.report(BRIEF, "below")
    assert [(s.walks, s.falls) for s in found.contacts] == [(len(cells), 0), (1, 1)]
    assert found.chosen.names == (found.contacts[1].name,)
    assert (found.total.falls, found.chosen.falls) == (0, 1)
    assert not tally.missing


@pytest.mark.slow
def test_it_ends_without_a_verdict_after_the_most_steps():
    few = replace(BRIEF, most_steps=20)
    found = prove(LIBRARY, few, crew()).qualification.proof
    assert found.verdict == "open"
    assert 20 <= found.total.steps < 40


@pytest.mark.slow
def test_other_seeds_than_those_of_the_grid(proven):
    """The worlds of the grid have rounds 0 to 2 in their seeds."""
    cells = [
        cell for cell in proof_walks.default_grid(LIBRARY).cells() if cell.required
    ]
    job = proof_walks.GridJob((proof_walks.BANK, 0), cells[0], "", ())
    ours = proof_walks.grid_world(LIBRARY, job, 5, 1.0).seed
    for number in range(3):
        grids = job._replace(key=(number, 0))
        assert proof_walks.grid_world(LIBRARY, grids, 5, 1.0).seed != ours


@pytest.mark.parametrize(("bound", "seconds"), [(0.01, 60.0), (0.02, 3600.0)])
def test_walks_too_long_for_the_bound_are_refused_with_the_longest(bound, seconds):
    asked = Criterion(bound, seconds=seconds)
    with pytest.raises(CommandError, match="less than 1 / bound") as refused:
        prove(LIBRARY, asked, crew())
    longest = float(re.search(r"--seconds (\d+) or less", str(refused.value))[1])
    check_length(LIBRARY, Criterion(bound, seconds=longest))
    with pytest.raises(CommandError, match=f"--seconds {longest:.0f} or less"):
        check_length(LIBRARY, Criterion(bound, seconds=longest + 1.0))


@pytest.mark.parametrize("bound", [0.1, 0.09])
def test_a_bound_for_which_no_walk_is_short_enough_is_refused(bound):
    with pytest.raises(CommandError, match="no walk is short enough") as refused:
        prove(LIBRARY, Criterion(bound), crew())
    most = float(re.search(r"--bound (\S+) or less", str(refused.value))[1])
    check_length(LIBRARY, Criterion(most, seconds=2.0))


def test_walks_that_count_steps_are_no_shorter_for_fewer_seconds(library):
    with pytest.raises(CommandError, match="no walk is short enough") as refused:
        check_length(library, Criterion(0.1))
    most = float(re.search(r"--bound (\S+) or less", str(refused.value))[1])
    check_length(library, Criterion(most))


def test_walks_that_count_steps_are_bounded_by_the_longest_of_them(library):
    """Their intervals need a bound that no walk exceeds."""
    rng, most = np.random.default_rng(5), library.command_range
    drawn = [library.family.random_schedule(rng, most, 60.0) for _ in range(200)]
    counts = {sum(part.steps for part in schedule) for schedule in drawn}
    assert len(counts) > 1
    assert fall_rate._longest(library, Criterion(0.01)) >= 2 * max(counts)


def test_what_is_not_qualified_is_not_proven():
    bad = replace(LIBRARY, qualification=replace(LIBRARY.qualification, gate=None))
    with pytest.raises(LibraryError, match="qualified"):
        prove(bad, BRIEF, crew(1))
