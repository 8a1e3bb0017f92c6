"""`gaitchain build`: a robot's file to a qualified gait library."""

from gaitchain.cli.building import build_and_save
from gaitchain.cli.console import say
from gaitchain.cli.options import Build
from gaitchain.gait.build_config import BuildConfig


def run(options: Build) -> int:
    """Build; return 1 if physics does not pass the library."""
    config = BuildConfig(
        robot=options.robot,
        profile=None if options.profile is None else str(options.profile),
        preset=options.preset,
        seed=options.seed,
        cost=options.cost,
        training=options.training,
        epsilon=options.epsilon,
        walks=options.walks,
        search=options.search,
        search_s=options.search_s,
        step_s=options.step_s,
        speed_limit_deg_s=options.speed_limit,
    )
    library, _ = build_and_save(config, options.out)
    if not library.qualified:
        say("not qualified: this library will be refused; see the table above")
    return 0 if library.qualified else 1
