"""Results of a library's tests in physics: the gate of its build, a grid of worlds."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from gaitchain.chain.layered_chain import IntArray

Count = Annotated[int, msgspec.Meta(ge=0)]
"""A number of things."""


@dataclass(frozen=True)
class GateReport:
    """Result of the gate: random schedules, walked in rounds until one passes."""

    passed: bool
    """Whether the last round passed."""
    rounds: Count
    """Number of rounds."""
    schedules: Count
    """Schedules in each round."""
    survived: Count
    """Schedules of the last round without a fall."""
    feedback: bool
    """Whether they were walked with feedback."""
    worlds: Mapping[str, Any] = field(default_factory=dict)
    """Range of the worlds, with the fields of `sim.world_range.WorldRange`."""
    with_faults: Count | None = None
    """Schedules of the last round in worlds with faults of servos and sensors that
    held, too few; None if the worlds above have such faults, or none were asked for."""

    def describe(self) -> str:
        """Say how many held, and of what."""
        held = f"{self.survived} of {self.schedules} held, round {self.rounds}"
        if self.with_faults is None:
            return held
        return (
            f"{held}, with servos and sensors as in the file; with mild faults of them "
            f"{self.with_faults} held, too few for a robot that was not identified"
        )


@dataclass(frozen=True)
class OwnModel:
    """What was walked of a robot's own model."""

    joints: Count
    """Without the base's."""
    actuators: Count
    timestep_s: float
    friction: float
    """Sliding friction of the soles, the least of them."""
    contact_s: float
    """Time constant of the soles' contacts, the largest of them [s]."""
    integrator: str = ""
    """Which one, and why, where it is not the file's."""
    parted: Count = 0
    """Pairs of links that pass through each other, as they overlap where it stands."""
    step: str = ""
    """Which time step, and why, where it is not the file's."""
    left_out: Count = 0
    """Actuators that would pull at the legs by a tendon or a crank, without targets."""
    gains: str = ""
    """Stiffness of the legs' servos, and that of the file, where it is another one."""

    def describe(self) -> str:
        """Say what it was, and what was changed so that it could be walked."""
        said = (
            f"{self.joints} joints, {self.actuators} actuators, friction "
            f"{self.friction:g}, contacts of {1000.0 * self.contact_s:g} ms"
        )
        if self.parted:
            said += (
                f"; {self.parted} pairs of links overlap as it stands, and pass "
                "through each other"
            )
        if self.left_out:
            said += (
                f"; {self.left_out} actuators that pull at legs by tendons or cranks "
                "left out"
            )
        said += f"; leg servos of {self.gains}" if self.gains else ""
        said += f"; time step {self.step}" if self.step else ""
        return said + (f"; integrator {self.integrator}" if self.integrator else "")


@dataclass(frozen=True)
class OwnReport:
    """Result of the gate in the robot's own model, as its file has it."""

    passed: bool
    """Whether the last round passed."""
    rounds: Count = 0
    """Number of rounds."""
    schedules: Count = 0
    """Schedules in each round."""
    survived: Count = 0
    """Schedules of the last round without a fall."""
    model: OwnModel | None = None
    """What was walked; None if it could not be."""
    fault: str = ""
    """Why it could not be simulated; then the skeleton's verdict stands alone."""

    def describe(self) -> str:
        """Say how many held, and of what; or why none was walked."""
        if self.fault:
            return f"NOT WALKED: {self.fault}"
        held = f"{self.survived} of {self.schedules} held, round {self.rounds}"
        return held if self.model is None else f"{held}; {self.model.describe()}"


@dataclass(frozen=True)
class CellReport:
    """Result of one world of a grid."""

    name: str
    """Name of the world, for reports."""
    kind: str
    """Name of its disturbance, or "nominal" or "corner"."""
    required: bool
    """Whether the library must pass here."""
    numbers: tuple[tuple[str, float], ...]
    """(disturbance, level) of those that are not nominal."""
    runs: Count
    """Number of walks of commands."""
    passes: Count
    """Number of these without a fall."""
    groups: Mapping[str, tuple[Count, Count]]
    """Number of walks, and of those without a fall, for each group of commands."""
    steps: tuple[Count, Count]
    """Number of different steps that were walked, and of those that ever fell."""


@dataclass(frozen=True)
class GridReport:
    """Result of a grid of worlds for the library as a whole."""

    passed: bool
    """Whether enough walks did not fall, and the remaining steps form a walk."""
    rounds: Count
    """Number of rounds."""
    share: float
    """Part of the walks in a required world that must not fall."""
    cells: tuple[CellReport, ...]
    """Result of each world."""
    taken_out: tuple[tuple[int, int], ...]
    """First and last pose of the steps that were removed as they fell too often."""
    settled: bool = True
    """Whether the last round removed none, so that what is left was walked together.

    Grids of before did not look."""


@dataclass(frozen=True)
class Stratum:
    """Walks of a proof that have something in common, and how often they fell."""

    name: str
    """What they have in common."""
    walks: Count
    steps: Count
    falls: Count
    low: float
    """Least rate of falls per step that they leave possible."""
    high: float
    """Greatest one."""


@dataclass(frozen=True)
class StepStratum:
    """Visits of a proof to one step of the chain, and its falls."""

    first: int
    """First pose."""
    last: int
    """Last pose."""
    walked: Count
    falls: Count
    low: float
    """Least rate of falls per visit that the walks leave possible."""
    high: float
    """Greatest one."""


@dataclass(frozen=True)
class StepStrata:
    """Steps of the chain in a proof; their intervals hold all together."""

    allowed: Count
    """Number of different steps that the robot may make."""
    walked: Count
    """Number of those that it made."""
    never: tuple[tuple[int, int], ...]
    """First and last pose of steps that were never walked."""
    seldom: tuple[StepStratum, ...]
    """Steps that were walked less than 10 times."""
    fell_on: tuple[StepStratum, ...]
    """Steps with a fall."""
    high: tuple[float, ...]
    """Least, median and greatest upper end of the intervals of walked steps."""


@dataclass(frozen=True)
class ChosenWalks:
    """Walks of a proof in worlds and contact models that none was drawn for."""

    names: tuple[str, ...]
    """Of these worlds and models, with one walk each."""
    steps: Count
    falls: Count


@dataclass(frozen=True)
class EarlierCriterion:
    """By which walks of a library were judged before another criterion was chosen."""

    bound: float
    """Falls per step."""
    confidence: float
    seconds: float
    """Length of each walk's schedule, if it counts time [s]."""

    def describe(self) -> str:
        """Say it for a person."""
        sure = f"{100.0 * self.confidence:g} % confidence"
        return f"{self.bound:g} with {sure} in walks of {self.seconds:g} s"


@dataclass(frozen=True)
class ProofReport:
    """Result of a test whether a library falls less often than a bound."""

    bound: float
    """Falls per step."""
    confidence: float
    """Of the verdict, of each end of the interval of all walks, and of those of all
    strata together; of all steps together."""
    verdict: str
    """"below" the bound, "above" it, or "open" after the most steps."""
    seconds: float
    """Length of each walk's schedule, if it counts time [s]."""
    total: Stratum
    """All walks whose world was drawn: what the verdict is of."""
    worlds: tuple[Stratum, ...]
    """By their world: the level of one disturbance; with the chosen walk if there was
    one."""
    contacts: tuple[Stratum, ...]
    """By the model of the contacts; with the chosen walk if there was one."""
    kinds: tuple[Stratum, ...]
    """By the kind of their disturbance."""
    steps: StepStrata
    """By the step of the chain."""
    fell_in: tuple[int, ...] = ()
    """Numbers of the first walks with a fall, by which they can be walked again."""
    chosen: ChosenWalks | None = None
    """Walks after the test was sure of "below"; None if it was not, or if draws had met
    each world and contact model. Proofs of before have none."""
    before: tuple[EarlierCriterion, ...] = ()
    """Other criteria by which walks had been judged until this proof was made."""

    @property
    def criterion(self) -> EarlierCriterion:
        """What it was judged by, as the next proof remembers it."""
        return EarlierCriterion(self.bound, self.confidence, self.seconds)

    @property
    def all_walks(self) -> Stratum:
        """All walks, drawn or chosen; the interval is that of the drawn ones."""
        total, more = self.total, self.chosen
        if more is None:
            return total
        return replace(
            total,
            walks=total.walks + len(more.names),
            steps=total.steps + more.steps,
            falls=total.falls + more.falls,
        )

    def describe(self) -> str:
        """Say the verdict for a person."""
        falls = f"{self.bound:g} falls per step"
        if self.verdict == "open":
            return f"neither fewer nor more than {falls} is sure; raise --most-steps"
        than = "fewer" if self.verdict == "below" else "more"
        said = f"{than} than {falls}, with {100.0 * self.confidence:g} % confidence"
        return f"{said}, after other criteria" if self.before else said


@dataclass(frozen=True)
class Qualification:
    """Tests of a library in physics; None for those that were not made."""

    gate: GateReport | None = None
    """Test at the end of the build."""
    own: OwnReport | None = None
    """The same in the robot's own model."""
    grid: GridReport | None = None
    """Test in a grid of worlds."""
    proof: ProofReport | None = None
    """How seldom it falls; of the steps that the tests above leave."""

    @property
    def passed(self) -> bool:
        """Whether the gate was passed, and what else was tested."""
        gate, own, grid = self.gate, self.own, self.grid
        held = own is None or own.passed or bool(own.fault)
        gated = gate is not None and gate.passed and held
        return gated and (grid is None or grid.passed)

    @property
    def verdict(self) -> str:
        """Whether all was passed, for a person."""
        if not self.passed:
            return "NO"
        unwalked = self.own is not None and self.own.fault
        return "yes, but not in the robot's own model" if unwalked else "yes"

    def to_json(self) -> Any:
        """Return plain values."""
        plain = msgspec.to_builtins(self)
        # Most have none of it: their libraries are the same bytes as older ones.
        model = self.own.model if self.own else None
        for name in ("step", "left_out", "gains") if model else ():
            if not getattr(model, name):
                plain["own"]["model"].pop(name, None)
        if self.grid and self.grid.settled:
            plain["grid"].pop("settled", None)
        return plain

    @classmethod
    def from_json(cls, plain: Any) -> "Qualification":
        """Create a qualification from the result of `to_json`.

        Raises:
            ValueError: a field is missing or has the wrong type.
        """
        return msgspec.convert(plain, cls)


@dataclass(frozen=True, eq=False)
class GridVerdict:
    """Result of a grid of worlds for each step (`build.qualify.qualify_grid`)."""

    runs: IntArray
    """(N_1, N_4) how often the step was walked in a required world."""
    passes: IntArray
    """(N_1, N_4) how often the robot did not fall in it."""
    forbidden: NDArray[np.bool_]
    """(N_1, N_4) steps that are removed from the library."""
