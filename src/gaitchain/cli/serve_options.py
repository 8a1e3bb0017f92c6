"""What the verbs of the service can be told; light, as `options`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro


@dataclass(frozen=True)
class Serve:
    """Walk live: a page to watch and steer the robot, an API, a safety layer, a log.

    Ctrl-C stops the walk and ends it. Without a library, RES walks in simulation.
    """

    library: Annotated[Path | None, tyro.conf.Positional] = None
    """A library that `gaitchain build` wrote; one of RES comes with the package."""
    backend: str = "mujoco"
    """mujoco, mock, dynamixel:PORT (or dynamixel:emulated), ros (Zenoh's router on this
    computer), ros:zenoh:tcp/HOST:PORT, ros:ws://HOST:PORT."""
    calibration: Path | None = None
    """Servos' calibration, as `gaitchain calibrate` writes it."""
    rate: float | None = None
    """Control periods a second: 250 in simulation, 100 with motors, by default [Hz]."""
    host: str = "127.0.0.1"
    """Address to listen on; others than this computer's own need a token."""
    port: int = 8700
    """Of the page and the API; 0 finds a free one."""
    token: str | None = None
    """What everybody must know to watch or drive."""
    log: Path | None = None
    """MCAP file to write; a new one in runs/serve by default."""
    no_log: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Write no log."""
    ros: str | None = None
    """Let ROS 2 watch and drive as well: zenoh, zenoh:tcp/HOST:PORT, ws://HOST:PORT."""
    open_loop: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Walk without feedback; needed for a robot without an IMU."""
    seed: int = 0
    """Of the simulated world."""
    browser: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Open the page in this computer's browser."""


@dataclass(frozen=True)
class Replay:
    """Play a log in the browser: the page of `serve`, with Start, Stop and Reset."""

    log: Annotated[Path, tyro.conf.Positional]
    """A log that `serve` wrote (.mcap); it needs no other file."""
    port: int = 8700
    """Of the page; 0 finds a free one."""
    no_browser: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Only say where the page is."""


ServiceOptions = Serve | Replay
SERVICE_VERBS: dict[str, type[ServiceOptions]] = {"serve": Serve, "replay": Replay}
