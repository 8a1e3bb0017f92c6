"""A small robot in a file, and the command line on it."""

LEG = """
<body name="{s}1" pos="0 {y} -0.05"><joint name="{s}_yaw" axis="0 0 1" range="-1 1"/>
 <inertial mass="0.2" pos="0 0 0" diaginertia="2e-4 2e-4 2e-4"/>
 <body name="{s}2"><joint name="{s}_roll" axis="1 0 0" range="-1 1"/>
  <inertial mass="0.2" pos="0 0 0" diaginertia="2e-4 2e-4 2e-4"/>
  <body name="{s}3"><joint name="{s}_pitch" axis="0 1 0" range="-2 1"/>
   <geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.03" mass="0.8"/>
   <body name="{s}4" pos="0 0 -0.2"><joint name="{s}_knee" axis="0 1 0" range="0 2.2"/>
    <geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.025" mass="0.6"/>
    <body name="{s}5" pos="0 0 -0.2"><joint name="{s}_ankle" axis="0 1 0"
      range="-1.2 1.2"/>
     <inertial mass="0.1" pos="0 0 0" diaginertia="1e-4 1e-4 1e-4"/>
     <body name="{s}6"><joint name="{s}_tilt" axis="1 0 0" range="-0.7 0.7"/>
      <geom type="box" size="0.09 0.05 0.01" pos="0.02 0 -0.04" mass="0.3"/>
</body></body></body></body></body></body>"""


ARM = """
<body name="{s}_arm" pos="0 {y} 0.2"><joint name="{s}_shoulder" axis="0 1 0"/>
 <geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.02" mass="0.3"/></body>"""


SIDES = (("left", 1.0), ("right", -1.0))


JOINTS = ("yaw", "roll", "pitch", "knee", "ankle", "tilt")


def toy(kp=300.0):
    """A humanoid of 8 kg that nobody tuned."""
    legs = "".join(LEG.format(s=s, y=0.07 * y) for s, y in SIDES)
    arms = "".join(ARM.format(s=s, y=0.15 * y) for s, y in SIDES)
    names = [f"{s}_{j}" for s, _ in SIDES for j in (*JOINTS, "shoulder")]
    servos = "".join(
        f'<position joint="{n}" kp="{kp}" kv="6" forcerange="-60 60"/>' for n in names
    )
    return (
        '<mujoco model="toy"><compiler angle="radian"/><default><joint '
        'armature="0.02"/></default><worldbody><body name="torso" '
        'pos="0 0 0.5"><freejoint/><geom type="box" size="0.06 0.1 0.12" mass="4" '
        f'pos="0 0 0.1"/>{arms}{legs}</body></worldbody><actuator>{servos}</actuator>'
        "</mujoco>"
    )
