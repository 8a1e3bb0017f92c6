"""Make `gymnasium.make("gaitchain/Walk-v0")` work, without importing a simulator.

To import `gaitchain.rl` is enough: Gymnasium has no plugins since its version 1.0.
"""

import gymnasium

WALK = "gaitchain/Walk-v0"
"""Name of the environment in Gymnasium."""
_PERIODS = 1000  # of an episode: 10 s


def register() -> None:
    """Register the environment; again it does nothing."""
    if WALK not in gymnasium.registry:
        gymnasium.register(
            WALK,
            entry_point="gaitchain.rl.environment:WalkEnv",
            max_episode_steps=_PERIODS,
        )


register()
