"""The gains of the balance: named, documented, and scaled to the robot."""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from gaitchain.balance.compiled import compiled
from gaitchain.balance.leg_kinematics import Legs
from gaitchain.balance.state import Planar, StepTimes
from gaitchain.errors import CommandError
from gaitchain.gait.motion import Timing
from gaitchain.messages import GRAVITY

_RATE = 4.1  # sqrt(g / l) of RES [1/s]; quicker robots are further off on any floor
_SHIFT = 4.0  # pendulum times: weight shift before the first step


class Gains(NamedTuple):
    """Every gain of the balance, in SI units; `derive_gains` scales them to a robot."""

    dead_zone: Planar
    """Errors that are left to the servos [m]."""
    follow: Planar
    """How fast the reference takes over errors beyond that [1/s]."""
    far_zone: Planar
    """Errors beyond which the robot was pushed [m]."""
    far_follow: Planar
    """How fast the reference takes those over [1/s]."""
    ankle: Planar
    """ZMP shift per error, where servos are stiff against m g h."""
    zmp_reach: Planar
    """How far the planned ZMP may leave the step's first one for balance [m]."""
    sole_margin: float
    """Between planned ZMP and the sole's edge [m]."""
    foot_zmp: Planar
    """Where in the foot the ZMP is planned: ahead, and outward [m]."""
    landing_reach: Planar
    """How far a landing may be moved [m]."""
    landing_speed: Planar
    """How fast it may be moved [m/s]."""
    narrowest: float
    """Least distance between the ankles sideways [m]."""
    fixed_s: float
    """Before touch-down the landing is no longer moved [s]."""
    hurry_beyond: Planar
    """A landing moved further than this makes the step hurry [m]."""
    fastest: float
    """Of the step's time, 1 is nominal."""
    slowest: float
    shortest_s: float
    """Left of a hurried single support [s]."""
    touch: float
    """A swing sole this near the ground has touched down [m]."""
    touch_load: float
    """Part of the weight on the swing sole at touch-down, where that is measured."""
    pushed: float
    """Error from which on a touch-down may be an early one [m]."""
    earliest: float
    """Part of single support after which a touch-down is believed."""
    usual: float
    """Part of single support after which it is no early one."""
    latest: float
    """Part of single support that a foot may be late; it is lowered meanwhile."""
    trunk: float
    """Part of the trunk's tilt that the support hip corrects."""
    swing_tilt: float
    """Part of the trunk's tilt that the swing leg allows for."""
    learning: float
    """How fast a CoM that is off the model's is learned while walking [1/s]."""
    offset_reach: float
    """The most that it can be off [m]."""
    error_filter: float
    """Part of the old error that is kept, each control period."""
    counter_swing: float
    """How far the pelvis gives way to the swing foot, part of the foot's lead."""
    reaction: Planar
    """Part of the links' own motion that the support ankle carries."""
    inertia: float
    """Part of the swing leg's inertia that the servos are told of."""
    hold_from: float
    """DCM no further inside the support ankle than this: held there [m]. Never on soles
    that are narrower than `far_zone`: they cannot hold who was pushed."""
    hold_until: float
    """DCM further inside than this: the step goes on [m]."""
    hold_follow: float
    """How fast the reference takes over errors sideways meanwhile [1/s]."""
    lean_from: float
    """DCM this far outside the support ankle makes the trunk lean [m]."""
    lean: float
    """Of the trunk, over how far the DCM is beyond that [rad/m]."""
    lean_most: float
    """[rad]"""
    lean_rate: float
    """How fast the trunk leans [1/s]."""
    lean_back: float
    """How fast it is upright again [1/s]."""
    wary_from: float
    """Largest error of a step in place from which on the next is shorter [m]."""
    wary_stride: float
    """What a long step adds to that, over its length squared [1/m]."""
    wary_over: float
    """Error beyond that which makes the robot stay in place [m]."""
    wary_kept: float
    """Part of that caution that is left after a step without a disturbance."""


def derive_gains(legs: Legs, factors: Mapping[str, float] | None = None) -> Gains:
    """Scale the gains to a robot.

    Lengths go with the leg l, speeds with sqrt(g l), rates with sqrt(g / l), so that
    two robots of one shape walk alike. The ankles' gain makes up for soft servos: a
    servo of stiffness kp answers a lean of its own accord, like a gain of kp / (m g h);
    where that is below 3, the gain fills up. The numbers were found by a search in
    physics (`docs/design.md`).

    Args:
        legs: the robot.
        factors: on single gains by name, where a search found better ones.

    Returns:
        The gains, SI units.

    Raises:
        CommandError: a factor names no gain.
    """
    gains = _derived(legs)
    for name, factor in (factors or {}).items():
        if name not in Gains._fields:
            raise CommandError(
                f"{name} is no gain; there are {', '.join(Gains._fields)}"
            )
        gain: Any = getattr(gains, name)
        more: Any = (
            Planar(factor * gain.x, factor * gain.y)
            if isinstance(gain, Planar)
            else factor * gain
        )
        gains = gains._replace(**{name: more})
    return gains


def _derived(legs: Legs) -> Gains:
    leg = legs.leg
    speed, rate = math.sqrt(GRAVITY * leg), math.sqrt(GRAVITY / leg)
    ankle = float(legs.stiffness[legs.knee + 1])
    own = ankle / (legs.mass * GRAVITY * (leg + legs.ankle_height))
    centre = 0.5 * (legs.sole_front + legs.sole_rear)
    soft = max(0.0, 3.0 - own)
    half, aside = legs.sole_half_width, 0.066 * leg
    return Gains(
        dead_zone=Planar(0.034 * leg, 0.025 * leg),
        follow=Planar(0.9 * rate, 0.9 * rate),
        far_zone=Planar(0.071 * leg, aside),
        far_follow=Planar(2.6 * rate, 2.3 * rate),
        ankle=Planar(1.55 + soft, 1.6 + soft),
        zmp_reach=Planar(0.047 * leg, 0.042 * leg),
        sole_margin=0.22 * half,
        foot_zmp=Planar(centre + 0.018 * leg, 0.005 * leg),
        landing_reach=Planar(0.59 * leg, 0.76 * leg),
        landing_speed=Planar(1.03 * speed, 0.97 * speed),
        narrowest=0.755 * legs.hip_width,
        fixed_s=0.165 / rate,
        hurry_beyond=Planar(0.3 * leg, 0.28 * leg),
        fastest=1.9,
        slowest=0.9,
        shortest_s=0.15 / rate,
        touch=0.007 * leg,
        touch_load=0.1,
        pushed=0.11 * leg,
        earliest=0.4,
        usual=0.9,
        latest=0.03,
        trunk=0.55,
        swing_tilt=0.63,
        learning=0.008 * rate,
        offset_reach=0.08 * leg,
        error_filter=0.14,
        counter_swing=-0.09,
        reaction=Planar(0.0, 0.7),
        inertia=0.85,
        hold_from=0.31 * half if half > aside else -math.inf,
        hold_until=0.77 * half,
        hold_follow=2.5 * rate,
        lean_from=0.31 * half,
        lean=9.0 / leg,
        lean_most=0.4,
        lean_rate=6.1 * rate,
        lean_back=0.8 * rate,
        wary_from=0.08 * leg * max(1.0, rate / _RATE),
        wary_stride=0.55 / leg,
        wary_over=0.12 * leg,
        wary_kept=0.8,
    )


def open_loop(gains: Gains) -> Gains:
    """Return gains that feel nothing: the plan and the servo feed-forward alone."""
    none = Planar(0.0, 0.0)
    return gains._replace(
        follow=none,
        far_follow=none,
        learning=0.0,
        touch=-math.inf,
        touch_load=math.inf,
        latest=-1.0,
        ankle=none,
        trunk=0.0,
        swing_tilt=0.0,
        hold_from=-math.inf,
        wary_from=math.inf,
    )


def step_times(
    timing: Timing, hip_height: float, com_height: float, period_s: float
) -> StepTimes:
    """Return the rhythm of a walk: the paper's times, and the pendulum over them.

    Args:
        timing: the step's times.
        hip_height: hips above the ankles [m].
        com_height: length of the pendulum, the CoM above the ground [m].
        period_s: control period [s].
    """
    omega = math.sqrt(GRAVITY / com_height)
    return StepTimes(
        step=timing.step,
        single=timing.rise + timing.fall,
        rise=timing.rise,
        shift=round(_SHIFT / omega / period_s) * period_s,
        hip_height=hip_height,
        omega=omega,
        period=period_s,
    )


@compiled
def clip(value: float, low: float, high: float) -> float:
    """Return the value, held between its bounds."""
    return min(max(value, low), high)
