"""The gains of the balance, each declared once: meaning, size, and without feedback.

Lengths go with the leg l, speeds with sqrt(g l), rates with sqrt(g / l), so that two
robots of one shape walk alike. The numbers come from searches in physics; what was
tried, and what came of it, is in `docs/experiments.md`. A new gain is one field of
`Gains`: all that takes a gain by its name, as the factors of a library do, then knows
it.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from gaitchain.balance.compiled import compiled
from gaitchain.balance.leg_kinematics import Legs, ankle_joints
from gaitchain.balance.state import Planar
from gaitchain.errors import CommandError
from gaitchain.messages import GRAVITY

_STIFF = 3.0  # of m g h: servos this stiff need no more than the least ankle gain


class Scale(NamedTuple):
    """The numbers of a robot that its gains are parts of."""

    leg: float
    """l [m]."""
    speed: float
    """sqrt(g l) [m/s]."""
    rate: float
    """sqrt(g / l) [1/s]."""
    hip_width: float
    """Between the ankles [m]."""
    zmp_centre: float
    """Middle of where one foot's ZMP can be, ahead of the ankle [m]."""
    zmp_front: float
    """End of that [m]."""
    firm_front: float
    """End of where the sole is wide, ahead of the ankle [m]."""
    firm_rear: float
    """[m]"""
    sole_half_width: float
    """[m]"""
    softness: Planar
    """What kp / (m g h) of the ankle's pitch and roll servo lacks of 3. A servo of
    stiffness kp answers a lean of its own accord, like an ankle gain of that; the gain
    makes up the rest."""


def scale_of(legs: Legs) -> Scale:
    """Return the numbers that a robot's gains are parts of."""
    leg = legs.leg
    return Scale(
        leg=leg,
        speed=math.sqrt(GRAVITY * leg),
        rate=math.sqrt(GRAVITY / leg),
        hip_width=legs.hip_width,
        zmp_centre=0.5 * (legs.zmp_front + legs.zmp_rear),
        zmp_front=legs.zmp_front,
        firm_front=legs.firm_front,
        firm_rear=legs.firm_rear,
        sole_half_width=legs.sole_half_width,
        softness=_softness(legs),
    )


def _softness(legs: Legs) -> Planar:
    """Return `Scale.softness`; aside that of the pitch where no ankle rolls."""
    tipping = legs.mass * GRAVITY * (legs.leg + legs.ankle_height)
    pitch, roll = (legs.stiffness[ankle_joints(legs, turned)] for turned in (1, 0))
    soft = [_STIFF - float(own[0]) / tipping for own in (pitch, roll) if own.size]
    return Planar(max(0.0, soft[0]), max(0.0, soft[-1]))


class Gain(NamedTuple):
    """The declaration of a gain."""

    of: Callable[[Scale], Any]
    """Its value for a robot, SI units."""
    open_loop: Any
    """Its value in a walk without feedback; None where that is the same."""


def gain(of: Callable[[Scale], Any], open_loop: Any = None) -> Any:
    """Declare a gain, as a field of `Gains`; arguments are those of `Gain`."""
    return Gain(of, open_loop)


_NONE = Planar(0.0, 0.0)
_FOREMOST = 0.7  # of the way to where the ZMP can be: the ankle needs the rest
_ASIDE = 0.066  # legs: an error sideways beyond which a robot was pushed


class Gains(NamedTuple):
    """Every gain of the balance, SI units; `derive_gains` makes them for a robot.

    `x` is ahead, `y` to the side. Each default declares a gain and is no number.
    """

    dead_zone: Planar = gain(lambda s: Planar(0.034 * s.leg, 0.025 * s.leg))
    """Errors that are left to the servos [m]: stiff servos pull small ones back by
    themselves, and steps that answer those as well destabilise the robot."""
    follow: Planar = gain(lambda s: Planar(0.9 * s.rate, 0.9 * s.rate), _NONE)
    """How fast the reference takes over errors beyond that [1/s]. It must lag: what it
    lags by is what pulls a pushed robot back."""
    far_zone: Planar = gain(lambda s: Planar(0.071 * s.leg, _ASIDE * s.leg))
    """Errors beyond which a standing robot was pushed [m]."""
    ankle: Planar = gain(
        lambda s: Planar(1.55 + s.softness.x, 1.6 + s.softness.y), open_loop=_NONE
    )
    """ZMP shift per error; softer servos than 3 m g h need as much more."""
    sole_margin: float = gain(lambda s: 0.22 * s.sole_half_width)
    """Between planned ZMP and the sole's edge [m]; the ankles use what is left."""
    firm_front: float = gain(lambda s: s.firm_front, open_loop=math.inf)
    """Ends of where feedback puts the ZMP of one foot, ahead of the ankle [m]. A plan
    may step off on a heel's point; a robot that falls back onto it is not held."""
    firm_rear: float = gain(lambda s: s.firm_rear, open_loop=-math.inf)
    """[m]"""
    foot_zmp: Planar = gain(
        lambda s: Planar(
            min(s.zmp_centre + 0.018 * s.leg, _FOREMOST * s.zmp_front), 0.005 * s.leg
        )
    )
    """Where in the foot the ZMP is planned: ahead, and outward [m]. Further ahead, G1
    held 3 instead of 15 of 48 fast walks. It is on the wide part of the sole, at any
    factor: a step whose ZMP may not be where the stand has it drifts away from it."""
    landing_reach: Planar = gain(lambda s: Planar(0.59 * s.leg, 0.76 * s.leg))
    """How far a landing may be moved [m]."""
    swing_speed: float = gain(lambda s: 1.05 * s.speed)
    """How fast the swing foot gets to another landing, and that is moved [m/s]."""
    narrowest: float = gain(
        lambda s: min(max(2.32 * s.sole_half_width, 0.45 * s.hip_width), s.hip_width)
    )
    """Least distance between the ankles sideways where one foot is beside the other
    [m]: neither soles nor legs may touch."""
    across: float = gain(lambda s: 0.3 * s.hip_width)
    """How far beyond the other foot's middle a foot may land that is ahead of its toes
    or behind its heel [m]."""
    fixed_s: float = gain(lambda s: 0.165 / s.rate)
    """Before touch-down the landing is no longer moved [s]."""
    sooner: float = gain(lambda s: 0.1)
    """Cost of a touch-down sooner by all of single support; a landing moved by a leg
    costs 1. A short step moves its foot less, because the DCM has less time to run away
    from the ZMP."""
    later: float = gain(lambda s: 3.0)
    """The same for a later one."""
    shortest_s: float = gain(lambda s: 0.15 / s.rate)
    """Least time left of a hurried single support [s]."""
    touch: float = gain(lambda s: 0.014 * s.leg, open_loop=-math.inf)
    """A swing sole this near the ground has touched down [m]."""
    touch_load: float = gain(lambda s: 0.1, open_loop=math.inf)
    """Part of the weight on the swing sole at touch-down, where that is measured."""
    pushed: float = gain(lambda s: 0.08 * s.leg, open_loop=math.inf)
    """Error beyond a step's usual one from which on a touch-down may be an early one,
    and a landing another one than planned [m]. On uneven ground a foot in the air can
    be level with the other: believed of every robot, an early touch-down left 6 to 13
    instead of 14 of 20 walks over 10 mm blocks."""
    earliest: float = gain(lambda s: 0.4)
    """Part of single support after which a touch-down is believed."""
    sag_reach: float = gain(lambda s: 0.1 * s.leg, open_loop=0.0)
    """The most by which hips at touch-down are taken to be lower than planned [m]."""
    rise: float = gain(lambda s: 1.5 * s.rate)
    """How fast hips that were too low at touch-down return to their height [1/s]: a leg
    that stretches at once throws the robot up, and in the air it has no ZMP."""
    crouch: float = gain(lambda s: 0.5 * s.rate)
    """How fast the hips follow a commanded crouch [1/s]: two lags, `balance.crouch`."""
    latest: float = gain(lambda s: 0.03, open_loop=-1.0)
    """Part of single support that a foot may be late; it is lowered meanwhile. Waiting
    longer, fewer walks of G1 and OP3 hold."""
    stretched: float = gain(lambda s: 0.985)
    """Part of its reach from which on a hind leg lifts its heel. At 1 m/s G1 holds 11
    of 12 walks with it and 3 with 0.97; with level feet it has no such strides."""
    trunk: float = gain(lambda s: 0.55, open_loop=0.0)
    """Part of the trunk's tilt that the support hip corrects: 0.5 to 1 of it brought
    the error of RES from 37 to 23 mm; G1 needs more."""
    settled_trunk: float = gain(lambda s: 0.5)
    """Part of `trunk` before the first step and after the last one. On both feet G1
    rocks itself over with all of it, where its servos are 40 ms late: 7 of 8 fell."""
    swing_tilt: float = gain(lambda s: 0.63, open_loop=0.0)
    """Part of the trunk's tilt that the pose of the swing foot is corrected for."""
    learning: float = gain(lambda s: 0.008 * s.rate, open_loop=0.0)
    """How fast a CoM that is off the model's is learned while walking [1/s];
    learned faster, walks over blocks fall."""
    offset_reach: float = gain(lambda s: 0.08 * s.leg)
    """The most that it can be off [m]; 2 cm made G1 fall in 10 of 12 walks."""
    turning: float = gain(lambda s: 1.0)
    """Part of the robot's turning about its CoM that the DCM takes in."""
    error_filter: float = gain(lambda s: 0.14)
    """Part of the old error that is kept, each control step."""
    counter_swing: float = gain(lambda s: -0.09)
    """How far the pelvis gives way to the swing foot, part of the foot's lead over a
    steady way: the ZMP of RES was off by 71 instead of 92 mm at 0.85 m/s."""
    reaction: Planar = gain(lambda s: Planar(0.0, 0.7))
    """Part of the links' own motion that the support ankle carries: sideways the ZMP is
    then off by 9 instead of 35 mm; ahead it made that worse."""
    inertia: float = gain(lambda s: 0.85)
    """Part of the swing leg's inertia in the servos' feed-forward."""


_DECLARED: Mapping[str, Gain] = Gains._field_defaults


def derive_gains(legs: Legs, factors: Mapping[str, float] | None = None) -> Gains:
    """Scale the gains to a robot.

    Args:
        legs: the robot.
        factors: on single gains by name, where a search found better ones.

    Returns:
        The gains, SI units; at any factor `foot_zmp` is where a step may have its ZMP.

    Raises:
        CommandError: a factor names no gain.
    """
    scale = scale_of(legs)
    gains = Gains(**{name: declared.of(scale) for name, declared in _DECLARED.items()})
    for name, factor in (factors or {}).items():
        if name not in _DECLARED:
            raise CommandError(
                f"{name} is no gain; there are {', '.join(_DECLARED)}. A library of "
                "another version of gaitchain has to be built anew"
            )
        found: Any = getattr(gains, name)
        more: Any = (
            Planar(factor * found.x, factor * found.y)
            if isinstance(found, Planar)
            else factor * found
        )
        gains = gains._replace(**{name: more})
    return _with_firm_zmp(legs, gains)


def _with_firm_zmp(legs: Legs, gains: Gains) -> Gains:
    """Return gains whose planned ZMP is where the plan of a step may have it."""
    rear, front = zmp_ends(legs, gains)
    least = min(rear + gains.sole_margin, 0.5 * (rear + front))
    ahead = min(max(gains.foot_zmp.x, least), rear + front - least)
    return gains._replace(foot_zmp=Planar(ahead, gains.foot_zmp.y))


@compiled
def zmp_ends(legs: Legs, gains: Gains) -> tuple[float, float]:
    """Return between which x of a foot its ZMP may be, from the ankle [m]."""
    rear = max(legs.zmp_rear, gains.firm_rear)
    return rear, min(legs.zmp_front, gains.firm_front)


def open_loop(gains: Gains) -> Gains:
    """Return gains without feedback: the plan and the servos' feed-forward alone."""
    values = {name: declared.open_loop for name, declared in _DECLARED.items()}
    return gains._replace(**{n: v for n, v in values.items() if v is not None})
