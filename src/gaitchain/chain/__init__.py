"""The Markov chain: layers, training, expected costs, pruning, policies.

The package works on indices, costs and probabilities and is independent of robots. Its
front door is `LayeredChainModel`.
"""

from gaitchain.chain.estimator import LayeredChainModel

__all__ = ["LayeredChainModel"]
