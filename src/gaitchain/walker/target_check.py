"""What leaves the walker: finite joint targets within the joints' ranges."""

from dataclasses import replace

import numpy as np

from gaitchain.balance.bounds import inside
from gaitchain.messages import Array, JointTargets
from gaitchain.robot.leg_model import LegModel


class TargetCheck:
    """Keep targets that no servo should get from the robot, and say so.

    A target beyond its joint's range becomes the end of the range. Where a target is no
    number, all of the last good ones stay: the rest was meant to go with it. Neither
    comes up in a walk that physics has passed.
    """

    def __init__(self, legs: LegModel, stand: Array) -> None:
        """Take the robot's limits, and targets for a start."""
        self._lower, self._upper = np.array(legs.lower), np.array(legs.upper)
        self._names = legs.joint_names
        self._last = np.array(stand)

    def kept(self, targets: JointTargets) -> JointTargets:
        """Return the targets, or what is sent in their place; `status` says why."""
        if not inside(targets.position, self._lower, self._upper):
            targets = self._replaced(targets)
        self._last[:] = targets.position
        return targets

    def _replaced(self, targets: JointTargets) -> JointTargets:
        asked = targets.position
        if np.isfinite(asked).all():
            position = np.clip(asked, self._lower, self._upper)
            names = self._named(position != asked)
            told = f"{names} kept within range"
        else:
            position = self._last.copy()
            told = f"no target for {self._named(~np.isfinite(asked))}: last ones used"
        status = f"{targets.status}; {told}" if targets.status else told
        return replace(targets, position=position, status=status)

    def _named(self, mask: Array) -> str:
        return ", ".join(n for n, is_it in zip(self._names, mask, strict=True) if is_it)
