"""Speeds of the parts, as ratios measured in one run."""

import statistics
import sys
import time
from collections.abc import Callable

import mujoco
import numpy as np

from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.balance.compiled import COMPILED
from gaitchain.build.pipeline import build_library
from gaitchain.chain.expectation import expected_costs, path_costs
from gaitchain.chain.layered_chain import LayeredChain, draw_gaits
from gaitchain.chain.training import train_batch, train_sequential
from gaitchain.gait.build_config import BuildConfig
from gaitchain.gait.keypose.cost import PlannedCost
from gaitchain.gait.keypose.presets import draw_candidates
from gaitchain.gait.motion import Timing
from gaitchain.messages import CONTROL_PERIOD_S, GRAVITY, Array, Command, Sensors
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.walker.generator import ChainState
from gaitchain.walker.keypose_generator import KeyposeGenerator
from gaitchain.walker.walker import Walker

_REPEATS = 5
_WALK_TICKS, _STEPS_PER_TICK = 1000, 5  # 10 s in control periods and time steps
_TRAINING_LAYERS = (1000, 1000, 1000, 1000)

Figures = dict[str, float]


def measure_decision() -> Figures:
    """Time a next-pose decision and a control tick against one `mj_step` of RES."""
    small = BuildConfig(walks=20, qualification_walks=20, gate_runs=2)
    library, _ = build_library(small)
    generator = KeyposeGenerator(library)
    high = library.speed_range[1]
    commands = [Command(vx) for vx in np.linspace(0.2 * high, high, 97)]

    def decide() -> None:
        state = ChainState()
        for command in commands:
            state, _ = generator.advance(state, command)

    walker = Walker(library, feedback=False, require_qualified=False)
    walker.command(Command(0.5 * high))
    ticks = [_sensors(CONTROL_PERIOD_S * i) for i in range(600)]

    def tick() -> None:
        walker.reset()
        for sensors in ticks:
            walker.step(sensors)

    backend = MujocoBackend(library.robot)
    backend.connect(walker.stand)

    def simulate() -> None:
        for _ in range(500):
            mujoco.mj_step(backend.model, backend.data)

    decision_s, tick_s, step_s = _medians(decide, tick, simulate)
    step_s /= 500
    return {
        "mj_step_us": 1e6 * step_s,
        "decision_us": 1e6 * decision_s / len(commands),
        "decision_over_mj_step": decision_s / len(commands) / step_s,
        "open_loop_tick_over_mj_step": tick_s / len(ticks) / step_s,
    }


def measure_closed_loop() -> Figures:
    """Time walking in closed loop against the physics alone of the very same walk."""
    small = BuildConfig(
        preset="brisk",
        poses_per_layer=(12, 1, 1, 12),
        walks=20,
        qualification_walks=60,
        gate_runs=2,
    )
    library, _ = build_library(small)
    walker = Walker(library, require_qualified=False)
    backend = MujocoBackend(library.robot)
    sensors: list[Sensors] = []
    targets: list[Array] = []

    def start() -> None:
        walker.reset()
        backend.connect(walker.stand)
        walker.command(Command(0.5 * library.command_range.vx[1]))

    start()
    for _ in range(_WALK_TICKS):
        sensors.append(backend.read())
        targets.append(walker.step(sensors[-1]).position)
        backend.write(targets[-1])

    def closed_loop() -> None:
        start()
        for _ in range(_WALK_TICKS):
            backend.write(walker.step(backend.read()).position)

    def raw() -> None:
        backend.connect(walker.stand)
        for target in targets:
            backend.data.ctrl[:] = target
            mujoco.mj_step(backend.model, backend.data, nstep=_STEPS_PER_TICK)

    def ticks() -> None:
        walker.reset()
        walker.command(Command(0.5 * library.command_range.vx[1]))
        for seen in sensors:
            walker.step(seen)

    closed_s, raw_s, tick_s = _medians(closed_loop, raw, ticks)
    step_s = raw_s / (_WALK_TICKS * _STEPS_PER_TICK)
    return {
        "online_path_compiled": float(COMPILED),
        "tick_us": 1e6 * tick_s / _WALK_TICKS,
        "tick_over_mj_step": tick_s / _WALK_TICKS / step_s,
        "closed_loop_fraction_of_raw": raw_s / closed_s,
        "closed_loop_10_s_walks_per_minute": 60.0 / closed_s,
    }


def measure_planned_cost() -> Figures:
    """Time the batched planned cost against a loop over single gaits."""
    rng = np.random.default_rng(0)
    poses = draw_candidates(load_box_robot("res"), "table1", rng)
    cost = PlannedCost(poses, Timing())
    gaits = draw_gaits(poses.counts, 5000, rng)
    some = gaits[:250]
    cost(some)  # the impact table is made once, for both

    def loop() -> None:
        for gait in some:
            cost(gait[None])

    batch_s, loop_s = _medians(lambda: cost(gaits), loop)
    per_gait_s = batch_s / len(gaits)
    return {
        "planned_cost_gaits_per_s": 1.0 / per_gait_s,
        "planned_cost_speedup": loop_s / len(some) / per_gait_s,
    }


def measure_training() -> Figures:
    """Time training on 10^5 and 10^6 sampled gaits over 4 layers of 1000."""
    rng = np.random.default_rng(0)
    seconds = []
    for samples in (10**5, 10**6):
        gaits = draw_gaits(_TRAINING_LAYERS, samples, rng)
        costs = rng.random(samples)
        begin = time.perf_counter()
        train_batch(_TRAINING_LAYERS, gaits, costs)
        train_sequential(LayeredChain.uniform(_TRAINING_LAYERS), gaits, costs)
        expected_costs(_TRAINING_LAYERS, gaits, costs)
        path_costs(_TRAINING_LAYERS, gaits, costs)
        seconds.append(time.perf_counter() - begin)
    return {
        "train_1e5_s": seconds[0],
        "train_1e6_s": seconds[1],
        "train_1e6_over_1e5": seconds[1] / seconds[0],
        **_peak(),
    }


def _peak() -> Figures:
    """Return the most memory of the whole process, an upper bound; not on Windows."""
    try:
        import resource  # noqa: PLC0415
    except ImportError:
        return {}
    in_mb = 1e6 if sys.platform == "darwin" else 1e3  # bytes there, kB on Linux
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return {"train_1e6_peak_mb": peak / in_mb}


MEASUREMENTS: tuple[Callable[[], Figures], ...] = (
    measure_decision,
    measure_closed_loop,
    measure_planned_cost,
    measure_training,
)
"""All of them, for `gaitchain bench`."""


def _medians(*jobs: Callable[[], object]) -> list[float]:
    """Median seconds of each job, run in turn so that drift hits all alike."""
    times: list[list[float]] = [[] for _ in jobs]
    for repeat in range(_REPEATS + 1):
        for own, job in zip(times, jobs, strict=True):
            begin = time.perf_counter()
            job()
            if repeat:  # the first round warms up
                own.append(time.perf_counter() - begin)
    return [statistics.median(own) for own in times]


def _sensors(time_s: float) -> Sensors:
    still = np.zeros(12)
    return Sensors(time_s, still, still, np.zeros(3), np.array([0.0, 0.0, GRAVITY]))
