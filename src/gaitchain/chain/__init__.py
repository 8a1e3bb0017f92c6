"""The Markov chain: layers, training, expected costs, pruning, policies.

The package works on indices, costs and probabilities and is independent of robots.
"""
