// Words, numbers and colours that the page shows.

const INK = "#e8ecf2";

// What the clock shows at a time of the page.
function clock(time) { return (time + about.start).toFixed(2).replace(/^-0\.00$/, "0.00"); }

function countUpTo(sorted, value) {
  let low = 0, high = sorted.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (sorted[middle] <= value) low = middle + 1; else high = middle;
  }
  return low;
}

// Linear interpolation in a table.
function interpolated(times, values, time) {
  const next = Math.min(countUpTo(times, time), times.length - 1), last = Math.max(next - 1, 0);
  const span = times[next] - times[last];
  const fraction = span > 0 ? Math.min(Math.max((time - times[last]) / span, 0), 1) : 1;
  return values[last] + fraction * (values[next] - values[last]);
}

function shortened(value) {
  const size = Math.abs(value);
  return size !== 0 && (size < 1e-3 || size >= 1e5) ? value.toExponential(2) : String(+value.toPrecision(4));
}

// Whether a motion completes, and keeps its margin and all limits.
function keeps(scene, limits) {
  return scene.ending === "completed" && scene.keeps_margin && !scene.lines.length && limits.every(({ kept }) => kept);
}

// What a motion does; empty for maps.
function sentence(scene) {
  const { trail, ending, begin, end, margin, lines } = scene;
  const lasted = `${+(end - begin).toPrecision(4)}\u00a0s`;
  if (!trail) return "";
  if (ending === "singular") return `The arm becomes singular after ${lasted} and cannot follow its path further.`;
  if (ending === "margin") return `The arm has used up its margin after ${lasted}, before the end of its path.`;
  const moves = trail.joints.some(([, , values]) => values.some(value => value !== values[0]));
  const does = trail.fractions ? "The end-effector follows its path" : moves ? "The arm moves" : "The arm rests";
  const kept = margin > 0 ? scene.keeps_margin ? " and keeps the margin" : " but falls below the margin" : "";
  const violated = lines.some(line => line.startsWith("infeasible")) ? `${kept && ","} but not all limits` : "";
  return `${does} for ${lasted}${kept}${violated}.`;
}

// Copies a text, also where the clipboard is refused: in frames and on insecure pages.
async function copy(text) {
  try {
    await navigator.clipboard.writeText(text);
  } catch {
    const area = document.createElement("textarea");
    area.value = text;
    document.body.append(area);
    area.select();
    document.execCommand("copy");
    area.remove();
  }
}

function plainLine(line) { return typeof line === "string" ? line : line.verdict; }

function verdictColour(feasible) { return feasible ? "#9be3a0" : "#ffb27a"; }

function lineColour(line) { return typeof line === "string" ? INK : verdictColour(line.feasible); }

// A unit with superscripts; empty without a unit.
function printed(unit) {
  return unit === "1" ? "" : unit.replace(/\^(-?\d+)/g, (_, power) =>
    [...power].map(digit => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(digit)]).join(""));
}

function unit() { return printed(about.scale.unit); }

// The margin is kept up to rounding; see keeps_threshold in margin.py.
function feasible(value) { return value > 0 && value >= about.scale.margin * (1 - 1e-6); }
