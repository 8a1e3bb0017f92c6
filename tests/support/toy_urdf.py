"""A small humanoid as URDF, whose foot and numbers a test may change."""

SIDES = (("left", 0.07), ("right", -0.07))
# Name, axis, drop from the joint before [m], lower and upper [rad], mass [kg].
CHAIN = (
    ("yaw", "0 0 1", 0.05, -1.0, 1.0, 0.2),
    ("roll", "1 0 0", 0.0, -1.0, 1.0, 0.2),
    ("pitch", "0 1 0", 0.0, -2.0, 1.0, 0.8),
    ("knee", "0 1 0", 0.2, 0.0, 2.2, 0.6),
    ("ankle", "0 1 0", 0.2, -1.2, 1.2, 0.1),
    ("tilt", "1 0 0", 0.0, -0.7, 0.7, 0.3),
)
TORSO = '<box size="0.12 0.2 0.24"/>'
FOOT = '<box size="0.18 0.1 0.02"/>'


def inertial(mass):
    """What a link weighs; nothing for None."""
    if mass is None:
        return ""
    inertia = " ".join(f'{key}="{0.002 * mass}"' for key in ("ixx", "iyy", "izz"))
    products = 'ixy="0" ixz="0" iyz="0"'
    return f'<inertial><mass value="{mass}"/><inertia {inertia} {products}/></inertial>'


def collision(shape, at="0 0 0", kind="collision"):
    """A shape of a link."""
    place = f'<origin xyz="{at}"/>'
    return f"<{kind}>{place}<geometry>{shape}</geometry></{kind}>"


def toy_urdf(foot=FOOT, torso="", weighs=lambda name, mass: mass, turn=lambda a: a):
    """A humanoid of 8 kg.

    `foot` is the geometry of its feet, `torso` more of its base; `weighs` changes the
    masses [kg], by name, None for no <inertial>, and `turn` the limits [rad].
    """
    parts = [
        f'<link name="torso">{inertial(weighs("torso", 4.0))}'
        f"{collision(TORSO, '0 0 0.1')}{torso}</link>"
    ]
    for side, y in SIDES:
        parent, at = "torso", f"0 {y} -0.05"
        for name, axis, drop, low, high, mass in CHAIN:
            link = f"{side}_{name}_link"
            own = collision(foot, "0.02 0 -0.04") if name == "tilt" else ""
            at = at if parent == "torso" else f"0 0 {-drop}"
            parts.append(
                f'<link name="{link}">{inertial(weighs(link, mass))}{own}</link>'
                f'<joint name="{side}_{name}" type="revolute"><parent link="{parent}"/>'
                f'<child link="{link}"/><origin xyz="{at}"/><axis xyz="{axis}"/>'
                f'<limit lower="{turn(low)}" upper="{turn(high)}" effort="60" '
                'velocity="8"/></joint>'
            )
            parent = link
    return f'<robot name="toy">{"".join(parts)}</robot>'
