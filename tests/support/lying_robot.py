"""What poses of a robot that gets up must keep."""

import numpy as np


def keeps_its_limits(robot, poses):
    """Check angles and speeds of the joints, from the stand back to the stand."""
    last = robot.stand
    for pose in poses:
        angles = np.array(pose.angles)
        assert (angles >= robot.lower - 1e-4).all()
        assert (angles <= robot.upper + 1e-4).all()
        fastest = 1.5 * np.abs(angles - last) / pose.seconds
        assert (fastest <= 1.01 * robot.speed_limit).all()
        last = angles
    np.testing.assert_allclose(last, robot.stand, atol=1e-4)
    return True
