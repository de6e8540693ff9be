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
