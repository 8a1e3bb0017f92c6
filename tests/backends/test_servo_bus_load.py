"""The time on the bus, against packets that the emulation puts on the line."""

import re
from dataclasses import replace
from pathlib import Path
from typing import get_type_hints

import numpy as np
import pytest
from servo_bench import ServoBackend, ServoBusEmulator, few

from gaitchain.backends.dynamixel.control_table import GOAL, PRESENT, STATE
from gaitchain.backends.dynamixel.emulator import EmulatedXSeries, EmulatedXSeriesBus
from gaitchain.backends.dynamixel.emulator.packets import encode
from gaitchain.backends.dynamixel.make import MAKE
from gaitchain.backends.servos.bus_load import LEAST_HZ, SHARE, TURN_S, BusLoad
from gaitchain.backends.servos.emulator.bus import BROADCAST
from gaitchain.backends.servos.make import make_named
from gaitchain.cli.options import Serve
from gaitchain.errors import BackendError

HUNDRED_HZ = 0.01


def on_the_line(instruction, block, ids, extra=b""):
    """Bytes of a request and of all answers to it."""
    bus = EmulatedXSeriesBus([EmulatedXSeries(number) for number in ids])
    head = block.address.to_bytes(2, "little") + block.size.to_bytes(2, "little")
    request = encode(BROADCAST, instruction, head + (extra or bytes(ids)))
    return len(request) + len(bus.answer(request))


@pytest.mark.parametrize("count", [1, 12, 20])
def test_bytes_are_those_of_the_packets(count):
    """10 bits a byte, at 1 Mbit/s: 10 us."""
    ids = list(range(1, count + 1))
    goals = b"".join(bytes([number]) + bytes(GOAL.size) for number in ids)
    plain, fast = (
        BusLoad(count, 1_000_000, make=MAKE),
        BusLoad(count, 1_000_000, fast=True, make=MAKE),
    )
    took_s = 1e-5 * on_the_line(0x82, PRESENT, ids) + TURN_S
    assert plain.read_s == pytest.approx(took_s)
    took_s = 1e-5 * on_the_line(0x8A, PRESENT, ids) + TURN_S
    assert fast.read_s == pytest.approx(took_s)
    assert plain.write_s == pytest.approx(1e-5 * on_the_line(0x83, GOAL, ids, goals))
    bus = EmulatedXSeriesBus([EmulatedXSeries(1)])
    place = STATE.address.to_bytes(2, "little") + STATE.size.to_bytes(2, "little")
    request = encode(1, 2, place)
    size = len(request) + len(bus.answer(request))
    assert plain.look_s == pytest.approx(1e-5 * size + TURN_S)


def test_twenty_servos_at_one_megabit_do_not_fit_at_100_hz():
    load = BusLoad(20, 1_000_000, imu_bytes=12, make=MAKE)
    with pytest.raises(
        BackendError, match=r"20 servos and the imu takes 9\.7 ms"
    ) as told:
        load.check(HUNDRED_HZ, "bus")
    most, baud = load.most_servos(HUNDRED_HZ), load.least_baud(HUNDRED_HZ)
    assert f"{most} servos would fit" in str(told.value)
    assert f"at {baud} bit/s" in str(told.value)
    assert f"--rate {int(load.most_hz())}" in str(told.value)
    assert "fast sync reads" in str(told.value)


@pytest.mark.parametrize("fast", [False, True])
@pytest.mark.parametrize("delay_s", [0.0, 5e-5])
def test_what_is_said_to_fit_fits_and_the_next_does_not(fast, delay_s):
    load = BusLoad(30, 1_000_000, delay_s, fast, imu_bytes=12, make=MAKE)
    most = load.most_servos(HUNDRED_HZ)
    replace(load, servos=most).check(HUNDRED_HZ, "bus")
    with pytest.raises(BackendError, match="allowed"):
        replace(load, servos=most + 1).check(HUNDRED_HZ, "bus")
    load.check(1.0 / int(load.most_hz()), "bus")
    assert load.most_hz() * load.period_s == pytest.approx(SHARE)


def test_delays_and_turns_that_no_rate_mends_are_said_as_such():
    load = BusLoad(20, 4_500_000, 5e-4, make=MAKE)  # 10 ms of return delays
    assert load.least_baud(HUNDRED_HZ) is None
    with pytest.raises(BackendError, match="Return Delay Time") as told:
        load.check(HUNDRED_HZ, "bus")
    assert "Baud Rate(8)" not in str(told.value)


@pytest.mark.parametrize(
    ("count", "baud", "make", "rate"),
    [
        (12, 57_600, "dynamixel", None),
        (12, 57_600, "feetech", None),
        (20, 38_400, "feetech", None),
        (35, 1_000_000, "dynamixel", 26),
    ],
)
def test_only_a_rate_that_serve_takes_is_named(count, baud, make, rate):
    load = BusLoad(count, baud, 5e-4, make=make_named(make))
    with pytest.raises(BackendError, match="servos would fit; ") as told:
        load.check(HUNDRED_HZ, "bus")
    named = re.findall(r"--rate (\d+)", str(told.value))
    assert named == ([] if rate is None else [str(rate)])
    (limits,) = get_type_hints(Serve, include_extras=True)["rate"].__metadata__
    assert limits.low == LEAST_HZ


def test_no_servo_fits_in_less_than_the_turns():
    assert BusLoad(1, 1_000_000, make=MAKE).most_servos(TURN_S) == 0


def test_emulated_robots_say_what_would_fit():
    calibration = few(20)
    with ServoBusEmulator.like(calibration) as bus:
        bus.bus.fast = False
        robot = ServoBackend(bus.port, calibration, calibration.joint_names, 0.008)
        with pytest.raises(BackendError, match="servos would fit"):
            robot.connect(np.zeros(20))
        bus.bus.fast = True
        robot = ServoBackend(bus.port, calibration, calibration.joint_names, 0.01)
        robot.connect(np.zeros(20))
        robot.close()


def test_the_guide_says_how_many_servos_fit():
    guide = Path(__file__).parents[2] / "docs" / "connect_servos.md"
    rows = re.findall(r"^\| (\d) Mbit/s((?: \| \d+){4}) \|$", guide.read_text(), re.M)
    assert len(rows) == 3
    for mbit, told in rows:
        loads = [
            BusLoad(1, 10**6 * int(mbit), 0.0, fast, imu, make=MAKE)
            for imu in (0, 12)
            for fast in (False, True)
        ]
        most = [load.most_servos(HUNDRED_HZ) for load in loads]
        assert [int(word) for word in re.findall(r"\d+", told)] == most
