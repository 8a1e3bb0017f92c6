"""The fit of a robot that stands and sways: by smooth slopes, then climbed. Ours.

Smooth slopes lead to where they end: zeros that are off put the soles on other edges,
where slopes point elsewhere. What they leave unknown of zeros and CoM is long and
narrow, and a replay with numbers anywhere along it misses nearly as little. So a
CMA-ES [Hansen01] goes on from there, whose first draws have the covariance that smooth
slopes leave: it needs no slope, and does not search across the valley.
"""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from gaitchain.errors import LogError
from gaitchain.identify.certainty import ALIKE, posterior_covariance
from gaitchain.identify.chord import GaussianPrior, follow, slopes
from gaitchain.identify.joint_search import Group, JointSearch, Searched
from gaitchain.identify.log import Measured
from gaitchain.identify.motion_fit import NOISE, Belief, MotionFit
from gaitchain.identify.parameters import OF_SERVOS, OF_STAND
from gaitchain.identify.rounds import Rounds
from gaitchain.identify.sensor_rows import BLOCK
from gaitchain.messages import Array

SMOOTH = 3
"""Times that smooth slopes are taken, at most."""
EXPLAINED = 0.5 * (BLOCK + 1)
"""Most likeness of a joint's residuals, see `spread`, with which they have led to where
residuals are noise, mostly."""
CLIMBS, CROWD = 40, 16
"""Generations of the climb from there, and replays in each."""
REPLAYS = 96
"""Number of replays in a round of a regression; more than numbers."""
OTHER = 2.0
"""Times its residual that a row counts as, once more, in what smooth slopes tell: they
are those of another robot."""
CLIMB_SPREAD = 0.5
"""Deviations with which a climb begins, of what smooth slopes leave unknown."""
_CLIMBED = "offset", "tilt", *OF_STAND  # what hung legs do not tell
_ROUGHEN = "backlash_deg", "dry_friction", "stiction"  # what smooth slopes are without
_BY_HUNG_LEGS = "damping", "backlash_deg", "dry_friction", *OF_SERVOS
"""Numbers of which a stand says what the smooth robot does not have, or next to
nothing."""
_SLOPE, _LEAST_SLOPE = 0.3, 0.1  # differences, of deviations; least of these
_STEPS = (1.0, 0.5)  # parts of a Gauss-Newton step that are tried
_LEAST_SPREAD = 0.03


class StandFit(MotionFit):
    """A robot on its own soles: all rows tell of all numbers."""

    rough = 5.0

    @property
    def most_rounds(self) -> int:
        """Number of rounds of a fit, at most."""
        return SMOOTH + 1 + CLIMBS + 1

    def fit(
        self, belief: Belief, rng: np.random.Generator, begin: Callable[[], None]
    ) -> tuple[Array, Array]:
        """Return the most likely numbers, and the covariance; see `MotionFit.fit`.

        Raises:
            LogError: every replay falls.
        """
        rounds = Rounds(rng, begin)
        found = self._settled(belief, rounds)
        known = partial(self.certainty, found, belief)
        return found, rounds.run(known, Array)

    def _settled(self, belief: Belief, rounds: Rounds) -> Array:
        """Return the most likely numbers."""
        found = belief.mean
        if not all(self._stood(self._replays([found]))):
            # Where it falls there are no slopes: begin near a replay that does not.
            found = self.improve(found, belief, rounds.rng)
        least, most = self._parameters.least, self._parameters.most
        precision = np.asarray(np.linalg.inv(belief.covariance))
        prior = GaussianPrior(belief.mean, precision, least, most)
        alike = np.inf
        for _ in range(SMOOTH):
            found = rounds.run(partial(self._followed, found, belief, prior), Array)
            alike = self.alike(found)
            if alike < EXPLAINED:
                break
        return found if alike < NOISE else self._climbed_from(found, belief, rounds)

    def _followed(self, start: Array, belief: Belief, prior: GaussianPrior) -> Array:
        """Return where smooth slopes at the start lead."""
        slope = self._smooth_slopes(start, belief)
        return follow(start, slope, prior, self._missed_with, self._weights)

    def _smooth_slopes(self, at: Array, belief: Belief) -> Array:
        """Return slopes of a robot without play and dry friction."""
        sd, lean = np.sqrt(np.diag(belief.covariance)), self._parameters.places("lean")
        by = _SLOPE * np.maximum(sd, _LEAST_SLOPE)
        by[lean] = 0.0
        plain = self._parameters.without(at, *_ROUGHEN)
        ahead, behind = (self._clipped(plain + np.diag(way * by)) for way in (1, -1))
        return slopes(ahead, behind, self._missed_standing)

    def _missed_standing(self, vectors: Array) -> Array:
        """Return what replays miss; NaN of those that fell."""
        replays = self._replays(vectors)
        tables = self._tables(replays)
        tables[~self._stood(replays)] = np.nan
        return tables

    def _climbed_from(self, start: Array, belief: Belief, rounds: Rounds) -> Array:
        """Return zeros and CoM that a climb finds from where smooth slopes end."""
        left = rounds.run(partial(self.certainty, start, belief), Array)
        numbers = np.array(self._parameters.places(*_CLIMBED))
        everything = np.arange(self._measured.shape[1])
        search = JointSearch(*belief, [Group(numbers, everything)])
        spread = CLIMB_SPREAD**2 * left[np.ix_(numbers, numbers)]
        search.go_on(Searched(start, [spread]))
        return self._climbed(search, rounds, CLIMBS, CROWD)

    def improve(self, start: Array, belief: Belief, rng: np.random.Generator) -> Array:
        """Return better numbers by a regression over replays all around.

        Args:
            start: numbers found so far.
            belief: without this motion.
            rng: source of randomness.

        Raises:
            LogError: every replay falls.
        """
        tried = self._clipped(start + self._around(belief, rng))
        replays = self._replays([start, *tried])
        tables = self._tables(replays)
        weights = self._weights(tables[0])
        precision = np.linalg.inv(belief.covariance)
        whole = self._stood(replays[1:])
        _check_stood(whole)
        level, slope = _regression(tried[whole] - start, weights * tables[1:][whole])
        curve = slope @ slope.T + precision
        back = slope @ level + precision @ (start - belief.mean)
        step = -np.linalg.solve(curve, back)
        ahead = self._clipped(np.array([start + part * step for part in _STEPS]))
        vectors = np.array([*ahead, start, *tried])
        missed = np.array([*self._missed_with(ahead), *tables])
        off = vectors - belief.mean
        costs = np.sum((weights * missed) ** 2, axis=(1, 2))
        costs += np.einsum("ij,jk,ik->i", off, precision, off)
        best: Array = vectors[int(np.argmin(costs))]
        return best

    def _around(self, belief: Belief, rng: np.random.Generator) -> Array:
        """Draw deviations as they are believed, in pairs of opposite ones."""
        sd = np.sqrt(np.diag(belief.covariance))
        together, _ = self._parameters.draw(REPLAYS // 2, rng)
        half = np.maximum(sd, _LEAST_SPREAD) * together
        half[:, self._parameters.places("lean")] = 0.0
        return np.concatenate([half, -half])

    def certainty(self, found: Array, belief: Belief) -> Array:
        """Return the covariance of numbers that were found: by smooth slopes.

        Args:
            found: the numbers.
            belief: without this motion.

        Raises:
            LogError: the robot falls with them.
        """
        replays = self._replays([found])
        _check_stood(self._stood(replays))
        weights = self._weights(self._table(replays[0])) / OTHER
        slope = self._smooth_slopes(found, belief) * weights[:, None]
        slope[..., self._parameters.places(*_BY_HUNG_LEGS)] = 0.0
        flat = slope.reshape(-1, len(found))
        return posterior_covariance(belief.covariance, flat.T @ flat)

    def _stood(self, replays: Sequence[Measured]) -> NDArray[np.bool_]:
        """Return which replays stayed on their feet."""
        return np.array([len(r.joint_position) == len(self._measured) for r in replays])


def _regression(moved: Array, rows: Array) -> tuple[Array, Array]:
    """Return residuals at the start (R,) and their slopes (P, R).

    Args:
        moved: (M, P) deviations of the replays' numbers from the start.
        rows: (M, N, S) what each missed, in deviations of each row.
    """
    design = np.column_stack([np.ones(len(moved)), moved])
    size = np.maximum(np.linalg.norm(design, axis=0), 1e-12)
    seen = rows.reshape(len(moved), -1)
    scaled = np.linalg.lstsq(design / size, seen, rcond=ALIKE)[0]
    level, *slope = scaled / size[:, None]
    return level, np.array(slope)


def _check_stood(stood: NDArray[np.bool_]) -> None:
    """Refuse replays of which none stayed on its feet.

    Raises:
        LogError: it is so.
    """
    if not stood.any():
        raise LogError(
            "every replay of the log falls, as if it were that of another robot; "
            "check the masses and the servos of the file"
        )
