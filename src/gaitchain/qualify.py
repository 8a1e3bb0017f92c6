"""The physics gate: which steps hold, how far they go, whether a library walks."""

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import TypeVar

import numpy as np

from gaitchain.library import GaitLibrary, best_gaits
from gaitchain.physics import PhysicsCost
from gaitchain.sampling import Mask, cover_pairs
from gaitchain.trial import run_trials
from gaitchain.worlds import WorldRange

Progress = Callable[[str, int, int], None]
"""Called with (stage, done, total)."""
_T = TypeVar("_T")
# Not a seed that a user's trial has: those report, this one decides.
_GATE_SEED = 2**32
_ROUNDS = 5


@dataclass(frozen=True)
class Crew:
    """Who does the physics, and whom to tell about it."""

    workers: int
    tell: Progress
    worlds: WorldRange = field(default_factory=WorldRange)
    """How much the physics varies."""

    def told(self, stage: str, results: Iterator[_T], total: int) -> Iterator[_T]:
        """Pass results on and tell about each."""
        self.tell(stage, 0, total)
        for done, result in enumerate(results, start=1):
            self.tell(stage, done, total)
            yield result


def qualify_steps(
    draft: GaitLibrary,
    size: tuple[int, int],
    rng: np.random.Generator,
    crew: Crew,
    pairs: Mask | None = None,
) -> GaitLibrary:
    """Walk every pair of first and last pose; note its falls and its advance.

    Args:
        draft: a library without verdicts.
        size: number of walks, each in a world of its own, and steps of each.
        rng: source of randomness.
        crew: who does the physics.
        pairs: (N_1, N_4) those that may be walked; by default all that are joined.

    Returns:
        The library with `pair_runs`, `pair_passes` and `pair_advance`.
    """
    gait_of = best_gaits(draft.path_costs)
    joined = gait_of[..., 0] >= 0
    joined = joined if pairs is None else joined & pairs
    plan = cover_pairs(gait_of, joined, *size, rng)
    seed = int(rng.integers(2**31))
    source = PhysicsCost(
        draft.poses, draft.timing, worlds=crew.worlds, seed=seed, workers=crew.workers
    )
    results = crew.told("qualifying every step", source.walk_all(plan), len(plan))
    runs, passes = np.zeros_like(draft.pair_runs), np.zeros_like(draft.pair_runs)
    advance = np.zeros_like(draft.pair_advance)
    for walk, result in zip(plan, results, strict=True):
        made, held = ~np.isnan(result.cost), ~np.isnan(result.advance)
        np.add.at(runs, (walk[made, 0], walk[made, 3]), 1)
        np.add.at(passes, (walk[held, 0], walk[held, 3]), 1)
        np.add.at(advance, (walk[held, 0], walk[held, 3]), result.advance[held])
    mean = advance / np.maximum(passes, 1)
    return replace(draft, pair_runs=runs, pair_passes=passes, pair_advance=mean)


def gate(
    library: GaitLibrary,
    runs: int,
    share: float,
    seed: int,
    crew: Crew,
) -> GaitLibrary:
    """Walk random schedules in rounds; the library passes a round or it does not.

    A step on which a schedule fell is forbidden, and a new round, with schedules and
    worlds of its own, tests what is left.

    Args:
        library: with its verdicts on steps.
        runs: schedules per round.
        share: part of a round that must not fall.
        seed: the build's seed.
        crew: who does the physics.

    Returns:
        The library with its qualification.
    """
    survived, rounds = 0, 0
    while rounds < _ROUNDS and library.speed_range[1] > 0.0:
        stage = "walking random schedules" + (f", round {rounds + 1}" * (rounds > 0))
        trials = run_trials(
            library,
            runs,
            _GATE_SEED + _ROUNDS * seed + rounds,
            workers=crew.workers,
            worlds=crew.worlds,
            require_qualified=False,
        )
        fallen = [t.last_step for t in crew.told(stage, trials, runs) if t.fell]
        library = _forbid_steps(library, fallen)
        survived, rounds = runs - len(fallen), rounds + 1
        if survived >= share * runs:
            break
    qualification = {
        "passed": survived > 0 and survived >= share * runs,
        "rounds": rounds,
        "schedules": runs,
        "schedules_survived": survived,
        "open_loop": not library.dynamic,
        "speed_mps": list(library.speed_range),
        "commands": asdict(library.command_range),
        **asdict(crew.worlds),
    }
    plain = json.loads(json.dumps(qualification))  # as it comes back from a file
    return replace(library, qualification=plain)


def _forbid_steps(
    library: GaitLibrary, steps: Sequence[tuple[int, int]]
) -> GaitLibrary:
    """Count one more walk without a pass for each step."""
    runs = np.array(library.pair_runs)
    for first, last in steps:
        runs[first, last] += 1
    return replace(library, pair_runs=runs)
