// What the server sends, made safe: every field is there, of its kind, NaN for unknown.

import { known, list, number, numbers, point, points, record, text } from "./raw.js";

const END = 3; // layer of the poses in which a step ends

/** Read a frame; null if it is none. */
export function readFrame(raw) {
  if (record(raw).type !== "frame") return null;
  const pace = record(raw.pace);
  const link = record(raw.link);
  return {
    time: number(raw.time_s),
    mode: text(raw.mode),
    reason: text(raw.reason),
    driver: text(raw.driver),
    asked: [0, 1, 2].map((i) => number(list(raw.asked)[i])),
    askedParts: [0, 1, 2].map((i) => number(list(raw.asked_parts)[i])),
    command: [0, 1, 2].map((i) => number(list(raw.command)[i])),
    crouch: { asked: number(raw.crouch_asked), done: number(raw.crouch) },
    note: text(raw.note),
    status: text(raw.status),
    place: readPlace(raw.place),
    feet: list(raw.feet).map(readPlace).filter(Boolean),
    going: readGoing(raw.going),
    view: Number.isInteger(raw.view) ? raw.view : null,
    position: numbers(raw.joint_position),
    target: numbers(raw.joint_target),
    load: numbers(raw.joint_load),
    unit: String(raw.load_unit ?? "N m"),
    tilt: point(raw.estimated_tilt),
    support: text(raw.support),
    steps: number(raw.steps),
    choice: readChoice(raw.choice),
    scene: readScene(raw.scene),
    pace: {
      period: number(pace.period_s),
      rate: number(pace.rate_hz),
      overruns: number(pace.overruns),
      late: number(pace.late_p99_s),
      worst: number(pace.late_max_s),
    },
    link: {
      sent: number(link.sent),
      lost: number(link.lost),
      note: text(link.note),
      holds: link.holds === true,
      supply: number(link.supply_v),
    },
    events: readEvents(raw.events),
    fall: text(raw.fall),
    simulated: raw.simulated === true,
    kind: text(raw.kind),
    canGetUp: raw.can_get_up === true && !raw.replay,
    replay: readReplay(raw.replay),
    disturbances: readDisturbances(raw.disturbances),
  };
}

/** Read how far a log is played; null for a robot that is live. */
function readReplay(raw) {
  const { at_s, length_s, speed, playing, jumps } = record(raw);
  const found = { at: number(at_s), length: number(length_s), speed: number(speed), jumps: number(jumps) };
  return known(Object.values(found)) ? { ...found, playing: playing === true } : null;
}

/** Read x, y [m] and heading [rad]; null where they are not known. */
function readPlace(raw) {
  const place = [0, 1, 2].map((i) => number(list(raw)[i]));
  return known(place) ? place : null;
}

function readGoing(raw) {
  if (raw === null || typeof raw !== "object") return null;
  return {
    goal: readPlace(raw.goal),
    steps: number(raw.footsteps_left),
    distance: number(raw.distance_m),
    turn: number(raw.turn_rad),
    arrived: raw.arrived === true,
  };
}

function readDisturbances(raw) {
  const { punches, arms, payload } = record(raw);
  const { most_ns, every_s } = record(punches);
  const ends = { most: number(most_ns), every: number(every_s) };
  return {
    punches: known([ends.most, ends.every]) ? ends : null,
    swings: arms === "random",
    payload: number(payload),
  };
}

function readChoice(raw) {
  const { layer, pose } = record(raw);
  if (!Number.isInteger(layer) || !Number.isInteger(pose)) return null;
  return {
    moment: text(raw.key_moment) || `kp_${layer + 1}`,
    layer,
    pose,
    target: Number.isInteger(raw.target) ? raw.target : -1,
    sizes: list(raw.sizes).map(point).filter(known),
    decided: readDecided(raw),
    leftSupport: raw.left_support === true,
    primitives: record(raw.primitives),
  };
}

/** Read what was decided: where the step ends, if that was chosen by cost, else the next pose. */
function readDecided(raw) {
  const expected = numbers(raw.expected);
  const [end, ...ends] = readPoses(raw.ends).map((one, i) => ({ ...one, walking: expected[i] }));
  if (end) return { layer: END, ...end, others: ends, byCommand: true };
  const next = { layer: raw.layer, pose: raw.pose, cost: number(raw.cost), byCommand: false };
  const others = readPoses(raw.runners_up).map((one) => ({ ...one, walking: one.cost }));
  return { ...next, walking: next.cost, others };
}

/** Read (pose, cost) pairs. */
function readPoses(raw) {
  return list(raw)
    .map((pair) => ({ pose: list(pair)[0], cost: number(list(pair)[1]) }))
    .filter((one) => Number.isInteger(one.pose));
}

function readScene(raw) {
  const scene = record(raw);
  const feet = list(scene.feet).map((foot) => [0, 1, 2].map((i) => number(list(foot)[i])));
  return {
    feet: feet.filter(known),
    soles: list(scene.soles).map(points),
    zmp: point(scene.zmp),
    planned: point(scene.planned_zmp),
    region: points(scene.region),
  };
}

/** Read a list of events, or the answer that holds one. */
export function readEvents(raw) {
  return list(Array.isArray(raw) ? raw : record(raw).events)
    .map((event) => ({
      number: number(record(event).number),
      time: number(record(event).time_s),
      stamp: number(record(event).stamp_ns),
      kind: text(record(event).kind),
      text: text(record(event).text),
    }))
    .filter((event) => event.text);
}
