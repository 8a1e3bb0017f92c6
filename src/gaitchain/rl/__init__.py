"""For learning: the walk as an environment, an expert to imitate, reference motions.

Where Gymnasium is installed, importing this registers `gaitchain/Walk-v0`.
"""

from importlib.util import find_spec

if find_spec("gymnasium") is not None:
    from gaitchain.rl import registration as registration
