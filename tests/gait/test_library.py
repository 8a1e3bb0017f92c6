"""The gait library and its file: round trips, the same bytes, every damage refused."""

import contextlib
import hashlib
import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from other_robots import resized
from safetensors.numpy import load, save
from small_build import TINY

from gaitchain.build.pipeline import build_library
from gaitchain.cli.libraries import shipped_library
from gaitchain.discover.loaded_robot import load_robot
from gaitchain.errors import ChainError, LibraryError, RobotFileError
from gaitchain.gait.family import STAND
from gaitchain.gait.library import best_gaits
from gaitchain.gait.library_file import (
    SCHEMA,
    check_robot,
    library_bytes,
    load_library,
    parse_library,
    save_library,
)
from gaitchain.gait.slide import Slides
from gaitchain.robot.box_robot import load_box_robot
from gaitchain.robot.identified import Identified
from gaitchain.robot.leg_model import legs_from

# The file is read for every example, but the folder may be shared.
SHARED = settings(
    max_examples=60,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("libraries")


@pytest.fixture(scope="module")
def data(library):
    return library_bytes(library)


def load_bytes(folder, data):
    path = folder / "file.gait"
    path.write_bytes(data)
    return load_library(path)


def arrays_of(library):
    return {
        "parameters": library.poses.parameters,
        "rates": library.poses.rates,
        "q": library.poses.q,
        "dq": library.poses.dq,
        "transitions": library.chain.transitions,
        "edge_costs": library.edge_costs,
        "path_costs": library.path_costs,
        "pairs": (
            library.pair_advance,
            library.pair_error,
            library.pair_slip,
            library.pair_runs,
            library.pair_passes,
        ),
    }


def assert_equal(one, other):
    for name, arrays in arrays_of(one).items():
        for a, b in zip(arrays, arrays_of(other)[name], strict=True):
            np.testing.assert_array_equal(a, b)
    assert one.robot == other.robot
    assert one.timing == other.timing
    assert one.poses.closed == other.poses.closed
    assert one.config == other.config
    assert one.qualification == other.qualification


def signed(data, arrays=None, **header):
    """The file with other arrays or header fields, and a checksum that fits them.

    The checksum is computed here anew, by the rule that the format documents.
    """
    size = int.from_bytes(data[:8], "little")
    facts = json.loads(json.loads(data[8 : 8 + size])["__metadata__"]["gaitchain"])
    facts = {**facts, **header}
    facts.pop("sha256")
    content = {**load(data), **(arrays or {})}
    content = {k: np.ascontiguousarray(a) for k, a in content.items() if a is not None}
    digest = hashlib.sha256(json.dumps(facts, sort_keys=True).encode())
    for name in sorted(content):
        array = content[name]
        digest.update(f"{name}{array.dtype}{array.shape}".encode() + array.tobytes())
    facts["sha256"] = digest.hexdigest()
    return save(content, {"gaitchain": json.dumps(facts, sort_keys=True)})


def test_round_trip(library, folder):
    path = folder / "res.gait"
    size = save_library(library, path)
    assert size == path.stat().st_size < 64_000
    loaded = load_library(path, library.robot)
    assert_equal(loaded, library)
    assert loaded.qualified == library.qualified
    assert loaded.speed_range == library.speed_range
    assert loaded.slides == library.slides
    np.testing.assert_array_equal(loaded.gait_of, library.gait_of)


def test_a_library_of_before_slides_were_learned_has_none(brisk, folder):
    assert any(brisk.slides.steps)
    assert any(brisk.slides.trunk)
    data = library_bytes(brisk)
    assert load_bytes(folder, data).slides == brisk.slides
    assert load_bytes(folder, signed(data, {"usual_slides": None})).slides == Slides()


def test_a_library_of_before_steps_of_robots_were_compared(brisk, folder):
    data = library_bytes(replace(brisk, usual_spread=0.2))
    assert load_bytes(folder, data).usual_spread == 0.2
    assert load_bytes(folder, signed(data, {"usual_spread": None})).usual_spread == 0.0


def test_saving_again_gives_the_same_bytes(library, data, folder):
    assert library_bytes(library) == data
    assert library_bytes(load_bytes(folder, data)) == data


def test_the_test_signs_as_the_package_does(data):
    assert signed(data) == data


@pytest.mark.slow
def test_same_config_and_seed_same_bytes_for_any_workers():
    """The whole way: training, verdicts on the steps, and the gate's schedules."""
    one = build_library(TINY)[0]
    data = library_bytes(one)
    assert library_bytes(build_library(TINY, workers=2)[0]) == data
    other = build_library(replace(TINY, seed=2))[0]
    unlike = replace(other, config=one.config, qualification=one.qualification)
    assert library_bytes(unlike) != data


@SHARED
@given(st.floats(0.0, 1.0, exclude_max=True))
def test_truncated_files_are_refused(folder, data, part):
    with pytest.raises(LibraryError, match=r"truncated|damaged"):
        load_bytes(folder, data[: int(part * len(data))])


@pytest.mark.parametrize("length", [0, 1, 7, 8, 9, 100, -1, -8])
def test_truncation_at_the_edges(folder, data, length):
    with pytest.raises(LibraryError, match="truncated"):
        load_bytes(folder, data[:length] if length else b"")


@SHARED
@given(st.data())
def test_a_changed_byte_is_refused_or_changes_nothing(folder, data, library, draw):
    header = 8 + int.from_bytes(data[:8], "little")
    # As many in the header as in the far larger arrays.
    place = draw.draw(st.integers(0, header - 1) | st.integers(0, len(data) - 1))
    value = draw.draw(st.integers(0, 255).filter(lambda v: v != data[place]))
    changed = data[:place] + bytes([value]) + data[place + 1 :]
    try:
        loaded = load_bytes(folder, changed)
    except LibraryError:
        return
    assert place < header  # every byte of every array counts
    assert_equal(loaded, library)


def places_in(value, path=()):
    """Every place of a JSON value, the keys that lead there."""
    yield path
    parts = value.items() if isinstance(value, dict) else []
    for key, part in enumerate(value) if isinstance(value, list) else parts:
        yield from places_in(part, (*path, key))


ODD = st.sampled_from(
    [None, True, 0, -1, 1e30, "", "x", [], {}, [1], {"a": 1}, [[]], "9" * 400, 2**80]
)


@pytest.fixture(scope="module", params=["library", "brisk"])
def sealed(request):
    """The bytes of a library, and the text of its header."""
    content = library_bytes(request.getfixturevalue(request.param))
    size = int.from_bytes(content[:8], "little")
    header = json.loads(content[8 : 8 + size])["__metadata__"]["gaitchain"]
    return content, header


@pytest.mark.slow
@SHARED
@given(draw=st.data())
def test_a_sealed_value_of_another_type_is_refused_or_taken(sealed, draw):
    """The checksum fits, so that all else has to be checked."""
    content, header = sealed
    facts = json.loads(header)
    places = [place for place in places_in(facts) if place]
    first, *path = places[draw.draw(st.integers(0, len(places) - 1))]
    if not path:
        facts[first] = draw.draw(ODD)
    else:
        part = facts[first]
        for key in path[:-1]:
            part = part[key]
        part[path[-1]] = draw.draw(ODD)
    with contextlib.suppress(LibraryError):
        parse_library(signed(content, **facts), "sealed")


@pytest.mark.parametrize("balance", [1.0, None, "x", [1.0]])
def test_gains_that_are_no_table_are_refused(brisk, balance):
    content = library_bytes(brisk)
    size = int.from_bytes(content[:8], "little")
    facts = json.loads(json.loads(content[8 : 8 + size])["__metadata__"]["gaitchain"])
    poses = {**facts["poses"], "balance": balance}
    with pytest.raises(LibraryError, match="inconsistent"):
        parse_library(signed(content, poses=poses), "sealed")


def shipped_facts():
    content = shipped_library().read_bytes()
    size = int.from_bytes(content[:8], "little")
    return content, json.loads(
        json.loads(content[8 : 8 + size])["__metadata__"]["gaitchain"]
    )


@pytest.mark.parametrize("length", ["femur_length", "crus_length"])
@pytest.mark.parametrize("value", [0, False, -1.0])
def test_a_robot_without_lengths_is_refused(length, value):
    content, facts = shipped_facts()
    robot = facts["robot"]
    changed = {**robot, "numbers": {**robot["numbers"], length: value}}
    with pytest.raises(LibraryError, match=f"inconsistent: {length}"):
        parse_library(signed(content, robot=changed), "sealed")


@pytest.mark.parametrize(
    "name, value, limit",
    [
        ("servo_stiffness", 0, "above 0"),
        ("servo_stiffness", 0.01, "0.1 to 1e\\+06"),
        ("trunk_length", -1, "0.02 to 3"),
        ("joint_angle_limit", 180, "0.174533 to 3.14159"),
    ],
)
def test_a_robots_number_outside_its_limits_is_refused_by_name(name, value, limit):
    content, facts = shipped_facts()
    robot = facts["robot"]
    changed = {**robot, "numbers": {**robot["numbers"], name: value}}
    with pytest.raises(LibraryError, match=f"{name} of the robot is {value}.*{limit}"):
        parse_library(signed(content, robot=changed), "sealed")


@pytest.mark.parametrize("name", ["\ud800", "", "a\n", "x" * 2000, None, ["RES"]])
def test_a_robots_name_that_cannot_be_shown_is_refused(name):
    content, facts = shipped_facts()
    robot = {**facts["robot"], "name": name}
    with pytest.raises(LibraryError, match=r"name = .*: expected") as refused:
        parse_library(signed(content, robot=robot), "sealed")
    assert str(refused.value).isprintable()


def test_impossible_results_of_tests_are_refused():
    content, facts = shipped_facts()
    grid = facts["qualification"]["grid"]
    first, *others = grid["cells"]
    for passes, told in ((-(10**18), ">= 0"), (first["runs"] + 1, "at most")):
        cells = [{**first, "passes": passes}, *others]
        tested = {**facts["qualification"], "grid": {**grid, "cells": cells}}
        with pytest.raises(LibraryError, match=told):
            parse_library(signed(content, qualification=tested), "sealed")


@pytest.mark.parametrize("end", [(1e308, 0.1), (-1e308, 0.1), (0.2, 0.1), (0, np.nan)])
def test_a_range_that_nothing_walks_is_refused(end):
    content, facts = shipped_facts()
    steady = [*facts["steady"][:2], end]
    with pytest.raises(LibraryError, match="steady: yaw_rate from"):
        parse_library(signed(content, steady=steady), "sealed")


@pytest.mark.parametrize(
    "name, value, told",
    [
        ("parameters_3", np.nan, "has nan, each number must be finite"),
        ("path_cost_2", -np.inf, "has -inf, each number must be above -inf"),
        ("edge_cost_1", np.nan, "has nan, each number must be above -inf"),
    ],
)
def test_numbers_of_a_table_are_refused_by_name(name, value, told):
    content, _ = shipped_facts()
    table = np.full_like(load(content)[name], value)
    with pytest.raises(LibraryError, match=f"{name} {told}"):
        parse_library(signed(content, {name: table}), "sealed")


def test_names_of_what_was_identified_without_its_numbers_are_refused():
    content, facts = shipped_facts()
    names = list(Identified.of_file(12).facts())
    robot = {**facts["robot"], "identified": names}
    with pytest.raises(LibraryError, match="must be a table"):
        parse_library(signed(content, robot=robot), "sealed")


@pytest.mark.parametrize(
    "name, value, told",
    [
        ("trunk_mass", "x", "trunk_mass"),
        ("trunk_mass", 0.0, "above 0"),
        ("knee", 99, "knee is 99"),
        ("held", ["head"], "held"),
        ("joint_names", "left", "joint_names"),
    ],
)
def test_legs_with_facts_of_other_types_are_refused(name, value, told):
    legs = load_box_robot("res").legs
    with pytest.raises(RobotFileError, match=told):
        legs_from({**legs.facts(), name: value}, legs.arrays())


@SHARED
@given(st.binary(max_size=200))
def test_other_bytes_are_refused(folder, content):
    with pytest.raises(LibraryError, match="not a gait library"):
        load_bytes(folder, content)


def test_appended_bytes_are_refused(folder, data):
    with pytest.raises(LibraryError, match="not a gait library"):
        load_bytes(folder, data + b"x")


def test_foreign_safetensors_are_refused(folder):
    values = {"weight": np.zeros(3)}
    for metadata in (None, {"format": "pt"}):
        with pytest.raises(LibraryError, match="safetensors file, but not a gait"):
            load_bytes(folder, save(values, metadata))
    with pytest.raises(LibraryError, match="not a gait library"):
        load_bytes(folder, save(values, {"gaitchain": "not JSON"}))
    with pytest.raises(LibraryError, match="schema None"):
        load_bytes(folder, save(values, {"gaitchain": "{}"}))


@pytest.mark.parametrize("header", ["[1]", "1", "null", '"schema"', "true"])
def test_a_header_that_is_no_table_is_refused(folder, header):
    with pytest.raises(LibraryError, match=r"not a gait library.*no.* JSON object"):
        load_bytes(folder, save({"weight": np.zeros(3)}, {"gaitchain": header}))


@pytest.mark.parametrize("depth", [700, *range(950, 1001, 5), 200_000])
def test_a_header_that_is_nested_too_deeply_is_refused(folder, data, depth):
    """Python reads, writes and shows fewer than 1000 levels."""
    nested = "[" * depth + "]" * depth
    for header in ("[" * depth, f'{{"schema": {nested}}}'):
        deep = save({"weight": np.zeros(3)}, {"gaitchain": header})
        with pytest.raises(LibraryError) as refused:
            load_bytes(folder, deep)
        assert len(str(refused.value)) < 500
    size = int.from_bytes(data[:8], "little")
    text = json.loads(data[8 : 8 + size])["__metadata__"]["gaitchain"]
    with pytest.raises(LibraryError, match=r"not a gait library|damaged|inconsis"):
        parse_library(
            save(load(data), {"gaitchain": f'{text[:-1]}, "x": {nested}}}'}), ""
        )


def test_a_name_that_comes_with_the_package_is_told_by_its_path():
    """On the command line the name is enough."""
    for name in ("res", "res.gait"):
        with pytest.raises(LibraryError, match="comes with gaitchain is ") as told:
            load_library(name)
        path = str(told.value).rpartition(" is ")[2]
        assert load_library(path).qualified


@pytest.mark.parametrize("path", [None, 5, "a\0b", b"a"])
def test_what_is_no_path_is_refused(library, path):
    with pytest.raises(LibraryError, match="cannot be the path of a library"):
        load_library(path)
    with pytest.raises(LibraryError, match="cannot be the path of a library"):
        save_library(library, path)
    with pytest.raises(RobotFileError, match="cannot be the path of a robot"):
        load_robot(path)


def test_missing_file_and_directory(folder):
    with pytest.raises(LibraryError, match=r"nowhere\.gait: cannot be read: No such"):
        load_library(folder / "nowhere.gait")
    with pytest.raises(LibraryError, match="cannot be read: Is a directory"):
        load_library(folder)
    with pytest.raises(LibraryError, match="cannot be"):
        load_library(folder / "nowhere" / "res.gait")


@pytest.mark.parametrize("odd", ["res", 5, ("res",)])
def test_what_is_no_robot_or_no_library_is_refused(library, tmp_path, odd):
    path = tmp_path / "a.gait"
    with pytest.raises(LibraryError, match=r"is no gait library; .*walker\.library"):
        save_library(odd, path)
    assert not path.exists()
    save_library(library, path)
    with pytest.raises(LibraryError, match="is no robot; give a Robot, as load_robot"):
        load_library(path, odd)


def test_a_file_that_cannot_be_written(library, folder):
    with pytest.raises(LibraryError, match=str(folder)):
        save_library(library, folder)


@pytest.mark.parametrize("schema", [0, 1, SCHEMA - 1, str(SCHEMA), None])
def test_another_schema_says_what_to_do(folder, data, schema):
    with pytest.raises(LibraryError, match=f"version reads {SCHEMA}; build it again"):
        load_bytes(folder, signed(data, schema=schema))


def test_another_robot_is_refused_by_what_differs(library, folder, data):
    heavier = resized(library.robot, trunk_mass=20.0, name="Heavy")
    with pytest.raises(LibraryError) as refusal:
        check_robot(library, heavier)
    message = str(refusal.value)
    assert "built for Robo-Erectus Senior, not for Heavy" in message
    assert "trunk_mass 16 / 20" in message
    assert "crus_mass" not in message
    path = folder / "robot.gait"
    path.write_bytes(data)
    with pytest.raises(LibraryError, match=r"robot\.gait: built for.*trunk_mass"):
        load_library(path, heavier)
    renamed = resized(library.robot, name="the same under another name")
    check_robot(library, renamed)
    assert load_library(path, load_box_robot("res")).robot == load_box_robot("res")


def bumped(array, index, amount):
    changed = array.copy()
    changed[index] += amount
    return changed


@pytest.mark.parametrize("layer", [1, 2, 3, 4])
def test_a_pose_that_its_primitives_do_not_make(folder, data, layer):
    name = f"pose_{layer}"
    wrong = bumped(load(data)[name], (1, 3), 1e-4)
    with pytest.raises(LibraryError, match=rf"pose of layer {layer} is 0\.0001 rad"):
        load_bytes(folder, signed(data, {name: wrong}))


@pytest.mark.parametrize("layer", [1, 2, 3])
def test_rows_that_do_not_sum_to_one(folder, data, layer):
    name = f"transition_{layer}"
    wrong = bumped(load(data)[name], (1, 0), 1e-3)
    with pytest.raises(LibraryError, match=rf"layer {layer}, row 1 sums to 1\.001"):
        load_bytes(folder, signed(data, {name: wrong}))


def test_missing_parts_are_named(folder, data):
    with pytest.raises(LibraryError, match=r"inconsistent: .*edge_cost_2"):
        load_bytes(folder, signed(data, {"edge_cost_2": None}))
    with pytest.raises(LibraryError, match="inconsistent"):
        load_bytes(folder, signed(data, timing=[3.0, 2.0, 1.5]))
    with pytest.raises(LibraryError, match="inconsistent"):
        load_bytes(folder, signed(data, robot={"name": "x"}))
    unreachable = bumped(load(data)["parameters_2"], (0, 1), 5.0)
    with pytest.raises(LibraryError, match="inconsistent"):
        load_bytes(folder, signed(data, {"parameters_2": unreachable}))


def test_layers_that_do_not_fit_the_chain(folder, data):
    parts = {n: load(data)[n][:-1] for n in ("parameters_2", "rates_2", "pose_2")}
    with pytest.raises(LibraryError, match="inconsistent: the chain has"):
        load_bytes(folder, signed(data, parts))


WRONG_TABLES = {
    "edge costs of another shape": ("edge_cost_2", lambda a: a[:-1]),
    "edge costs the other way round": ("edge_cost_1", lambda a: a.T),
    "edge costs that are no numbers": ("edge_cost_1", lambda a: a * np.nan),
    "edge costs without a bound": ("edge_cost_3", lambda a: a * 0 - np.inf),
    "path costs of another shape": ("path_cost_3", lambda a: a[:, :-1]),
    "path costs that are no numbers": ("path_cost_2", lambda a: a * np.nan),
    "path costs without a bound": ("path_cost_1", lambda a: a * 0 - np.inf),
    "advances of another shape": ("pair_advance", lambda a: a[:-1, :-1]),
    "advances that are no numbers": ("pair_advance", lambda a: a * np.nan),
    "advances without a bound": ("pair_advance", lambda a: a + np.inf),
    "errors of another shape": ("pair_error", lambda a: a[:-1, :-1]),
    "errors below zero": ("pair_error", lambda a: a - 1.0),
    "errors without a bound": ("pair_error", lambda a: a + np.inf),
    "slips of another shape": ("pair_slip", lambda a: a[:-1, :-1]),
    "slips below zero": ("pair_slip", lambda a: a - 1.0),
    "slips without a bound": ("pair_slip", lambda a: a + np.inf),
    "a spread below zero": ("usual_spread", lambda a: a - 1.0),
    "a spread that is no number": ("usual_spread", lambda a: a * np.nan),
    "several spreads": ("usual_spread", lambda a: np.array([a, a])),
    "slides of another shape": ("usual_slides", lambda a: a[:, :-1]),
    "slides that are no numbers": ("usual_slides", lambda a: a + np.nan),
    "slides without a bound": ("usual_slides", lambda a: a + np.inf),
    "runs of another shape": ("pair_runs", lambda a: a[:, :-1]),
    "passes of another shape": ("pair_passes", lambda a: a[:-1]),
    "passes in a row": ("pair_passes", lambda a: a.reshape(-1)),
    "more passes than runs": ("pair_passes", lambda a: a + 1),
    "fewer passes than none": ("pair_passes", lambda a: a - 1),
    "runs and passes below 0": ("pair_runs", lambda a: a * 0 - 1),
}
# One number among all others that is none.
WRONG_NUMBERS = {
    name: (name, lambda a: bumped(a, (-1, -1), np.nan))
    for name in (
        "edge_cost_3",
        "path_cost_3",
        "pair_advance",
        "pair_error",
        "pair_slip",
    )
}


@pytest.mark.filterwarnings("ignore:invalid value:RuntimeWarning")  # inf * 0, by us
@pytest.mark.parametrize("what", [*WRONG_TABLES, *WRONG_NUMBERS])
def test_tables_that_do_not_fit(folder, data, what):
    name, change = {**WRONG_TABLES, **WRONG_NUMBERS}[what]
    with pytest.raises(LibraryError, match="inconsistent"):
        load_bytes(folder, signed(data, {name: change(load(data)[name])}))


@pytest.mark.parametrize("name", ["edge_cost", "path_cost"])
@pytest.mark.parametrize("number", [1, 2, 3])
def test_each_table_of_costs_is_needed(folder, data, name, number):
    with pytest.raises(LibraryError, match=f"inconsistent: '{name}_{number}'"):
        load_bytes(folder, signed(data, {f"{name}_{number}": None}))


def test_loaded_arrays_are_frozen(library, folder, data):
    loaded = load_bytes(folder, data)
    for arrays in (loaded.poses.parameters, loaded.poses.q, loaded.chain.transitions):
        with pytest.raises(ValueError, match="read-only"):
            arrays[0][0, 0] = 0.5


def test_allowed_pairs_were_walked_and_never_fell(library):
    runs, passes = library.pair_runs.copy(), library.pair_passes.copy()
    runs[1, 1], passes[1, 1] = 0, 0
    runs[1, 2], passes[1, 2] = 5, 4
    runs[2, 1], passes[2, 1] = 5, 5
    allowed = replace(library, pair_runs=runs, pair_passes=passes).allowed_pairs
    assert not allowed[1, 1]
    assert not allowed[1, 2]
    assert allowed[2, 1]


def test_speed_range_is_of_cycles_that_go_on_and_on(library):
    count = len(library.pair_runs)
    ones = np.ones((count, count), dtype=np.int64)
    advance = 0.03 * np.arange(count)[:, None] + 0.001 * np.arange(count)
    every = replace(library, pair_runs=ones, pair_passes=ones, pair_advance=advance)
    steady = 0.031 * np.arange(1, count) / library.timing.step
    assert every.speed_range == pytest.approx((steady[0], steady[-1]))
    fallen = ones.copy()
    fallen[1, 1] = 0
    fewer = replace(every, pair_passes=fallen)
    # The slowest cycle is now from the first to the second pose and back.
    mixed = 0.5 * (steady[0] + steady[1])
    assert fewer.speed_range == pytest.approx((mixed, steady[-1]))
    fallen[1, 2] = 0  # a way there without a way back is no cycle
    mixed = 0.5 * (steady[0] + steady[2])
    one_way = replace(every, pair_passes=fallen)
    assert one_way.speed_range == pytest.approx((min(mixed, steady[1]), steady[-1]))
    none = replace(every, pair_passes=0 * ones)
    assert none.speed_range == (0.0, 0.0)


def test_the_best_gait_between_two_poses(library):
    """Against all gaits between the two, one by one."""
    costs = library.path_costs
    sizes = library.chain.layer_sizes
    inner = np.indices(sizes[1:3]).reshape(2, -1)
    for first, last in np.ndindex(sizes[0], sizes[3]):
        total = (
            costs[0][first, inner[0]]
            + costs[1][inner[0], inner[1]]
            + costs[2][inner[1], last]
        )
        gait = library.gait_of[first, last]
        if np.isinf(total.min()):
            assert np.all(gait == -1)
            continue
        assert (gait[0], gait[3]) == (first, last)
        own = sum(c[gait[i], gait[i + 1]] for i, c in enumerate(costs))
        assert own == pytest.approx(total.min())


def test_the_best_gait_goes_by_the_path_costs_alone(library):
    """Edge costs say otherwise, and are not asked."""
    other = tuple(np.where(np.isfinite(c), 1.0 - c, c) for c in library.edge_costs)
    misled = replace(library, edge_costs=other)
    np.testing.assert_array_equal(misled.gait_of, library.gait_of)
    np.testing.assert_array_equal(library.gait_of, best_gaits(library.path_costs))
    assert np.any(best_gaits(other) != library.gait_of)


def test_no_gait_where_no_path_leads():
    costs = (np.array([[0.0, np.inf]]), np.array([[np.inf], [0.0]]), np.zeros((1, 2)))
    np.testing.assert_array_equal(best_gaits(costs), np.full((1, 2, 4), -1))


def test_costs_that_are_no_numbers_are_refused():
    with pytest.raises(ChainError, match="NaN"):
        best_gaits((np.full((1, 1), np.nan), np.zeros((1, 1))))


def test_standing_is_pose_0(library):
    assert STAND == 0
    assert not library.allowed_pairs[STAND, STAND]
    np.testing.assert_allclose(library.poses.foot_x[0][STAND], 0.0, atol=1e-12)
