"""The fit of legs that hang from a trunk that is held: searched, then climbed. Ours."""

from collections.abc import Callable
from functools import partial

import numpy as np

from gaitchain.identify.certainty import fisher_information, posterior_covariance
from gaitchain.identify.joint_search import Group, JointSearch, Searched
from gaitchain.identify.motion_fit import Belief, Columns, MotionFit
from gaitchain.identify.parameters import OF_JOINTS, OF_SERVOS
from gaitchain.identify.rounds import Rounds
from gaitchain.identify.sensor_rows import IMU
from gaitchain.messages import Array

SEARCHES = 2
"""Rounds of the search joint by joint."""
REPLAYS = 96
"""Number of replays in each; more than numbers."""
CLIMBS, CROWD = 40, 32
"""Generations of the climb from there, at most, and replays in each."""
SURE, SURE_OWN = 0.3, 1.0
"""How far from what was found replays are that show how well the log tells it: parts of
the deviations that are believed, and of those by which a joint differs from others."""
SURE_REPLAYS = 96
"""Number of them, in pairs; more of these than of slopes."""
_LEAST_SPREAD = 0.03


class HungFit(MotionFit):
    """Legs that swing freely: each joint's rows tell of its own servo first."""

    rough = 1.0

    @property
    def most_rounds(self) -> int:
        """Number of rounds of a fit, at most."""
        return SEARCHES + CLIMBS + 1

    def fit(
        self, belief: Belief, rng: np.random.Generator, begin: Callable[[], None]
    ) -> tuple[Array, Array]:
        """Return the most likely numbers, and the covariance; see `MotionFit.fit`."""
        rounds = Rounds(rng, begin)
        found = self._searched(belief, rounds)
        known = partial(self.certainty, found, belief, rng)
        return found, rounds.run(known, Array)

    def _searched(self, belief: Belief, rounds: Rounds) -> Array:
        search = JointSearch(*belief, self._groups())
        select = partial(self._selected, search, rounds.rng)
        for _ in range(SEARCHES):
            search.go_on(rounds.run(select, Searched))
        return self._climbed(search, rounds, CLIMBS, CROWD)

    def _selected(self, search: JointSearch, rng: np.random.Generator) -> Searched:
        """Do one round of a search."""
        tried = self._clipped(search.draw(REPLAYS, rng))
        search.select(tried, self._weighed(self._missed_with(tried)))
        return search.searched

    def certainty(
        self, found: Array, belief: Belief, rng: np.random.Generator
    ) -> Array:
        """Return the covariance of numbers that were found: by pairs of replays.

        Args:
            found: the numbers.
            belief: without this motion.
            rng: source of randomness.
        """
        tried = self._clipped(found + self._around(belief, rng))
        tables = self._missed_with([found, *tried])
        rows = tables[1:] * self._weights(tables[0])
        moved, apart = _halves(tried), _halves(rows)
        told = np.zeros_like(belief.covariance)
        for sensors, numbers in self._effects():
            seen = apart[:, :, sensors].reshape(len(apart), -1)
            told[np.ix_(numbers, numbers)] += fisher_information(
                moved[:, numbers], seen
            )
        return posterior_covariance(belief.covariance, told)

    def _around(self, belief: Belief, rng: np.random.Generator) -> Array:
        """Draw deviations of replays around what was found, in pairs of opposites."""
        sd = np.sqrt(np.diag(belief.covariance))
        together, apart = self._parameters.draw(SURE_REPLAYS // 2, rng)
        half = np.maximum(SURE * sd, _LEAST_SPREAD) * together
        half += SURE_OWN * sd * apart
        return np.concatenate([half, -half])

    def _groups(self) -> list[Group]:
        """Return each joint's numbers, those of all servos, and those of the IMU."""
        numbers, joints = self._parameters, np.arange(self._joints)
        common = [i for name in (*OF_SERVOS, "lean") for i in numbers.places(name)]
        imu = self._joints + np.arange(IMU)
        return [
            *(
                Group(np.array(numbers.own(joint)), joints[joint : joint + 1])
                for joint in range(self._joints)
            ),
            Group(np.array(common), joints),
            Group(np.array(numbers.places("tilt")), imu),
        ]

    def _effects(self) -> list[tuple[Columns, Columns]]:
        """Return which sensors tell of which numbers, of each leg and of the IMU."""
        numbers, joints = self._parameters, np.arange(self._joints)
        imu, leg = self._joints + np.arange(IMU), self._joints // 2
        servos, lean = numbers.places(*OF_SERVOS), numbers.places("lean")
        shown = []
        for side in range(2):
            own = [
                place
                for place in numbers.places(*OF_JOINTS)
                if (numbers.all[place].index or 0) // leg == side
            ]
            of = np.array(sorted([*own, *servos, *lean]))
            shown.append((joints[joints // leg == side], of))
        tilt = np.array(sorted([*numbers.places("tilt"), *lean]))
        return [*shown, (imu, tilt)]


def _halves(rows: Array) -> Array:
    """Return half of what the first half of all rows differs by from the second."""
    first, second = np.split(rows, 2)
    return np.asarray(0.5 * (first - second))
