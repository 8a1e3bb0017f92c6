# /// script
# dependencies = ["gaitchain[sim]"]
# ///
"""Walk a library's robot in a MuJoCo model of your own, whatever else is in it.

1. `ModelBackend` finds the robot's joints by name, and gives its servos their gains.
2. `Walker` takes the joints in the model's order, arms and hands among them.
3. The walk is the model's: its contacts, its masses, its terrain.
"""

from importlib.resources import files

import mujoco
import numpy as np

from gaitchain import Command, ModelBackend, Walker, load_library
from gaitchain.sim.model import build_model

library = load_library(files("gaitchain") / "data" / "res.gait")
# In place of these two lines: model = mujoco.MjModel.from_xml_path("my_scene.xml")
model = build_model(library.robot)
model.geom_friction[model.geom("floor").id, 0] = 0.5  # a smoother floor

robot = ModelBackend(model, library)
walker = Walker(library, joint_names=robot.joint_names)
robot.connect(walker.stand)
print(f"{len(robot.joint_names)} joints, from {robot.joint_names[0]}")

for tick in range(800):  # 8 s at 100 Hz
    if tick == 100:  # it has stood for a second and knows the vertical
        print("carried out:", walker.command(Command(vx=0.3)))
    robot.write(walker.step(robot.read()).position)
walked = float(np.hypot(*robot.data.qpos[:2]))
print(f"MuJoCo {mujoco.__version__}: walked {walked:.2f} m")
print("fell" if robot.fallen else f"stands after {walker.gait.steps} steps")
