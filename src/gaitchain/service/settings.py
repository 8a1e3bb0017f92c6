"""The settings of one service, in a file that its parts read."""

import ipaddress
from pathlib import Path
from typing import Literal

import msgspec

RobotKind = Literal["simulation", "mock", "emulated", "real", "unknown"]
"""What a service drives, or its log is of."""
TOKEN_LENGTHS = 8, 256
"""Least and most characters of a token: every way of signing in takes as many."""
_FILE = "settings.json"


class Settings(msgspec.Struct, frozen=True):
    """The settings of one service."""

    library: str
    """Path of the gait library."""
    backend: str = "mujoco"
    """mujoco, mock, dynamixel:PORT, feetech:PORT, ros:LINK, ros-effort:LINK."""
    own_model: str | None = None
    """Path of the robot's MJCF or URDF, which is simulated with all its joints."""
    get_up: str | None = None
    """Path of what `gaitchain get-up` found."""
    calibration: str | None = None
    """Path of the servos' calibration."""
    rate_hz: float = 250.0
    """Rate of the control loop [Hz]."""
    host: str = "127.0.0.1"
    port: int = 8700
    token: str = ""
    """Token that every request must carry; empty for none, on loopback only."""
    log: str | None = None
    """Path of the MCAP file; None for no log."""
    log_mb: float = 512.0
    """Size from which a log goes on in the next file [MB]."""
    log_files: int = 8
    """Files that a log may have; the oldest one is removed."""
    replay: str | None = None
    """A log to play instead of a robot."""
    drawn: str | None = None
    """File or name of the robot in whose shapes a log's robot is drawn."""
    profile: str | None = None
    """Profile of that file."""
    ros: str | None = None
    """Link over which ROS may drive and watch; None for none."""
    ros_stamped: bool = False
    """Whether commands over a rosbridge are TwistStamped, not Twist."""
    open_loop: bool = False
    seed: int = 0
    """Seed of the simulated world."""
    waits: bool = False
    """Whether the loop retries to reach the servos, once the page is being served."""
    viewer_port: int = 0
    """Loopback port of the 3-D view, chosen by the supervisor."""
    viewer_secret: str = ""
    """What that port asks for, so that nobody goes past the API; drawn likewise."""


def save_settings(settings: Settings, folder: Path) -> None:
    """Write the settings into the folder of the service, readable by its user alone."""
    new = folder / f"{_FILE}.new"
    new.touch(mode=0o600)
    new.write_bytes(msgspec.json.encode(settings))
    new.replace(folder / _FILE)  # whole at any moment: parts read it when they start


def are_saved(folder: Path) -> bool:
    """Return whether a folder has what `save_settings` wrote."""
    return (folder / _FILE).exists()


def load_settings(folder: Path) -> Settings:
    """Read what `save_settings` wrote."""
    return msgspec.json.decode((folder / _FILE).read_bytes(), type=Settings)


def is_loopback(host: str) -> bool:
    """Return whether only this computer can reach what is served on a host."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
