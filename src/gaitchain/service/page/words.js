// Words and numbers as a person reads them.

const NOTICE = 8000; // ms

export const LOST = "There is no connection to the robot.";

export const MODES = {
  off: ["Off", "Torque is off."],
  rising: ["Rising", "Goes slowly to the standing pose."],
  getting_up: ["Getting up", "Moves all its joints from lying to standing: keep away."],
  standing: ["Standing", "Ready for a command."],
  walking: ["Walking", "Follows the driver."],
  safe: ["Safe", "Something is wrong: it holds still until Reset."],
  stopped: ["Stopped", "Torque is off until Reset."],
};

const SUPPORTS = {
  stand: "both feet, standing",
  ls: "left foot",
  rs: "right foot",
  lr: "both feet, from left to right",
  rl: "both feet, from right to left",
};

// A name that the page says otherwise, with its unit.
const NAMES = {
  share: ["part of the way passed", ""],
  share_rate: ["speed along it", "ways a swing"],
  fall_rate: ["foot lowering speed", "lifts a swing"],
};

const UNITS = {
  sway: "rad",
  turn: "rad",
  hip_x: "m",
  hip_height: "m",
  foot_x: "m",
  foot_z: "m",
  length: "m",
  outward: "m",
  lift: "m",
};

/** Format a number; a dash where there is none. */
export function fixed(value, digits = 2) {
  if (!Number.isFinite(value)) return "–";
  const text = value.toFixed(digits);
  // No "-0.00", and a true minus sign, so that columns of figures line up.
  return Number(text) === 0 ? (0).toFixed(digits) : text.replace("-", "−");
}

/** Format how low hips are; a limit is not rounded up, so that it is accepted itself. */
export function inward(metres) {
  return fixed(Math.floor(1000 * metres + 1e-6) / 1000, 3);
}

/** Format a number with as few digits as say it. */
export function short(value) {
  return String(Number(value.toPrecision(4)));
}

/** Say what supports the robot. */
export function supportWords(support) {
  return SUPPORTS[support] ?? (support || "–");
}

/** Name the primitives that make a pose, with units. */
export function primitivesText(primitives) {
  const parts = Object.entries(primitives ?? {}).map(([name, value]) => {
    const [said, unit] = NAMES[name] ?? [name.replaceAll("_", " "), UNITS[name]];
    return `${said} ${fixed(value, 3)}${unit ? ` ${unit}` : ""}`;
  });
  return parts.join(", ") || "no primitives known";
}

/** Format a command: its speeds in the order vx, vy, yaw rate, and a crouch if any. */
export function commandText([vx, vy, yaw], crouch) {
  const low = crouch > 0 ? `, ${inward(crouch)} m lower` : "";
  return `${fixed(vx)}, ${fixed(vy)} m/s, ${fixed(yaw)} rad/s${low}`;
}

/** Format a time on the loop's clock. */
export function clockText(seconds) {
  if (!Number.isFinite(seconds)) return "–";
  const tenths = Math.round(10 * seconds); // first, as 59.96 s is a minute
  const minutes = Math.floor(tenths / 600);
  return `${minutes}:${(tenths / 10 - 60 * minutes).toFixed(1).padStart(4, "0")}`;
}

/** Set an element's text if it differs, so that live regions speak only of news. */
export function say(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** Return what says something for a while, in one place. */
export function speaker(place) {
  let fading = 0;
  return (text) => {
    say(place, text);
    clearTimeout(fading);
    fading = setTimeout(() => say(place, ""), NOTICE);
  };
}
