"""`gaitchain/Walk-v0`: a library's robot in MuJoCo as a Gymnasium environment."""

from collections.abc import Mapping
from dataclasses import fields, replace
from numbers import Real
from pathlib import Path
from reprlib import repr as short
from typing import Any, SupportsFloat, get_args

import gymnasium
import numpy as np
from numpy.typing import NDArray

from gaitchain.analysis.simulated_walk import SETTLE_TICKS
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.build.trial import draw_world
from gaitchain.errors import CommandError
from gaitchain.gait.command_range import AXES, CommandRange
from gaitchain.gait.library import GaitLibrary
from gaitchain.messages import CONTROL_PERIOD_S, Array, Command, Sensors
from gaitchain.rl.actions import ActionKind, make_control
from gaitchain.rl.expert import open_library
from gaitchain.rl.observation import Layout, Observation, phase_signal
from gaitchain.rl.reward import Reward
from gaitchain.sim.world import World
from gaitchain.walker.walker import Walker

_SEEDS = 2**31


class WalkEnv(gymnasium.Env[Observation, NDArray[np.float32]]):
    """Walk a command in physics; one step is one control period of 10 ms.

    An episode begins with a robot that stands and ends with a fall; `gymnasium.make`
    truncates it after 10 s, this class alone never. The observation is
    `observation.Layout`, the reward `reward.Reward`.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012 - as Gymnasium declares it
        "render_modes": [],
        "render_fps": round(1.0 / CONTROL_PERIOD_S),
    }

    def __init__(
        self,
        library: GaitLibrary | str | Path | None = None,
        action: ActionKind = "residual",
        *,
        residual_rad: float = 0.1,
        command: tuple[float, float, float] | None = None,
        random_world: bool = True,
        world: World | Mapping[str, Any] | None = None,
        render_mode: None = None,
    ) -> None:
        """Prepare the walk and the simulator.

        Args:
            library: the gaits, or their file; RES's library of the package by default.
            action: "residual" adds to the walk's joint targets, "command" commands it,
                "targets" are the joint targets, without a walk.
            residual_rad: what a residual of 1 adds [rad].
            command: vx, vy [m/s], yaw rate [rad/s] of every episode; drawn over the
                library's whole range by default.
            random_world: whether each episode has another world, drawn as `gaitchain
                trial` does; else all are the nominal one.
            world: fields of `World` that are not drawn, or the world of all episodes.
            render_mode: None; `gaitchain walk` and `replay` show walks.

        Raises:
            CommandError: an option is none of these, the command is out of range, or
                the world cannot be.
            LibraryError: the library cannot be read, or physics has not passed it.
        """
        if not (isinstance(action, str) and action in get_args(ActionKind)):
            known = ", ".join(get_args(ActionKind))
            raise CommandError(f"action {action!r}: there are {known}")
        if not (_is_number(residual_rad) and 0.0 < residual_rad <= 1.0):
            raise CommandError(f"residual_rad {residual_rad!r}: give above 0 to 1 rad")
        if render_mode is not None:
            raise CommandError(f"render_mode {render_mode!r}: only None is known")
        self.library = open_library(library)
        self.range = self.library.command_range
        self._asked = None if command is None else _command(command, self.range)
        if not isinstance(random_world, bool):
            raise CommandError(f"random_world {random_world!r}: need True or False")
        self._fixed, self._random_world = _fields_of(world), random_world
        self._world = world if isinstance(world, World) else None
        if world is not None:  # not at the first reset: bodies that are pushed, too
            MujocoBackend(self.library.robot, replace(World(), **self._fixed))
        walker = Walker(self.library)
        self.joint_names, self.stand = walker.joint_names, walker.stand
        self._held = walker.standing_targets.position  # a robot that settles
        self._rest_ticks = round(walker.gait.rest_s / CONTROL_PERIOD_S)
        self._control = make_control(action, self.library, self.stand, residual_rad)
        self.layout = Layout.of(len(self.stand), self._control.size)
        self._bounds = self.layout.bounds()
        self._set_spaces()
        self._backend: MujocoBackend | None = None

    def _set_spaces(self) -> None:
        size = (self._control.size,)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, size, np.float32)
        self.observation_space = gymnasium.spaces.Box(
            -self._bounds, self._bounds, dtype=np.float32
        )

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode.

        Args:
            seed: of all episodes from this one on: command, world and its noise.
            options: {"command": (vx, vy, yaw rate)} for this episode.

        Returns:
            The observation, and `info` with the "command" [m/s, m/s, rad/s].

        Raises:
            CommandError: there is no such option, or the command is none, or out of the
                library's range.
        """
        super().reset(seed=seed)
        command = self._draw_command({} if options is None else options)
        backend = self._backend = MujocoBackend(self.library.robot, self._draw_world())
        self._stand_still(backend)
        self._control.command(command)
        self._parts = np.array(self.range.parts(command))
        self._reward = Reward(command, self.library.robot, backend)
        self._ticks, self._last = 0, np.zeros(self._control.size)
        self._sensors = backend.read()
        return self._observe(), {"command": command.motion}

    def _draw_command(self, options: Mapping[str, Any]) -> Command:
        if not isinstance(options, Mapping):
            raise CommandError(f"reset options {short(options)}: give a dictionary")
        unknown = [name for name in options if name != "command"]
        if unknown:
            raise CommandError(f"reset option {unknown[0]!r}: there is only 'command'")
        given = options.get("command")
        if given is not None:
            return _command(given, self.range)
        if self._asked is not None:
            return self._asked
        return self.range.draw(self.np_random)

    def _draw_world(self) -> World:
        if self._world is not None:
            return self._world
        if not self._random_world:
            return replace(World(), **self._fixed)
        seed = int(self.np_random.integers(_SEEDS))
        return draw_world(self.library, (0, seed), self.np_random, fixed=self._fixed)

    def _stand_still(self, backend: MujocoBackend) -> None:
        """Let the robot settle and find the vertical, before it may be pushed."""
        backend.connect(self.stand)
        backend.stop_clock()
        self._control.reset()
        for _ in range(SETTLE_TICKS):
            backend.write(self._held)
        for _ in range(self._rest_ticks):
            backend.write(self._control.rest(backend.read()))
        backend.start_clock()

    def step(
        self, action: NDArray[np.float32]
    ) -> tuple[Observation, SupportsFloat, bool, bool, dict[str, Any]]:
        """Carry out an action for one control period.

        Args:
            action: numbers in [-1, 1], clipped to that.

        Returns:
            Observation, reward, whether the robot fell, False, and `info`: the parts of
            the reward, and at a fall "fall", what it was like.

        Raises:
            CommandError: there was no `reset`, or the action has another size, or is
                something else than finite numbers.
        """
        backend = self._backend
        if backend is None:
            raise CommandError("step before reset: call reset first")
        done = self._taken(action)
        backend.write(self._control.act(done, self._sensors))
        self._ticks += 1
        parts = self._reward.parts(done, done - self._last)
        self._last = done
        self._sensors = backend.read()
        info: dict[str, Any] = dict(parts)
        if backend.fallen:
            info["fall"] = self._fall(backend)
        reward = float(sum(parts.values()))
        return self._observe(), reward, backend.fallen, False, info

    def _taken(self, action: NDArray[np.float32]) -> Array:
        size = self._control.size
        given = _numbers(action, size)
        if given is None:
            raise CommandError(
                f"action {short(action)}: need {size} numbers in [-1, 1]"
            )
        return np.clip(given, -1.0, 1.0)

    def _fall(self, backend: MujocoBackend) -> str:
        """Say when, and to which side."""
        roll, pitch = np.degrees(backend.tilt)
        sides = ("forward", "backward") if abs(pitch) > abs(roll) else ("right", "left")
        lean = pitch if abs(pitch) > abs(roll) else roll
        side = sides[0] if lean > 0.0 else sides[1]
        seconds = self._ticks * CONTROL_PERIOD_S
        return f"fell {side} after {seconds:.2f} s, trunk {abs(lean):.0f} deg"

    def _observe(self) -> Observation:
        seen: Sensors = self._sensors
        numbers = np.concatenate(
            [
                seen.joint_position - self.stand,
                seen.joint_velocity,
                seen.angular_velocity,
                seen.acceleration,
                self._parts,
                phase_signal(self._control.phase),
                self._last,
            ]
        ).astype(np.float32)
        return np.clip(numbers, -self._bounds, self._bounds)


def _command(given: object, limits: CommandRange) -> Command:
    """Return a command within the range.

    Args:
        given: vx, vy [m/s] and yaw rate [rad/s].
        limits: the range.

    Raises:
        CommandError: it is no three finite numbers, or out of the range.
    """
    numbers = _numbers(given, len(AXES))
    if numbers is None:
        raise CommandError(
            f"command {short(given)}: give three finite numbers, vx, vy in m/s and the "
            "yaw rate in rad/s, such as (0.3, 0, 0)"
        )
    command = Command(*numbers.tolist())
    limits.check(command)
    return limits.clamp(command)[0]


def _numbers(given: object, size: int) -> Array | None:
    """Return so many finite numbers, or None where they are something else."""
    try:
        numbers = np.asarray(given)
    except (TypeError, ValueError, OverflowError):
        return None
    if numbers.shape != (size,) or numbers.dtype.kind not in "iuf":
        return None
    found = numbers.astype(np.float64)
    return found if np.isfinite(found).all() else None


def _fields_of(world: World | Mapping[str, Any] | None) -> dict[str, Any]:
    """Return the fields of a world that are not drawn.

    Raises:
        CommandError: there is no such field.
    """
    known = [field.name for field in fields(World)]
    if isinstance(world, World):
        return {name: getattr(world, name) for name in known}
    if not (world is None or isinstance(world, Mapping)):
        raise CommandError(f"world {short(world)}: give a World, or fields of one")
    fixed = dict(world or {})
    unknown = [name for name in fixed if name not in known]
    if unknown:
        raise CommandError(f"world {unknown[0]!r}: there are {', '.join(known)}")
    return fixed


def _is_number(value: object) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)
