"""What servos do otherwise than ideal ones: play, friction, speed, voltage, bus.

A servo of stiffness kp and damping kv, set-point s and angle q pushes with

    tau = clip(kp e - kv q', -b tau_max (1 + q' / w), b tau_max (1 - q' / w))    (1)
    e = s - q without the play of the gears;  within the play tau = 0            (2)
    b = 1 - sag sum|tau| / sum tau_max,  w = b no_load q'_max                    (3)

MuJoCo's own servo has neither (2) nor (3) nor the torque-speed line of (1), so the
difference is added as an outside torque, time step by time step. Dry friction is that
of MuJoCo's joints, larger at rest by Stribeck's law [Duclusaud24],

    tau_f = tau_dry (1 + stiction exp(-(q' / v_s)^2))                            (4)

Viscous friction is damping of the joints, see `scene.add_servo`.

Play is not quite free. MuJoCo's implicit integrator takes -kv q' of its own servo at
the end of a time step h, what is added here at its beginning, so that (2) leaves the
joint h kv of inertia that it does not have: 0.06 kg m^2 for RES at h = 2 ms, where its
rotor has 0.05. A hung knee of RES that is let go within its play turns in 60 ms 0.66 of
what one without torque does, 0.80 at h = 1 ms, 0.95 at 0.2 ms: the error falls as h.
The same holds where (1) limits a torque that MuJoCo does not. Ours.
"""

import math
from collections import deque
from typing import NamedTuple

import mujoco
import numpy as np

from gaitchain.balance.compiled import compiled
from gaitchain.messages import Array
from gaitchain.robot.robot import Robot
from gaitchain.sim.robot_faults import backlash_of, encoder_offsets
from gaitchain.sim.trunk import count_trunk
from gaitchain.sim.world import World
from gaitchain.sim.world_draws import (
    JITTER_STREAM,
    draw_gains,
    stream_of,
)

_STRIBECK = 0.3  # rad/s, v_s; 0.14 to 1.1 for four servos in [Duclusaud24]
_SLEW = 1  # index of a servo's speed limit in MuJoCo's actuator_dynprm
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

    def __init__(self, world: World, offsets: Array) -> None:
        """Take the encoders' offsets (2 n,) [rad]; nothing is on its way."""
        self._offsets = offsets
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
            target = self._step * np.rint(target / self._step)
        late_s = self._delay_s + float(self._rng.uniform(0.0, self._jitter_s))
        self._coming.append(_Late(now_s + late_s, self.true(target)))

    def clear(self) -> None:
        """Forget the targets on their way."""
        self._coming.clear()

    def true(self, shown: Array) -> Array:
        """Return the angles of joints whose encoders show these, (2 n,) [rad]."""
        return np.asarray(shown - self._offsets)

    @property
    def busy(self) -> bool:
        """Whether a target is on its way."""
        return bool(self._coming)

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
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        world: World,
        robot: Robot,
    ) -> None:
        """Take the servos' gains and limits.

        Args:
            model: the robot in its world.
            data: its state.
            world: with the faults.
            robot: the robot.
        """
        legs = robot.legs
        count = model.nu
        self._data, self._world = data, world
        joints, dofs = (slice(n, n + count) for n in count_trunk(model))
        self._aims, self._targets = data.act[:count], data.ctrl[:count]
        self._joints = data.qpos[joints]
        self._rates, self._torques = data.qvel[dofs], data.qfrc_applied[dofs]
        self._loss = model.dof_frictionloss[dofs]
        gains = draw_gains(world, count)
        most = np.array(model.actuator_forcerange[:, 1])
        speeds = np.array([world.motor_speed(own) for own in legs.speed_limit])
        play = 0.5 * backlash_of(robot, world)
        self._servos = np.array(
            [
                legs.stiffness * gains,
                (legs.damping - legs.joint_damping) * gains,
                most,
                world.timestep * model.actuator_dynprm[:, _SLEW],
                world.no_load * speeds,
                play,
            ]
        )
        self._dry = legs.friction_loss + world.dry_friction * most
        self._sagging, self._on = np.array([world.sag, 0.0]), True
        limited = math.isfinite(world.no_load)
        self._corrected = bool(play.any() or world.sag or limited)
        self.bus = Bus(world, encoder_offsets(robot, world))

    def act(self) -> None:
        """Deliver targets, and set friction and torques of the next time step."""
        if self.bus.busy:
            target = self.bus.deliver(float(self._data.time))
            if target is not None:
                self._targets[:] = target
        if self._world.stiction:
            _stick(self._dry, self._world.stiction, self._rates, self._loss)
        if self._corrected and self._on:
            self.correct()

    @property
    def missing(self) -> Array:
        """What is added to the torques of MuJoCo's servos, (2 n,) [N m]."""
        return np.asarray(self._torques)

    def power(self, *, on: bool) -> None:
        """Turn the torque on or off; friction stays, and the bus goes on."""
        self._on, self._sagging[1] = on, 0.0
        self._torques[:] = 0.0

    def correct(self) -> None:
        """Add what is missing of (1) to the torque of MuJoCo's servos."""
        # Loose arrays: to open a tuple of them takes as long as the rest.
        _correct(
            self._servos,
            self._sagging,
            self._aims,
            self._targets,
            self._joints,
            self._rates,
            self._torques,
        )


@compiled
def _stick(dry: Array, stiction: float, rates: Array, loss: Array) -> None:
    """Write the friction (4) of joints at these rates [rad/s]."""
    for j in range(dry.shape[0]):
        part = rates[j] / _STRIBECK
        loss[j] = dry[j] * (1.0 + stiction * math.exp(-part * part))


@compiled
def _correct(
    servos: Array,
    sagging: Array,
    aims: Array,
    targets: Array,
    joints: Array,
    rates: Array,
    missing: Array,
) -> None:
    """Write what is missing of (1) to the torque of MuJoCo's servos.

    Args:
        servos: (6, 2 n) kp, kv, torque limit, most that a set-point moves in a time
            step, speed without load, half the play [rad].
        sagging: (2,) sag, and the part of all torque that is used, which is updated.
        aims: (2 n,) set-points [rad].
        targets: (2 n,) [rad].
        joints: (2 n,) angles [rad].
        rates: (2 n,) of the joints [rad/s].
        missing: (2 n,) where it is written [N m].
    """
    left = 1.0 - sagging[0] * sagging[1]
    used = whole = 0.0
    for j in range(aims.shape[0]):
        kp, kv, most, slew, no_load, play = servos[:, j]
        # MuJoCo pushes with the set-point that the time step ends with.
        way = min(max(targets[j] - aims[j], -slew), slew)
        slack = aims[j] + way - joints[j]
        resisting = kv * rates[j]
        ideal = min(max(kp * slack - resisting, -most), most)
        torque = 0.0
        if abs(slack) >= play:
            torque = kp * (slack - math.copysign(play, slack)) - resisting
        part = rates[j] / (left * no_load)
        low = -left * most * min(max(1.0 + part, 0.0), 1.0)
        high = left * most * min(max(1.0 - part, 0.0), 1.0)
        torque = min(max(torque, low), high)
        missing[j] = torque - ideal
        used += abs(torque)
        whole += most
    sagging[1] = used / whole
