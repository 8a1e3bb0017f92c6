"""As little of a build as there can be: seconds on one core."""

from contextlib import contextmanager
from functools import partial

import pytest

from gaitchain.build import command_envelope, gate, usual_errors
from gaitchain.build.trial import Trial
from gaitchain.gait.build_config import BuildConfig

# Key poses, by planned cost.
TINY = BuildConfig(
    poses_per_layer=(4, 6, 8, 4),
    cost="planned",
    walks=20,
    steps_per_walk=4,
    qualification_walks=6,
    gate_runs=1,
    gate_share=0.0,
)
# Strides.
SMALLEST = BuildConfig(
    preset="brisk",
    poses_per_layer=(5, 1, 1, 5),
    walks=4,
    qualification_walks=4,
    recovery_walks=3,
    gate_runs=2,
    gate_share=0.0,
    search=0,
)


@contextmanager
def few_steady_walks():
    """Walk each end of the range once, for 4 s: 2 s are left after the run-in.

    Random schedules are as brief.
    """
    with pytest.MonkeyPatch.context() as patch:
        brief_schedules(patch)
        patch.setattr(command_envelope, "_RUNS", 1)
        patch.setattr(command_envelope, "_SECONDS", 4.0)
        patch.setattr(command_envelope, "_SCHEDULES", 1)
        patch.setattr(command_envelope, "_HARD_RUNS", 1)
        patch.setattr(usual_errors, "_RUNS", 1)
        patch.setattr(usual_errors, "_RUNS_OFF", 1)
        patch.setattr(usual_errors, "_SECONDS", 3.0)
        yield


def brief_schedules(patch):
    """Let a build's random schedules end after 6 s; its workers are told so."""
    for module in (command_envelope, gate):
        patch.setattr(module, "Trial", partial(Trial, seconds=6.0))
