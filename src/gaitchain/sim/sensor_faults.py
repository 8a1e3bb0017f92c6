"""What sensors show otherwise than the truth: offsets, scales, resolution, and time."""

import math
from collections import deque

import numpy as np

from gaitchain.messages import Array, Sensors
from gaitchain.sim.servo_faults import slot_of
from gaitchain.sim.world import World
from gaitchain.sim.world_draws import draw_imu_biases, draw_imu_scales

_SLACK_S = 1e-9  # times are sums of time steps


class SensorFaults:
    """The errors of a world's encoders and IMU that are not noise."""

    def __init__(self, world: World, offsets: Array) -> None:
        """Draw scales and biases; nothing has been read.

        Args:
            world: with the errors.
            offsets: (2 n,) what the encoders show more than the angles [rad].
        """
        self._offsets = offsets
        self._gyro_scale, self._accelerometer_scale = draw_imu_scales(world)
        self._gyro_bias, self._accelerometer_bias = draw_imu_biases(world)
        self._step = math.radians(world.encoder_step_deg)
        self._hz, self._delay_s = world.bus_hz, world.imu_delay_s
        self._slot = -1
        self._joints: tuple[Array, Array] | None = None
        self._felt: deque[tuple[float, Array, Array]] = deque()

    def shown(self, true: Sensors) -> Sensors:
        """Return what the sensors show in this control period.

        Args:
            true: what ideal sensors show, with noise.
        """
        position, velocity = self._on_bus(true)
        gyro, acceleration = self._late(true)
        turning = self._gyro_scale * gyro + self._gyro_bias
        pulling = self._accelerometer_scale * acceleration + self._accelerometer_bias
        return Sensors(true.time, position, velocity, turning, pulling, true.foot_load)

    def _on_bus(self, true: Sensors) -> tuple[Array, Array]:
        """Return the joints as they were last read."""
        slot = slot_of(true.time, self._hz)
        if self._joints is None or slot != self._slot or not math.isfinite(self._hz):
            position = true.joint_position + self._offsets
            if self._step:
                position = self._step * np.rint(position / self._step)
            self._slot, self._joints = slot, (position, true.joint_velocity)
        return self._joints

    def _late(self, true: Sensors) -> tuple[Array, Array]:
        """Return gyro and accelerometer as they were a delay ago."""
        felt = self._felt
        if not felt or true.time > felt[-1][0]:
            felt.append((true.time, true.angular_velocity, true.acceleration))
        due_s = true.time - self._delay_s + _SLACK_S
        while len(felt) > 1 and felt[1][0] <= due_s:
            felt.popleft()
        return felt[0][1:]
