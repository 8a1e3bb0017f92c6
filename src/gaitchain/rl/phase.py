"""Where a walk is in its cycle of two steps: 0 as the left leg begins its support."""

from gaitchain.messages import CONTROL_PERIOD_S
from gaitchain.walker.gait import Gait


class StepPhase:
    """Count the time since the latest step began, as a part of the planned step."""

    def __init__(self, gait: Gait) -> None:
        """Follow a gait; call `tick` after each of its steps."""
        self._gait = gait
        self._step_s = gait.generator.library.timing.step
        self.reset()

    def reset(self) -> None:
        """Return to standing."""
        self._steps, self._shifts = 0, True
        self._begin_step()

    def tick(self) -> None:
        """Advance by one control period."""
        gait = self._gait
        self._since_s += CONTROL_PERIOD_S
        begins = gait.steps != self._steps
        self._steps = gait.steps
        # The first step begins after the weight was shifted.
        self._shifts = (self._shifts or gait.standing) and not begins
        if begins or self._shifts:
            self._begin_step()

    def _begin_step(self) -> None:
        # The gait's own side is already the next step's in double support.
        self._since_s, self._left = 0.0, self._gait.state.left_support

    @property
    def value(self) -> float:
        """Part of the cycle that is done, 0 to 1; 0 while the robot stands.

        A step that takes longer than planned waits at its end, and a robot that leaves
        its stand at the beginning of its first step.
        """
        if self._gait.standing:
            return 0.0
        part = min(self._since_s / self._step_s, 1.0)
        return (0.5 * part + (0.0 if self._left else 0.5)) % 1.0
