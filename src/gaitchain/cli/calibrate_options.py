"""What `calibrate` can be told; light, like `options`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro


@dataclass(frozen=True)
class Calibrate:
    """Find which servo moves which joint and where its zero is, with torque off.

    A person moves the robot by hand as it is told; no motor is ever turned on. With
    `--check` a calibration is compared with the bus instead; the exit code is 1 if
    something differs.
    """

    library: Annotated[Path, tyro.conf.Positional]
    """A library that `gaitchain build` wrote."""
    port: str
    """Serial port of the servos, such as /dev/ttyUSB0."""
    out: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None
    """The calibration to write, such as robot.toml."""
    check: Path | None = None
    """The calibration to compare with the bus."""
    baud: int | None = None
    """Rate of the bus [bit/s]; the usual ones are tried by default."""
    ids: str | None = None
    """Servos to look for, such as "1-12,20"; all by default."""
    pose: Literal["straight", "standing"] = "straight"
    """Pose that says where the joints are: straight legs, or the library's stand."""
    limits: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Narrow the joints' limits to what the person moves them through."""
