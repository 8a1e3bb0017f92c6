"""Everything that decides what a gait library contains."""

import math
from dataclasses import dataclass
from typing import Literal, get_args

from gaitchain.errors import CommandError
from gaitchain.gait.motion import Timing
from gaitchain.gait.stride.preset import NAME as BRISK
from gaitchain.gait.stride.shape import StrideShape
from gaitchain.robot.reduced_biped import Biped, is_boxes

Cost = Literal["physics", "planned"]
Training = Literal["batch", "sequential"]


@dataclass(frozen=True)
class BuildConfig:
    """Everything that decides what a library contains."""

    robot: str = "res"
    """Built-in robot, name of the Menagerie, or a TOML, MJCF or URDF file."""
    preset: str | None = None
    """Candidate poses: "default" (the paper's walk) or "brisk" (dynamic); by default
    the paper's for a box robot, and brisk for one read from its model."""
    profile: str | None = None
    """TOML file that overrides what is found in the robot's MJCF or URDF."""
    poses_per_layer: tuple[int, int, int, int] | None = None
    """Candidates per key moment; the preset's own by default."""
    seed: int = 0
    cost: Cost = "physics"
    """Where the cost of a gait comes from."""
    training: Training = "batch"
    """Order-free counts, or the paper's Eq. 5-6 one sample after another."""
    search: int | None = None
    """Generations of the search for the step's shape (`stride_search`); by default 5
    for a robot read from its model, none for a box robot."""
    search_s: float | None = None
    """Time that the search may take [s]; it then depends on the machine how far it
    comes. No limit by default."""
    walks: int = 200
    """Random walks to train on."""
    steps_per_walk: int = 6
    epsilon: float | None = None
    """Least pose inner distance (Eq. 2, natural logarithm); 0.5 by default, 0.25 for
    strides."""
    qualification_walks: int | None = None
    """Walks that visit every pair of first and last pose; 150 by default, 400 for
    strides."""
    gate_runs: int = 40
    """Random schedules that the finished library must walk."""
    gate_share: float = 0.975
    """Share of a round of them that must not fall."""
    step_s: float | None = None
    """T; the preset's own by default, 3 s for the paper's walk."""
    rise_s: float | None = None
    """T_a; the same part of T as in the preset by default."""
    fall_s: float | None = None
    """T_b; the same part of T as in the preset by default."""
    speed_limit_deg_s: float | None = None
    """Joint speed that the walk may use; the robot's own by default, inf for any."""

    def __post_init__(self) -> None:
        if self.preset is None:
            own = "default" if is_boxes(self.robot) else BRISK
            object.__setattr__(self, "preset", own)
        for name, known in (("cost", get_args(Cost)), ("training", get_args(Training))):
            if getattr(self, name) not in known:
                given = getattr(self, name)
                raise CommandError(f"{name} = {given!r}: give {' or '.join(known)}")
        least = {
            "seed": 0,
            "walks": 1,
            "steps_per_walk": 2,
            "search": 0,
            "epsilon": 0,
            "qualification_walks": 1,
            "gate_runs": 1,
            "gate_share": 0,
        }
        limit = self.speed_limit_deg_s
        if limit is not None and not limit >= 1.0:  # false for NaN too
            raise CommandError(
                f"speed_limit_deg_s = {limit}: give 1 or more, inf for no limit"
            )
        if self.search_s is not None and not self.search_s >= 0.0:
            raise CommandError(f"search_s = {self.search_s}: give 0 or more seconds")
        for name, low in least.items():
            value = getattr(self, name)
            if name in ("epsilon", "qualification_walks", "search") and value is None:
                continue
            whole = isinstance(value, int) or name in ("epsilon", "gate_share")
            if not (whole and low <= value < math.inf):  # false for NaN too
                kind = "" if whole else "a whole number, "
                raise CommandError(f"{name} = {value}: give {kind}{low} or more")

    def timing(self, biped: Biped, shape: StrideShape | None = None) -> Timing:
        """Return the step's times of a robot that steps in a shape."""
        own = (shape or StrideShape()).timing(biped) if self.dynamic else Timing()
        step = own.step if self.step_s is None else self.step_s
        rise = step * own.rise / own.step if self.rise_s is None else self.rise_s
        fall = step * own.fall / own.step if self.fall_s is None else self.fall_s
        return Timing(step, rise, fall)

    @property
    def least_distance(self) -> float:
        """Eps of Eq. 2."""
        if self.epsilon is not None:
            return self.epsilon
        return 0.25 if self.dynamic else 0.5

    @property
    def cover_walks(self) -> int:
        """Walks that visit every pair of first and last pose."""
        if self.qualification_walks is not None:
            return self.qualification_walks
        return 400 if self.dynamic else 150

    @property
    def dynamic(self) -> bool:
        """Whether the library walks by strides, with balance."""
        return self.preset == BRISK
