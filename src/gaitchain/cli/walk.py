"""`gaitchain walk`: build or load a library and walk it in physics."""

import math
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from gaitchain.analysis.record import WalkRecord
from gaitchain.analysis.record_file import RECORD, save_record
from gaitchain.analysis.rule_checks import nearest_angle, nearest_speed
from gaitchain.analysis.simulated_walk import Visit, run_schedule, run_waypoints
from gaitchain.analysis.walk_metrics import (
    SegmentResult,
    WalkSummary,
    percent,
    summarise,
    support_region,
)
from gaitchain.backends.mujoco import MujocoBackend
from gaitchain.build.progress import Progress
from gaitchain.cli.console import print_table, progress, say, write_json
from gaitchain.cli.files import check_writable, make_folder
from gaitchain.cli.libraries import given_robot, read_library
from gaitchain.cli.library_cache import cached_library
from gaitchain.cli.options import Walk
from gaitchain.cli.waypoints import (
    given_commands,
    parse_waypoints,
    show_visits,
    visit_json,
)
from gaitchain.cli.world_options import (
    check_crouch,
    check_effects,
    check_pushes,
    check_pushes_on_way,
    read_schedule,
    wants_feedback,
    world_json,
    world_numbers,
)
from gaitchain.discover.loaded_robot import load_robot
from gaitchain.discover.looks import find_looks
from gaitchain.errors import CommandError
from gaitchain.figures.replay import Recording, write_replay
from gaitchain.figures.walk import plot_walk
from gaitchain.gait.build_config import BuildConfig
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.library_file import library_bytes
from gaitchain.gait.schedule import (
    Schedule,
    ends_at,
    format_schedule,
    lowered,
    parse_schedule,
)
from gaitchain.messages import Command
from gaitchain.robot.reduced_biped import is_boxes
from gaitchain.sim.model import build_model
from gaitchain.sim.world import World
from gaitchain.walker.place import Place
from gaitchain.walker.walker import Walker

_ROBOT = "res"
_RUNNERS_UP = 3  # number of other candidates of each decision in walk.json


def run(options: Walk) -> tuple[int, dict[str, Any]]:
    """Walk; the exit code is 1 if the robot fell."""
    feedback = wants_feedback(options.loop)
    given = world_numbers(options.world, options.push, options.punches)
    goals = _check_way(options)  # before a library is built
    library, build_s = _library(options, given)
    world = World(**{"seed": options.seed, **given})
    walker = Walker(library, options.policy, feedback=feedback)
    check_crouch(options.crouch, library)
    schedule = () if goals else _schedule(options.schedule, library)
    schedule = lowered(schedule, options.crouch)
    if schedule:
        check_pushes(given, ends_at(schedule, library.timing.step))
    out = _folder(options.out)
    with progress() as tell:
        tell("walking", 0, 1)
        backend = MujocoBackend(library.robot, world)
        walked = _walk(walker, backend, schedule, goals, options.crouch)
        tell("walking", 1, 1)
        summary = summarise(library.robot, walked.record, walked.schedule)
        note = walker.note if goals else _changes(walker, schedule)
        result = {
            **_result(library, walked, summary),
            "feedback": feedback,
            "world": world_json(vars(world)),
            "build_s": build_s,
            "walk_s": walked.walk_s,
            "note": note,
            "decisions": _decisions(walked.record),
        }
        write_json(out / "walk.json", result)
        _draw(library, walked, world, out, tell)
    if goals:
        show_visits(library, goals, walked.visits)
    _show(summary, library, walked.record, feedback, segments=not goals)
    if note:
        say(f"commands changed: {note}")
    say(f"{out}: walk.json, walk.png, walk.rec, walk.html (open it in any browser)")
    return 0 if walked.arrived(goals) and not summary.fell else 1, result


class _Walked(NamedTuple):
    """A walk, to its end or the fall."""

    record: WalkRecord
    schedule: Schedule
    """What was commanded."""
    visits: list[Visit]
    walk_s: float
    """Time that the simulation took [s]."""

    def arrived(self, goals: tuple[Place, ...]) -> bool:
        """Whether the robot got to all way points."""
        return all(v.arrived for v in self.visits) and len(self.visits) == len(goals)


def _folder(path: Path) -> Path:
    """Make the folder of the results; refuse one in which they cannot be written."""
    out = make_folder(path)
    for name in ("walk.json", "walk.png", "walk.html", RECORD):
        check_writable(out / name)
    return out


def _walk(
    walker: Walker,
    backend: MujocoBackend,
    schedule: Schedule,
    goals: tuple[Place, ...],
    crouch: float,
) -> _Walked:
    """Walk the schedule, or to the way points.

    Raises:
        CommandError: a push comes after the way.
    """
    begin = time.perf_counter()
    visits: list[Visit] = []
    if goals:
        record, visits = run_waypoints(walker, backend, goals, crouch=crouch)
        if record.fell_at_s is None:
            check_pushes_on_way(backend.world.push, float(record.time_s[-1]))
        schedule = given_commands(record)
    else:
        record = run_schedule(walker, backend, schedule)
    return _Walked(record, schedule, visits, time.perf_counter() - begin)


def _changes(walker: Walker, schedule: Schedule) -> str:
    """Say what was changed of a schedule's commands, each thing once."""
    clamp = walker.gait.generator.clamp
    notes = [walker.note, *(clamp(segment.command)[1] for segment in schedule)]
    return "; ".join(dict.fromkeys(filter(None, notes)))


def _check_way(options: Walk) -> tuple[Place, ...]:
    """Return the way points, if any; refuse what no library could walk.

    Raises:
        CommandError: schedule or way points cannot be parsed, both are given, or the
            library that would be built has no strides.
    """
    boxes = options.library is None and is_boxes(options.robot or _ROBOT)
    if options.waypoints is None:
        if options.library is None and options.schedule is not None:
            parse_schedule(options.schedule, steps=boxes)
        return ()
    if options.schedule is not None:
        raise CommandError("--schedule and --waypoints: give one of them")
    if boxes:
        raise CommandError(
            "--waypoints: the paper's walk, which is built of a robot of boxes, goes "
            "straight ahead; give a library of strides, as `res`"
        )
    return parse_waypoints(options.waypoints)


def _library(options: Walk, given: Mapping[str, Any]) -> tuple[GaitLibrary, float]:
    if options.library is not None:
        robot = given_robot(options.robot, options.profile)
        library = read_library(options.library, robot)
        check_effects(given, library.robot)
        return library, 0.0
    name = options.robot or _ROBOT
    loaded = load_robot(name, options.profile)  # reports a bad file before any work
    check_effects(given, loaded)
    profile = None if options.profile is None else str(options.profile)
    config = BuildConfig(robot=name, profile=profile, seed=options.seed)
    stem = "".join(c for c in Path(name).stem if c.isalnum() or c in "-_")
    path = make_folder(options.out) / f"{stem or loaded.fingerprint}.gait"
    return cached_library(config, path, options.workers)


def _schedule(text: str | None, library: GaitLibrary) -> Schedule:
    if text is None:
        return library.family.demonstration(library.command_range)
    return read_schedule(text, library)


def _result(
    library: GaitLibrary, walked: _Walked, summary: WalkSummary
) -> dict[str, Any]:
    """Return what was walked, for the JSON."""
    return {
        "robot": library.robot.name,
        **summary.to_json(),
        "library": {
            "bytes": len(library_bytes(library)),
            "poses_per_layer": list(library.poses.counts),
        },
        "schedule": format_schedule(walked.schedule),
        "waypoints": [visit_json(visit) for visit in walked.visits],
    }


def _decisions(record: WalkRecord) -> list[dict[str, Any]]:
    """Return each chosen key pose with the reasons and its primitives."""
    return [
        {
            "time_s": round(time_s, 3),
            "key_moment": panel.key_moment,
            "support": "left" if panel.left_support else "right",
            "pose": decision.pose,
            "cost": decision.cost,
            "runners_up": [list(other) for other in decision.runners_up[:_RUNNERS_UP]],
            "primitives": {**panel.move, **panel.lift, **panel.swing},
        }
        for time_s, decision, panel in record.decisions
    ]


def _show(
    summary: WalkSummary,
    library: GaitLibrary,
    record: WalkRecord,
    feedback: bool,
    *,
    segments: bool,
) -> None:
    loop = "with feedback" if feedback else "open loop"
    title = f"{library.robot.name} walks {loop}, {summary.distance_m:.2f} m"
    heads = (
        "segment",
        "time [s]",
        "commanded [vx,vy,yaw]",
        "achieved mean [vx,vy,yaw]",
    )
    rows = [(f"{i}", *_cells(s)) for i, s in enumerate(summary.segments, start=1)]
    if segments:
        print_table(title, heads, rows)
    angle = nearest_angle(library.robot, record)
    speed = nearest_speed(library.robot, record)
    low, at, high = (math.degrees(q) for q in (angle.low, angle.value, angle.high))
    fastest, most = math.degrees(speed.value), math.degrees(speed.high)
    say(
        f"{summary.cause if summary.fell else 'no fall'}; "
        f"ZMP in the support region {percent(summary.zmp_inside_support)} of the time; "
        f"nearest to their limits: {angle.joint} at {at:.0f} deg ({low:.0f} to "
        f"{high:.0f}), {speed.joint} at {fastest:.0f} deg/s (limit {most:.0f})"
    )


def _cells(segment: SegmentResult) -> tuple[str, str, str]:
    asked, did = _three(segment.command), _three(segment.achieved)
    return f"{segment.duration_s:.3g}", asked, "-" if "nan" in did else did


def _three(command: Command) -> str:
    return f"{command.vx:.3f}, {command.vy:.3f}, {command.yaw_rate:.3f}"


def _draw(
    library: GaitLibrary, walked: _Walked, world: World, out: Path, tell: Progress
) -> None:
    """Write the record, the overview and the replay of a walk."""
    tell("drawing", 0, 2)
    save_record(walked.record, out / RECORD)
    plot_walk(walked.record, library.robot, walked.schedule, out / "walk.png")
    tell("drawing", 1, 2)
    _write_replay(library, walked.record, world, out / "walk.html")
    tell("drawing", 2, 2)


def _write_replay(
    library: GaitLibrary, record: WalkRecord, world: World, path: Path
) -> None:
    rows = range(len(record.time_s))
    regions = tuple(support_region(library.robot, record, i) for i in rows)
    model = build_model(library.robot, world, looks=find_looks(library))
    waist = model.nq - record.qpos.shape[1]  # is not recorded: drawn straight
    qpos = np.pad(record.qpos, ((0, 0), (0, waist)))
    recording = Recording(record.time_s, qpos, record.zmp, regions)
    title = f"{library.robot.name}: gaitchain walk"
    write_replay(model, recording, path, title=title)
