"""Choice of the last pose of a step, by the forward motion measured in physics."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gaitchain.chain.layered_chain import FloatArray
from gaitchain.gait.command_range import ends_text, inward
from gaitchain.gait.family import STAND
from gaitchain.gait.library import GaitLibrary
from gaitchain.messages import Command
from gaitchain.walker.generator import LATE_STOP, ChainState, Generator, StepRequest
from gaitchain.walker.policy_table import Policy

_SPEED_TOLERANCE = 0.05  # relative speed error that adds a cost of 1


class KeyposeGenerator(Generator):
    """Select key poses for a speed straight ahead."""

    def __init__(self, library: GaitLibrary, policy: Policy = "look_ahead") -> None:
        """Compute all choices; see `Generator`.

        Raises:
            LibraryError: no walk passed physics.
        """
        super().__init__(library, policy)
        self._step_s = library.timing.step
        self._advance = np.where(self.allowed, library.pair_advance, 0.0)
        self._walking = self._path_cost.copy()
        self._walking[:, STAND] = np.inf

    def clamp(self, command: Command) -> tuple[Command, str]:
        """Clamp the forward speed; side steps, turns, crouches do not exist."""
        low, high = self.library.speed_range
        notes = []
        if command.vy or command.yaw_rate:  # also if NaN
            notes.append(
                f"{command.vy:g} m/s aside, {command.yaw_rate:g} rad/s: key poses walk "
                "straight ahead"
            )
        if command.crouch:  # also if NaN
            notes.append(f"crouch {command.crouch:g} m: key poses do not crouch")
        vx = min(max(command.vx, low), high)
        if not command.vx > 0.0:  # also if NaN
            vx = 0.0
            if command.vx != 0.0:
                notes.append(f"{command.vx:g} m/s is no way on: stop")
        elif vx != command.vx:
            walked = ends_text(low, high, "m/s")
            end = inward(vx) if vx == high else -inward(-vx)
            notes.append(f"{command.vx:g} m/s is outside {walked}: {end:.3f}")
        return Command(vx), "; ".join(notes)

    def stays(self, state: ChainState, command: Command) -> bool:
        """Whether the robot stands and no forward speed is commanded."""
        return state.pose == STAND and not command.vx > 0.0

    def begin_step(self, state: ChainState, request: StepRequest) -> ChainState:
        """See `Generator`; the residual is carried over while the speed is the same."""
        upcoming, vx = request.upcoming, request.command.vx
        vx = vx if vx > 0.0 else 0.0  # also if NaN
        asked = vx * self._step_s
        behind = state.owed[0] if asked == state.asked[0] else 0.0
        stops_next = bool(upcoming) and upcoming[0].vx == 0.0
        costs = self._step_costs(vx, stops_next, behind)[state.pose]
        if upcoming:
            costs = costs + self._costs_ahead(upcoming)
        target = int(np.argmin(costs))
        behind = asked + behind - float(self._advance[state.pose, target])
        return replace(
            state,
            first=state.pose,
            target=target,
            asked=(asked, 0.0, 0.0),
            owed=(behind, 0.0, 0.0),
        )

    def step_speed(self, state: ChainState) -> float:
        """Return the measured forward speed of a step [m/s]."""
        return float(self._advance[state.first, state.target]) / self._step_s

    def _step_costs(self, vx: float, stops_next: bool, behind: float) -> FloatArray:
        """Return the cost of each step, its expected cost plus that of its speed error.

        Returns:
            (N_1, N_4) costs.
        """
        stop = vx == 0.0
        base = self._path_cost if stop or stops_next else self._walking
        # Below the slowest walk (half steps) the tolerance does not shrink further.
        slowest = self.library.speed_range[0]
        scale = _SPEED_TOLERANCE * max(vx, slowest) * self._step_s
        costs = base + ((self._advance - vx * self._step_s - behind) / scale) ** 2
        if stop:
            costs = costs + LATE_STOP * self._steps_to_stand
        return np.asarray(costs)

    def _costs_ahead(self, upcoming: Sequence[Command]) -> FloatArray:
        """Return the least cost of the known later commands from each pose, (N_4,)."""
        ahead = np.zeros(self._advance.shape[1])
        for i in reversed(range(len(upcoming))):
            vx = upcoming[i].vx
            stops_next = i + 1 < len(upcoming) and upcoming[i + 1].vx == 0.0
            costs = self._step_costs(vx, stops_next, behind=0.0)
            here = (costs + ahead).min(axis=1)
            if vx == 0.0:
                here = here + LATE_STOP
                here[STAND] = ahead[STAND]
            ahead = here
        return ahead
