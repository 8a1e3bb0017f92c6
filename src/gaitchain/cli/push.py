"""`gaitchain push`: find the impulse at which half the walks fall, by direction."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from gaitchain.build.push import (
    MOST,
    PushedWalk,
    PushResult,
    judge,
    run_pushes,
    size_of,
)
from gaitchain.cli.console import print_table, say, watched
from gaitchain.cli.files import check_picture
from gaitchain.cli.libraries import read_library
from gaitchain.cli.options import Push
from gaitchain.cli.world_options import (
    check_effects,
    check_pushed,
    wants_feedback,
    world_json,
    world_numbers,
)
from gaitchain.errors import CommandError
from gaitchain.figures.robustness import plot_pushes
from gaitchain.gait.library import GaitLibrary
from gaitchain.messages import Command
from gaitchain.sim.bodies import ANY_BODY, body_names
from gaitchain.sim.push import Push as SimulatedPush
from gaitchain.walker.walker import Walker


def run(options: Push) -> tuple[int, dict[str, Any]]:
    """Push; the exit code is 0 also if walks fall."""
    feedback, fixed = wants_feedback(options.loop), world_numbers(options.world)
    if options.output is not None:
        check_picture(options.output)
    library = read_library(options.library)
    Walker(library)  # refuses an unqualified library before any work
    check_effects(fixed, library.robot)
    _check_speed(options.vx, library)
    check_pushed("body", options.body, (*body_names(library.robot), ANY_BODY))
    tests = run_pushes(
        PushedWalk(library, options.vx, fixed, feedback, options.body),
        options.runs,
        options.seed,
        directions=options.directions,
        workers=options.workers,
    )
    total = options.runs * options.directions
    results = judge(list(watched(tests, "pushing", total)))
    figures = _figures(options, library, results)
    figures["fixed"] = world_json(fixed)
    _show(figures, results)
    if options.output is not None:
        title = f"{library.robot.name} walking {_walk(figures)}"
        scale, body = figures["m_sqrt_gh_ns"], options.body
        plot_pushes(results, title, scale, options.output, body=body)
        say(f"{options.output}: the picture")
    return 0, figures


def _check_speed(vx: float, library: GaitLibrary) -> None:
    if not math.isfinite(vx):
        raise CommandError(f"--vx {vx:g}: need a speed in m/s, as 0.2")
    if vx != 0.0:  # standing is always possible
        try:
            library.command_range.check(Command(vx))
        except CommandError as error:
            raise CommandError(f"--vx: {error}") from None


def _figures(
    options: Push, library: GaitLibrary, results: Sequence[PushResult]
) -> dict[str, Any]:
    mass, height, scale = size_of(library)
    parts = [result.impulse_ns / scale for result in results]
    return {
        "robot": library.robot.name,
        "worst_over_m_sqrt_gh": min(parts),
        "mean_over_m_sqrt_gh": float(np.mean(parts)),
        "m_sqrt_gh_ns": scale,
        "mass_kg": mass,
        "com_height_m": height,
        "vx_mps": options.vx,
        "duration_s": SimulatedPush.duration_s,
        "body": options.body,
        "runs": options.runs,
        "seed": options.seed,
        "feedback": not options.loop.open_loop,
        "per_direction": [
            _plain(result, scale) | {"over_m_sqrt_gh": part}
            for result, part in zip(results, parts, strict=True)
        ],
    }


def _plain(result: PushResult, scale_ns: float) -> dict[str, Any]:
    known = not math.isnan(result.interval_ns[0])
    return asdict(result) | {
        "interval_ns": result.interval_ns if known else None,
        "fell_alone": result.fell_alone,
        "withstood": result.withstood(scale_ns),
    }


def _between(interval_ns: tuple[float, float]) -> str:
    low, high = interval_ns
    return "-" if math.isnan(low) else f"{low:.1f} to {high:.1f}"


def _walk(figures: dict[str, Any]) -> str:
    loop = "with feedback" if figures["feedback"] else "open loop"
    return f"{figures['vx_mps']:g} m/s, {loop}"


def _show(figures: dict[str, Any], results: Sequence[PushResult]) -> None:
    scale = figures["m_sqrt_gh_ns"]
    rows = [
        (
            f"{r.direction_deg:g}",
            f"{r.impulse_ns:.1f}",
            _between(r.interval_ns),
            f"{r.impulse_ns / scale:.3f}",
        )
        for r in results
    ]
    on = f"pushed for {SimulatedPush.duration_s:g} s on {figures['body']}"
    title = f"{figures['robot']} {on}, {_walk(figures)}"
    heads = (
        "direction [deg]",
        "half fall [N s]",
        "90 % interval [N s]",
        "over m sqrt(g h)",
    )
    print_table(title, heads, rows)
    say(
        f"worst {figures['worst_over_m_sqrt_gh']:.3f}, mean "
        f"{figures['mean_over_m_sqrt_gh']:.3f} m sqrt(g h); 0 deg pushes forward, 90 "
        f"to the left; m sqrt(g h) = {scale:.1f} N s"
    )
    for line in _apart(results, scale):
        say(line)


def _apart(results: Sequence[PushResult], scale_ns: float) -> Iterator[str]:
    """Say of which runs the impulses are not those of a push."""
    runs = sum(len(result.critical_ns) for result in results)
    if alone := sum(result.fell_alone for result in results):
        yield f"{alone} of {runs} walks fell without a push, and count as 0"
    if stood := sum(result.withstood(scale_ns) for result in results):
        yield (
            f"{stood} of {runs} walks withstood the hardest push, and count as "
            f"{MOST * scale_ns:.1f} N s"
        )
    if math.isnan(results[0].interval_ns[0]):
        yield "of fewer than 5 runs a direction no 90 % interval is known"
