"""Targets for RES that move all joints, and the path that a simulated robot makes."""

import numpy as np

BENT = np.tile([0.0, 0.0, -0.3, 0.6, -0.3, 0.0], 2)  # soles level
WAVES = [BENT + 0.1 * np.sin(0.1 * i + np.arange(12.0)) for i in range(60)]


def path_of(backend, targets=WAVES, start=BENT):
    """Write targets one after another; return base and joints after each."""
    backend.connect(start)
    path = []
    for target in targets:
        backend.write(target)
        path.append(backend.data.qpos.copy())
    return np.array(path)
