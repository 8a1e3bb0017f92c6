"""A robot of two feet that makes the steps of a library, each a little wrong."""

import numpy as np

from gaitchain.gait.step_target import Step
from gaitchain.walker.generator import ChainState
from gaitchain.walker.place import Place
from gaitchain.walker.stride_generator import StrideGenerator

_UPCOMING = 2  # phases from the middle of a step to that of the next one


def walk_way(library, way, most_steps, error_m, seed):
    """Walk a way by steps alone; return where it stands, None if it never does.

    Args:
        library: of strides.
        way: leads there.
        most_steps: after which it is given up.
        error_m: standard deviation of what each step is wrong by, ahead and aside [m],
            and turned [rad].
        seed: of the errors.
    """
    generator, rng = StrideGenerator(library), np.random.default_rng(seed)
    half = 0.5 * generator.stance
    feet = {1.0: Place(0.0, half), -1.0: Place(0.0, -half)}
    state = made = None
    for _ in range(most_steps):
        if state is None:
            here = Place(*np.mean([feet[1.0], feet[-1.0]], axis=0).tolist())
            command = generator.clamp(way.command(here, stepping=False))[0]
            if command.stops:
                return here
            state = ChainState(left_support=generator.first_support(command))
        else:
            side = 1.0 if state.left_support else -1.0
            beside = feet[side].moved(0.0, -side * half)
            command = generator.clamp(way.command(beside, stepping=True))[0]
        side = 1.0 if state.left_support else -1.0
        state, _ = generator.advance(state, command, made=made)
        landing, stops = generator.landing(state), state.target == 0
        for _ in range(_UPCOMING):
            state, _ = generator.advance(state, command)
        off = error_m * rng.standard_normal(3)
        out = 2.0 * half + landing.outward
        made = Step(
            landing.length + off[0], -side * out + off[1], -side * landing.turn + off[2]
        )
        stood = feet[side]
        landed = stood.moved(made.ahead, made.left)
        feet[-side] = landed._replace(yaw=stood.yaw + made.turn)
        if stops:
            state = made = None
    return None
