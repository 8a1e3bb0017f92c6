"""Candidate key poses: Table I as printed, and the closed, scaled default.

Layer i holds the candidates of key moment kp_i. A candidate is its primitive
parameters and their rates; pose and velocity follow (Eq. 1). In a *closed* set,
candidate j of layer 4 with the legs' roles exchanged is candidate j of layer 1, and
candidate 0 of both is the standing pose: a step from it is the first half step, a
step to it the last one.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gaitchain.biped import Biped
from gaitchain.errors import CommandError, UnreachableError
from gaitchain.kinematics import Array, com, exchange_roles
from gaitchain.motion import Timing
from gaitchain.primitives import (
    PARAMETERS,
    compose,
    compose_rates,
    factorise,
    move_by_swing_leg,
    swing,
)

STAND = 0
"""Index of the standing pose in layers 1 and 4 of a closed set."""
LAYERS = 4
_TRIES = 1000


@dataclass(frozen=True, eq=False)
class KeyPoses:
    """The candidates of each key moment, made of primitives."""

    biped: Biped
    parameters: tuple[Array, ...]
    """Per layer (N_i, 5) primitive `PARAMETERS`."""
    rates: tuple[Array, ...]
    """Per layer (N_i, 5) their time derivatives."""
    closed: bool
    """Whether layer 4, roles exchanged, is layer 1."""

    def __post_init__(self) -> None:
        q = tuple(compose(self.biped, p) for p in self.parameters)
        pairs = zip(self.parameters, self.rates, strict=True)
        dq = tuple(compose_rates(self.biped, p, r) for p, r in pairs)
        for name, arrays in (
            ("parameters", self.parameters),
            ("rates", self.rates),
            ("q", q),
            ("dq", dq),
        ):
            frozen = tuple(np.array(a, dtype=float) for a in arrays)
            for array in frozen:
                array.setflags(write=False)
            object.__setattr__(self, name, frozen)

    q: tuple[Array, ...] = ()
    """Per layer (N_i, 7) poses [rad]; derived."""
    dq: tuple[Array, ...] = ()
    """Per layer (N_i, 7) velocities [rad/s]; derived."""

    @property
    def counts(self) -> tuple[int, ...]:
        """Candidates per key moment."""
        return tuple(len(p) for p in self.parameters)

    @property
    def foot_x(self) -> tuple[Array, ...]:
        """Per layer (N_i,) swing ankle ahead of the support ankle, the paper's x6."""
        return tuple(p[:, PARAMETERS.index("foot_x")] for p in self.parameters)

    @property
    def step_lengths(self) -> Array:
        """(N_4,) step length that each candidate of the last layer ends with [m]."""
        return self.foot_x[-1]

    def keep(self, kept: Sequence[NDArray[np.int64]]) -> "KeyPoses":
        """Return the set without the candidates that pruning dropped."""
        return KeyPoses(
            self.biped,
            tuple(p[k] for p, k in zip(self.parameters, kept, strict=True)),
            tuple(r[k] for r, k in zip(self.rates, kept, strict=True)),
            self.closed,
        )


@dataclass(frozen=True)
class Preset:
    """A recipe for candidate poses."""

    name: str
    counts: tuple[int, int, int, int]
    """Candidates per key moment when the caller names none."""
    draw: Callable[[Biped, Timing, Sequence[int], np.random.Generator], KeyPoses]


def draw_candidates(
    biped: Biped,
    preset: str,
    rng: np.random.Generator,
    timing: Timing | None = None,
    counts: Sequence[int] | None = None,
) -> KeyPoses:
    """Draw the candidate poses of a preset from its ranges.

    Args:
        biped: the robot.
        preset: "table1" (the printed ranges) or "default" (closed and scaled).
        rng: source of randomness; candidates out of reach are drawn again.
        timing: step timing, which the default's rates scale with.
        counts: candidates per layer; the preset's own by default.

    Returns:
        The candidates.

    Raises:
        CommandError: the preset or the counts are unknown or impossible.
        UnreachableError: a range stays out of the robot's reach.
    """
    if preset not in PRESETS:
        raise CommandError(f"preset {preset!r}: known presets are {', '.join(PRESETS)}")
    recipe = PRESETS[preset]
    sizes = tuple(recipe.counts if counts is None else counts)
    if len(sizes) != LAYERS or min(sizes) < 2:
        raise CommandError(f"poses per layer {sizes}: need {LAYERS} numbers >= 2")
    return recipe.draw(biped, timing or Timing(), sizes, rng)


def geometric_sway(biped: Biped, hip_height: float) -> float:
    """Sway that puts the standing robot's CoM over the support sole's centre line.

    Ours: the CoM moves sideways in proportion to sin(theta). For RES it is 16.5 deg
    at the default crouch; the walk needs 0.75 to 0.82 of it (12.4 to 13.5 deg, beside
    the 12 deg of Table I), which brings the CoM onto the sole.

    Args:
        biped: the robot.
        hip_height: hip above the ankle [m].

    Returns:
        Sway [rad].
    """
    upright = np.array([0.0, hip_height, 0.0, 0.0, 0.0])
    tilted = upright + np.array([0.0, 0.0, 0.0, 0.0, 0.1])
    start, end = (com(biped, compose(biped, p))[1] for p in (upright, tilted))
    return float(np.arcsin(min(1.0, -start / (end - start) * np.sin(0.1))))


def _draw_default(
    biped: Biped, timing: Timing, counts: Sequence[int], rng: np.random.Generator
) -> KeyPoses:
    """Draw the closed preset: ranges around a walk that holds in physics.

    Ours. Lengths scale with the leg, sways with `geometric_sway`, rates with 1 / T.
    The ranges surround the optimum of a search over 12 parameters in MuJoCo
    (`docs/design.md`); each kp_3 belongs to one step length.
    """
    if counts[0] != counts[3]:
        raise CommandError(
            f"poses per layer {tuple(counts)}: kp_4 is the next step's kp_1, so the "
            "first and last number must be equal"
        )
    leg = biped.leg_length
    height = 0.875 * leg
    sway = geometric_sway(biped, height)
    lengths = np.concatenate([[0.0], np.linspace(0.085, 0.62, counts[0] - 1) * leg])

    def uniform(low: float, high: float) -> float:
        return float(rng.uniform(low, high))

    def landing(length: float) -> Array:
        lead = 0.02 * leg + uniform(0.2, 0.28) * length
        lift_off = uniform(0.25, 0.32) * sway
        if length == 0.0:
            lead, lift_off = 0.0, 0.0
        return np.array([-lead, height, -length, 0.0, lift_off])

    def apex(place: float) -> Array:
        hip_x = uniform(-0.03, 0.01) * leg
        lift = uniform(0.068, 0.095) * leg
        return np.array([hip_x, height, place, lift, uniform(0.75, 0.82) * sway])

    def contact(length: float) -> Array:
        hip_x = 0.315 * length + uniform(0.0, 0.04) * leg
        foot_x, lift = uniform(0.98, 1.0) * length, uniform(0.023, 0.032) * leg
        return np.array([hip_x, height, foot_x, lift, uniform(0.37, 0.45) * sway])

    places = np.linspace(-0.32, 0.27, counts[1]) * leg
    shared = [lengths[i % counts[3]] for i in range(counts[2])]
    first = _reachable(biped, landing, lengths)
    second = _reachable(biped, apex, places)
    third = _reachable(biped, contact, shared)
    rates = [np.zeros((n, len(PARAMETERS))) for n in counts]
    rates[1][:, PARAMETERS.index("foot_x")] = (
        rng.uniform(0.4, 1.6, counts[1]) * leg / timing.step
    )
    last = factorise(biped, exchange_roles(compose(biped, first))).parameters
    return KeyPoses(biped, (first, second, third, last), tuple(rates), closed=True)


def _draw_table1(
    biped: Biped, timing: Timing, counts: Sequence[int], rng: np.random.Generator
) -> KeyPoses:
    """Draw Table I as printed; what it leaves open is the hip (decisions row 6).

    kp_1, kp_3 and kp_4 name the swing leg's angles, so the hip follows by closure. At
    kp_2 it is drawn between the hips of kp_1 and kp_3.
    """
    del timing  # at rest at every key moment

    def angles(femur: tuple[float, float], crus: tuple[float, float]) -> Array:
        return np.radians([rng.uniform(*femur), rng.uniform(*crus)])

    def closure(leg: Array, foot_x: float, foot_z: float, sway_deg: float) -> Array:
        upright = swing(np.zeros(7), np.radians(sway_deg))
        q = move_by_swing_leg(biped, upright, leg, foot_x, foot_z)
        return factorise(biped, q).parameters

    def kp_1(_: float) -> Array:
        return closure(angles((10, 15), (15, 20)), -0.15, 0.0, rng.choice([3, 8]))

    def kp_3(_: float) -> Array:
        leg = angles((-20, -15), (-15, -10))
        foot_x, foot_z = rng.choice([0.12, 0.14]), rng.choice([0.01, 0.02])
        return closure(leg, foot_x, foot_z, rng.choice([3, 8]))

    def kp_4(_: float) -> Array:
        leg = angles((-25, -20), (-20, -15))
        return closure(leg, 0.15, 0.0, rng.choice([-1, 1]))

    first = _reachable(biped, kp_1, np.zeros(counts[0]))
    third = _reachable(biped, kp_3, np.zeros(counts[2]))
    last = _reachable(biped, kp_4, np.zeros(counts[3]))
    hips = np.concatenate([first, third])[:, :2]

    def kp_2(_: float) -> Array:
        hip_x, hip_height = rng.uniform(hips.min(axis=0), hips.max(axis=0))
        foot_x, foot_z = rng.choice([0.02, 0.04]), rng.choice([0.04, 0.08])
        return np.array([hip_x, hip_height, foot_x, foot_z, np.radians(12.0)])

    second = _reachable(biped, kp_2, np.zeros(counts[1]))
    rates = tuple(np.zeros((n, len(PARAMETERS))) for n in counts)
    return KeyPoses(biped, (first, second, third, last), rates, closed=False)


def _reachable(
    biped: Biped, draw: Callable[[float], Array], places: Sequence[float] | Array
) -> Array:
    """Draw one candidate per place, again while the legs cannot reach it."""
    result = []
    for place in places:
        for attempt in range(_TRIES):
            try:
                parameters = draw(float(place))
                compose(biped, parameters)
            except UnreachableError as error:
                if attempt == _TRIES - 1:
                    raise UnreachableError(
                        f"no candidate pose in {_TRIES} draws is in reach: {error}"
                    ) from None
            else:
                result.append(parameters)
                break
    return np.array(result)


PRESETS = {
    "default": Preset("default", (10, 20, 20, 10), _draw_default),
    "table1": Preset("table1", (5, 10, 10, 5), _draw_table1),
}
