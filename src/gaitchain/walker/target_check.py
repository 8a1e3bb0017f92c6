"""Check of the walker's output: finite joint targets within the joints' ranges."""

from dataclasses import replace

import numpy as np

from gaitchain.balance.bounds import inside
from gaitchain.messages import Array, JointTargets
from gaitchain.robot.leg_model import LegModel


class TargetCheck:
    """Replace joint targets that must not reach a servo, and report it.

    A target outside its joint's range is clamped. If a target is not finite, the last
    valid targets of all joints are held, as the others belong to the same posture.
    Neither occurs in a walk that passed physics.
    """

    def __init__(self, legs: LegModel, stand: Array) -> None:
        """Set the joint limits, and the targets to hold until the first valid ones."""
        self._lower, self._upper = np.array(legs.lower), np.array(legs.upper)
        self._names = legs.joint_names
        self._last = np.array(stand)

    def kept(self, targets: JointTargets) -> JointTargets:
        """Return valid targets; if any was replaced, `status` names it."""
        if not inside(targets.position, self._lower, self._upper):
            targets = self._replaced(targets)
        self._last[:] = targets.position
        return targets

    def _replaced(self, targets: JointTargets) -> JointTargets:
        asked = targets.position
        if np.isfinite(asked).all():
            position = np.clip(asked, self._lower, self._upper)
            names = self._named(position != asked)
            why = f"{names} kept within range"
        else:
            position = self._last.copy()
            why = f"no target for {self._named(~np.isfinite(asked))}: last ones used"
        status = f"{targets.status}; {why}" if targets.status else why
        return replace(targets, position=position, status=status)

    def _named(self, mask: Array) -> str:
        return ", ".join(n for n, is_it in zip(self._names, mask, strict=True) if is_it)
