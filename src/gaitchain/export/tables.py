"""Tables of a library and its robot as C, and the constants of the runner."""

from collections.abc import Iterator
from types import ModuleType
from typing import Any

import numpy as np

from gaitchain.balance import attitude, state, state_estimation, walk_controller
from gaitchain.balance.leg_kinematics import Legs
from gaitchain.balance.walk_controller import Snapshot
from gaitchain.chain import recovery
from gaitchain.export.c_literals import literal, text_literal
from gaitchain.gait import command_range
from gaitchain.gait.family import STAND
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.stride.strides import StridePoses
from gaitchain.messages import ABSURD, GRAVITY, Array
from gaitchain.robot.turn import turn_matrix
from gaitchain.walker import (
    generator,
    sensor_check,
    stride_gait,
    stride_generator,
)
from gaitchain.walker.motor_targets import NO_LOAD
from gaitchain.walker.stride_generator import StrideTables

# Names in C, prefix first, of constants that have their value in a module of Python.
_CONSTANTS: tuple[tuple[ModuleType, str, str], ...] = (
    (state, "", "STAND SHIFT SINGLE DOUBLE SETTLE"),
    (attitude, "VERTICAL", "_RATE _REACH _BIAS_RATE _SMOOTH_S _SHAKEN _TURNING"),
    (attitude, "VERTICAL", "_FIRST_S _FIRST_Z_S _MOST_RATE _MOST_S _KEPT_S"),
    (attitude, "VERTICAL", "_LEAN_RATE _LEAN_REACH"),
    (state_estimation, "LOOK", "NEAR"),
    (state_estimation, "WEIGH", "_FIRST_S"),
    (state_estimation, "", "_LOOK_EVERY _WEIGH_EVERY"),
    (walk_controller, "WALK", "_SLACK_S _AT_REST _LONGEST_SETTLE_S"),
    (recovery, "FOOT", "AHEAD"),
    (stride_gait, "", "_SMALLEST _MISPLACED"),
    (stride_generator, "", "_PAID_AT_ONCE"),
    (stride_generator, "STRIDE", "_TAUGHT"),
    (generator, "", "LATE_STOP"),
    (recovery, "UNREST", "_DECAY CALM _MORE _FIRST _LOWERS"),
    (command_range, "RANGE", "_SLACK"),
    (sensor_check, "", "GYRO_JUMP"),
)


def constants(library: GaitLibrary, poses: int) -> str:
    """Return the runner's constants.

    Args:
        library: the gaits.
        poses: number of strides.
    """
    found = {
        "_".join(filter(None, (prefix, name.strip("_")))): getattr(module, name)
        for module, prefix, names in _CONSTANTS
        for name in names.split()
    }
    found |= {
        "ABSURD": ABSURD,
        "GRAVITY": GRAVITY,
        "TAU": 2.0 * np.pi,
        "STANDING_POSE": STAND,
        "STRIDES": poses,
        "STEP_S": library.timing.step,
        "LEG": library.robot.reduced.leg_length,
        "STANCE": library.poses_as(StridePoses).stance,
        "SIZES": len(recovery.SIZES),
        "LEVELS": len(recovery.ERRORS),
        "RECOVERS": int(library.recovery is not None),
        "USUAL_OFF": library.usual_off,
        "SLIDE_EACH": library.slides.steps.each,
        "SLIDE_AHEAD": library.slides.steps.ahead,
        "SLIDE_BACK": library.slides.steps.back,
        "SLIDE_LEFT": library.slides.steps.left,
        "MOUNTED": int(library.robot.identified is not None),
    }
    return "\n".join(f"#define {n} {_number(v)}" for n, v in found.items()) + "\n"


def _number(value: float) -> str:
    return literal(value) if isinstance(value, float) else str(value)


def tables(library: GaitLibrary, legs: Legs, start: Snapshot, own: StrideTables) -> str:
    """Return all tables.

    Args:
        library: the gaits.
        legs: the robot, as its walk controller has it.
        start: a standing walk.
        own: what strides are looked up in.
    """
    walk, memory = braced(start.numbers[0].item()), braced(start.memory)
    parts = [
        *_tables_of_gaits(library, own),
        *_tables_of_robot(library, np.asarray(start.memory.joints)),
        f"static const gait_legs LEGS = {braced(legs)};\n",
        f"static const gait_walk WALK_AT_START = {walk};\n",
        f"static const gait_memory MEMORY_AT_START = {memory};\n",
    ]
    return "\n".join(parts)


def _tables_of_gaits(library: GaitLibrary, own: StrideTables) -> Iterator[str]:
    yield from (table(name, array) for name, array in _reals(library, own).items())
    yield table("STEPS_TO_STAND", own.steps_to_stand, "double")
    sizes = library.chain.layer_sizes
    yield table("POSES", np.array(sizes), "int")
    for layer in range(len(sizes) - 1):
        chosen = np.array(
            [[_first(options) for options in way[layer]] for way in own.choices]
        )
        yield table(f"CHOICES_{layer + 1}", chosen, "uint16_t")
    if library.recovery is not None:
        yield table("RECOVERY_SIZES", np.array(recovery.SIZES))
        yield table("RECOVERY_COST", library.recovery.cost)
        yield f"#define RECOVERY_ERROR {literal(library.recovery.error)}\n"


def _reals(library: GaitLibrary, own: StrideTables) -> dict[str, Array]:
    """Return the tables of real numbers by name."""
    reals = {
        "STRIDE": own.strides,
        "CELL_LOW": own.cell[0],
        "CELL_HIGH": own.cell[1],
        "STRIDE_TOLERANCE": own.tolerance,
        "STRIDE_LEARNED": stride_generator.LEARNED,
        "MOST_OWED": own.most_owed,
        "MOST_MISSED": own.most_missed,
        "OUTER_SHARE": own.outer_share,
        "PATH_COST": own.path_cost,
        "PAIR_ERROR": library.pair_error,
        "PAIR_SLIP": library.pair_slip,
        "PASSING": library.poses.parameters[1],
        "LANDING": library.poses.parameters[2],
        "UNREST_ERRORS": np.array(recovery.errors_of(library.usual_spread)),
    }
    span = library.command_range
    for name, ends in zip(("VX", "VY", "YAW_RATE"), span.ends, strict=True):
        reals[f"RANGE_{name}"] = np.array(ends)
    reals["MOST_MEASURED"] = np.array(list(sensor_check.LIMITS.values()))
    reals["RANGE_CROUCH"] = np.array(span.crouch)
    return reals


def _first(options: Any) -> int:
    """Return the best choice; 0 where a walk never gets, as no way leads from there."""
    return int(options[0][0]) if options else 0


def _tables_of_robot(library: GaitLibrary, stand: Array) -> Iterator[str]:
    legs, found = library.robot.legs, library.robot.identified
    names = ", ".join(map(text_literal, legs.joint_names))
    offset = np.zeros_like(stand) if found is None else found.offset
    yield f"const char *const gait_joint_names[GAIT_JOINTS] = {{{names}}};\n"
    yield public("gait_stand", stand + offset)
    yield public("gait_stiffness", legs.stiffness)
    yield public("gait_damping", legs.damping - legs.joint_damping)
    yield table("STAND_ANGLES", stand)
    yield table("PASSIVE_DAMPING", legs.joint_damping)
    yield table("TORQUE_LIMIT", legs.torque_limit)
    yield table("TORQUE_LOSS", 1.0 / (NO_LOAD * legs.speed_limit))  # 0 without limit
    if found is not None:
        yield table("MOUNTED_OFFSET", found.offset)
        yield table("MOUNTED_TURN", turn_matrix(found.tilt))


def public(name: str, values: Array) -> str:
    """Return a table that the header declares."""
    return table(name, values).removeprefix("static ")


def table(name: str, values: Any, kind: str = "double") -> str:
    """Return the definition of an array."""
    sizes = "".join(f"[{size}]" for size in values.shape)
    return f"static const {kind} {name}{sizes} = {_rows(values, kind)};\n"


def _rows(values: Any, kind: str) -> str:
    """Return the initialiser of an array."""
    if values.ndim > 1:
        return "{" + ",\n    ".join(_rows(row, kind) for row in values) + "}"
    plain = values.tolist()
    numbers = [literal(v) if kind == "double" else str(v) for v in plain]
    return "{" + ", ".join(numbers) + "}"


def braced(value: Any) -> str:
    """Return the initialiser of a struct: nested tuples of numbers and arrays."""
    if isinstance(value, tuple):
        return "{" + ", ".join(map(braced, value)) + "}"
    if isinstance(value, np.ndarray):
        return _rows(value.ravel(), "double")
    return literal(value) if isinstance(value, float) else str(value)
