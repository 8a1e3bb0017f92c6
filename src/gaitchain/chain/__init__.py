"""The Markov chain: layers, training, expected costs, pruning, policies.

It knows indices, costs and probabilities, and no robot.
"""
