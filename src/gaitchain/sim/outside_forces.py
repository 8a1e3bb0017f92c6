"""What others do to a simulated robot: pushes, punches, arms that swing, a payload."""

from collections.abc import Callable, Iterable
from dataclasses import replace

import mujoco

from gaitchain.messages import Array
from gaitchain.robot.robot import Robot
from gaitchain.sim.arm_motion import ArmMotion
from gaitchain.sim.bodies import ANY_BODY, check_body
from gaitchain.sim.push import Push
from gaitchain.sim.push_force import Pushes, draw_body, draw_punches
from gaitchain.sim.truth import SimulatorTruth
from gaitchain.sim.waist import trunk_parts
from gaitchain.sim.world import World
from gaitchain.sim.world_draws import PUNCHES_STREAM, PUSHES_STREAM, stream_of


class OutsideForces:
    """The forces of one world on one robot; its physics is stepped under them."""

    def __init__(self, robot: Robot, truth: SimulatorTruth, world: World) -> None:
        """Plan the forces of a world.

        Args:
            robot: the robot.
            truth: its model in that world, with the payload, and where it is.
            world: with the forces.

        Raises:
            CommandError: the robot has no body that is to be pushed.
        """
        model, data = truth.model, truth.data
        self._robot, self._truth, self._model, self._data = robot, truth, model, data
        self._forces = data.xfrc_applied
        self._bodies = {model.body(i).name: i for i in range(1, model.nbody)}
        self._upper = self._bodies[list(trunk_parts(world))[-1]]
        self.plan(world)

    def plan(self, world: World) -> None:
        """Plan the world's pushes, punches and arms, none of which has begun.

        Raises:
            CommandError: the robot has no body that is to be pushed.
        """
        for push in world.push:
            check_body(push.body, self._bodies)
        self._world = world
        self._push_rng = stream_of(world, PUSHES_STREAM)
        self._punch_rng = stream_of(world, PUNCHES_STREAM)
        self.pushes = Pushes(world.push, self._punches(0.0))
        """Pushes and punches, timed."""
        self._arms = ArmMotion(self._robot, world)
        self._pushing: dict[int, Array] = {}  # forces of the latest time step

    def change(self, world: World) -> None:
        """Change punches, arms and payload to those of another world, from now on."""
        before, self._world = self._world, world
        self.pushes.ensure_clock(self._data.time)
        now_s = self.pushes.elapsed_s(self._data.time)
        self._arms.swing(world.arms == "random", now_s)
        self._load(world.payload - before.payload)
        if world.punches != before.punches:
            self.pushes.set_punches(self._punches(now_s), self._data.time)

    def push(self, push: Push) -> Push:
        """Push now, in addition to the world's pushes.

        Returns:
            The push, with the body that was drawn if any is to be pushed.

        Raises:
            CommandError: there is no such body.
        """
        if push.body == ANY_BODY:
            push = replace(push, body=draw_body(self.masses, self._push_rng))
        check_body(push.body, self._bodies)
        self.pushes.add(push, self._data.time)
        return push

    @property
    def masses(self) -> dict[str, float]:
        """Mass of each body by its name [kg]."""
        masses = self._model.body_mass
        return {name: float(masses[i]) for name, i in self._bodies.items()}

    def step(self, count: int, before: Callable[[], None] | None = None) -> None:
        """Do so many time steps of physics.

        Args:
            count: their number.
            before: called before each of them.
        """
        self._let_go()
        period_s = count * self._world.timestep
        if self.pushes.elapsed_s(self._data.time) < self._arms.rest_s:
            self._swing_arms()
        pushed = bool(self.pushes and self._impulses_within(period_s))
        if pushed:
            self._step_pushed(count, before)
        elif before is not None:
            for _ in range(count):
                before()
                mujoco.mj_step(self._model, self._data)
        else:
            mujoco.mj_step(self._model, self._data, nstep=count)

    def _punches(self, since_s: float) -> Iterable[Push]:
        punches = self._world.punches
        if punches is None:
            return ()
        return draw_punches(self._punch_rng, punches, self.masses, since_s)

    def _load(self, part: float) -> None:
        """Load the trunk with more of the robot's mass, or with less.

        The spring of a waist that gives way stays.
        """
        if part:
            mass = part * self._robot.legs.mass
            for name, share in trunk_parts(self._world).items():
                self._model.body_mass[self._bodies[name]] += share * mass
            # What follows from the masses; it needs data of its own to work in.
            mujoco.mj_setConst(self._model, mujoco.MjData(self._model))
            self._truth.update_weight()

    def _swing_arms(self) -> None:
        """Let the arms act on the part of the trunk that has the shoulders."""
        data, model, upper = self._data, self._model, self._upper
        time_s = self.pushes.elapsed_s(data.time)
        turn, com = data.xmat[upper].reshape(3, 3), model.body_ipos[upper].copy()
        if upper != self._bodies["trunk"]:
            com += model.body_pos[upper]
        self._forces[upper] = self._arms.wrench(time_s, turn, com)

    def _step_pushed(self, count: int, before: Callable[[], None] | None) -> None:
        step = self._world.timestep
        for _ in range(count):
            if before is not None:
                before()
            self._let_go()
            for name, impulse in self._impulses_within(step).items():
                self._push_body(name, impulse / step)
            mujoco.mj_step(self._model, self._data)

    def _push_body(self, name: str, force: Array) -> None:
        """Push a body at its CoM; that of the trunk is the CoM of both of its parts."""
        parts = trunk_parts(self._world) if name == "trunk" else {name: 1.0}
        for part, share in parts.items():
            body = self._bodies[part]
            self._forces[body, :3] += share * force
            self._pushing[body] = self._pushing.get(body, 0.0) + share * force

    def _let_go(self) -> None:
        """Take the latest pushes away.

        Not before the next time step: until then, MuJoCo's forces on a body have them.
        """
        for body, force in self._pushing.items():
            self._forces[body, :3] -= force
        self._pushing.clear()

    def _impulses_within(self, duration_s: float) -> dict[str, Array]:
        """Return the impulses on bodies during the next `duration_s`, (3,) [N s]."""
        now_s, heading = self._data.time, self._truth.heading
        return self.pushes.impulses_within(now_s, duration_s, heading)
