"""Load a humanoid's MJCF or URDF file, or one by its name in a collection."""

import os
import re
import warnings
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mujoco

from gaitchain.discover.balls import weld_balls
from gaitchain.discover.catalogue import find_robot_file
from gaitchain.discover.gears import fold_gears
from gaitchain.discover.isolate import isolate
from gaitchain.discover.linkages import fold_linkages
from gaitchain.discover.repair import repair
from gaitchain.discover.tendons import fold_tendons
from gaitchain.discover.urdf import read_speeds, read_urdf
from gaitchain.errors import RobotFileError, short_name

_MEGABYTE = 1_000_000
_MAX_BYTES = 50 * _MEGABYTE  # of all XML files of a robot together
_MAX_ELEMENTS = 200_000
_MAX_DEPTH = 200  # of nested elements
_MAX_BODIES = 2_000  # of the file, scenery and fixed frames included
_MAX_PARTS = 20_000  # bodies, geoms, sites and joints
_PARTS = {"body", "geom", "site", "joint", "light", "camera"}
# MuJoCo allocates what these ask for, without asking back.
_MAX_NUMBER = {"nrow": 2_000, "ncol": 2_000, "width": 10_000, "height": 10_000}
_MAX_SIZE = 10_000  # of what <size> reserves
_MUJOCO_ERRORS = (
    ValueError,
    RuntimeError,
    TypeError,
    MemoryError,
    mujoco.FatalError,
    mujoco.UnexpectedError,
)
_SHOWN_WARNINGS = 3
_UTF_8 = "; save it as UTF-8"
# What begins with "<", the longer ones first, and what closes it.
_CLOSING = {b"<!--": b"-->", b"<![CDATA[": b"]]>", b"<?": b"?>", b"<": b">"}
_MARK = re.compile(rb"[\"'>]")
_BLANK = bytes(code if code in b"\r\n" else ord(" ") for code in range(256))


@dataclass(frozen=True, eq=False)
class RobotModel:
    """A robot alone, as MuJoCo has it: no floor, no lights, nothing but its bodies."""

    name: str
    origin: str
    """What messages call it: its path, or its name in a collection."""
    spec: Any
    """The repaired `mujoco.MjSpec`: it compiles, angles are in radians, and its base
    has the only free joint."""
    model: Any
    """That, compiled."""
    notes: tuple[str, ...]
    """What was repaired or left out, one sentence each."""
    speeds: Mapping[str, float] = field(default_factory=dict)
    """Speed limits of joints that a URDF has and MuJoCo has no place for [rad/s]."""
    balls: Mapping[str, str] = field(default_factory=dict)
    """Ball joints that were welded, by the body that hung on each."""


def load_model(robot: str | Path) -> RobotModel:
    """Load a robot and repair what can safely be repaired.

    Args:
        robot: path of an MJCF or URDF file, or a name that `list_robots` lists.

    Returns:
        The robot, with a note for everything that was repaired or left out.

    Raises:
        RobotFileError: there is no such robot, its file cannot be read, or something
            is wrong with it that only its author can repair.
    """
    path, origin = find_robot_file(robot)
    try:
        with _warnings_kept() as warned:
            spec, notes, speeds = _read(path)
            strict = speeds is None  # MJCF says itself where its meshes are
            notes += isolate(spec) + fold_tendons(spec) + fold_gears(spec)
            model, repaired = repair(spec, strict)
            folded = fold_linkages(spec)
            balls, welded = weld_balls(spec)
            if folded or welded:
                model = spec.compile()
            notes += repaired + folded + welded
        notes += _warned(warned)
    except RobotFileError as error:
        raise RobotFileError(f"{origin}: {error}") from None
    except _MUJOCO_ERRORS as error:
        hint = _UTF_8 if _is_coded(path, error) else ""
        raise RobotFileError(
            f"{origin}: MuJoCo refuses it: {_line(error)}{hint}"
        ) from None
    unnamed = spec.modelname in ("", "MuJoCo Model")
    name = short_name(path.stem if unnamed else spec.modelname)
    return RobotModel(name, origin, spec, model, tuple(notes), speeds or {}, balls)


def _is_coded(path: Path, error: Exception) -> bool:
    """Whether MuJoCo refuses a file for another coding than UTF-8.

    It reads bytes, so that other codings in comments do not matter.
    """
    if isinstance(error, UnicodeDecodeError):  # a name of an included file's, too
        return True
    return "XML parse error" in str(error) and not _is_utf_8(path.read_bytes())


def _is_utf_8(data: bytes) -> bool:
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        return False
    return True


def is_mjcf(path: Path) -> bool:
    """Return whether a robot's file is MJCF, not URDF.

    Raises:
        RobotFileError: it cannot be read, or is no XML.
    """
    return _Reader().read(path).tag == "mujoco"


def _read(path: Path) -> tuple[Any, list[str], dict[str, float] | None]:
    """Read a file; return also the speed limits of a URDF's joints, None for MJCF."""
    root = _Reader().read(path)
    if root.tag == "robot":
        speeds = read_speeds(root)
        return *read_urdf(root, path), speeds
    if root.tag != "mujoco":
        hint = "; convert SDF to URDF first" if root.tag == "sdf" else ""
        raise RobotFileError(
            f"its root is <{root.tag:.40}>; expected <mujoco> (MJCF) or <robot> "
            f"(URDF){hint}"
        )
    _Reader().check(path)
    return mujoco.MjSpec.from_file(str(path)), [], None


@contextmanager
def _warnings_kept() -> Iterator[list[str]]:
    """Collect MuJoCo's warnings, which otherwise go to a file in the folder."""
    kept: list[str] = []
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(kept.append)
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            yield kept
    finally:
        mujoco.set_mju_user_warning(before)
        kept += [str(warning.message) for warning in caught]


def _warned(warned: list[str]) -> list[str]:
    """Turn MuJoCo's warnings into notes, or refuse what they make impossible."""
    for warning in warned:
        if "singular" in warning:
            raise RobotFileError(
                f"MuJoCo warns: {_line(warning)} Some mass or inertia is far too small "
                "or too large beside the others"
            )
    # What becomes of a <mimic> is in the notes already.
    notes = {f"MuJoCo warns: {_line(w)}": w for w in warned if "<mimic>" not in w}
    more = len(notes) - _SHOWN_WARNINGS
    last = [f"MuJoCo gave {more} warnings more."] if more > 0 else []
    return [*list(notes)[:_SHOWN_WARNINGS], *last]


def _line(message: object) -> str:
    text = re.sub(r"\s+", " ", str(message)).strip().removeprefix("Error: ")
    return re.sub(r" Element name '', id -?\d+$", "", text)


class _Guard(ET.TreeBuilder):
    """Builds the tree of a file, up to the size that a robot can have."""

    def __init__(self) -> None:
        super().__init__()
        self._elements = self._depth = 0

    def doctype(self, *_: object) -> None:
        # Entities can blow a small file up to gigabytes, or read other files.
        raise RobotFileError("it has a <!DOCTYPE>, which no robot needs; take it out")

    def start(self, tag: str, attrs: dict[str, str]) -> ET.Element:
        self._elements += 1
        self._depth += 1
        if self._elements > _MAX_ELEMENTS:
            raise RobotFileError(f"more than {_MAX_ELEMENTS} elements; a robot has few")
        if self._depth > _MAX_DEPTH:
            raise RobotFileError(f"elements nested more than {_MAX_DEPTH} deep")
        return super().start(tag, attrs)

    def end(self, tag: str) -> ET.Element:
        self._depth -= 1
        return super().end(tag)


@dataclass
class _Reader:
    """Goes through the files of an MJCF model before MuJoCo does."""

    chain: tuple[Path, ...] = ()
    """The files that led here, for rings of them."""
    included: set[Path] = field(default_factory=set)
    size: list[int] = field(default_factory=lambda: [0])
    models: dict[str, tuple[int, int]] = field(default_factory=dict)
    """Bodies and parts of each model that can be attached."""

    def read(self, path: Path) -> ET.Element:
        """Parse one file."""
        try:
            if not path.is_file():
                raise RobotFileError(f"{path.name} is not a regular file")
            self.size[0] += path.stat().st_size
            if self.size[0] > _MAX_BYTES:
                raise RobotFileError(
                    f"{self.size[0] / _MEGABYTE:.0f} MB of XML; at most "
                    f"{_MAX_BYTES / _MEGABYTE:.0f} MB"
                )
            data = path.read_bytes()
        except OSError as error:
            raise RobotFileError(f"{path.name}: {error.strerror}") from None
        if not data.strip():
            what = path.name if self.chain else "it"  # who reads it names the first
            raise RobotFileError(f"{what} is empty; expected MJCF or URDF")
        parser = ET.XMLParser(target=_Guard())
        try:
            # MuJoCo reads on after a blank line, and has no rule for comments.
            parser.feed(_without_comments(data.lstrip()))
            root = parser.close()
        except (ET.ParseError, ValueError, LookupError) as error:
            kind = "is not XML" if b"<" not in data[:4096] else "is not well-formed XML"
            hint = "" if b"\0" in data or _is_utf_8(data) else _UTF_8
            raise RobotFileError(f"{path.name} {kind}: {error}{hint}") from None
        assert isinstance(root, ET.Element)
        return root

    def check(self, path: Path) -> tuple[int, int]:
        """Count bodies and parts of a model with all that it includes and attaches."""
        path = _reduced(path)
        if self._is_ring(path):
            ring = " -> ".join(p.name for p in (*self.chain, path))
            raise RobotFileError(f"its files go round in a ring: {ring}")
        inner = _Reader((*self.chain, path), {path}, self.size)
        return inner.count(inner.read(path), path.parent)

    def count(self, root: ET.Element, folder: Path) -> tuple[int, int]:
        """Count bodies and parts below an element, copies included."""
        for model in root.iter("model"):
            if name := model.get("file"):
                total = self.check(self._locate(name, folder))
                self.models[model.get("name", Path(name).stem)] = total
        return self._tally(root, folder)

    def _tally(self, element: ET.Element, folder: Path) -> tuple[int, int]:
        _check_numbers(element)
        bodies, parts = int(element.tag == "body"), int(element.tag in _PARTS)
        if element.tag == "attach":
            bodies, parts = self.models.get(element.get("model", ""), (0, 0))
        for child in element:
            below = (
                self._include(child, folder)
                if child.tag == "include"
                else self._tally(child, folder)
            )
            bodies, parts = bodies + below[0], parts + below[1]
        copies = _whole(element.get("count", "1")) if element.tag == "replicate" else 1
        bodies, parts = bodies * max(copies, 1), parts * max(copies, 1)
        if bodies > _MAX_BODIES or parts > _MAX_PARTS:
            raise RobotFileError(
                f"{bodies} bodies of {parts} parts; at most {_MAX_BODIES} bodies of "
                f"{_MAX_PARTS} parts: give the robot alone"
            )
        return bodies, parts

    def _include(self, element: ET.Element, folder: Path) -> tuple[int, int]:
        path = self._locate(element.get("file", ""), folder)
        ring = self._is_ring(path)
        if ring or path in self.included:
            names = " -> ".join(p.name for p in (*self.chain, path))
            what = "go round in a ring" if ring else "include one twice"
            raise RobotFileError(f"its files {what}: {names}")
        self.included.add(path)
        inner = _Reader((*self.chain, path), self.included, self.size, self.models)
        return inner.count(inner.read(path), path.parent)

    def _is_ring(self, path: Path) -> bool:
        """Whether a file is one of those that led here, by whatever links."""
        return path.resolve() in {led.resolve() for led in self.chain}

    def _locate(self, name: str, folder: Path) -> Path:
        main, plain = self.chain[0].parent, name.replace("\\", "/")  # as MuJoCo does
        try:
            for place in (main, folder):
                path = _reduced(place / plain)
                if path.is_file():
                    return path
        except (OSError, ValueError):
            pass
        raise RobotFileError(f"it includes {name!r:.80}, which is not in {main}")


def _reduced(path: Path) -> Path:
    """Return the path of the file that MuJoCo opens for another one.

    It stays in the folder of a link, beside which a store of links has the other files,
    and takes ".." for the folder that is written before it.
    """
    return Path(os.path.abspath(path))  # noqa: PTH100 - resolve() follows links


def _without_comments(data: bytes) -> bytes:
    """Blank comments out, lines kept: "--" in one is an error of XML, not of MuJoCo.

    What only looks like a comment stays, in CDATA, instructions and quoted values.
    """
    parts, at = list[bytes](), 0
    while (start := data.find(b"<", at)) >= 0:
        opening = next(o for o in _CLOSING if data.startswith(o, start))
        end = _end_of(data, start + len(opening), _CLOSING[opening])
        if end < 0:  # left to the parser, which says what is wrong
            break
        parts.append(data[at:start])
        found = data[start:end]
        parts.append(found.translate(_BLANK) if opening == b"<!--" else found)
        at = end
    return b"".join((*parts, data[at:]))


def _end_of(data: bytes, at: int, closing: bytes) -> int:
    """Return where something is closed, in a tag outside of quotes; -1 if nowhere."""
    if closing != b">":
        end = data.find(closing, at)
        return end + len(closing) if end >= 0 else -1
    while (mark := _MARK.search(data, at)) is not None and mark[0] != b">":
        at = data.find(mark[0], mark.end()) + 1
        if at == 0:
            return -1
    return -1 if mark is None else mark.end()


def _check_numbers(element: ET.Element) -> None:
    if element.tag == "flexcomp":
        raise RobotFileError(
            "it has a soft body (<flexcomp>); walking needs rigid ones"
        )
    for name, value in element.items():
        limit = _MAX_SIZE if name.startswith(("nkey", "nuser")) else None
        limit = _MAX_NUMBER.get(name, limit)
        if limit and _whole(value) > limit:
            what = f'<{element.tag} {name}="{value:.20}">'
            raise RobotFileError(f"{what}: at most {limit}")


def _whole(text: str) -> int:
    return int(text) if re.fullmatch(r"\s*\d{1,18}\s*", text) else 1
