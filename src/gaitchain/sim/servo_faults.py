"""What servos do otherwise than ideal ones: play, friction, speed, voltage, bus.

A servo of stiffness kp and damping kv, set-point s and angle q pushes with

    tau = clip(kp e - kv q', -b tau_max (1 + q' / w), b tau_max (1 - q' / w))    (1)
    e = s - q without the play of the gears;  within the play tau = 0            (2)
    b = 1 - sag sum|tau| / sum tau_max,  w = b no_load q'_max                    (3)

MuJoCo's own servo has neither (2) nor (3) nor the torque-speed line of (1), so the
difference is added as an outside torque, time step by time step. Dry friction is that
of MuJoCo's joints, larger at rest by Stribeck's law [Duclusaud24],

    tau_f = tau_dry (1 + stiction exp(-(q' / v_s)^2))                            (4)

Viscous friction is damping of the joints, see `scene.add_servo`. Ours.
"""

import math
from collections import deque
from typing import NamedTuple

import mujoco
import numpy as np

from gaitchain.messages import Array
from gaitchain.robot.leg_model import LegModel
from gaitchain.sim.world import World
from gaitchain.sim.world_draws import (
    JITTER_STREAM,
    draw_encoder_offsets,
    draw_gains,
    stream_of,
)

_STRIBECK = 0.3  # rad/s, v_s; 0.14 to 1.1 for four servos in [Duclusaud24]
_SLEW = 1  # index of a servo's speed limit in MuJoCo's actuator_dynprm
_FREE = 6  # degrees of freedom of the trunk
_SLACK_S = 1e-9  # times are sums of time steps


class _Late(NamedTuple):
    """A target on its way."""

    arrives_s: float
    target: Array


class Bus:
    """Carries targets to the servos: in steps, at its own rate, and late.

    The encoders' offsets belong here, too: a servo brings what its encoder shows to
    its target, so that the joint is off by the offset.
    """

    def __init__(self, world: World, joints: int) -> None:
        """Draw the offsets; nothing is on its way."""
        self._offsets = draw_encoder_offsets(world, joints)
        self._step = math.radians(world.target_step_deg)
        self._delay_s = world.delay_steps * world.timestep
        self._jitter_s, self._hz = world.jitter_s, world.bus_hz
        self._rng = stream_of(world, JITTER_STREAM)
        self._coming: deque[_Late] = deque()
        self._slot = -1

    def send(self, target: Array, now_s: float) -> None:
        """Send targets (2 n,) [rad], unless the bus is not due yet."""
        slot = slot_of(now_s, self._hz)
        if slot == self._slot:
            return
        self._slot = slot if math.isfinite(self._hz) else -1
        if self._step:
            target = self._step * np.round(target / self._step)
        late_s = self._delay_s + float(self._rng.uniform(0.0, self._jitter_s))
        self._coming.append(_Late(now_s + late_s, self.true(target)))

    def true(self, shown: Array) -> Array:
        """Return the angles of joints whose encoders show these, (2 n,) [rad]."""
        return np.asarray(shown - self._offsets)

    def deliver(self, now_s: float) -> Array | None:
        """Return the latest target that has arrived since the last call, if any."""
        arrived = None
        while self._coming and self._coming[0].arrives_s <= now_s + _SLACK_S:
            arrived = self._coming.popleft().target
        return arrived


def slot_of(now_s: float, rate_hz: float) -> int:
    """Return the number of the period of a bus; 0 if it is always ready."""
    return math.floor(now_s * rate_hz + _SLACK_S) if math.isfinite(rate_hz) else 0


class ServoFaults:
    """The faults of a robot's servos in one world."""

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData, world: World, legs: LegModel
    ) -> None:
        """Take the servos' gains and limits.

        Args:
            model: the robot in its world.
            data: its state.
            world: with the faults.
            legs: the robot's legs.
        """
        count = model.nu
        self._model, self._data, self._world = model, data, world
        self._dofs = slice(_FREE, _FREE + count)
        gains = draw_gains(world, count)
        self._kp = legs.stiffness * gains
        self._kv = (legs.damping - legs.joint_damping) * gains
        self._most = np.array(model.actuator_forcerange[:, 1])
        self._dry = legs.friction_loss + world.dry_friction * self._most
        self._slew = world.timestep * model.actuator_dynprm[:, _SLEW]
        limit = world.speed_limit_deg_s
        speed = legs.speed_limit if limit is None else np.full(count, np.radians(limit))
        self._no_load = world.no_load * speed
        self._play = 0.5 * math.radians(world.backlash_deg)
        self._pulled = 0.0
        self.bus = Bus(world, count)

    @property
    def pushes(self) -> bool:
        """Whether a torque has to be corrected in each time step."""
        world = self._world
        return bool(self._play or world.sag or math.isfinite(world.no_load))

    def act(self) -> None:
        """Deliver targets, and set the torques of the next time step."""
        data = self._data
        target = self.bus.deliver(float(data.time))
        if target is not None:
            data.ctrl[:] = target
        rates = data.qvel[self._dofs]
        if self._world.stiction:
            still = np.exp(-((rates / _STRIBECK) ** 2))
            loss = self._dry * (1.0 + self._world.stiction * still)
            self._model.dof_frictionloss[self._dofs] = loss
        if self.pushes:
            data.qfrc_applied[self._dofs] = self._correction(rates)

    def _correction(self, rates: Array) -> Array:
        """Return what is missing of (1) to the torque of MuJoCo's servos, (2 n,)."""
        data = self._data
        # MuJoCo pushes with the set-point that the time step ends with.
        aimed = data.act + np.clip(data.ctrl - data.act, -self._slew, self._slew)
        slack = aimed - data.qpos[_FREE + 1 : _FREE + 1 + len(rates)]
        ideal = np.clip(self._kp * slack - self._kv * rates, -self._most, self._most)
        beyond = np.sign(slack) * np.maximum(np.abs(slack) - self._play, 0.0)
        left = 1.0 - self._world.sag * self._pulled
        part = rates / (left * self._no_load)
        stall = left * self._most
        torque = np.where(
            np.abs(slack) < self._play, 0.0, self._kp * beyond - self._kv * rates
        )
        low = -stall * np.clip(1.0 + part, 0.0, 1.0)
        high = stall * np.clip(1.0 - part, 0.0, 1.0)
        torque = np.clip(torque, low, high)
        self._pulled = float(np.abs(torque).sum() / self._most.sum())
        return np.asarray(torque - ideal)
