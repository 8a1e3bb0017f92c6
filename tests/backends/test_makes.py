"""Makes of servos: a name in one place, and a package that has the rest."""

import sys
from types import ModuleType

import msgspec
import pytest
from servo_bench import RES

from gaitchain.backends.feetech.emulator import EmulatedSts, EmulatedStsBus
from gaitchain.backends.feetech.make import Feetech
from gaitchain.backends.makes import MAKES
from gaitchain.backends.servos import ServoBusEmulator, plain_calibration
from gaitchain.backends.servos.emulator.port import Kinds
from gaitchain.backends.servos.make import make_named
from gaitchain.cli.parser import parse
from gaitchain.errors import CommandError
from gaitchain.service.robots import check_backend


@pytest.mark.parametrize("name", MAKES)
def test_a_make_is_known_wherever_one_is_asked_for(name, capsys):
    make = make_named(name)
    assert make.name == name
    assert make.plain_model in {model.name for model in make.models.values()}
    assert parse(["calibrate", "res", "--make", name]).make == name
    check_backend(f"{name}:emulated")
    with pytest.raises(CommandError, match=f"{name}:PORT, {name}:emulated"):
        check_backend("futaba:emulated")
    with pytest.raises(SystemExit):
        parse(["serve", "--help"])
    assert f"{name}:PORT" in capsys.readouterr().out


@pytest.mark.parametrize("name", MAKES)
def test_servos_of_a_make_are_emulated_by_its_own_kind(name):
    with ServoBusEmulator.like(plain_calibration(RES, make=name)) as bus:
        kinds = {type(servo) for servo in bus.servos.values()}
        assert len(kinds) == 1
        assert (kinds == {EmulatedSts}) == (name == "feetech")


class Toy(Feetech):
    name = "toy"


class ToyServo(EmulatedSts):
    pass


class ToyBus(EmulatedStsBus):
    pass


def test_another_make_brings_an_emulation_of_its_own(monkeypatch):
    package = {"make": {"MAKE": Toy()}, "emulator": {"KINDS": Kinds(ToyServo, ToyBus)}}
    for part, content in package.items():
        module = ModuleType(f"gaitchain.backends.toy.{part}")
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, module.__name__, module)
    calibration = plain_calibration(RES, make="feetech")
    toys = msgspec.structs.replace(calibration, make="toy")
    with ServoBusEmulator.like(toys) as bus:
        assert type(bus.bus) is ToyBus
        assert {type(servo) for servo in bus.servos.values()} == {ToyServo}
