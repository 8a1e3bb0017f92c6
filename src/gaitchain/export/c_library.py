"""A library of strides as C99: header, code, and a program that tries them."""

import re
from collections.abc import Mapping
from importlib.metadata import version
from importlib.resources import files
from string import Template
from typing import Any, NamedTuple

from gaitchain.balance.bounds import inside, sane
from gaitchain.balance.com_estimator import weigh
from gaitchain.balance.control_step import control_step
from gaitchain.balance.curves import clip
from gaitchain.balance.packed_state import Walk
from gaitchain.balance.rotations import rotation
from gaitchain.balance.standing import standing_balance
from gaitchain.balance.state import Foot, GaitState, seen_from
from gaitchain.balance.state_estimation import turn_trunk
from gaitchain.balance.support_foot import measured_step
from gaitchain.balance.walk_controller import WalkController
from gaitchain.errors import ExportError, printable
from gaitchain.export.c_literals import literal
from gaitchain.export.c_types import REAL, Array
from gaitchain.export.program import Program
from gaitchain.export.tables import constants, tables
from gaitchain.gait.command_range import inward
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.stride.family import STRIDES
from gaitchain.gait.stride.strides import StridePoses
from gaitchain.messages import CONTROL_PERIOD_S
from gaitchain.walker.stride_gait import StrideGait
from gaitchain.walker.stride_generator import StrideGenerator
from gaitchain.walker.stride_setup import make_walk
from gaitchain.walker.walker import check_step_period

HEADER, CODE, DEMO = "gait.h", "gait.c", "demo.c"


class Translated(NamedTuple):
    """What the control step became."""

    public: str
    """Structs of the walker's state."""
    private: str
    """All other structs."""
    functions: str


def export_c(
    library: GaitLibrary, period_s: float = CONTROL_PERIOD_S
) -> dict[str, str]:
    """Write a walker of a library in C99.

    Args:
        library: qualified strides.
        period_s: control period [s].

    Returns:
        Text of each file by name.

    Raises:
        ExportError: the library walks by key poses, or is not qualified.
        CommandError: the control period is too long for the steps, or none.
    """
    _check(library)
    check_step_period(period_s, library)
    period_s = float(period_s)  # NumPy's own float is written otherwise
    poses = library.poses_as(StridePoses)
    walk = make_walk(poses, library.timing, period_s)
    facts = _facts(library, walk) | {"period_s": literal(period_s)}
    facts |= {"period_ms": f"{1e3 * period_s:g}"}
    made = translated(walk)
    own = StrideGenerator(library).tables
    code = {
        "structs": made.private,
        "functions": made.functions,
        "constants": constants(library, len(own.strides)),
        "tables": tables(library, walk.legs, walk.snapshot(), own),
    }
    return {
        HEADER: _filled(HEADER, facts | {"structs": made.public}),
        CODE: _filled(CODE, facts | code),
        DEMO: _filled(DEMO, facts),
    }


def _check(library: GaitLibrary) -> None:
    """Refuse a library of which no C is written."""
    if library.family.name != STRIDES.name:
        raise ExportError(
            f"this library walks by {library.family.name}; C is written of "
            f"{STRIDES.name} only: build one with preset {STRIDES.presets[0]!r}"
        )
    if not library.qualified:
        raise ExportError(
            f"the library for {library.robot.name} is not qualified: physics has not "
            "passed it; build it with `gaitchain build`, which qualifies it"
        )


def translated(walk: WalkController) -> Translated:
    """Translate what computes a control period, for one robot."""
    program = Program()
    walk_type = program.type_of_kind(Walk)
    memory = program.type_of(walk.snapshot().memory)
    public = program.structs
    legs, joints = program.type_of(walk.legs), Array((len(walk.stand),))
    axes, turn = Array((3,)), Array((3, 3))
    foot, state = program.type_of_kind(Foot), program.type_of_kind(GaitState)
    program.translate(turn_trunk, walk_type, axes, axes)
    program.translate(control_step, legs, walk_type, joints, joints, memory)
    program.translate(standing_balance, legs, walk_type)
    program.translate(measured_step, legs, joints, REAL, REAL)
    program.translate(seen_from, foot, state)
    program.translate(sane, joints, joints, axes, axes, Array((4,)))
    program.translate(inside, joints, joints, joints)
    program.translate(weigh, legs, joints, joints, joints, turn)
    program.translate(rotation, REAL, REAL, REAL)
    program.translate(clip, REAL, REAL, REAL)
    private = program.structs.removeprefix(public)
    return Translated(public, private, program.functions)


def _facts(library: GaitLibrary, walk: WalkController) -> dict[str, str]:
    """Return what the text says of the robot."""
    span, robot = library.command_range, library.robot
    facts = {
        "robot": _told(robot.name),
        "version": version("gaitchain"),
        "joints": str(len(walk.stand)),
        "rest_s": literal(StrideGait.rest_s),
        "most_crouch": f"{inward(span.crouch[0]):.3f}",
        "held": _held(robot.legs.held),
    }
    for axis, (least, most) in zip(("vx", "vy", "yaw"), span.limits, strict=True):
        facts[f"least_{axis}"] = f"{-inward(-least) + 0.0:.3f}"
        facts[f"most_{axis}"] = f"{inward(most):.3f}"
    return facts


def _held(held: Mapping[str, float]) -> str:
    """Tell where all other joints are to be held."""
    if not held:
        return ""
    rows = "".join(f" *   {_told(n)}: {at:.6g}\n" for n, at in held.items())
    return f"/* All other joints are to be held still at [rad, slides m]\n{rows} */\n"


def _told(name: str) -> str:
    """Return a name in one line that begins or ends no comment, and has no trigraph."""
    return re.sub(r"(?<=[*/?])(?=[*/?])", " ", printable(name))


def _filled(name: str, facts: Mapping[str, Any]) -> str:
    text = (files("gaitchain.export") / "c" / name).read_text("utf-8")
    return Template(text).substitute(facts)
