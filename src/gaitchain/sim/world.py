"""Parameters of the robot's world: floor, servos, sensors, pushes; numbers only.

Everything random in a world follows from its seed (`world_draws`). A new disturbance is
a new field of `World` that carries a `Disturbance` in its annotation, and its physics.
From that declaration come the limits and their error messages, the options of the
command line with their help (`cli.options`), the names and units in tables and plots,
the levels of the grid (`build.grid`), and the range from which random worlds are drawn
(`world_range`). This module imports nothing heavy, so that `--help` is fast.
"""

import math
from dataclasses import dataclass
from typing import Annotated, Literal, get_args

from gaitchain.errors import CommandError
from gaitchain.gait.limits import Limits, check_numbers, declared
from gaitchain.sim.disturbance import Disturbance, Exposure
from gaitchain.sim.push import Punches, Push

SAME_PERIOD = 1e-6
"""Periods that differ by less are one: a rate of 83.33333 Hz has seven digits."""
_PLANNED_S = Limits(0.0, 1e6)  # times of a world's pushes
Arms = Literal["still", "random"]
"""What somebody else does with the arms."""
Cone = Literal["pyramidal", "elliptic"]
"""How friction is modelled: by a pyramid of four sides, or by the cone itself."""


@dataclass(frozen=True)
class World:
    """Floor, servos, sensors and model errors of a simulated walk.

    The defaults are the nominal world: level and even floor, perfect model and sensors.
    """

    friction: Annotated[
        float,
        Disturbance(
            help="Friction of the soles on the floor; 0.8 nominal.",
            label="friction",
            option="friction",
            limits=Limits(1e-3, 10.0),
            key_poses=Exposure((0.6, 1.0), (0.6, 1.0), (0.4,)),
            strides=Exposure((0.6, 1.0), (0.6, 1.0), (0.2, 0.4)),
        ),
    ] = 0.8
    """With less than the limit MuJoCo's friction pyramids are so thin that its solver
    throws a standing robot up."""
    servo_gain: Annotated[
        float,
        Disturbance(
            help="Factor on the servos' stiffness and damping.",
            label="servo gain",
            option="gain",
            limits=Limits(0.0, 100.0),
            key_poses=Exposure((0.9, 1.1), (0.9, 1.1), (0.7,)),
            strides=Exposure((0.9, 1.1), (0.9, 1.1), (0.7,)),
        ),
    ] = 1.0
    torque_limit: Annotated[
        float,
        Disturbance(
            help="Factor on the joints' torque limits.",
            label="torque limit",
            option="torque_limit",
            limits=Limits(1e-3, 100.0),
            fault=True,
            key_poses=Exposure(None, (0.9,), (0.5,)),
            strides=Exposure((0.9, 1.0), (0.9,), (0.5, 0.7)),
        ),
    ] = 1.0
    mass: Annotated[
        float,
        Disturbance(
            help="Factor on every mass and inertia.",
            label="mass",
            option="mass",
            limits=Limits(0.01, 100.0),
            key_poses=Exposure((0.95, 1.05), (0.95, 1.05), (1.15,)),
            strides=Exposure((0.95, 1.05), (0.95, 1.05), (0.85, 1.15)),
        ),
    ] = 1.0
    payload: Annotated[
        float,
        Disturbance(
            help="Mass that the trunk carries in its CoM, part of the robot's mass.",
            label="payload",
            option="payload",
            limits=Limits(0.0, 10.0),
            scale=100.0,
            unit=" %",
            strides=Exposure(None, (), (0.1, 0.2)),
        ),
    ] = 0.0
    waist: Annotated[
        float,
        Disturbance(
            help="Stiffness of a waist that gives way, over m g h of the upper body; "
            "inf for a rigid trunk.",
            label="waist stiffness / m g h",
            option="waist",
            limits=Limits(1.1, math.inf),
        ),
    ] = math.inf
    """See `waist`. With 1 the upper body falls over."""
    model_error: Annotated[
        float,
        Disturbance(
            help="Part by which mass, inertia and centre of each link are off at most.",
            label="mass and CoM of links",
            option="model_error",
            limits=Limits(0.0, 0.5),
            scale=100.0,
            unit=" %",
            key_poses=Exposure(0.0, (), (0.05,)),
            strides=Exposure(0.05, (0.05,), (0.1, 0.2)),
        ),
    ] = 0.0
    """Bound e of the errors, drawn for each link uniformly from -e to e: mass and
    inertia are multiplied by 1 + error, and the CoM is shifted along each axis of the
    link's equivalent box by error times half the box's side."""
    delay_s: Annotated[
        float,
        Disturbance(
            help="Servos receive targets this much late [s].",
            label="bus delay",
            option="delay",
            limits=Limits(0.0, 1.0),
            scale=1000.0,
            unit=" ms",
            key_poses=Exposure((0.0, 0.0), (0.01,), (0.03,)),
            strides=Exposure((0.0, 0.01), (0.01,), (0.02, 0.03)),
        ),
    ] = 0.0
    """Rounded to whole time steps of the simulation."""
    noise: Annotated[
        float,
        Disturbance(
            help="Level of the sensors' noise: 0 is perfect, 1 a cheap robot.",
            label="sensor noise",
            option="noise",
            limits=Limits(0.0, 100.0),
            fault=True,
            key_poses=Exposure(None, (1.0,)),
            strides=Exposure((0.0, 1.0), (1.0,), (2.0,)),
        ),
    ] = 0.0
    """See `world_draws.SensorNoise` for the standard deviations."""
    gain_error: Annotated[
        float,
        Disturbance(
            help="Part by which stiffness and damping of each servo are off at most.",
            label="gain of each servo",
            option="gain_error",
            limits=Limits(0.0, 0.95),
            fault=True,
            scale=100.0,
            unit=" %",
            strides=Exposure((0.0, 0.1), (0.1,), (0.2, 0.4)),
        ),
    ] = 0.0
    """Drawn for each joint uniformly, both by the same part."""
    backlash_deg: Annotated[
        float,
        Disturbance(
            help="Play of each servo's gears, from end to end [deg].",
            label="backlash",
            option="backlash",
            limits=Limits(0.0, 10.0),
            fault=True,
            unit=" deg",
            strides=Exposure((0.0, 0.25), (0.25,), (0.5, 1.0)),
        ),
    ] = 0.0
    """Within it a servo neither pushes nor holds; see `servo_faults`."""
    dry_friction: Annotated[
        float,
        Disturbance(
            help="Dry friction of the servos, part of their torque limit; in MuJoCo a "
            "joint that it holds still creeps.",
            label="dry friction",
            option="dry_friction",
            limits=Limits(0.0, 1.0),
            fault=True,
            scale=100.0,
            unit=" %",
            strides=Exposure((0.0, 0.02), (0.02,), (0.05, 0.1)),
        ),
    ] = 0.0
    stiction: Annotated[
        float,
        Disturbance(
            help="Dry friction at rest beyond that in motion, part of the latter.",
            label="stiction",
            option="stiction",
            limits=Limits(0.0, 10.0),
            fault=True,
            scale=100.0,
            unit=" %",
            needs="dry_friction",
            strides=Exposure((0.0, 0.3), (0.3,), (0.6, 1.0)),
        ),
    ] = 0.0
    """Stribeck's; of all dry friction, which is that of the robot's file, too."""
    viscous_friction: Annotated[
        float,
        Disturbance(
            help="Part of their torque limit that servos lose to viscous friction at "
            "their speed limit.",
            label="viscous friction",
            option="viscous_friction",
            limits=Limits(0.0, 1.0),
            fault=True,
            scale=100.0,
            unit=" %",
            strides=Exposure((0.0, 0.05), (0.05,), (0.1, 0.2)),
        ),
    ] = 0.0
    no_load: Annotated[
        float,
        Disturbance(
            help="Speed at which servos have no torque left, over their speed limit; "
            "inf by default.",
            label="no-load speed / speed limit",
            option="no_load",
            limits=Limits(0.1, math.inf),
            fault=True,
            strides=Exposure((1.5, 3.0), (1.5,), (1.0,)),
        ),
    ] = math.inf
    """The torque limit falls with the speed to that point, along a line."""
    sag: Annotated[
        float,
        Disturbance(
            help="Voltage lost while all servos pull with all they have, as a part of "
            "what is left then: torque and speed fall to 1 / (1 + sag).",
            label="voltage sag",
            option="sag",
            limits=Limits(0.0, 0.9),
            fault=True,
            scale=100.0,
            unit=" %",
            strides=Exposure((0.0, 0.1), (0.1,), (0.2, 0.3)),
        ),
    ] = 0.0
    target_step_deg: Annotated[
        float,
        Disturbance(
            help="Steps in which servos take their targets [deg].",
            label="steps of targets",
            option="target_step",
            limits=Limits(0.0, 10.0),
            fault=True,
            unit=" deg",
            strides=Exposure((0.0, 0.1), (0.1,), (0.3,)),
        ),
    ] = 0.0
    jitter_s: Annotated[
        float,
        Disturbance(
            help="Targets come late by up to this beyond the delay, each by another "
            "time [s].",
            label="bus jitter",
            option="jitter",
            limits=Limits(0.0, 1.0),
            fault=True,
            scale=1000.0,
            unit=" ms",
            strides=Exposure((0.0, 0.005), (0.005,), (0.01, 0.02)),
        ),
    ] = 0.0
    bus_hz: Annotated[
        float,
        Disturbance(
            help="Rate at which joints are read and targets are sent [Hz]; in each "
            "control period by default.",
            label="bus rate",
            option="bus_rate",
            limits=Limits(1.0, math.inf),
            fault=True,
            unit=" Hz",
            strides=Exposure((66.0, 100.0), (66.0,), (50.0, 33.0)),
        ),
    ] = math.inf
    encoder_step_deg: Annotated[
        float,
        Disturbance(
            help="Resolution of the encoders [deg].",
            label="encoder resolution",
            option="encoder_step",
            limits=Limits(0.0, 10.0),
            fault=True,
            unit=" deg",
            strides=Exposure((0.0, 0.1), (0.1,), (0.3,)),
        ),
    ] = 0.0
    encoder_offset_deg: Annotated[
        float,
        Disturbance(
            help="By how much the encoders' zeros are off at most [deg].",
            label="encoder offset",
            option="encoder_offset",
            limits=Limits(0.0, 45.0),
            fault=True,
            unit=" deg",
            strides=Exposure((0.0, 0.5), (0.5,), (1.0, 2.0)),
        ),
    ] = 0.0
    """Drawn for each joint uniformly; the servo believes its encoder, too."""
    imu_tilt_deg: Annotated[
        float,
        Disturbance(
            help="By how much the IMU is turned at most about each axis [deg].",
            label="IMU tilt",
            option="imu_tilt",
            limits=Limits(0.0, 45.0),
            fault=True,
            unit=" deg",
            strides=Exposure((0.0, 0.5), (0.5,), (1.0, 2.0)),
        ),
    ] = 0.0
    imu_offset_m: Annotated[
        float,
        Disturbance(
            help="How far the IMU sits from its place at most along each axis [m].",
            label="IMU offset",
            option="imu_offset",
            limits=Limits(0.0, 1.0),
            fault=True,
            scale=1000.0,
            unit=" mm",
            strides=Exposure((0.0, 0.01), (0.01,), (0.02, 0.05)),
        ),
    ] = 0.0
    gyro_bias_deg_s: Annotated[
        float,
        Disturbance(
            help="What the gyro shows at rest at most, each axis [deg/s].",
            label="gyro bias",
            option="gyro_bias",
            limits=Limits(0.0, 90.0),
            fault=True,
            unit=" deg/s",
            strides=Exposure((0.0, 0.25), (0.25,), (0.5, 1.0)),
        ),
    ] = 0.0
    """Beyond that of `noise`; constant, drawn for each axis uniformly."""
    accelerometer_bias: Annotated[
        float,
        Disturbance(
            help="What the accelerometer shows too much at most, each axis [m/s^2].",
            label="accelerometer bias",
            option="accelerometer_bias",
            limits=Limits(0.0, 10.0),
            fault=True,
            unit=" m/s^2",
            strides=Exposure((0.0, 0.05), (0.05,), (0.1, 0.2)),
        ),
    ] = 0.0
    """Constant, drawn for each axis uniformly."""
    imu_scale: Annotated[
        float,
        Disturbance(
            help="Error of the scale of gyro and accelerometer at most, each axis.",
            label="IMU scale error",
            option="imu_scale",
            limits=Limits(0.0, 0.5),
            fault=True,
            scale=100.0,
            unit=" %",
            strides=Exposure((0.0, 0.02), (0.02,), (0.05,)),
        ),
    ] = 0.0
    imu_delay_s: Annotated[
        float,
        Disturbance(
            help="Gyro and accelerometer are read this much late [s].",
            label="IMU delay",
            option="imu_delay",
            limits=Limits(0.0, 1.0),
            fault=True,
            scale=1000.0,
            unit=" ms",
            strides=Exposure((0.0, 0.01), (0.01,), (0.02, 0.03)),
        ),
    ] = 0.0
    """Rounded up to whole control periods."""
    com_m: Annotated[
        float,
        Disturbance(
            help="Shift of the trunk's CoM at most along each axis [m].",
            label="CoM of the trunk",
            option="com",
            limits=Limits(0.0, 1.0),
            scale=1000.0,
            unit=" mm",
            strides=Exposure(None, (), (0.005, 0.01, 0.02)),
        ),
    ] = 0.0
    doubt: Annotated[
        float,
        Disturbance(
            help="How far an identified robot is drawn from what was found of it, in "
            "standard deviations; 0 nominal.",
            label="doubt",
            option="doubt",
            limits=Limits(0.0, 3.0),
        ),
    ] = 0.0
    """What a log left unknown of an `Identified` robot, all of `UNSURE`, is drawn
    together, by its covariance."""
    blocks_m: Annotated[
        float,
        Disturbance(
            help="Height of the highest of the flat blocks on the floor [m].",
            label="blocks",
            option="blocks",
            limits=Limits(0.0, 0.1),
            scale=1000.0,
            unit=" mm",
            key_poses=Exposure(None, (), (0.002,)),
            strides=Exposure(None, (0.003,), (0.006, 0.01)),
        ),
    ] = 0.0
    """0 for no blocks; see `draw_blocks`."""
    slope_deg: Annotated[
        float,
        Disturbance(
            help="Slope of the floor, positive uphill ahead [deg].",
            label="slope",
            option="slope",
            limits=Limits(-45.0, 45.0),
            unit=" deg",
            key_poses=Exposure(None, (), (-1.0, 1.0)),
            strides=Exposure(None, (-1.0, 1.0), (-3.0, 3.0)),
        ),
    ] = 0.0
    """The floor stays at z = 0 and gravity is tilted, which is the same physics:
    positions remain in floor coordinates, and the sensors measure true gravity."""
    contact_s: Annotated[
        float,
        Disturbance(
            help="Time constant of the ground's contact, harder when smaller [s]; 0.02 "
            "nominal.",
            label="contact time",
            option="contact",
            limits=Limits(0.002, 0.2),
            scale=1000.0,
            unit=" ms",
            strides=Exposure((0.004, 0.02), (), (0.005, 0.01)),
        ),
    ] = 0.02
    """Applies to floor and blocks; at least two time steps of the simulation."""
    cone: Annotated[
        Cone,
        Disturbance(
            help="Model of the contacts' friction; pyramidal by default.",
            label="friction cone",
            option="cone",
            choices=get_args(Cone),
        ),
    ] = "pyramidal"
    """MuJoCo's two models of contact: with the elliptic one soles hardly creep."""
    push: Annotated[
        tuple[Push, ...],
        Disturbance(
            help='Pushes "impulse@direction@time@body": N s, deg (0 forward, 90 to the '
            "left), s (4 if left out), before the last command ends, body "
            '("trunk" if left out); several of them with commas between.',
            label="push / m sqrt(g h)",
            option="push",
            key_poses=Exposure(None, (), (0.05,)),
            strides=Exposure(0.1, (0.05,), (0.1, 0.2)),
        ),
    ] = ()
    """Levels of the grid are impulses in units of m sqrt(g h), h the height of the CoM;
    training's have the height of the hips."""
    punches: Annotated[
        Punches | None,
        Disturbance(
            help='Punches "impulse@interval": up to so many N s on a random body in a '
            "random direction in space, every so many s (5 if left out).",
            label="punches / m sqrt(g h)",
            option="punches",
            strides=Exposure(None, (), (0.1, 0.2)),
        ),
    ] = None
    """Levels of the grid are the largest impulses in units of m sqrt(g h)."""
    arms: Annotated[
        Arms,
        Disturbance(
            help="What somebody else does with the arms; still by default.",
            label="arms",
            option="arms",
            choices=get_args(Arms),
        ),
    ] = "still"
    """See `arm_motion`."""
    speed_limit_deg_s: Annotated[
        float | None,
        Disturbance(
            help="Speed limit of the servos' set-points [deg/s]; inf for none. The "
            "robot's own by default.",
            label="servo speed",
            option="speed_limit",
            limits=Limits(1.0, math.inf),
            unit=" deg/s",
        ),
    ] = None
    """Rate limit of the servos' set-points; `math.inf` for none. See `motor_speed`."""
    foot_sensors: Annotated[
        bool,
        Disturbance(
            help="Soles measure their load, and touch-down is seen by it.",
            label="foot sensors",
            option="foot_sensors",
        ),
    ] = False
    held: bool = False
    """Whether the trunk is held up, level, so that the legs swing freely."""
    timestep: Annotated[float, Limits(1e-5, 0.01)] = 0.002
    """Step of the simulation [s]."""
    seed: Annotated[int, Limits(0, 2**64 - 1, whole=True)] = 0
    """Seed of all that is drawn."""
    plant_seed: Annotated[int | None, Limits(0, 2**64 - 1, whole=True)] = None
    """Seed of what belongs to the robot: the errors of its links, servos, encoders and
    IMU; by default that of the world. With one of its own the same robot is in other
    worlds."""

    def __post_init__(self) -> None:
        """Refuse what cannot be.

        Raises:
            CommandError: a field is outside its limits, or of another kind.
        """
        check_numbers(self)
        if not isinstance(self.foot_sensors, bool):
            raise CommandError(
                f"foot_sensors is {self.foot_sensors!r}, must be True or False"
            )
        _check_plan(self.push)
        if not (self.punches is None or isinstance(self.punches, Punches)):
            raise CommandError(f"punches is {self.punches!r}, must be Punches or None")
        for name, disturbance in DISTURBANCES.items():
            word, allowed = getattr(self, name), disturbance.choices
            if allowed and word not in allowed:
                raise CommandError(
                    f"{name} is {word!r}, must be {' or '.join(allowed)}"
                )

    @property
    def delay_steps(self) -> int:
        """Delay of the targets in time steps."""
        return round(self.delay_s / self.timestep)

    @property
    def has_servo_faults(self) -> bool:
        """Whether servos do otherwise than ideal ones, see `servo_faults`."""
        wrong = (
            *(self.backlash_deg, self.stiction, self.sag, self.target_step_deg),
            *(self.jitter_s, self.encoder_offset_deg),
        )
        return any(wrong) or min(self.no_load, self.bus_hz) < math.inf

    @property
    def has_sensor_faults(self) -> bool:
        """Whether sensors show more than the truth and noise, see `sensor_faults`."""
        wrong = (
            *(self.encoder_offset_deg, self.encoder_step_deg),
            *(self.imu_scale, self.imu_delay_s),
            *(self.gyro_bias_deg_s, self.accelerometer_bias),
        )
        return any(wrong) or self.bus_hz < math.inf

    def motor_speed(self, own: float) -> float:
        """Return the speed of friction and of the torque-speed line [rad/s].

        Slower set-points leave a motor as it is; faster ones are those of a faster
        motor, so without any limit it has neither.

        Args:
            own: speed limit of the robot's joint [rad/s].
        """
        limit = self.speed_limit_deg_s
        return own if limit is None else max(own, math.radians(limit))

    @property
    def up(self) -> tuple[float, float, float]:
        """True vertical in the floor's frame, a unit vector."""
        slope = math.radians(self.slope_deg)
        return math.sin(slope), 0.0, math.cos(slope)


def _check_plan(pushes: object) -> None:
    """Refuse what is no plan of pushes."""
    if not (isinstance(pushes, tuple) and all(isinstance(p, Push) for p in pushes)):
        raise CommandError(f"push is {pushes!r}, must be a tuple of Push")
    for push in pushes:
        if not _PLANNED_S.hold(push.at_s):
            raise CommandError(
                f"push: at_s is {push.at_s!r}, must be {_PLANNED_S} in a world"
            )


DISTURBANCES: dict[str, Disturbance] = declared(World, Disturbance)
"""Disturbances by the name of the field, in the order of the grid."""
