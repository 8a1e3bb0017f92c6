"""How work that takes long reports its progress; imports nothing else."""

from collections.abc import Callable

Progress = Callable[[str, int, int], None]
"""Called with what is done, how far it is, and of how much."""
