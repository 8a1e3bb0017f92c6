"""Build and qualification of a gait library, and experiments in physics with it."""
