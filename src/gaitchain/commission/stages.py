"""The stages of commissioning in their order; each needs those before it."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

from gaitchain.commission.bench import Bench, Verdict
from gaitchain.commission.imu import check_imu
from gaitchain.commission.lateness import failed
from gaitchain.commission.servos import check_bus, check_directions, check_offsets
from gaitchain.commission.timing import check_timing
from gaitchain.commission.walking import (
    check_hung,
    check_shift,
    check_stand,
    check_steps,
)
from gaitchain.errors import BackendError


class Stage(NamedTuple):
    """One stage."""

    name: str
    what: str
    """What happens, for the person."""
    check: Callable[[Bench], Verdict]
    held: bool = True
    """Whether the robot hangs, so that nobody need be ready to catch it."""

    def run(self, bench: Bench) -> Verdict:
        """Carry the stage out; the torque is off at its end, whatever happens."""
        verdict = self._checked(bench)
        if not bench.not_let_go:
            return verdict
        todo = f"SWITCH THE SUPPLY OFF: {bench.not_let_go} did not confirm torque off"
        return replace(verdict, outcome="no-go", todo=f"{todo}; {verdict.todo}")

    def _checked(self, bench: Bench) -> Verdict:
        try:
            return self.check(bench)
        except BackendError as error:
            again = f"then begin again with --from {self.name}"
            verdict = failed(bench, str(error), "mend that")
            return replace(verdict, todo=f"{bench.torque}; {verdict.todo}, {again}")


STAGES = (
    Stage("bus", "find the servos of the calibration; nothing moves", check_bus),
    Stage(
        "directions",
        "trunk held up, legs hanging free: each joint turns by 8 deg at low torque",
        check_directions,
    ),
    Stage(
        "offsets",
        "still held up: the legs go slowly to the pose of joint angles 0",
        check_offsets,
    ),
    Stage("timing", "rate, delay and lost answers; torque off", check_timing),
    Stage("imu", "gyro and accelerometer; torque off", check_imu),
    Stage("hung", "slow steps in the air, at low torque", check_hung),
    Stage("stand", "stand on the ground", check_stand, held=False),
    Stage(
        "shift", "shift the weight, both soles on the ground", check_shift, held=False
    ),
    Stage("steps", "first slow steps on the ground", check_steps, held=False),
)
"""All stages."""
