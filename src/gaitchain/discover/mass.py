"""Masses and inertias that bodies can have."""

import math
from typing import Any

import numpy as np

from gaitchain.discover.mend import listed
from gaitchain.errors import RobotFileError

BALLAST_KG, BALLAST_INERTIA = 1e-3, 1e-5  # of a moving body that has no mass
_WATER = 1000.0  # density that an inertia is made up from [kg/m^3]
_NOTHING = 1e-15  # an inertia below that is zero, as to MuJoCo [kg m^2]
_LIGHT = 0.2  # of the robot's mass: what may have a made-up inertia


def mend_masses(spec: Any) -> list[str]:
    """Give every body a mass and an inertia that a body can have.

    Args:
        spec: the `mujoco.MjSpec` of the robot alone; changed in place.

    Returns:
        A note for everything that was mended.

    Raises:
        RobotFileError: a number is negative or none, or a heavy body has no inertia.
    """
    _check_geoms(spec)
    return _mend_inertias(spec) + _ballast(spec)


def _check_geoms(spec: Any) -> None:
    for body in spec.bodies:
        for geom in body.geoms:
            for what, value in (("mass", geom.mass), ("density", geom.density)):
                unset = what == "mass" and math.isnan(value)
                if not unset and not 0.0 <= value < math.inf:
                    raise RobotFileError(
                        f"body {body.name!r}: a geom of {what} {value:g}; give 0 or up"
                    )


def _mend_inertias(spec: Any) -> list[str]:
    """Make every inertia one that a body of positive density can have."""
    bodies = [body for body in spec.bodies if body.explicitinertial]
    for body in bodies:
        if not 0.0 <= body.mass < math.inf:
            raise RobotFileError(
                f"body {body.name!r} has a mass of {body.mass:g} kg; give 0 or more"
            )
    total = sum(body.mass for body in bodies)
    told: dict[str, list[str]] = {}
    for body in bodies:
        if body.mass > 0.0 and (how := _mend_inertia(spec, body, total)):
            told.setdefault(how, []).append(body.name)
    return [f"Inertia of {listed('body', names)} {how}." for how, names in told.items()]


def _mend_inertia(spec: Any, body: Any, total: float) -> str | None:
    """Mend one inertia; return what was done."""
    inertia = _inertia_of(body)
    diagonal = np.diag(inertia).copy()
    if not np.isfinite(inertia).all() or diagonal.min() < -_NOTHING:
        raise RobotFileError(
            f"body {body.name!r} has an inertia of {inertia[np.triu_indices(3)]} "
            "kg m^2 (xx, xy, xz, yy, yz, zz); give positive xx, yy and zz"
        )
    if diagonal.min() <= _NOTHING:
        if body.mass > _LIGHT * total:
            raise RobotFileError(
                f"body {body.name!r} of {body.mass:g} kg has an inertia of {diagonal} "
                f"kg m^2; only a body below {_LIGHT:g} of the robot's {total:g} kg can "
                "do without"
            )
        radius = (0.75 * body.mass / (math.pi * _WATER)) ** (1 / 3)
        _set_inertia(body, [max(0.4 * body.mass * radius**2, 1e-9)] * 3)
        return "was zero, taken as a ball of water"
    how = None
    moments = np.linalg.eigvalsh(inertia)
    if moments[0] <= 1e-9 * moments[2]:
        _set_inertia(body, diagonal)
        how, moments = "was not positive, taken without its products", np.sort(diagonal)
    if moments[0] + moments[1] < moments[2] * (1.0 - 1e-6):
        spec.compiler.balanceinertia = True
        return how or "broke A + B >= C, taken as its mean about all axes"
    return how


def _inertia_of(body: Any) -> Any:
    full = np.array(body.fullinertia)
    if np.isnan(full[0]) and not full[1:].any():  # not given
        return np.diag(body.inertia[:3])
    xx, yy, zz, xy, xz, yz = full
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _set_inertia(body: Any, diagonal: Any) -> None:
    body.fullinertia = [math.nan, 0, 0, 0, 0, 0]
    body.inertia[:3] = diagonal


def _ballast(spec: Any) -> list[str]:
    """Give a little mass to moving bodies that have none."""
    light = [b for b in spec.bodies[1:] if b.joints and not _has_mass(b)]
    for body in light:
        body.explicitinertial, body.mass = True, BALLAST_KG
        body.ipos, body.iquat = (0, 0, 0), (1, 0, 0, 0)
        _set_inertia(body, [BALLAST_INERTIA] * 3)
    names = [body.name for body in light]
    given = f"{BALLAST_KG:g} kg and {BALLAST_INERTIA:g} kg m^2 given to"
    return [f"{given} {listed('moving body', names)} without mass."] if light else []


def _has_mass(body: Any) -> bool:
    if body.explicitinertial:
        if body.mass > 0.0:
            return True
    elif any(weighs(geom) for geom in body.geoms):
        return True
    return any(not child.joints and _has_mass(child) for child in body.bodies)


def weighs(geom: Any) -> bool:
    """Return whether a geom adds mass to a body that has no inertia of its own."""
    return bool(geom.density > 0.0 if math.isnan(geom.mass) else geom.mass > 0.0)
