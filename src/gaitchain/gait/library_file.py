"""The file of a gait library: safetensors with a header; loading checks everything."""

import hashlib
import json
import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load, save

from gaitchain.chain.layered_chain import LayeredChain
from gaitchain.chain.recovery import Recovery
from gaitchain.errors import GaitchainError, LibraryError, file_errors
from gaitchain.gait.build_config import BuildConfig
from gaitchain.gait.command_range import AXES, CommandRange
from gaitchain.gait.families import family_named
from gaitchain.gait.family import LAYERS
from gaitchain.gait.file_kind import other_kind
from gaitchain.gait.library import GaitLibrary
from gaitchain.gait.motion import Timing
from gaitchain.gait.qualification import GridVerdict, Qualification
from gaitchain.gait.slide import Slide, Slides
from gaitchain.robot.compare import differences, differences_that_matter
from gaitchain.robot.robot import Robot, given_robot
from gaitchain.robot.storage import robot_arrays, robot_facts, robot_from
from gaitchain.robot.whole_file import given_path, read_file, replace_file

_LOG = logging.getLogger(__name__)
SCHEMA = 10
_SHIPPED = Path(__file__).parents[1] / "data"
_KEY = "gaitchain"  # the only metadata entry, as the order of several is not defined
_MOST_BYTES = 100_000_000  # a library has less than one
_FASTEST = 100.0  # m/s or rad/s
_SHOWN = 4  # differences between robots that an error message names
# What a header raises that is JSON, but of other types or values than ours.
_INCONSISTENT = (
    *(KeyError, IndexError, TypeError, ValueError, AttributeError, ArithmeticError),
    *(RecursionError, GaitchainError),
)
_LAYERS, _EDGES = range(1, LAYERS + 1), range(1, LAYERS)


def library_bytes(library: GaitLibrary) -> bytes:
    """Return the file's content; the same library gives the same bytes."""
    timing, robot = library.timing, library.robot
    facts, own = library.family.stored(library.poses)
    arrays = _arrays(library, own)
    header = {
        "schema": SCHEMA,
        "version": library.version,
        "robot": {**robot_facts(robot), "fingerprint": robot.fingerprint},
        "timing": [timing.step, timing.rise, timing.fall],
        "gait": library.family.name,
        "poses": facts,
        "steady": None if library.steady is None else library.steady.ends,
        "config": asdict(library.config),
        "qualification": library.qualification.to_json(),
    }
    header["sha256"] = _digest(arrays, header)
    return bytes(save(arrays, {_KEY: json.dumps(header, sort_keys=True)}))


def save_library(library: GaitLibrary, path: str | Path) -> int:
    """Write the file atomically: an existing one is replaced as a whole or kept.

    Args:
        library: the library.
        path: the file.

    Returns:
        Size of the file [bytes].

    Raises:
        LibraryError: the library is none, or the file cannot be written.
    """
    check_library(library)
    path = given_path(path, "a library", LibraryError)
    data = library_bytes(library)
    with file_errors(path, "written", LibraryError):
        path.parent.mkdir(parents=True, exist_ok=True)
        replace_file(path, data)
    return len(data)


def load_library(path: str | Path, robot: Robot | None = None) -> GaitLibrary:
    """Read a gait library and check everything in it.

    Args:
        path: the file.
        robot: the robot that it must be for; any robot by default.

    Returns:
        The library.

    Raises:
        LibraryError: the file is missing, truncated, damaged, not a library, of
            another schema, or for another robot; the message names the difference.
    """
    file = given_path(path, "a library", LibraryError)
    shipped = _SHIPPED / f"{file.stem}.gait"
    if file.name == str(path) and not file.exists() and shipped.exists():
        raise LibraryError(
            f"{path}: no such file; the one that comes with gaitchain is {shipped}"
        )
    with file_errors(file, "read", LibraryError):
        data = read_file(file, _MOST_BYTES)
    library = parse_library(data, str(file))
    if robot is not None:
        check_robot(library, robot, str(file))
    return library


def parse_library(data: bytes, origin: str) -> GaitLibrary:
    """Create a library from the bytes of its file.

    Args:
        data: as `library_bytes` returns them.
        origin: name of their source, for error messages.

    Raises:
        LibraryError: the data are damaged, of another schema, or inconsistent.
    """
    arrays, header = _unpack(data, origin)
    try:
        if header.get("schema") != SCHEMA:
            raise LibraryError(
                f"{origin}: library schema {header.get('schema')!r:.40}, this version "
                f"reads {SCHEMA}; build it again with `gaitchain build`"
            )
        if _digest(arrays, header) != header.get("sha256"):
            raise LibraryError(
                f"{origin}: damaged: its content does not fit its checksum"
            )
        library = _assemble(arrays, header)
        _verify(library, origin)
        _try_out(library)
    except LibraryError:
        raise
    except _INCONSISTENT as error:
        raise LibraryError(f"{origin}: inconsistent: {error}") from None
    return library


def check_library(library: object) -> None:
    """Refuse what is no library.

    Raises:
        LibraryError: it is none.
    """
    if not isinstance(library, GaitLibrary):
        raise LibraryError(
            f"{library!r:.80} is no gait library; read one from its file, by "
            "Walker.load(path) or load_library(path); a walker's is walker.library"
        )


def check_robot(library: GaitLibrary, robot: Robot, origin: str = "library") -> None:
    """Refuse a library that was built for another robot.

    What differs by no more than between the robots that training draws is told as a
    warning alone (`compare.differences_that_matter`).

    Raises:
        LibraryError: the robots differ, by what the message names, or one is none.
    """
    robot = given_robot(robot, LibraryError)
    own, other = library.robot.in_file, robot.in_file
    found = differences_that_matter(own, other)
    if not found:
        if little := differences(own, other):
            _LOG.warning(
                "%s: built for a %s that differs a little, in %s (library / robot, SI)",
                *(origin, own.name, ", ".join(little[:_SHOWN])),
            )
        return
    names = library.robot.name, robot.name
    which = (
        f"built for another {names[0]}"
        if names[0] == names[1]
        else f"built for {names[0]}, not for {names[1]}"
    )
    more = f", and in {len(found) - _SHOWN} points more" if len(found) > _SHOWN else ""
    raise LibraryError(
        f"{origin}: {which}; differs in {', '.join(found[:_SHOWN])}{more} (library / "
        "robot, SI); build one for this robot with `gaitchain build`"
    )


def _arrays(
    library: GaitLibrary, of_poses: Mapping[str, NDArray[Any]]
) -> dict[str, NDArray[Any]]:
    named = dict(of_poses)
    for i in _LAYERS:
        named[f"parameters_{i}"] = library.poses.parameters[i - 1]
    for i in _EDGES:
        named[f"transition_{i}"] = library.chain.transitions[i - 1]
        named[f"edge_cost_{i}"] = library.edge_costs[i - 1]
        named[f"path_cost_{i}"] = library.path_costs[i - 1]
    named["pair_advance"] = library.pair_advance
    named["pair_error"] = library.pair_error
    named["pair_slip"] = library.pair_slip
    named["usual_off"] = np.array(library.usual_off)
    named["usual_spread"] = np.array(library.usual_spread)
    named["usual_slides"] = np.array(library.slides)
    named["pair_runs"] = library.pair_runs.astype(np.int64)
    named["pair_passes"] = library.pair_passes.astype(np.int64)
    named |= robot_arrays(library.robot)
    if library.recovery is not None:
        named["recovery_cost"] = library.recovery.cost
        named["recovery_error"] = np.array(library.recovery.error)
    if library.grid is not None:
        named["grid_runs"] = library.grid.runs.astype(np.int64)
        named["grid_passes"] = library.grid.passes.astype(np.int64)
        named["grid_forbidden"] = library.grid.forbidden
    return {name: np.ascontiguousarray(a) for name, a in named.items()}


def _digest(arrays: Mapping[str, NDArray[Any]], header: Mapping[str, Any]) -> str:
    facts = {k: v for k, v in header.items() if k != "sha256"}
    digest = hashlib.sha256(json.dumps(facts, sort_keys=True).encode())
    for name in sorted(arrays):
        digest.update(f"{name}{arrays[name].dtype}{arrays[name].shape}".encode())
        digest.update(arrays[name].tobytes())
    return digest.hexdigest()


def _unpack(data: bytes, origin: str) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    try:
        arrays = load(data)
        size = int.from_bytes(data[:8], "little")
        metadata = json.loads(data[8 : 8 + size]).get("__metadata__", {})
        header = json.loads(metadata[_KEY])
        if not isinstance(header, dict):
            raise ValueError("its header is not a JSON object")
    except (SafetensorError, ValueError, UnicodeDecodeError, RecursionError) as error:
        raise LibraryError(
            f"{origin}: not a gait library, or truncated ({len(data)} bytes): {error}"
        ) from None
    except KeyError:
        raise LibraryError(
            f"{origin}: a safetensors file, but not a gait library of gaitchain"
        ) from None
    if other := other_kind(header, "a gait library"):
        raise LibraryError(
            f"{origin}: {other}, not a gait library; give a .gait file that `gaitchain "
            "build` wrote"
        )
    return arrays, header


def _assemble(arrays: Mapping[str, NDArray[Any]], header: Any) -> GaitLibrary:
    robot = robot_from(header["robot"], arrays)
    poses = family_named(header["gait"]).restored(robot, header["poses"], arrays)
    return GaitLibrary(
        poses=poses,
        timing=Timing(*header["timing"]),
        chain=LayeredChain(tuple(arrays[f"transition_{i}"] for i in _EDGES)),
        edge_costs=tuple(arrays[f"edge_cost_{i}"] for i in _EDGES),
        path_costs=tuple(arrays[f"path_cost_{i}"] for i in _EDGES),
        pair_advance=arrays["pair_advance"],
        pair_error=arrays["pair_error"],
        pair_slip=arrays["pair_slip"],
        pair_runs=arrays["pair_runs"],
        pair_passes=arrays["pair_passes"],
        config=BuildConfig.from_json(header["config"]),
        qualification=Qualification.from_json(header["qualification"]),
        version=str(header["version"]),
        grid=_grid_verdict(arrays),
        steady=_steady(header["steady"]),
        usual_off=arrays["usual_off"].item(),
        usual_spread=_usual_spread(arrays),
        slides=_slides(arrays),
        recovery=_recovery(arrays),
    )


def _steady(ends: Any) -> CommandRange | None:
    if ends is None:
        return None
    found = CommandRange(*((float(low), float(high)) for low, high in ends))
    for axis, (low, high) in zip(AXES, found.ends, strict=True):
        if not -_FASTEST <= low <= high <= _FASTEST:
            raise ValueError(
                f"steady: {axis} from {low:g} to {high:g}, must rise within "
                f"{-_FASTEST:g} to {_FASTEST:g}"
            )
    return found


def _grid_verdict(arrays: Mapping[str, NDArray[Any]]) -> GridVerdict | None:
    if "grid_forbidden" not in arrays:
        return None
    runs, passes = arrays["grid_runs"], arrays["grid_passes"]
    return GridVerdict(runs, passes, arrays["grid_forbidden"].astype(np.bool_))


def _usual_spread(arrays: Mapping[str, NDArray[Any]]) -> float:
    if "usual_spread" not in arrays:  # a library of before it was learned
        return 0.0
    return float(arrays["usual_spread"].item())


def _slides(arrays: Mapping[str, NDArray[Any]]) -> Slides:
    if "usual_slides" not in arrays:  # a library of before they were learned so
        return Slides()
    rows = arrays["usual_slides"].tolist()
    steps, trunk = (Slide(each, ahead, back, left) for each, ahead, back, left in rows)
    return Slides(steps, trunk)


def _recovery(arrays: Mapping[str, NDArray[Any]]) -> Recovery | None:
    if "recovery_cost" not in arrays:
        return None
    return Recovery(arrays["recovery_cost"], arrays["recovery_error"].item())


def _try_out(library: GaitLibrary) -> None:
    """Derive what everybody asks of a library, which fails where numbers cannot be."""
    _ = library.robot.fingerprint, library.robot.legs.mass, library.command_range


def _verify(library: GaitLibrary, origin: str) -> None:
    """Check that the parts are consistent, which the checksum does not cover."""
    counts = library.poses.counts
    if library.chain.layer_sizes != counts:
        raise LibraryError(
            f"{origin}: inconsistent: the chain has {library.chain.layer_sizes} poses "
            f"per layer, the primitives {counts}"
        )
    _check_shapes(library, origin)
    _check_numbers(library, origin)
    _check_passes(library, origin)


def _check_shapes(library: GaitLibrary, origin: str) -> None:
    """Check that there is a number for each edge, and for each pair of poses."""
    counts = library.poses.counts
    edges = list(pairwise(counts))
    pairs = (counts[0], counts[-1])
    expected = {
        "edge_cost": ([c.shape for c in library.edge_costs], edges),
        "path_cost": ([c.shape for c in library.path_costs], edges),
        "pair_advance": ([library.pair_advance.shape], [pairs]),
        "pair_error": ([library.pair_error.shape], [pairs]),
        "pair_slip": ([library.pair_slip.shape], [pairs]),
        "pair_runs": ([library.pair_runs.shape], [pairs]),
        "pair_passes": ([library.pair_passes.shape], [pairs]),
    }
    if (grid := library.grid) is not None:
        found = [grid.runs.shape, grid.passes.shape, grid.forbidden.shape]
        expected["grid"] = found, [pairs] * 3
    for name, (found, needed) in expected.items():
        if found != needed:
            raise LibraryError(
                f"{origin}: inconsistent: {name} has shape {found}, needs {needed}"
            )


def _check_numbers(library: GaitLibrary, origin: str) -> None:
    """Check that costs and what is known of steps are numbers; a cost may be inf."""
    costs = {"edge_cost": library.edge_costs, "path_cost": library.path_costs}
    for name, found in costs.items():
        # Expected costs are estimates: some are a little below 0.
        _check_each(name, found, origin, lambda c: c > -np.inf, "above -inf")
    poses = library.poses.parameters
    _check_each("parameters", poses, origin, np.isfinite, "finite")
    of_robot = library.usual_off, library.usual_spread
    usual = np.append([library.pair_error, library.pair_slip], of_robot)
    signed = np.append(library.pair_advance, library.slides)
    finite = np.isfinite(signed).all() and np.isfinite(usual).all()
    if not finite or (usual < 0.0).any():
        raise LibraryError(
            f"{origin}: inconsistent: an advance, error or slip is not a number"
        )


def _check_each(
    name: str,
    layers: Sequence[NDArray[Any]],
    origin: str,
    sound: Callable[[NDArray[Any]], NDArray[np.bool_]],
    needed: str,
) -> None:
    """Check each number of a table that there is for every layer."""
    for layer, table in enumerate(layers, start=1):
        bad = table[~sound(table)]
        if bad.size:
            raise LibraryError(
                f"{origin}: inconsistent: {name}_{layer} has {bad[0]:g}, each number "
                f"must be {needed}"
            )


def _check_passes(library: GaitLibrary, origin: str) -> None:
    """Check that nothing held more often than it was walked."""
    tested = library.qualification.grid
    for cell in () if tested is None else tested.cells:
        if cell.passes > cell.runs:
            raise LibraryError(
                f"{origin}: inconsistent: {cell.passes} walks held in the world "
                f"{cell.name!r:.80}, at most {cell.runs} were walked"
            )
    grid = library.grid
    verdicts = [(library.pair_runs, library.pair_passes)]
    verdicts += [(grid.runs, grid.passes)] if grid is not None else []
    if any(bool((p < 0).any() or (p > runs).any()) for runs, p in verdicts):
        raise LibraryError(f"{origin}: inconsistent: more steps held than were walked")
