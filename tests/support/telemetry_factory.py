"""Telemetry of a walk in MuJoCo, and of no walk at all, without the loop's process."""

import math

import numpy as np

from gaitchain.live.messages import Choice, Event, Mode, Pace, Telemetry, Truth
from gaitchain.robot.box_robot import anatomy_of

BEGAN_NS = 1_700_000_000_000_000_000
PACE = Pace(0.004, 10, 0, 1e-4, 2e-4, 1e-3)


def told(biped, time_s=0.0, **changes):
    """One telemetry of a robot that stands and whose loop knows nothing else."""
    count = len(anatomy_of(biped).joint_names)
    stand = tuple(anatomy_of(biped).stand.tolist())
    values = {
        "time_s": time_s,
        "stamp_ns": BEGAN_NS + round(1e9 * time_s),
        "mode": Mode.STANDING,
        "reason": "",
        "driver": "",
        "asked": (0.0, 0.0, 0.0),
        "command": (0.0, 0.0, 0.0),
        "note": "",
        "status": "",
        "joint_position": stand,
        "joint_velocity": (0.0,) * count,
        "joint_target": stand,
        "joint_load": (math.nan,) * count,
        "angular_velocity": (0.0, 0.0, 0.0),
        "acceleration": (0.0, 0.0, 9.81),
        "estimated_tilt": (0.0, 0.0),
        "planned_zmp": (math.nan, math.nan),
        "support": "stand",
        "steps": 0,
        "choice": None,
        "pace": PACE,
        "link_sent": 0,
        "link_lost": 0,
        "link_note": "",
    }
    return Telemetry(**{**values, **changes})


def truth_of(backend):
    """What the simulator knows now, as the loop tells it."""
    data, model = backend.data, backend.model
    feet = [model.body(f"{side}_foot").id for side in ("left", "right")]

    def plain(array):
        return tuple(np.ravel(array).tolist())

    return Truth(
        qpos=plain(data.qpos),
        qvel=plain(data.qvel),
        place=plain(data.xpos[feet]),
        turn=plain(data.xmat[feet]),
        wrench=plain(data.cfrc_ext[feet]),
        twist=plain(data.cvel[feet]),
        com=plain(data.subtree_com[1]),
        tilt=tuple(backend.tilt),
        foot_height=plain(backend.sole_heights()),
        self_contact=backend.self_contact,
    )


def choice_of(walker):
    """The key pose that the walker goes to."""
    decision, panel = walker.decision, walker.gait.panel
    if decision is None or panel is None:
        return None
    return Choice(
        key_moment=panel.key_moment,
        layer=decision.layer,
        pose=decision.pose,
        target=decision.target,
        cost=decision.cost,
        runners_up=decision.runners_up,
        left_support=panel.left_support,
        primitives={**panel.move, **panel.lift, **panel.swing},
    )


def seen(walker, backend, time_s, target, *, truth=True, **changes):
    """The telemetry of a walker and the simulator as they are now."""
    sensors, planned = backend.read(), walker.gait.planned_zmp
    estimate = walker.gait.estimate
    return told(
        walker.gait.generator.library.biped,
        time_s,
        **{
            "mode": Mode.WALKING,
            "joint_position": tuple(sensors.joint_position.tolist()),
            "joint_velocity": tuple(sensors.joint_velocity.tolist()),
            "joint_target": tuple(target.tolist()),
            "joint_load": tuple(backend.data.actuator_force.tolist()),
            "angular_velocity": tuple(sensors.angular_velocity.tolist()),
            "acceleration": tuple(sensors.acceleration.tolist()),
            "estimated_tilt": (math.nan, math.nan)
            if estimate is None
            else (estimate.roll, estimate.pitch),
            "planned_zmp": (math.nan, math.nan)
            if planned is None
            else tuple(planned.tolist()),
            "support": "stand" if walker.standing else walker.gait.support.value,
            "steps": walker.gait.steps,
            "choice": choice_of(walker),
            "truth": truth_of(backend) if truth else None,
            **changes,
        },
    )


def walked(walker, backend, ticks, *, period_s=0.01, began_s=0.0, each=1):
    """Walk for so many control periods; yield the telemetry of each, up to the fall.

    Args:
        walker: with its command.
        backend: connected, of the same control period.
        ticks: at most.
        period_s: control period.
        began_s: what the loop's clock said before.
        each: of so many rows one has the simulator's truth.
    """
    for tick in range(ticks):
        target = walker.step(backend.read()).position
        time_s = began_s + tick * period_s
        if backend.fallen:
            yield seen(
                walker,
                backend,
                time_s,
                target,
                mode=Mode.STOPPED,
                reason="fell: tilted past 45 deg; Reset puts it back on its feet",
            )
            return
        yield seen(walker, backend, time_s, target, truth=tick % each == 0)
        backend.write(target)


def event(time_s, kind, text):
    """One event of the loop's clock."""
    return Event(time_s, BEGAN_NS + round(1e9 * time_s), kind, text)
