"""What a joint's actuators do together."""

import mujoco
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
        ((SERVO, MOTOR), 60.0),
        ((SERVO, "<motor joint='j'/>"), 60.0),
        ((SERVO, SERVO), 120.0),
        ((MOTOR, MOTOR, DAMPER.format("")), 40.0),
    ],
)
def test_the_limit_is_that_of_the_servos_where_there_are_some(actuators, force):
    found = sum_actuators(acted(*actuators), 0)
    assert found.force == force
    assert found.damping == (6.0 if any("velocity" in a for a in actuators) else 0.0)
