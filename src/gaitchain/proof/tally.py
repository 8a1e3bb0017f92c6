"""Counts of a proof's walks: all, by world, contact model, disturbance and step."""

from gaitchain.build.grid import Cell
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.qualification import ChosenWalks, ProofReport, Stratum
from gaitchain.proof.proof_walks import CHOSEN, CONES, Criterion, ProofWalk
from gaitchain.proof.rate_test import rate_interval
from gaitchain.proof.step_strata import StepTally
from gaitchain.sim.world import DISTURBANCES
from gaitchain.walker.policy_table import safe_pairs

_NAMED = 100  # walks with a fall, by their numbers


class Tally:
    """Counts of walks, steps and falls; its memory does not grow with the walks."""

    def __init__(self, library: GaitLibrary, cells: list[Cell], longest: int) -> None:
        """Begin without a walk.

        Args:
            library: the gaits.
            cells: the mild worlds.
            longest: most steps that a walk may have.
        """
        self._cells, self._longest = cells, longest
        self._steps = StepTally(safe_pairs(library)[0])
        # Walks by world, contact model, whether they fell, and number of steps.
        self._lengths: dict[tuple[int, int, bool, int], int] = {}
        self._chosen: dict[int, ProofWalk] = {}
        self._fell_in: list[int] = []
        self._walks = self.steps = 0

    @property
    def missing(self) -> list[int]:
        """Numbers of the worlds, and after the last of the contact models, unwalked."""
        worlds = {world for world, _, _, _ in self._lengths}
        cones = {len(self._cells) + cone for _, cone, _, _ in self._lengths}
        walked = worlds | cones | self._chosen.keys()
        return [n for n in range(len(self._cells) + len(CONES)) if n not in walked]

    def choose(self, place: int, walk: ProofWalk) -> None:
        """Add a walk that was no draw."""
        self._chosen[place] = walk
        self._note(CHOSEN + place, walk)

    def add(self, walk: ProofWalk) -> None:
        """Add a walk that was drawn."""
        self._note(self._walks, walk)
        self._walks += 1
        length = walk.length
        kind = walk.world, walk.cone, walk.fell, length
        self._lengths[kind] = self._lengths.get(kind, 0) + 1
        self.steps += length
        self._steps.add(walk.steps, fell=walk.fell)

    def _note(self, number: int, walk: ProofWalk) -> None:
        if walk.fell and len(self._fell_in) < _NAMED:
            self._fell_in.append(number)

    def report(self, criterion: Criterion, verdict: str) -> ProofReport:
        """Return what is known of all walks.

        Args:
            criterion: what was to be shown.
            verdict: of the test.
        """
        kinds = list(dict.fromkeys(cell.kind for cell in self._cells))
        strata = len(self._cells) + len(kinds) + len(CONES)
        # Two ends each, any of which may be wrong. Those of all walks are the test's:
        # the upper one is at the bound where its verdict is "below".
        each = 1.0 - (1.0 - criterion.confidence) / (2 * strata)
        return ProofReport(
            bound=criterion.bound,
            confidence=criterion.confidence,
            verdict=verdict,
            seconds=criterion.seconds,
            total=self._stratum("all", criterion.confidence),
            worlds=tuple(
                self._stratum(cell.name, each, worlds={i}, place=i)
                for i, cell in enumerate(self._cells)
            ),
            contacts=tuple(
                self._stratum(_of_cone(i), each, cone=i, place=len(self._cells) + i)
                for i in range(len(CONES))
            ),
            kinds=tuple(
                self._stratum(
                    kind_label(kind),
                    each,
                    worlds={i for i, c in enumerate(self._cells) if c.kind == kind},
                )
                for kind in kinds
            ),
            steps=self._steps.report(self._longest, criterion.confidence),
            fell_in=tuple(self._fell_in),
            chosen=self._report_chosen(),
        )

    def _report_chosen(self) -> ChosenWalks | None:
        """Return what came of walks that were no draws; None without one."""
        if not self._chosen:
            return None
        names = [cell.name for cell in self._cells]
        names += (_of_cone(i) for i in range(len(CONES)))
        walks = self._chosen.values()
        return ChosenWalks(
            names=tuple(names[place] for place in self._chosen),
            steps=sum(walk.length for walk in walks),
            falls=sum(walk.fell for walk in walks),
        )

    def _stratum(
        self,
        name: str,
        confidence: float,
        worlds: set[int] | None = None,
        cone: int | None = None,
        place: int | None = None,
    ) -> Stratum:
        """Return what is known of drawn walks, and of the one chosen for a place."""
        walks = [
            (length, fell, count)
            for (of, model, fell, length), count in self._lengths.items()
            if (worlds is None or of in worlds) and cone in (None, model)
        ]
        if place in self._chosen:
            walk = self._chosen[place]
            walks.append((walk.length, walk.fell, 1))
        number = sum(count for _, _, count in walks)
        steps = sum(length * count for length, _, count in walks)
        falls = sum(count for _, fell, count in walks if fell)
        low, high = rate_interval(walks, self._longest, confidence)
        return Stratum(name, number, steps, falls, low, high)


def kind_label(kind: str) -> str:
    """Return the name of a kind of worlds in a report."""
    return DISTURBANCES[kind].label if kind in DISTURBANCES else kind


def _of_cone(number: int) -> str:
    return f"{CONES[number]} friction"
