"""The configuration of a build, which determines the library completely."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import PurePath
from typing import Annotated, Any, Literal, get_args

import msgspec

from gaitchain.errors import CommandError
from gaitchain.gait.families import PRESETS, family_of_preset
from gaitchain.gait.family import LAYERS, GaitFamily
from gaitchain.gait.keypose.family import KEY_POSES
from gaitchain.gait.limits import Limits, check_numbers, declared
from gaitchain.gait.motion import Timing
from gaitchain.gait.stride.family import STRIDES
from gaitchain.robot.reduced_biped import is_boxes

Cost = Literal["physics", "planned"]
Training = Literal["batch", "sequential"]
_WORDS: dict[str, tuple[str, ...]] = {
    "preset": PRESETS,
    "cost": get_args(Cost),
    "training": get_args(Training),
}
_EPSILON = 0.2
_COUNT = Limits(1, 10**6, whole=True)
_STEP_S, _PART_S = Limits(0.1, 30.0, unit="s"), Limits(0.01, 30.0, unit="s")


@dataclass(frozen=True)
class BuildConfig:
    """Configuration of a build: two equal ones give the same library.

    On another kind of processor the last digits differ, and so does the library.
    """

    robot: str = "res"
    """Built-in robot, name of the Menagerie, or a TOML, MJCF or URDF file."""
    preset: str | None = None
    """Candidate poses: "default" (the paper's walk), or strides ("brisk" and others of
    `stride.presets`); by default the paper's for a box robot, and brisk for one read
    from its model."""
    profile: str | None = None
    """TOML file that overrides what is found in the robot's MJCF or URDF."""
    poses_per_layer: tuple[int, int, int, int] | None = None
    """Candidates per key moment; those of the preset by default. Of fewer strides than
    a preset has, the furthest are left out, so that the robot walks more slowly."""
    servo_gain: Annotated[float | None, Limits(0.01, 100.0)] = None
    """Part of the file's servo stiffness and damping to walk with; by default all of
    it; half or twice where no walk holds with that, and walks do with the other."""
    seed: Annotated[int, Limits(0, 2**29 - 1, whole=True)] = 0
    """Seed of all random numbers of the build."""
    cost: Cost = "physics"
    """Whether the cost of a gait is measured in physics or computed from the plan."""
    training: Training = "batch"
    """All samples at once (for key poses by expected costs, for strides by weighted
    counts), or the paper's Eq. 5-6 sample by sample."""
    search: Annotated[int | None, Limits(0, 1000, whole=True)] = None
    """Generations of the search for the step's shape (`build.shape_search`); by default
    6 for a robot read from its model, none for a box robot."""
    search_s: Annotated[float | None, Limits(0.0, math.inf, unit="s")] = None
    """Time limit of the search [s], with which its result depends on the machine's
    speed; no limit by default."""
    walks: Annotated[int, _COUNT] = 200
    """Random walks to train on."""
    steps_per_walk: Annotated[int, Limits(2, 1000, whole=True)] = 6
    """Steps of each of them."""
    epsilon: Annotated[float | None, Limits(0.0, 100.0)] = None
    """Least pose inner distance (Eq. 2, natural logarithm); 0.2 by default. Between
    strides there is one pose, so it changes nothing there."""
    qualification_walks: Annotated[int | None, _COUNT] = None
    """Walks that visit every pair of first and last pose; 150 by default, 400 for
    strides."""
    recovery_walks: Annotated[int | None, Limits(0, 10**6, whole=True)] = None
    """Disturbed walks from which it is learned how far to step after a disturbance; 400
    for strides, none for key poses."""
    gate_runs: Annotated[int, _COUNT] = 40
    """Random schedules in each round of the gate, which tests the finished library."""
    gate_share: Annotated[float, Limits(0.0, 2.0)] = 0.975
    """Part of a round that must not fall for the library to pass."""
    own_runs: Annotated[int, Limits(0, 10**6, whole=True)] = 20
    """Schedules in each round in the robot's own model, with every joint, actuator and
    contact of its file; 0 for none. A robot of boxes has no other model."""
    step_s: Annotated[float | None, _STEP_S] = None
    """T [s]; that of the preset by default, 3 s for the paper's walk."""
    rise_s: Annotated[float | None, _PART_S] = None
    """T_a [s]; the same part of T as in the preset by default."""
    fall_s: Annotated[float | None, _PART_S] = None
    """T_b [s]; the same part of T as in the preset by default."""
    speed_limit_deg_s: Annotated[float | None, Limits(1.0, math.inf, unit="deg/s")] = (
        None
    )
    """Joint speed that the walk may use [deg/s]; the robot's limit by default, inf for
    none."""

    def __post_init__(self) -> None:
        """Refuse what cannot be built, and make each value one that a file can hold.

        Raises:
            CommandError: a value is outside its limits, or of another kind.
        """
        self._set("robot", _file_name("robot", self.robot))
        if self.profile is not None:
            self._set("profile", _file_name("profile", self.profile))
        if self.preset is None:
            own = KEY_POSES if is_boxes(self.robot) else STRIDES
            self._set("preset", own.presets[0])
        for name, known in _WORDS.items():
            self._set(name, _word(name, getattr(self, name), known))
        check_numbers(self)
        for name, limits in declared(BuildConfig, Limits).items():
            number = getattr(self, name)
            self._set(name, None if number is None else limits.plain(number))
        if self.poses_per_layer is not None:
            self._set("poses_per_layer", _counts(self.poses_per_layer))
            self._check_strides()
        if self.cost == "planned" and self.family is STRIDES:
            raise CommandError(
                "cost = 'planned': strides are planned with the ZMP in the sole, so "
                "their cost is measured; give physics"
            )

    def _check_strides(self) -> None:
        """Refuse other numbers of strides at the end of a step than at its begin."""
        counts = self.poses_per_layer
        if counts is None or self.family is not STRIDES:
            return
        most = max(2, counts[0])  # standing is one of them
        if counts != (most, 1, 1, most):
            raise CommandError(
                f"poses_per_layer is {counts}: strides need ({most}, 1, 1, {most}), as "
                "a step ends in a stride as it begins in one, and the swing foot "
                "passes between them in one way"
            )

    def _set(self, name: str, value: object) -> None:
        object.__setattr__(self, name, value)  # of a frozen instance

    @classmethod
    def from_json(cls, plain: Mapping[str, Any]) -> "BuildConfig":
        """Create a config from plain values, as stored in a library's file.

        Raises:
            ValueError: a name is unknown, or a value has the wrong type.
            CommandError: a number is out of its range.
        """
        return msgspec.convert(plain, cls)

    @property
    def family(self) -> GaitFamily:
        """Family of the gait that is built.

        Raises:
            CommandError: there is no such preset.
        """
        return family_of_preset(str(self.preset))

    def scaled_timing(self, own: Timing) -> Timing:
        """Return the step's times: those of the config, else scaled from a preset's.

        Args:
            own: times of the preset.
        """
        step = own.step if self.step_s is None else self.step_s
        rise = step * own.rise / own.step if self.rise_s is None else self.rise_s
        fall = step * own.fall / own.step if self.fall_s is None else self.fall_s
        return Timing(step, rise, fall)

    @property
    def least_distance(self) -> float:
        """Least pose inner distance, eps of Definition 2.2."""
        return _EPSILON if self.epsilon is None else self.epsilon

    @property
    def disturbed_walks(self) -> int:
        """Disturbed walks to learn from."""
        own, asked = self.family.recovery_walks, self.recovery_walks
        return own if asked is None else asked

    @property
    def cover_walks(self) -> int:
        """Walks that visit every pair of first and last pose."""
        own, asked = self.family.cover_walks, self.qualification_walks
        return own if asked is None else asked


def _file_name(name: str, given: object) -> str:
    if not isinstance(given, str | PurePath):
        raise CommandError(f"{name} is {given!r}, must be a name or the path of a file")
    return str(given)


def _word(name: str, given: object, known: tuple[str, ...]) -> str:
    if not (isinstance(given, str) and given in known):
        raise CommandError(f"{name} {given!r}: give one of {', '.join(known)}")
    return known[known.index(given)]


def _counts(given: object) -> tuple[int, ...]:
    counts: tuple[Any, ...] = tuple(given) if isinstance(given, Iterable) else ()
    if len(counts) != LAYERS or not all(map(_COUNT.hold, counts)):
        raise CommandError(
            f"poses_per_layer is {given!r}, must be {LAYERS} numbers, each {_COUNT}"
        )
    return tuple(int(count) for count in counts)
