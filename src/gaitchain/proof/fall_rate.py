"""How often a library falls: random walks in mild worlds until that is sure. Ours.

The criterion is fixed beforehand: falls per step, of random schedules over the whole
range of commands, as the robot walks them, in the nominal world and all mild ones of
the grid, with both models of contact, each drawn with equal chances.

Few walks leave worlds that none was drawn for. Each of these, and a contact model that
was not drawn, is walked once after the test is sure. That it was sure once is enough
[Ville39], so that these walks, which are no draws, cannot make the verdict wrong; but a
fall in one of them counts against it (`RateTest.count_against`). If it is not sure any
more then, the draws go on.
"""

import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import replace
from statistics import fmean

import numpy as np

from gaitchain.build.workers import Crew
from gaitchain.errors import CommandError
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.qualification import ChosenWalks, EarlierCriterion, ProofReport
from gaitchain.proof.proof_walks import (
    Criterion,
    ProofWalks,
    draw_schedule,
    mild_cells,
)
from gaitchain.proof.rate_test import (
    RateTest,
    Verdict,
    fewest_steps,
    length_fault,
)
from gaitchain.proof.tally import Tally

_HURRY = 2.0  # steps of a walk over those that the plan makes in the time
_DRAWN = 64  # schedules by which walks are known to be so long
_SHORTEST_S = 2  # of a walk: a random schedule holds each command for so long


def prove(library: GaitLibrary, criterion: Criterion, crew: Crew) -> GaitLibrary:
    """Walk until it is sure that robots fall less often than a bound, or more often.

    Before it says so of less often, each world and each contact model has been walked:
    see above for those that were not drawn. They are in the rows of their own world or
    model alone, and in `ProofReport.chosen`.

    Every walk has seeds of its own that neither a build nor a grid uses. The verdict
    depends on them in their order, not on the workers or the backend of
    `joblib.parallel_config`.

    Args:
        library: a qualified library.
        criterion: what is to be shown.
        crew: processes and progress.

    Returns:
        The library with the report, `qualification.proof`.

    Raises:
        CommandError: the bound cannot be tested by walks of this length.
        LibraryError: the library is not qualified.
    """
    plain = library.proven(None)
    check_length(plain, criterion)
    cells = mild_cells(plain)
    longest = _longest(plain, criterion)
    tally = Tally(plain, cells, longest)
    test = RateTest(criterion.bound, longest, criterion.confidence)
    walks = ProofWalks(plain, criterion, cells, crew.workers)
    verdict, stage = test.verdict, "walking for the proof"
    crew.progress(stage, 0, 100)
    for walk in walks.drawn():
        tally.add(walk)
        verdict = test.add(walk.length, fell=walk.fell)
        crew.progress(stage, round(100.0 * test.sureness), 100)
        if verdict == "below":
            verdict = _cover(tally, test, walks, crew)
        if verdict != "open" or tally.steps >= criterion.limit:
            break
    return library.proven(tally.report(criterion, verdict))


def _cover(tally: Tally, test: RateTest, walks: ProofWalks, crew: Crew) -> Verdict:
    """Walk once wherever no draw has led; return what is known then."""
    missing = tally.missing
    if missing:
        found = crew.track(
            "walking where no walk was drawn", walks.chosen(missing), len(missing)
        )
        for place, walk in zip(missing, found, strict=True):
            tally.choose(place, walk)
            if walk.fell:
                test.count_against()
    return test.verdict


def check_length(library: GaitLibrary, criterion: Criterion) -> None:
    """Refuse walks so long that each would count as a fall by its length alone.

    Raises:
        CommandError: a walk may have 1 / bound steps or more.
    """
    fault = _length_fault(library, criterion)
    if fault:
        raise CommandError(f"{fault}; {_way_out(library, criterion)}")


def check_most_steps(criterion: Criterion) -> None:
    """Refuse a limit that is reached before walks without a fall could show anything.

    Raises:
        CommandError: fewer steps are allowed than it takes if none falls.
    """
    need = fewest_steps(criterion.bound, criterion.confidence)
    if criterion.limit < need:
        raise CommandError(
            f"--most-steps {criterion.limit}: to show fewer than {criterion.bound:g} "
            f"falls per step takes at least {need} steps without a fall; give "
            f"--most-steps {need} or more"
        )


def _length_fault(library: GaitLibrary, criterion: Criterion) -> str:
    return length_fault(criterion.bound, _longest(library, criterion))


def _way_out(library: GaitLibrary, criterion: Criterion) -> str:
    """Say how long a walk may be, or which bound its shortest walks can be tested for.

    Walks that count steps are as long whatever the seconds.
    """

    def lasting(seconds: float) -> Criterion:
        return replace(criterion, seconds=float(seconds))

    def too_long(seconds: float) -> bool:
        return bool(_length_fault(library, lasting(seconds)))

    end = _SHORTEST_S  # from below: to draw schedules of an hour takes seconds
    while end < criterion.seconds and not too_long(end):
        end *= 2
    shorter = range(_SHORTEST_S, min(end, math.ceil(criterion.seconds)))
    fit = bisect_left(shorter, True, key=too_long)
    if fit:
        return f"give --seconds {shorter[fit - 1]} or less"
    least = _longest(library, lasting(_SHORTEST_S))
    most = math.floor(1e4 / (least + 1)) / 1e4  # rounded down, so that it will do
    return f"no walk is short enough; give --bound {most:g} or less"


def _longest(library: GaitLibrary, criterion: Criterion) -> int:
    """Return the most steps that a walk may have."""
    return int(_HURRY * max(_planned(library, criterion))) + 2


def usual_steps(library: GaitLibrary, criterion: Criterion) -> int:
    """Return how many steps a walk of the proof has, as planned, in the mean."""
    return max(round(fmean(_planned(library, criterion))), 1)


def _planned(library: GaitLibrary, criterion: Criterion) -> list[float]:
    """Return the steps of some walks; those that count steps are not equally long."""
    rng, step_s = np.random.default_rng(0), library.timing.step
    drawn = (draw_schedule(library, criterion, rng) for _ in range(_DRAWN))
    return [sum(s.steps or (s.duration_s or 0.0) / step_s for s in d) for d in drawn]


def walk_length(library: GaitLibrary, proof: ProofReport) -> str:
    """Say how long the walks of a proof were, by what its schedules count."""
    if not library.family.counts_steps:
        return f"{proof.seconds:g} s"
    return f"{proof.total.steps / max(proof.total.walks, 1):.0f} steps on average"


def describe_unmet(chosen: ChosenWalks, proof: ProofReport) -> str:
    """Say how many worlds, and how many contact models, no draw met."""
    worlds = sum(world.name in chosen.names for world in proof.worlds)
    counts = {"world": worlds, "contact model": len(chosen.names) - worlds}
    said = (f"{n} {name}{'s' * (n > 1)}" for name, n in counts.items() if n)
    return " and ".join(said)


def describe_chosen(chosen: ChosenWalks, proof: ProofReport) -> str:
    """Say what came of the walks that were no draws."""
    return (
        f"No walk was drawn for {describe_unmet(chosen, proof)}; each was walked once "
        f"after the test was sure, {chosen.steps} steps in all, "
        f"and {chosen.falls} of these walks fell. A fall counts against the verdict, "
        "and a walk without one does not count for it."
    )


def describe_before(before: Sequence[EarlierCriterion]) -> str:
    """Say by which criteria walks were judged beside another one, before or between."""
    return (
        "Walks were judged by other criteria as well, for the falls per step: "
        f"{'; '.join(each.describe() for each in before)}. The confidence is that of a "
        "single criterion, which is fixed before the first walk."
    )
