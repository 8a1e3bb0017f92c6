"""Springs at the joints of the legs, of which no plan of steps knows. Ours."""

from collections.abc import Mapping, Sequence

import mujoco

from gaitchain.discover.findings import FoundServo, Rows, UnfitError
from gaitchain.discover.pinned_robot import PinnedRobot
from gaitchain.messages import Array

_LEAST, _MOST = 0.01, 0.5  # of a servo's torque limit: least reported, most accepted


def spring_rows(
    robot: PinnedRobot,
    legs: Sequence[int],
    pose: Array,
    servos: Mapping[str, FoundServo],
) -> Rows:
    """Say what the legs' springs pull with where the robot stands.

    Args:
        robot: the robot; it is left in that pose.
        legs: ids of the driven joints of both legs.
        pose: (nq,) where it stands.
        servos: of its joints, which have to hold against the springs.

    Returns:
        A row of evidence, if they pull.

    Raises:
        UnfitError: a spring takes more than half of its servo's torque there.
    """
    robot.place(pose)
    mujoco.mj_fwdPosition(robot.model, robot.data)
    mujoco.mj_fwdVelocity(robot.model, robot.data)
    pulls = {
        robot.joint_name(j): abs(float(robot.data.qfrc_spring[dof]))
        for j, dof in zip(legs, robot.model.jnt_dofadr[list(legs)], strict=True)
    }
    parts = {name: pull / servos[name].torque_limit for name, pull in pulls.items()}
    name = max(parts, key=lambda name: parts[name])
    said = f"{pulls[name]:.3g} N m of {servos[name].torque_limit:.3g} N m at {name}"
    if parts[name] > _MOST:
        raise UnfitError(
            f"springs take {said} where the robot stands; steps are planned without "
            f"springs, which may take {_MOST:g} of a servo's torque",
            "stand.hip_height, for legs less bent",
        )
    count = sum(part > _LEAST for part in parts.values())
    why = f"up to {said} where the robot stands"
    return [("leg springs", f"{count} not planned with", why)] if count else []
