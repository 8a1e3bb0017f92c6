"""Get a robot up that fell: all its joints, while the walker waits."""

from dataclasses import replace

import numpy as np

from gaitchain.errors import CommandError
from gaitchain.live.safe_backend import SafeBackend
from gaitchain.messages import Array
from gaitchain.walker.riser import Riser, Rising


class GettingUp:
    """What a loop needs of a riser and of a backend that moves all joints."""

    def __init__(self, backend: SafeBackend, leg_joints: tuple[str, ...]) -> None:
        """Know no way yet.

        Args:
            backend: the robot.
            leg_joints: those that the walker moves, in its order.
        """
        self._backend, self._legs = backend, leg_joints
        self._riser: Riser | None = None
        self.target: Array | None = None
        """(n,) targets of all joints while it gets up [rad]."""

    @property
    def riser(self) -> Riser | None:
        """Made for the loop's control period; None where no way is known.

        Raises:
            CommandError: one that is set has other joints than the robot.
        """
        return self._riser

    @riser.setter
    def riser(self, riser: Riser | None) -> None:
        if riser is not None and self._backend.whole_joint_names:
            _check_names(riser.joint_names, self._backend.whole_joint_names)
        self._riser = riser

    @property
    def able(self) -> bool:
        """Whether the robot can be asked to get up."""
        return self.riser is not None and bool(self._backend.whole_joint_names)

    @property
    def note(self) -> str:
        """What it does, or why it gave up."""
        return "" if self.riser is None else self.riser.note

    @property
    def of_legs(self) -> Array:
        """(2 n,) targets of the legs [rad]."""
        names = self._backend.whole_joint_names
        assert self.target is not None  # whoever asks has begun
        return self.target[[names.index(name) for name in self._legs]]

    def begin(self) -> None:
        """Turn the torque on, and begin from where the joints are.

        Raises:
            BackendError: the robot cannot be reached.
        """
        assert self.riser is not None  # whoever calls has seen `able`
        self._backend.engage()
        self.target = self._backend.where_whole()
        self.riser.begin(self._in_order(self.target))

    def step(self) -> Rising:
        """Choose the targets of this control period; return what it does.

        Raises:
            BackendError: the robot does not answer.
        """
        assert self.riser is not None  # whoever calls has begun
        sensors = self._backend.read_whole()
        angles = self._in_order(sensors.joint_position)
        targets = self.riser.step(replace(sensors, joint_position=angles))
        self.target = self._from_order(targets)
        return self.riser.state

    def end(self) -> None:
        """Leave the joints to the walker."""
        self.target = None

    def _in_order(self, angles: Array) -> Array:
        """Return angles of the backend's joints as the riser has them."""
        assert self.riser is not None
        names = self._backend.whole_joint_names
        return angles[[names.index(name) for name in self.riser.joint_names]]

    def _from_order(self, angles: Array) -> Array:
        """Return angles of the riser's joints as the backend has them."""
        assert self.riser is not None
        found = dict(zip(self.riser.joint_names, angles.tolist(), strict=True))
        return np.array([found[name] for name in self._backend.whole_joint_names])


def _check_names(known: tuple[str, ...], moved: tuple[str, ...]) -> None:
    """Refuse a way of other joints than the robot's: the loop would fail on it."""
    strange, lacking = sorted({*known} - {*moved}), sorted({*moved} - {*known})
    if not strange and not lacking:
        return
    parts = {"has": strange, "lacks": lacking}
    told = " and ".join(f"{what} {', '.join(n)}" for what, n in parts.items() if n)
    raise CommandError(
        f"the way to get up is of other joints than the robot's {len(moved)}: it "
        f"{told}; search one in the model that is served, by `gaitchain get-up`"
    )
