"""What a joint's actuators do together."""

import mujoco
import numpy as np
import pytest

from gaitchain.discover.servos import sum_actuators

SERVO = "<position joint='j' kp='300' forcerange='-60 60'/>"
MOTOR = "<motor joint='j' ctrlrange='-20 20'/>"
DAMPER = "<velocity joint='j' kv='6' {}/>"


def acted(*actuators):
    return mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body><joint name='j' axis='0 1 0'/><geom size='.1'/>"
        f"</body></worldbody><actuator>{''.join(actuators)}</actuator></mujoco>"
    )


@pytest.mark.parametrize(
    ("actuators", "force"),
    [
        ((SERVO, DAMPER.format("")), 60.0),
        ((DAMPER.format("forcerange='-5 5'"), SERVO), 60.0),
        ((DAMPER.format("forcerange='-5 5'"),), 5.0),
        ((SERVO, MOTOR), 80.0),
        ((SERVO, "<motor joint='j'/>"), np.inf),
    ],
)
def test_a_damper_beside_a_servo_has_no_limit_of_its_own(actuators, force):
    found = sum_actuators(acted(*actuators), 0)
    assert found.force == force
    assert found.damping == (6.0 if any("velocity" in a for a in actuators) else 0.0)
