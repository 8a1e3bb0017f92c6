"""Servos that an integrator cannot take: closed form, and MuJoCo itself."""

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gaitchain.sim.stability import (
    divergences,
    explicit_damping,
    explicit_stiffness,
    most_damping,
    most_stiffness,
)

INERTIA, STEP_S = 0.02, 0.002
ARM = """
<mujoco><option timestep="{step}" gravity="0 0 0" integrator="{how}"/><worldbody>
 <body><joint name="still" axis="0 0 1"/>
  <inertial mass="1" pos="0 0 0" diaginertia="1 1 1"/></body>
 <body><joint name="elbow" axis="0 1 0" damping="3" armature="{rotor}"/>
  <inertial mass="1" pos="0 0 0" diaginertia="0.01 0.01 0.01"/></body>
</worldbody><actuator><position joint="still" kp="0" kv="1"/>
 <position joint="elbow" kp="{kp}" kv="{kv}" gear="{gear}"/></actuator></mujoco>"""


def arm(kv, how="Euler", gear=1.0, kp=0.0):
    """A servo on an inertia of 0.02 kg m^2, beside one that is well damped."""
    rotor = INERTIA - 0.01
    text = ARM.format(step=STEP_S, how=how, kp=kp, kv=kv, gear=gear, rotor=rotor)
    return mujoco.MjModel.from_xml_string(text)


@settings(max_examples=30)
@given(kv=st.floats(0.2, 100.0), gear=st.floats(0.5, 3.0))
def test_it_is_damping_times_step_over_inertia(kv, gear):
    ratio, joint = explicit_damping(arm(kv, gear=gear))
    assert ratio == pytest.approx(STEP_S * kv * gear**2 / INERTIA)
    assert joint == "elbow"


@pytest.mark.parametrize("how", ["Euler", "RK4"])
@pytest.mark.parametrize("part", [0.5, 0.98, 1.02, 1.5])
def test_mujoco_shakes_from_there_on(part, how):
    most = most_damping(arm(0.0, how))
    model = arm(part * most * INERTIA / STEP_S, how)
    model.dof_damping[:] = 0.0
    data = mujoco.MjData(model)
    data.joint("elbow").qvel[0] = 1e-3
    mujoco.mj_step(model, data, nstep=10)
    assert explicit_damping(model)[0] == pytest.approx(part * most)
    assert (abs(data.joint("elbow").qvel[0]) > 1e-3) == (part > 1.0)


@pytest.mark.parametrize("how", ["implicit", "implicitfast"])
def test_an_implicit_integrator_takes_any_damping(how):
    assert explicit_damping(arm(1e4, how)) == (0.0, "")


def test_a_model_without_servos_has_none():
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    assert explicit_damping(model) == (0.0, "")


def test_a_coupled_mass_matrix_counts():
    """Two links in a row: the outer one turns an inertia that is less than its own."""
    chain = """<mujoco><option gravity="0 0 0"/><worldbody><body>
     <joint name="a" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 1"
      size="0.05" mass="1"/><body pos="0 0 1"><joint name="b" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 0 0 1" size="0.05" mass="1"/></body>
     </body></worldbody><actuator><position joint="b" kp="0" kv="9"/></actuator>
     </mujoco>"""
    model = mujoco.MjModel.from_xml_string(chain)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    mass = np.zeros((2, 2))
    mujoco.mj_fullM(model, data, mass)
    free = np.linalg.inv(mass)[1, 1]
    ratio, joint = explicit_damping(model)
    assert ratio == pytest.approx(model.opt.timestep * 9.0 * free)
    assert joint == "b"


@settings(max_examples=30)
@given(kp=st.floats(0.2, 1e5), gear=st.floats(0.5, 3.0))
def test_it_is_stiffness_times_the_squared_step_over_inertia(kp, gear):
    ratio, joint = explicit_stiffness(arm(1.0, gear=gear, kp=kp))
    assert ratio == pytest.approx(STEP_S**2 * kp * gear**2 / INERTIA)
    assert joint == "elbow"


@pytest.mark.parametrize("how", ["Euler", "implicit", "implicitfast", "RK4"])
@pytest.mark.parametrize("part", [0.9, 1.1])
def test_no_integrator_takes_more_stiffness(part, how):
    """MuJoCo says so of the state of whoever shakes, and begins anew."""
    most = most_stiffness(arm(0.0, how))
    model = arm(0.0, how, kp=part * most * INERTIA / STEP_S**2)
    model.dof_damping[:] = 0.0
    model.actuator_biasprm[:, 2] = 0.0
    data = mujoco.MjData(model)
    data.joint("elbow").qvel[0] = 1e-3
    bad = divergences(data)
    assert not bad.any()
    mujoco.mj_step(model, data, nstep=200)
    assert bad.any() == (part > 1.0)
    mujoco.mj_resetData(model, data)
    assert not bad.any()
