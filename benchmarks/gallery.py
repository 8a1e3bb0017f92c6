"""Build robots from their files, measure them, and write the gallery: docs/robots.md.

Usage: python benchmarks/gallery.py [ROBOT ...] [--out FOLDER]. A robot is what `build`
takes: a file, or a name that `gaitchain robots` lists; by default all of that list, and
what has two legs, or looks so, of example-robot-data, where that is installed (`pip
install example-robot-data`). Libraries and results stay in the folder: a run that was
interrupted goes on, and a robot whose library is there already, as NAME.gait, is not
built again. It takes 10 to 20 minutes a robot on two cores.
"""

import argparse
import math
import resource
import subprocess
import sys
import textwrap
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path

from PIL import Image
from results import fastest, pushes, result

from gaitchain.build.shape_start import PACE
from gaitchain.discover.catalogue import list_robots
from gaitchain.discover.loaded_robot import LoadedRobot, load_with_findings
from gaitchain.discover.looks import read_looks
from gaitchain.errors import GaitchainError
from gaitchain.figures.snapshots import draw_portrait
from gaitchain.gait.stride.shape import MODEL_SHAPE

DOCS = Path(__file__).parents[1] / "docs"
PICTURES = Path("images", "robots")  # beside the page
HEAD = """# Robots from their files

Robots from their files alone, without options (RES with `--preset brisk`), as `python
benchmarks/gallery.py` built and measured them, in simulation: 20 walks of 30 s at each
end of the range; mass, inertia and CoM of every link off by up to 10 %; friction 0.6 to
1; estimator on. A push is the impulse over m sqrt(g h) that half of 20 walks hold at
0.6 of the speed, from the worst of eight directions, and the mean of all. A build's
time is that of the processor, beside other work: two quiet cores take half of it.
The name under a picture is the robot's name in the MuJoCo Menagerie, or the file's name
in example-robot-data; where that has several files of a robot, the most complete one
was taken. Talos of the Menagerie is its talos.xml, which has no actuators; the name
pal_talos stands for talos_position.xml.
[Results](results.md) have more.

Not here: apptronik_apollo, fourier_n1, pndbotics_adam_lite, toddlerbot_2xc and
toddlerbot_2xm of the Menagerie were not at hand. `gaitchain build NAME -o NAME.gait`
downloads them, this page's command too. Of example-robot-data Cassie is an SDF, which
is not read, and Hector no robot with legs.

{begins}

"""
BEGINS = """The search for a robot's shape begins with the same numbers for all robots:
{shape}, and a pace of {pace:g} sqrt(g leg). Whoever changes one of them measures all
robots anew, by the same command: a test compares them with this page."""
COLUMNS = (
    *("", "robot", "legs", "leg servos", "ahead [m/s]", "aside [m/s]"),
    *("around [rad/s]", "push, worst / mean", "build [core s]", "assumed"),
)
# Of example-robot-data, of each robot the file that has most of it.
URDFS = (
    "alex_description/urdf/alex_nub_hands.urdf",
    "alexander_description/urdf/alexander_v1.lowerBodyOnly.urdf",
    "bolt_description/robots/bolt.urdf",
    "g1_description/urdf/g1_29dof_rev_1_0.urdf",
    "human_description/robots/human.urdf",
    "icub_description/robots/icub.urdf",
    "romeo_description/urdf/romeo.urdf",
    "simple_humanoid_description/urdf/simple_humanoid.urdf",
    "talos_data/robots/talos_reduced.urdf",
)
WIDTH = 150  # pixels of a picture
PAGE_WIDTH = 88  # characters of a line
RUNS = ("--runs", "20", "--seed", "7")
ASSUMED = {"leg gains": "gains", "leg armature": "rotor inertia"}


@dataclass(frozen=True)
class Robot:
    """A robot of the gallery."""

    name: str
    """Of its files in the folder, and of its picture."""
    source: str
    """As `build` takes it."""


def at_hand() -> list[str]:
    """Return the robots that the page has by default."""
    named = [robot.name for robot in list_robots() if robot.available]
    try:
        files = metadata.files("example-robot-data") or []
    except metadata.PackageNotFoundError:
        return named
    ends = tuple(f"/robots/{urdf}" for urdf in URDFS)
    found = (str(file.locate()) for file in files if str(file).endswith(ends))
    return [*named, *sorted(found)]


def begins() -> str:
    """Return what the page says about where the search begins."""
    numbers = asdict(MODEL_SHAPE)
    factors = numbers.pop("balance")
    said = [f"{name} {value:g}" for name, value in numbers.items()]
    said += [f"{name} x {value:g}" for name, value in factors.items()]
    shape = f"{', '.join(said[:-1])} and {said[-1]}"
    return textwrap.fill(BEGINS.format(shape=shape, pace=PACE), PAGE_WIDTH)


def row(robot: Robot, out: Path, pictures: Path) -> str:
    """Return a robot's row of the table; build and measure it if need be."""
    loaded, path = load_with_findings(robot.source), out / f"{robot.name}.gait"
    reduced = loaded.robot.reduced
    cells = [
        _portrait(pictures / f"{robot.name}.png", loaded),
        f"{loaded.robot.name}, {reduced.mass:.3g} kg, legs {reduced.leg_length:.2g} m",
        f"{loaded.robot.legs.leg_joints} joints",
        _servos(loaded),
    ]
    brisk = ("--preset", "brisk") if loaded.findings is None else ()
    report = _build(robot, path, out, *brisk)
    if path.exists():
        cells += [*_walks(path, out), _push(path, out), report]
    else:
        cells += [report, *4 * ["-"]]
    return f"| {' | '.join([*cells, _assumed(loaded)])} |"


def _portrait(path: Path, loaded: LoadedRobot) -> str:
    """Render the robot; return what shows the picture."""
    looks = []
    if loaded.findings is not None:
        looks = read_looks(loaded.model, loaded.findings, loaded.robot)
    image = Image.fromarray(draw_portrait(loaded.robot, looks))
    path.parent.mkdir(parents=True, exist_ok=True)
    image.thumbnail((WIDTH, 2 * WIDTH), Image.Resampling.LANCZOS)
    image.quantize(64).save(path, optimize=True)
    return f"![{path.stem}]({(PICTURES / path.name).as_posix()})"


def _build(robot: Robot, path: Path, out: Path, *options: str) -> str:
    """Build the library if it is not there.

    Returns:
        The processor's time [s], or why there is no library.
    """
    said = out / f"{robot.name}.build.txt"
    if not said.exists():
        if path.exists():
            return "-"
        begin = _processor_s()
        words = ["build", robot.source, "-o", str(path), "--quiet", *options]
        done = subprocess.run(
            [sys.executable, "-m", "gaitchain", *words],
            check=False,
            stderr=subprocess.PIPE,
            text=True,
        )
        took = f"{_processor_s() - begin:.0f}"
        said.write_text(took if path.exists() else done.stderr.strip(), "utf-8")
    return said.read_text("utf-8").strip().replace("|", "/")


def _processor_s() -> float:
    """Return the processor's time of all processes that were started and have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _walks(path: Path, out: Path) -> list[str]:
    """Return speeds ahead, aside and around, and how many walks held if not all."""
    cells = []
    for axis, most in enumerate(fastest(str(path))):
        if not most:
            cells.append("-")
            continue
        command = ",".join(f"{most:g}" if i == axis else "0" for i in range(3))
        found = result("trial", str(path), [*RUNS, "--schedule", f"{command}@30"], out)
        speed = found.get("speed_mps") if axis < 2 else most
        held = found.get("survived", 0)
        missed = "" if held == found.get("runs") else f" ({held} of 20)"
        cells.append("-" if speed is None else f"{speed:.3g}{missed}")
    return cells


def _push(path: Path, out: Path) -> str:
    found = pushes(str(path), out)
    worst, mean = (found.get(f"{w}_over_m_sqrt_gh") for w in ("worst", "mean"))
    return "-" if worst is None else f"{worst:.3f} / {mean:.3f}"


def _servos(loaded: LoadedRobot) -> str:
    """Return the legs' gains, and whether they are the file's."""
    if loaded.findings is None:
        return f"kp {loaded.robot.reduced.servo_stiffness:g} N m/rad"
    rows = [row for row in loaded.findings.evidence if row[0] == "leg servos"]
    kp = loaded.robot.legs.stiffness
    span = dict.fromkeys((f"{kp.min():.4g}", f"{kp.max():.4g}"))
    sources = sorted({row[1].partition(" ")[2] for row in rows})
    said = ", ".join(sources).replace("actuator", "the file's")
    return f"kp {' to '.join(span)} N m/rad, {said}"


def _assumed(loaded: LoadedRobot) -> str:
    if loaded.findings is None:
        return "see res.toml"
    found = [ASSUMED[row[0]] for row in loaded.findings.evidence if row[0] in ASSUMED]
    legs, servos = loaded.robot.legs, loaded.findings.servos
    if all(math.isinf(servos[name].speed_limit) for name in legs.joint_names):
        found.append(f"speeds to {legs.speed_limit.max():g} rad/s")
    # Meshes that the picture may lack.
    lost = [note for note in loaded.notes if " mesh file" in note.partition("(")[0]]
    found += [note.rstrip(".") for note in lost if "left out" in note]
    return ", ".join(dict.fromkeys(found)) or "nothing"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("robots", nargs="*", help="files or names; all by default")
    parser.add_argument("--out", type=Path, default=Path("runs/gallery"))
    parser.add_argument("--page", type=Path, default=DOCS / "robots.md")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    rows = []
    for source in options.robots or at_hand():
        robot = Robot(Path(source).stem, source)
        print(robot.name, flush=True)
        try:
            rows.append(row(robot, options.out, options.page.parent / PICTURES))
        except GaitchainError as error:
            why = str(error).partition(";")[0].removeprefix(f"{source}: ")
            rows.append(f"| | {robot.name} | no library: {why} | | | | | | | |")
        lines = [f"| {' | '.join(COLUMNS)} |", "|" + len(COLUMNS) * "---|", *rows]
        text = HEAD.format(begins=begins()) + "\n".join(lines) + "\n"
        options.page.write_text(text, encoding="utf-8")
    print(f"{options.page}: {len(rows)} robots")


if __name__ == "__main__":
    main()
