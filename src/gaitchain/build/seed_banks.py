"""Banks of seeds: a stage of a build has walks that nothing else in it has.

A bank reserves some seeds for each build, in the order of the builds' own seeds. In
any one build the banks follow each other in the same order without touching, because
their begins and ends grow evenly with the build's seed, and are apart for the least
and for the largest one. All lie above the seeds of a user's trials.
"""

from typing import NamedTuple

TRIALS = 2**32
"""Seeds of a user's trials are below."""


class SeedBank(NamedTuple):
    """Seeds of one stage."""

    base: int
    each: int
    """Seeds that each build has."""

    def first(self, build_seed: int) -> int:
        """Return the first seed of a build."""
        return self.base + self.each * build_seed


GATE = SeedBank(2**32, 16)
"""Rounds of random schedules."""
STEADY = SeedBank(2**33, 4096)
"""Walks that go on and on."""
OWN_STEADY = SeedBank(2**35, 4096)
"""The same in the robot's own model."""
HARD = SeedBank(2**36, 4096)
"""Walks at the ends of the range in other worlds, and schedules in these."""
OWN_GATE = SeedBank(2**42, 16)
"""Rounds of random schedules in the robot's own model."""
NO_WALK = SeedBank(2**43, 1)
"""Walks that say why none holds."""
