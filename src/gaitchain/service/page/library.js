// What the server says of the library and its robot, made safe.

import { known, list, number, point, record, text } from "./raw.js";

const DRIVES = ["vx", "vy", "yaw_rate"];

/** Read the library: what does not change while the page is open. */
export function readLibrary(raw) {
  const facts = record(raw);
  return {
    name: text(facts.name) || text(facts.robot_name) || text(facts.robot) || "robot",
    fingerprint: text(facts.fingerprint),
    qualified: facts.qualified === true,
    mass: number(facts.mass_kg),
    joints: readJoints(facts),
    limits: readLimits(facts),
    crouch: point(record(facts.command_range).crouch),
    disturb: readBounds(facts.disturbances),
    step: number(record(facts.timing).step),
    layers: list(facts.layers).map((layer, i) => ({
      moment: text(record(layer).key_moment) || `kp_${i + 1}`,
      poses: list(record(layer).poses).map((pose) => record(record(pose).primitives)),
    })),
    edges: list(facts.edges)
      .map((edge) => ({
        layer: number(record(edge).layer),
        from: number(record(edge).from),
        to: number(record(edge).to),
        cost: number(record(edge).cost),
      }))
      .filter((edge) => known([edge.layer, edge.from, edge.to])),
  };
}

/** Read what may disturb the robot; null where it is not simulated. */
function readBounds(raw) {
  const bounds = record(raw);
  const found = {
    impulse: number(bounds.impulse_ns),
    bodies: list(bounds.bodies).map(text).filter(Boolean),
    elevation: point(bounds.elevation_deg),
    every: point(bounds.every_s),
    payload: point(bounds.payload),
  };
  return Number.isFinite(found.impulse) ? found : null;
}

function readJoints(facts) {
  const joints = list(facts.joints).length ? facts.joints : list(facts.joint_names);
  return joints.map((joint) => text(joint) || text(record(joint).name) || "joint");
}

function readLimits(facts) {
  const range = record(facts.command_range ?? facts.range ?? facts.commands);
  return DRIVES.map((axis) => {
    const [low, high] = Array.isArray(range[axis])
      ? range[axis]
      : [record(range[axis]).least, record(range[axis]).most];
    const ends = [number(low), number(high)];
    return known(ends) ? ends : [0, 0];
  });
}
