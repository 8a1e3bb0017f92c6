"""The reduced biped and its file: RES as in the paper, and every way to spoil it."""

import math
import tomllib
from dataclasses import fields
from importlib import resources

import pytest
from hypothesis import given
from hypothesis import strategies as st
from other_robots import resized

from gaitchain.errors import RobotFileError
from gaitchain.robot.box_robot import box_robot, load_box_robot
from gaitchain.robot.reduced_biped import ReducedBiped, builtin_robots, parse_biped

RES_TEXT = (resources.files("gaitchain") / "data" / "res.toml").read_text("utf-8")
NUMBERS = {f.name: f.metadata for f in fields(ReducedBiped) if f.metadata}
PAPER = {
    "crus_mass": 4.0,
    "femur_mass": 2.5,
    "trunk_mass": 16.0,
    "crus_length": 0.246,
    "femur_length": 0.346,
    "trunk_length": 0.5,
    "joint_angle_limit": math.radians(80.0),
    "joint_speed_limit": math.radians(150.0),
}


def res_table():
    return tomllib.loads(RES_TEXT)


def refused(table):
    with pytest.raises(RobotFileError) as caught:
        parse_biped(table, "robot.toml")
    return str(caught.value)


def test_res_has_the_papers_numbers():
    res = load_box_robot("res")
    assert res.name == "Robo-Erectus Senior"
    for name, value in PAPER.items():
        assert getattr(res.reduced, name) == pytest.approx(value, rel=1e-15), name
    assert res.reduced.leg_length == pytest.approx(0.592)
    assert res.reduced.mass - 2 * res.reduced.foot_mass == pytest.approx(29.0)


def test_every_number_of_res_has_a_source():
    res = load_box_robot("res")
    assert set(res.reduced.sources) == set(NUMBERS) == set(res.reduced.numbers())
    for name, source in res.reduced.sources.items():
        expected = "paper, Sec. VI" if name in PAPER else "assumed"
        assert source.startswith(expected), name


def test_load_by_name_and_by_path_agree(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(RES_TEXT, encoding="utf-8")
    assert "res" in builtin_robots()
    assert load_box_robot(path) == load_box_robot(str(path)) == load_box_robot("res")


def test_sole_edges_and_si_units():
    res = resized(load_box_robot("res"), sole_length=0.2, sole_offset=0.03)
    assert res.reduced.sole_x == pytest.approx((-0.07, 0.13))
    table = res_table()
    table["joint_speed_limit"]["value"] = 180
    assert parse_biped(table, "x").joint_speed_limit == pytest.approx(math.pi)


@pytest.mark.parametrize("key", NUMBERS)
def test_missing_key(key):
    table = res_table()
    del table[key]
    message = refused(table)
    meta = NUMBERS[key]
    allowed = f"allowed: {meta['low']:.15g} to {meta['high']:.15g} {meta['unit']}"
    assert message == f"robot.toml: {key} is missing; {allowed}"


def test_unknown_key_gets_a_suggestion():
    table = res_table()
    table["crus_lenght"] = table["crus_length"]
    assert refused(table) == (
        "robot.toml: unknown key crus_lenght; did you mean crus_length?"
    )
    table = res_table()
    table["zzz"] = 1.0
    assert refused(table) == "robot.toml: unknown key zzz"
    of_servos = {"robot": "RES", "fingerprint": "d", "joints": {}}
    assert refused(of_servos).endswith("; this is a calibration of servos, no robot")


def test_unknown_key_within_an_entry():
    table = res_table()
    table["crus_length"]["vlaue"] = 0.2
    message = refused(table)
    assert "crus_length" in message
    assert "unknown key vlaue; did you mean value?" in message


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        ("0.246", "'0.246'"),
        (True, "True"),
        ([0.246], "[0.246]"),
        (math.nan, "nan"),
        (math.inf, "inf"),
        (-math.inf, "-inf"),
        (0.01, "0.01"),
        (2.5, "2.5"),
        (-0.246, "-0.246"),
        (246, "246"),
    ],
)
def test_bad_value(value, shown):
    table = res_table()
    table["crus_length"]["value"] = value
    message = refused(table)
    assert message.startswith(f"robot.toml: crus_length = {shown}")
    assert message.endswith("; allowed: 0.02 to 2 m")


@pytest.mark.parametrize("entry", [0.246, "0.246 m", [0.246, "m"], {"unit": "m"}])
def test_entry_of_another_shape(entry):
    table = res_table()
    table["crus_length"] = entry
    message = refused(table)
    assert f"crus_length = {entry!r}: expected {{ value = ..., unit = " in message
    assert message.endswith("allowed: 0.02 to 2 m")


@pytest.mark.parametrize(
    ("key", "unit"), [("crus_length", "mm"), ("joint_angle_limit", "rad")]
)
def test_wrong_unit(key, unit):
    table = res_table()
    table[key]["unit"] = unit
    assert refused(table) == (
        f"robot.toml: {key} is in {unit!r}; use {NUMBERS[key]['unit']!r}"
    )


@pytest.mark.parametrize("name", ["", 7, None])
def test_bad_name(name):
    table = res_table()
    table["name"] = name
    assert f"name = {name!r}: expected a non-empty string" in refused(table)


@pytest.mark.parametrize("offset", [0.11, -0.11, 0.3])
def test_sole_offset_off_the_sole(offset):
    table = res_table()
    table["sole_offset"]["value"] = offset
    message = refused(table)
    assert f"sole_offset = {offset:g} m leaves the ankle off the sole" in message
    assert "allowed: -0.11 to 0.11 m" in message


@pytest.mark.parametrize(
    ("content", "reason"),
    [(b"crus_length = = 1", "not a TOML file"), (b"\xff\xfe\x00\x9d", "not a text")],
)
def test_unreadable_file(tmp_path, content, reason):
    path = tmp_path / "broken.toml"
    path.write_bytes(content)
    with pytest.raises(RobotFileError, match=reason) as caught:
        load_box_robot(path)
    assert str(path) in str(caught.value)


def test_missing_file_and_directory_name_the_builtin_robots(tmp_path):
    for path in (tmp_path / "none.toml", tmp_path):
        with pytest.raises(RobotFileError, match=r"built-in name \(.*res.*\)") as error:
            load_box_robot(path)
        assert str(path) in str(error.value)


@given(st.sampled_from(sorted(NUMBERS)), st.booleans(), st.floats(1e-9, 1e30))
def test_any_number_out_of_its_range_is_refused(key, above, excess):
    meta = NUMBERS[key]
    bound = meta["high"] if above else meta["low"]
    value = bound + excess if above else bound - excess
    if value == bound:
        value = math.nextafter(bound, math.inf if above else -math.inf)
    table = res_table()
    table[key]["value"] = value
    message = refused(table)
    # As written in the file: rounded to 6 digits it could look allowed.
    assert f"{key} = {value!r} {meta['unit']}" in message
    assert (
        f"allowed: {meta['low']:.15g} to {meta['high']:.15g} {meta['unit']}" in message
    )


@pytest.mark.parametrize("key", sorted(set(NUMBERS) - {"sole_offset", "sole_length"}))
def test_the_ends_of_each_range_are_allowed(key):
    for bound in ("low", "high"):
        table = res_table()
        table[key]["value"] = NUMBERS[key][bound]
        value = getattr(parse_biped(table, "x"), key)
        assert value == pytest.approx(NUMBERS[key][bound] * NUMBERS[key]["scale"])


@pytest.mark.parametrize("key", sorted(NUMBERS))
def test_fingerprint_follows_every_number(key):
    res = load_box_robot("res")
    value = getattr(res.reduced, key)
    changed = resized(res, **{key: math.nextafter(value, math.inf)})
    assert changed.fingerprint != res.fingerprint
    assert resized(changed, **{key: value}).fingerprint == res.fingerprint


def test_fingerprint_does_not_tell_minus_0_from_0():
    res = load_box_robot("res")
    one, other = (resized(res, sole_offset=zero) for zero in (0.0, -0.0))
    assert one == other and one.fingerprint == other.fingerprint


def test_fingerprint_ignores_names_and_sources():
    table = res_table()
    table["name"] = "another"
    table["crus_length"]["source"] = "measured"
    other = parse_biped(table, "x")
    assert other.sources["crus_length"] == "measured"
    assert box_robot(other).fingerprint == load_box_robot("res").fingerprint
