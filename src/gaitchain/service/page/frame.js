// What the server sends, made safe: every field is there, of its kind, NaN for unknown.

const DRIVES = ["vx", "vy", "yaw_rate"];

const END = 3; // layer of the poses in which a step ends

const number = (value) =>
  typeof value === "number" && Number.isFinite(value) ? value : NaN;
const list = (value) => (Array.isArray(value) ? value : []);
const text = (value) => (typeof value === "string" ? value : "");
const record = (value) =>
  value !== null && typeof value === "object" && !Array.isArray(value) ? value : {};
const numbers = (value) => list(value).map(number);
const point = (value) => [number(list(value)[0]), number(list(value)[1])];
const points = (value) => list(value).map(point).filter(known);

/** Whether all numbers of a list are known. */
export function known(values) {
  return values.every(Number.isFinite);
}

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
      ticks: number(pace.ticks),
      overruns: number(pace.overruns),
      late: number(pace.late_p99_s),
      worst: number(pace.late_max_s),
    },
    link: { sent: number(link.sent), lost: number(link.lost), note: text(link.note) },
    events: readEvents(raw.events),
    fall: text(raw.fall),
    simulated: raw.simulated === true,
    disturbances: readDisturbances(raw.disturbances),
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
  const [end, ...ends] = readPoses(raw.ends);
  if (end) return { layer: END, ...end, others: ends, byCommand: true };
  const next = { layer: raw.layer, pose: raw.pose, cost: number(raw.cost), byCommand: false };
  return { ...next, others: readPoses(raw.runners_up) };
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
