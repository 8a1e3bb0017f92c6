# /// script
# dependencies = ["gaitchain"]
# ///
"""Change a number of the robot and see what a gait library says to that.

1. A robot is a TOML table; every number has a unit, a range and a source.
2. A library remembers its robot and refuses another one, naming what differs.
"""

import tomllib
from importlib import resources

from gaitchain import GaitchainError
from gaitchain.robot.box_robot import box_robot, load_box_robot
from gaitchain.robot.reduced_biped import parse_biped

text = (resources.files("gaitchain") / "data" / "res.toml").read_text("utf-8")
table = tomllib.loads(text)
table["name"] = "RES with longer shanks"
table["crus_length"] = {"value": 0.3, "unit": "m", "source": "what if"}
longer = box_robot(parse_biped(table, "longer shanks"))

original = load_box_robot("res")
print(f"leg {original.reduced.leg_length:.3f} -> {longer.reduced.leg_length:.3f} m")
print(f"fingerprint {original.fingerprint} -> {longer.fingerprint}")

table["crus_length"]["value"] = 30.0
try:
    parse_biped(table, "giant")
except GaitchainError as error:
    print("refused:", error)
