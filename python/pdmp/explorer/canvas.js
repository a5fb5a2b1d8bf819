// Drawing: canvases with a layer that rarely changes, axes with ticks, and projections.

/** Returns a number as short text. */
const short = (x) => (Math.abs(x) < 1e-12 ? "0" : String(Number(x.toPrecision(4))).replace("-", "−"));

/** Returns a number as text, rounded to a ten-thousandth of a span. */
const rounded = (x, span) => short(Math.round((x / span) * 1e4) * 1e-4 * span);

/** Returns a name with its unit, such as x [m/s]. */
const labelled = (name, unit, per = "") => (unit || per ? `${name} [${unit || "1"}${per}]` : name);

/** Creates an element with properties, and children or texts. */
function element(tag, properties = {}, ...children) {
  const node = document.createElement(tag);
  for (const [key, value] of Object.entries(properties)) {
    if (key in node) node[key] = value;
    else node.setAttribute(key, value);
  }
  node.append(...children);
  return node;
}

/** Returns the colours of the present scheme, light or dark. */
function palette() {
  const style = getComputedStyle(document.documentElement);
  const names = ["back", "text", "faint", "line", "demo", "movement", "limit", "mark"];
  return Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
}

/** Range that contains all values added; it grows in steps, so that the axes rest while a value moves. */
class AxisRange {
  constructor(values, minimum = 1e-9) {
    [this.low, this.high] = [Infinity, -Infinity];
    for (const value of values) [this.low, this.high] = [Math.min(this.low, value), Math.max(this.high, value)];
    if (!(this.low <= this.high)) [this.low, this.high] = [-1, 1];
    const middle = (this.low + this.high) / 2;
    const half = Math.max((this.high - this.low) * 0.54, minimum, Math.abs(middle) * 1e-6);
    [this.low, this.high, this.step] = [middle - half, middle + half, half * 0.3];
  }

  /** Extends the range to values, and returns whether it changed. */
  extend(low, high) {
    const [down, up] = [this.low - low, high - this.high].map((excess) => Math.ceil(excess / this.step));
    if (down > 0) this.low -= down * this.step;
    if (up > 0) this.high += up * this.step;
    return down > 0 || up > 0;
  }
}

/** Returns the smallest and the largest of values. */
function extremes(values) {
  let [low, high] = [Infinity, -Infinity];
  for (const value of values) {
    if (value < low) low = value;
    if (value > high) high = value;
  }
  return [low, high];
}

/** Returns the difference between the largest and the smallest of values. */
function spanOf(values) {
  const [low, high] = extremes(values);
  return high - low;
}

/** Returns ticks at round numbers of a range, about `n`. */
function ticks({ low, high }, n) {
  const raw = (high - low) / n;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].find((factor) => factor * power >= raw) * power;
  const found = [];
  for (let k = Math.ceil(low / step); k * step <= high; k++) found.push(k * step);
  return found;
}

/** Canvas in a figure with a caption. `paint` draws what rarely changes, `update` what moves. */
class Diagram {
  constructor(caption, controls, attributes) {
    this.canvas = element("canvas", { role: "img", ...attributes });
    this.name = caption;
    this.canvas.setAttribute("aria-label", caption);
    const heading = element("figcaption", {}, element("span", {}, caption), ...controls);
    this.figure = element("figure", {}, heading, this.canvas);
    this.context = this.canvas.getContext("2d");
    this.layer = document.createElement("canvas");
    this.stale = true;
  }

  /** Makes the canvas answer to pointer and keys, or only show. */
  makeInteractive(active, cursor) {
    this.canvas.setAttribute("role", active ? "application" : "img");
    this.canvas.tabIndex = active ? 0 : -1;
    Object.assign(this.canvas.style, { cursor: active ? cursor : "", touchAction: active ? "none" : "" });
  }

  /** Sets text for screen readers, if it changed. */
  describe(text) {
    const label = `${this.name}: ${text}`;
    if (this.label !== label) this.canvas.setAttribute("aria-label", (this.label = label));
  }

  /** Adapts to the size on the screen. */
  measure() {
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    if (this.width === width && this.height === height && this.ratio === ratio) return;
    Object.assign(this, { width, height, ratio, stale: true });
    for (const canvas of [this.canvas, this.layer]) {
      canvas.width = Math.max(1, Math.round(width * ratio));
      canvas.height = Math.max(1, Math.round(height * ratio));
    }
  }

  /** Draws both layers. `paint` and `update` take a context in units of pixels of the page. */
  draw(colours) {
    if (!this.width || !this.height) return;
    if (this.stale || this.colours !== colours) {
      const context = this.layer.getContext("2d");
      this.prepare(context);
      this.paint(context, colours);
      [this.stale, this.colours] = [false, colours];
    }
    this.context.setTransform(1, 0, 0, 1, 0, 0);
    this.context.clearRect(0, 0, this.canvas.width, this.canvas.height);
    this.context.drawImage(this.layer, 0, 0);
    this.prepare(this.context, false);
    this.update(this.context, colours);
  }

  prepare(context, clear = true) {
    context.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    if (clear) context.clearRect(0, 0, this.width, this.height);
    context.font = "12px system-ui, sans-serif";
    context.lineJoin = context.lineCap = "round";
    context.setLineDash([]);
  }
}

/** Draws a line through points, given by two arrays of pixels or functions of the index. */
function line(context, n, x, y, colour, width) {
  context.beginPath();
  for (let k = 0; k < n; k++) context.lineTo(x(k), y(k));
  context.strokeStyle = colour;
  context.lineWidth = width;
  context.stroke();
}

/** Draws a filled disc, or a ring. */
function disc(context, x, y, radius, colour, ring = false) {
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  context.fillStyle = context.strokeStyle = colour;
  context.lineWidth = 2;
  if (ring) context.stroke();
  else context.fill();
}

/** Rectangle of a diagram in which x and y ranges are drawn. */
class Axes {
  constructor(diagram, x, y, { equal = false, labels = ["", ""], noY = false } = {}) {
    this.box = { left: noY ? 12 : 48, right: diagram.width - 10, top: 8, bottom: diagram.height - 34 };
    Object.assign(this, { labels, noY });
    let [a, b] = [x, y].map(({ low, high }) => ({ low, high }));
    if (equal) {
      const [width, height] = [this.box.right - this.box.left, this.box.bottom - this.box.top];
      const unit = Math.max((a.high - a.low) / width, (b.high - b.low) / height);
      [a, b] = [[a, width], [b, height]].map(([{ low, high }, size]) => {
        const middle = (low + high) / 2;
        return { low: middle - (unit * size) / 2, high: middle + (unit * size) / 2 };
      });
    }
    const { left, right, top, bottom } = this.box;
    [this.xRange, this.yRange] = [a, b];
    this.sx = (right - left) / (a.high - a.low);
    this.sy = (bottom - top) / (b.high - b.low);
    this.x = (value) => left + (value - a.low) * this.sx;
    this.y = (value) => bottom - (value - b.low) * this.sy;
  }

  /** Returns the values at a pixel. */
  invert(px, py) {
    const { left, bottom } = this.box;
    return [this.xRange.low + (px - left) / this.sx, this.yRange.low + (bottom - py) / this.sy];
  }

  /** Draws grid, ticks and labels. */
  paint(context, colours) {
    const { left, right, top, bottom } = this.box;
    context.strokeStyle = colours.line;
    context.lineWidth = 1;
    context.fillStyle = colours.faint;
    context.beginPath();
    context.textAlign = "center";
    const skip = context.measureText(this.labels[0]).width + 12;
    for (const value of ticks(this.xRange, Math.max(2, (right - left) / 80))) {
      const x = Math.round(this.x(value)) + 0.5;
      context.moveTo(x, top);
      context.lineTo(x, bottom);
      context.fillText(short(value), x, bottom + 14);
    }
    context.textAlign = "right";
    context.fillText(this.labels[0], right, bottom + 28, Math.max(skip, right - left));
    if (!this.noY) {
      for (const value of ticks(this.yRange, Math.max(2, (bottom - top) / 28))) {
        const y = Math.round(this.y(value)) + 0.5;
        context.moveTo(left, y);
        context.lineTo(right, y);
        context.fillText(short(value), left - 5, y + 4);
      }
    }
    context.stroke();
    if (this.labels[1]) {
      context.textAlign = "left";
      context.fillText(this.labels[1], 4, bottom + 28, (right - left) / 2);
    }
  }

  /** Restricts drawing to the rectangle until `restore`. */
  clip(context) {
    const { left, right, top, bottom } = this.box;
    context.save();
    context.beginPath();
    context.rect(left, top, right - left, bottom - top);
    context.clip();
  }
}

/** Parallel projection of points in three dimensions, whose third axis points upwards. */
class View {
  constructor() {
    [this.yaw, this.pitch] = [-0.9, 0.4];
  }

  /** Returns the point of the plane: to the right, and upwards. */
  project([x, y, z]) {
    const [c, s] = [Math.cos(this.yaw), Math.sin(this.yaw)];
    const [right, away] = [c * x - s * y, s * x + c * y];
    return [right, z * Math.cos(this.pitch) + away * Math.sin(this.pitch)];
  }

  /** Turns with the pointer and the arrow keys on a canvas; calls `changed`. */
  attach(canvas, isActive, changed) {
    const turn = (yaw, pitch) => {
      if (!isActive()) return false;
      this.yaw += yaw;
      this.pitch = Math.min(Math.max(this.pitch + pitch, -1.5), 1.5);
      changed();
      return true;
    };
    canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
    canvas.addEventListener("pointermove", (event) => {
      if (event.buttons & 1) turn(event.movementX * 0.01, event.movementY * 0.01);
    });
    canvas.addEventListener("keydown", (event) => {
      const [yaw, pitch] = ARROWS[event.key] ?? [0, 0];
      if ((yaw || pitch) && turn(yaw * 0.1, pitch * 0.1)) event.preventDefault();
    });
  }
}

const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
