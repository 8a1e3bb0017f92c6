"""Presets of candidate key poses: Table I as printed, and the closed default."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from gaitchain.errors import CommandError, UnreachableError
from gaitchain.gait.family import LAYERS
from gaitchain.gait.keypose.key_poses import KeyPoses
from gaitchain.gait.keypose.primitives import (
    PARAMETERS,
    compose,
    compose_rates,
    factorise,
    move_by_swing_leg,
    swing,
)
from gaitchain.gait.motion import Timing
from gaitchain.messages import Array
from gaitchain.robot.kinematics import com, exchange_roles
from gaitchain.robot.robot import Robot

CROUCH = 0.866
"""Hip above the ankle in the default preset, part of the leg."""
_TRIES = 1000
_FOOT_X, _FOOT_Z, _SWAY = map(PARAMETERS.index, ("foot_x", "foot_z", "sway"))
_STRAIGHTEST = 0.985  # of the leg: largest distance hip to rear ankle at toe-off


Sways = tuple[float, float]
"""Least and largest sway over the support foot [rad]."""


@dataclass(frozen=True)
class Preset:
    """A rule by which candidate poses are drawn."""

    name: str
    counts: tuple[int, int, int, int]
    """Default number of candidates per key moment."""
    draw: Callable[..., KeyPoses]
    """Draws the candidates of a robot, for times, counts, a generator and sways."""


def draw_candidates(
    robot: Robot,
    preset: str,
    rng: np.random.Generator,
    timing: Timing | None = None,
    counts: Sequence[int] | None = None,
    sways: Sways | None = None,
) -> KeyPoses:
    """Draw the candidate poses of a preset from its ranges.

    Args:
        robot: the robot.
        preset: "table1" (the printed ranges) or "default" (closed and scaled).
        rng: source of randomness; candidates out of reach are drawn again.
        timing: the step's times, with which the rates of "default" scale.
        counts: candidates per layer; those of the preset by default.
        sways: least and largest sway of "default" over the support foot [rad], for
            servos that follow the plan (`weight_shift`); by default those of RES.

    Returns:
        The candidates.

    Raises:
        CommandError: the preset is unknown, or the counts are not possible.
        UnreachableError: no draw from a range is within the robot's reach.
    """
    if preset not in PRESETS:
        raise CommandError(f"preset {preset!r}: known presets are {', '.join(PRESETS)}")
    recipe = PRESETS[preset]
    sizes = tuple(recipe.counts if counts is None else counts)
    whole = all(isinstance(size, int | np.integer) for size in sizes)
    if len(sizes) != LAYERS or not whole or min(sizes) < 2:
        raise CommandError(f"poses per layer {sizes}: need {LAYERS} numbers >= 2")
    return recipe.draw(robot, timing or Timing(), sizes, rng, sways)


def geometric_sway(robot: Robot, hip_height: float) -> float:
    """Compute the sway that puts the standing robot's CoM over the sole's centre line.

    Ours: the CoM moves sideways in proportion to sin(theta). For RES the sway is
    16.7 deg at the default crouch; the walk needs 0.785 to 0.82 of it (13.1 to
    13.7 deg, compared with 12 deg in Table I), which brings the CoM over the sole.

    Args:
        robot: the robot.
        hip_height: hip above the ankle [m].

    Returns:
        Sway [rad].

    Raises:
        UnreachableError: the feet are too far apart for the CoM to get over one.
    """
    upright = np.array([0.0, hip_height, 0.0, 0.0, 0.0])
    tilted = upright + np.array([0.0, 0.0, 0.0, 0.0, 0.1])
    start, end = (com(robot.reduced, compose(robot, p))[1] for p in (upright, tilted))
    sine = -start / (end - start) * np.sin(0.1)
    if sine >= 1.0:
        raise UnreachableError(
            f"hip_width = {robot.reduced.hip_width:g} m: no sway brings the CoM "
            "over one sole; reachable with less than "
            f"{robot.reduced.hip_width / sine:.3f} m"
        )
    return float(np.arcsin(sine))


def _draw_default(
    robot: Robot,
    timing: Timing,
    counts: Sequence[int],
    rng: np.random.Generator,
    sways: Sways | None,
) -> KeyPoses:
    """Draw the closed preset: ranges around a walk that is stable in physics.

    Ours. Lengths scale with the leg, sways with `geometric_sway`, rates with 1 / T.
    The ranges surround the optimum of a search over 18 parameters in MuJoCo
    (`docs/experiments.md`). A kp_2 is drawn for the step lengths before and after it, a
    kp_3 for the one after it.
    """
    if counts[0] != counts[3]:
        raise CommandError(
            f"poses per layer {tuple(counts)}: kp_4 is the next step's kp_1, so the "
            "first and last number must be equal"
        )
    recipe = (
        _DefaultRecipe(robot, timing, rng)
        if sways is None
        else _FollowedRecipe(robot, timing, rng, sways)
    )
    longest = 0.56 * robot.reduced.leg_length
    shortest = 0.085 * robot.reduced.leg_length
    # Equal ratios, so that the relative error is the same at every speed.
    lengths = np.array([0.0, *np.geomspace(shortest, longest, counts[0] - 1)])
    pairs = _step_pairs(lengths, counts[1], rng)
    landings = lengths[np.arange(counts[2]) % counts[3]]
    made = (
        _reachable(robot, recipe.kp_1, lengths[:, None]),
        _reachable(robot, recipe.kp_2, pairs),
        _reachable(robot, recipe.kp_3, landings[:, None]),
    )
    parameters, rates = (tuple(m[:, part] for m in made) for part in (0, 1))
    last = factorise(robot, exchange_roles(compose(robot, parameters[0]))).parameters
    # Both feet stand still at kp_1, so the rates are the same from either foot.
    return KeyPoses(robot, (*parameters, last), (*rates, rates[0]), closed=True)


class _DefaultRecipe:
    """Draws the parameters and rates of one candidate, (2, 5), at each key moment."""

    def __init__(self, robot: Robot, timing: Timing, rng: np.random.Generator) -> None:
        self._leg = robot.reduced.leg_length
        self._height = CROUCH * self._leg
        self._sway = geometric_sway(robot, self._height)
        self._step_s = timing.step
        self._rng = rng

    def kp_1(self, length: float) -> Array:
        lead = 0.008 * self._leg + self._uniform(0.11, 0.19) * length
        sway = self._uniform(0.255, 0.3) * self._sway
        speed = self._uniform(0.5, 0.7) * length / self._step_s
        if length == 0.0:  # standing
            lead = sway = speed = 0.0
        if np.hypot(length - lead, self._height) > _STRAIGHTEST * self._leg:
            raise UnreachableError("a knee this straight bends too fast at lift-off")
        pose = [-lead, self._height, -length, 0.0, sway]
        return np.array([pose, [speed, 0.0, 0.0, 0.0, 0.0]])

    def kp_2(self, before: float, after: float) -> Array:
        share = self._uniform(0.3, 0.36)
        place = share * after - (1.0 - share) * before
        hip_x = self._uniform(-0.065, -0.035) * self._leg
        lift = self._uniform(0.06, 0.066) * self._leg
        sway = self._uniform(0.785, 0.82) * self._sway
        reach = (before + after) / self._step_s
        speed, hip_speed = self._uniform(1.65, 2.0) * reach, -0.12 * reach
        pose = [hip_x, self._height, place, lift, sway]
        return np.array([pose, [hip_speed, 0.0, speed, 0.0, 0.0]])

    def kp_3(self, length: float) -> Array:
        hip_x = 0.136 * length + self._uniform(-0.01, 0.022) * self._leg
        hip_speed = self._uniform(0.2, 0.37) * length / self._step_s
        foot_x = self._uniform(0.985, 0.998) * length
        lift = self._uniform(0.028, 0.032) * self._leg
        sway = self._uniform(0.6, 0.655) * self._sway
        fall = self._uniform(0.03, 0.11) * self._leg / self._step_s
        pose = [hip_x, self._height, foot_x, lift, sway]
        return np.array([pose, [hip_speed, 0.0, 0.0, -fall, 0.0]])

    def _uniform(self, low: float, high: float) -> float:
        return float(self._rng.uniform(low, high))


class _FollowedRecipe(_DefaultRecipe):
    """The same for servos that follow the plan instead of sagging.

    The weight is over the support foot as long as the other one is in the air, also
    where a walk begins: the robot stands with its weight over one leg, as in the first
    picture of the paper's Fig. 10. The foot is down at kp_3.
    """

    def __init__(
        self, robot: Robot, timing: Timing, rng: np.random.Generator, sways: Sways
    ) -> None:
        super().__init__(robot, timing, rng)
        self._sways = sways

    def kp_1(self, length: float) -> Array:
        drawn = super().kp_1(length)
        drawn[0, _SWAY] = self._sways[0]
        return drawn

    def kp_2(self, before: float, after: float) -> Array:
        drawn = super().kp_2(before, after)
        drawn[0, _SWAY] = self._uniform(*self._sways)
        return drawn

    def kp_3(self, length: float) -> Array:
        drawn = super().kp_3(length)
        drawn[0, _SWAY] = self._uniform(*self._sways)
        drawn[0, _FOOT_X], drawn[0, _FOOT_Z], drawn[1, _FOOT_Z] = length, 0.0, 0.0
        return drawn


def _step_pairs(lengths: Array, count: int, rng: np.random.Generator) -> Array:
    """Return pairs of step lengths before and after kp_2: equal ones, then others.

    The others are spread evenly by Kronecker's sequence [Roberts18].
    """
    steady = lengths[1 : count // 2 + 1]
    plastic = 1.32471795724474602596  # x^3 = x + 1
    steps = np.arange(count - len(steady))[:, None]
    others = (rng.random(2) + steps * np.array([1.0 / plastic, 1.0 / plastic**2])) % 1.0
    return np.concatenate([np.stack([steady, steady], axis=1), lengths[-1] * others])


def _draw_table1(
    robot: Robot,
    timing: Timing,
    counts: Sequence[int],
    rng: np.random.Generator,
    sways: Sways | None,
) -> KeyPoses:
    """Draw Table I as printed, and the hip, which it leaves open.

    That is row 6 of what `docs/paper_map.md` says that we decided.

    At kp_1, kp_3 and kp_4 the swing leg's angles are given, so the hip follows by
    closure. At kp_2 it is drawn between the hips of kp_1 and kp_3.
    """
    del timing, sways  # all rates are 0, sways are as printed

    def angles(femur: tuple[float, float], crus: tuple[float, float]) -> Array:
        return np.radians([rng.uniform(*femur), rng.uniform(*crus)])

    def closure(leg: Array, foot_x: float, foot_z: float, sway_deg: float) -> Array:
        upright = swing(np.zeros(7), np.radians(sway_deg))
        q = move_by_swing_leg(robot, upright, leg, foot_x, foot_z)
        return np.stack([factorise(robot, q).parameters, np.zeros(5)])

    def kp_1() -> Array:
        return closure(angles((10, 15), (15, 20)), -0.15, 0.0, rng.choice([3, 8]))

    def kp_3() -> Array:
        leg = angles((-20, -15), (-15, -10))
        foot_x, foot_z = rng.choice([0.12, 0.14]), rng.choice([0.01, 0.02])
        return closure(leg, foot_x, foot_z, rng.choice([3, 8]))

    def kp_4() -> Array:
        leg = angles((-25, -20), (-20, -15))
        return closure(leg, 0.15, 0.0, rng.choice([-1, 1]))

    first, third, last = (
        _reachable(robot, draw, np.empty((counts[i], 0)))[:, 0]
        for i, draw in ((0, kp_1), (2, kp_3), (3, kp_4))
    )
    hips = np.concatenate([first, third])[:, :2]

    def kp_2() -> Array:
        hip_x, hip_height = rng.uniform(hips.min(axis=0), hips.max(axis=0))
        foot_x, foot_z = rng.choice([0.02, 0.04]), rng.choice([0.04, 0.08])
        pose = np.array([hip_x, hip_height, foot_x, foot_z, np.radians(12.0)])
        return np.stack([pose, np.zeros(5)])

    second = _reachable(robot, kp_2, np.empty((counts[1], 0)))[:, 0]
    rates = tuple(np.zeros((n, len(PARAMETERS))) for n in counts)
    return KeyPoses(robot, (first, second, third, last), rates, closed=False)


def _reachable(robot: Robot, draw: Callable[..., Array], places: Array) -> Array:
    """Draw one candidate per row of `places`, again while it is out of reach.

    Args:
        robot: the robot.
        draw: returns (2, 5) parameters and rates for the numbers of a row.
        places: (N, K) arguments of `draw`, such as step lengths.

    Returns:
        (N, 2, 5) candidates.
    """
    result = []
    for place in places:
        for attempt in range(_TRIES):
            try:
                candidate = draw(*place.tolist())
                compose_rates(robot, *candidate)
            except UnreachableError as error:
                if attempt == _TRIES - 1:
                    raise UnreachableError(
                        f"no candidate pose in {_TRIES} draws is in reach: {error}"
                    ) from None
            else:
                result.append(candidate)
                break
    return np.array(result)


PRESETS = {
    "default": Preset("default", (13, 30, 26, 13), _draw_default),
    "table1": Preset("table1", (5, 10, 10, 5), _draw_table1),
}
