// Diagrams of a movement: curves over time, paths, the plane of styles and a stick figure.

/** Returns the value of samples at a share of the duration. */
function interpolated(values, share) {
  const at = share * (values.length - 1);
  const k = Math.min(Math.floor(at), values.length - 2);
  return values[k] + (values[k + 1] - values[k]) * (at - k);
}

const shares = (n) => Array.from({ length: n + 1 }, (_, k) => k / n);
const positionAt = (movement, share) => movement.position.map((values) => interpolated(values, share));

/** Curve of one quantity over time, with limits. Demonstrations are {time, values}. */
class TimeCurve extends Diagram {
  constructor(label, unit, demos, limits, pick) {
    super(label, [], {});
    Object.assign(this, { unit, demos, limits, pick });
    const values = demos.flatMap((demo) => extremes(demo.values));
    this.y = new AxisRange(values);
    this.x = new AxisRange([0]);
    [this.x.low, this.x.high] = [0, Math.max(...demos.map((demo) => demo.time[demo.time.length - 1]))];
    this.x.step = this.x.high * 0.25;
  }

  /** Takes a movement, and extends the axes to it and to limits nearby. */
  follow(movement) {
    [this.time, this.values] = [movement.time, this.pick(movement)];
    const [low, high] = extremes(this.values);
    const last = this.time[this.time.length - 1];
    let changed = this.y.extend(low, high);
    changed = this.x.extend(0, last) || changed;
    const near = (this.y.high - this.y.low) * 0.35;
    for (const limit of this.limits) {
      if (limit > this.y.high && limit < this.y.high + near) changed = this.y.extend(limit, limit) || changed;
      if (limit < this.y.low && limit > this.y.low - near) changed = this.y.extend(limit, limit) || changed;
    }
    if (changed) this.stale = true;
    this.extent = [low, high];
  }

  summarise() {
    const [low, high] = this.extent.map(short);
    this.describe(`from ${low} to ${high} ${this.unit}, in ${short(this.time[this.time.length - 1])} s`);
  }

  paint(context, colours) {
    this.axes = new Axes(this, this.x, this.y, { labels: ["time [s]", ""] });
    const { x, y, box } = this.axes;
    this.axes.paint(context, colours);
    this.axes.clip(context);
    for (const { time, values } of this.demos) {
      line(context, values.length, (k) => x(time[k]), (k) => y(values[k]), colours.demo, 1);
    }
    context.setLineDash([6, 4]);
    for (const limit of this.limits) {
      line(context, 2, (k) => (k ? box.right : box.left), () => y(limit), colours.limit, 1.5);
    }
    context.restore();
  }

  update(context, colours) {
    const { axes, time, values } = this;
    const [x, y] = [(k) => axes.x(time[k]), (k) => axes.y(values[k])];
    axes.clip(context);
    line(context, values.length, x, y, colours.movement, 2.2);
    const [lower, upper] = this.limits;
    if (this.extent[0] < lower || this.extent[1] > upper) {
      const { left, right, top, bottom } = axes.box;
      const outside = new Path2D();
      if (this.extent[1] > upper) outside.rect(left, top, right - left, axes.y(upper) - top);
      if (this.extent[0] < lower) outside.rect(left, axes.y(lower), right - left, bottom - axes.y(lower));
      context.clip(outside);
      line(context, values.length, x, y, colours.limit, 3.5);
    }
    context.restore();
    const value = interpolated(values, this.share);
    const at = axes.x(interpolated(time, this.share));
    line(context, 2, () => at, (k) => (k ? axes.box.bottom : axes.box.top), colours.faint, 1);
    disc(context, at, axes.y(value), 4.5, colours.mark);
    context.fillStyle = colours.text;
    context.textAlign = "left";
    context.fillText(`${rounded(value, this.y.high - this.y.low)} ${this.unit}`.trim(), 4, this.height - 6);
  }
}

/** Path of two or three quantities. `quantities` are {label, unit, of(movement)}. */
class PathView extends Diagram {
  constructor(quantities, chosen, movements, changed) {
    const selects = ["x", "y", "z"].map((axis, i) => {
      const names = quantities.map(({ label }, n) => element("option", { value: n }, label));
      if (i === 2) names.unshift(element("option", { value: "" }, "none"));
      const select = element("select", { "aria-label": `Path: quantity of the ${axis} axis` }, ...names);
      select.value = String(chosen[i] ?? "");
      select.addEventListener("change", () => {
        this.choose();
        changed();
      });
      return select;
    });
    super("Path", selects, {});
    Object.assign(this, { quantities, selects, movements, view: new View() });
    this.view.attach(this.canvas, () => this.chosen.length === 3, () => {
      this.stale = true;
      changed();
    });
    this.choose();
  }

  /** Takes the axes from the selections. */
  choose() {
    this.chosen = this.selects.filter((select) => select.value !== "").map((select) => this.quantities[select.value]);
    this.makeInteractive(this.chosen.length === 3, "grab");
    this.demos = this.movements.map((movement) => this.chosen.map((quantity) => quantity.of(movement)));
    const all = this.chosen.map((_, i) => this.demos.flatMap((demo) => extremes(demo[i])));
    this.ranges = all.map((values) => new AxisRange(values));
    this.movement &&= this.follow(this.movement);
    this.stale = true;
  }

  follow(movement) {
    this.movement = movement;
    this.path = this.chosen.map((quantity) => quantity.of(movement));
    this.path.forEach((values, i) => {
      if (this.ranges[i].extend(...extremes(values))) this.stale = true;
    });
    return movement;
  }

  summarise() {
    const ends = (k) => this.path.map((values) => short(values[k])).join(", ");
    const names = this.chosen.map(({ label }) => label).join(", ");
    const turn = this.chosen.length === 3 ? "; arrow keys turn the view" : "";
    this.describe(`${names}, from ${ends(0)} to ${ends(this.path[0].length - 1)}${turn}`);
  }

  paint(context, colours) {
    this.frame = frameOf(this, this.ranges, this.view, this.chosen.map(({ label }) => label), this.isEqual());
    this.frame.paint(context, colours);
    for (const demo of this.demos) this.trace(context, demo, colours.demo, 1);
  }

  /** Returns whether all axes have one unit, and so one scale. */
  isEqual() {
    return this.chosen.every(({ unit }) => unit === this.chosen[0].unit);
  }

  trace(context, curves, colour, width) {
    context.beginPath();
    for (let k = 0; k < curves[0].length; k++) context.lineTo(...this.frame.at(curves.map((values) => values[k])));
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.stroke();
  }

  update(context, colours) {
    this.trace(context, this.path, colours.movement, 2.2);
    const end = this.path[0].length - 1;
    disc(context, ...this.frame.at(this.path.map((values) => values[0])), 4, colours.movement, true);
    disc(context, ...this.frame.at(this.path.map((values) => values[end])), 3.5, colours.movement);
    disc(context, ...this.frame.at(this.path.map((values) => interpolated(values, this.share))), 5.5, colours.mark);
  }
}

/** Returns the drawing of axes in two dimensions, or of a box in three: {at(point), paint(context, colours)}. */
function frameOf(diagram, ranges, view, labels, equal) {
  if (ranges.length === 2) {
    const axes = new Axes(diagram, ...ranges, { equal, labels });
    return { at: ([x, y]) => [axes.x(x), axes.y(y)], paint: (context, colours) => axes.paint(context, colours) };
  }
  if (equal) {
    const half = Math.max(...ranges.map(({ low, high }) => high - low)) / 2;
    const middles = ranges.map(({ low, high }) => (low + high) / 2);
    ranges = middles.map((middle) => ({ low: middle - half, high: middle + half }));
  }
  const centred = (point) => point.map((x, i) => (x - ranges[i].low) / (ranges[i].high - ranges[i].low) - 0.5);
  const unit = Math.min(diagram.width - 40, diagram.height - 40) / 1.55;
  const at = (point) => {
    const [right, up] = view.project(centred(point));
    return [diagram.width / 2 + unit * right, diagram.height / 2 - unit * up];
  };
  const paint = (context, colours) => {
    const low = ranges.map((range) => range.low);
    const corner = (bits) => ranges.map((range, i) => (bits & (1 << i) ? range.high : range.low));
    for (let from = 0; from < 8; from++) {
      for (const bit of [1, 2, 4].filter((b) => !(from & b))) {
        const ends = [at(corner(from)), at(corner(from | bit))];
        line(context, 2, (k) => ends[k][0], (k) => ends[k][1], colours.line, from ? 1 : 1.5);
      }
    }
    context.textAlign = "center";
    labels.forEach((label, i) => {
      const { low: from, high: to } = ranges[i];
      const write = (share, text, colour) => {
        const [x, y] = at(low.map((value, n) => (n === i ? from + share * (to - from) : value)));
        context.fillStyle = colour;
        context.fillText(text, x, y + 12);
      };
      write(0.5, label, colours.text);
      write(0.95, rounded(to, 10 * (to - from)), colours.faint);
    });
  };
  return { at, paint };
}

/** Plane of two styles, with the demonstrations as points; a click or an arrow key selects a style. */
class StylePlane extends Diagram {
  constructor(nStyles, demos, select) {
    const selects = [0, 1].slice(0, Math.min(nStyles, 2)).map((axis) => {
      const options = Array.from({ length: nStyles }, (_, j) => element("option", { value: j }, `style ${j + 1}`));
      const name = `Plane of styles: ${axis ? "vertical" : "horizontal"} axis`;
      const menu = element("select", { "aria-label": name, value: String(axis) }, ...options);
      menu.value = String(axis);
      menu.hidden = nStyles < 3;
      menu.addEventListener("change", () => this.choose());
      return menu;
    });
    super("Styles", selects, {});
    this.makeInteractive(true, "crosshair");
    Object.assign(this, { selects, demos, select });
    // A style in which the demonstrations hardly differ has a range in which it acts.
    this.smallest = 0.15 * Math.max(...Array.from({ length: nStyles }, (_, j) => spanOf(demos.map(({ style }) => style[j]))));
    this.choose();
    const pick = (event) => this.pick(event);
    this.canvas.addEventListener("pointerdown", (event) => {
      this.canvas.setPointerCapture(event.pointerId);
      this.canvas.focus();
      pick(event);
    });
    this.canvas.addEventListener("pointermove", (event) => event.buttons & 1 && pick(event));
    this.canvas.addEventListener("keydown", (event) => {
      const step = ARROWS[event.key];
      if (!step || (step[1] && this.axesOf.length < 2)) return;
      event.preventDefault();
      const changes = this.axesOf.map((j, i) => [j, this.style[j] + (step[i] * this.ranges[i].step) / 6]);
      this.select(changes, null);
    });
  }

  choose() {
    this.axesOf = this.selects.map((menu) => Number(menu.value));
    this.ranges = this.axesOf.map((j) => {
      const range = new AxisRange(this.demos.map(({ style }) => style[j]), this.smallest);
      range.extend(range.low - range.step, range.high + range.step);
      return range;
    });
    if (this.style) this.follow(this.style);
    this.stale = true;
  }

  /** Selects the style under the pointer, or the demonstration there. */
  pick(event) {
    const { left, top } = this.canvas.getBoundingClientRect();
    const [x, y] = [event.clientX - left, event.clientY - top];
    const away = this.demos.map(({ style }) => Math.hypot(...this.place(style).map((p, i) => p - [x, y][i])));
    const nearest = away.indexOf(Math.min(...away));
    const values = this.axes.invert(x, y);
    this.select(this.axesOf.map((j, i) => [j, values[i]]), away[nearest] <= 9 ? nearest : null);
  }

  /** Returns the pixel of a style. */
  place(style) {
    const [x, y] = this.axesOf.map((j) => style[j]);
    return [this.axes.x(x), this.axes.y(y ?? 0)];
  }

  follow(style) {
    this.style = style;
    this.axesOf.forEach((j, i) => {
      if (this.ranges[i].extend(style[j], style[j])) this.stale = true;
    });
  }

  summarise() {
    const values = this.axesOf.map((j) => `style ${j + 1} is ${short(this.style[j])}`).join(", ");
    this.describe(`${values}, among ${this.demos.length} demonstrations; arrow keys change it`);
  }

  paint(context, colours) {
    const vertical = this.ranges[1] ?? { low: -1, high: 1 };
    const labels = this.axesOf.map((j) => `style ${j + 1}`);
    this.axes = new Axes(this, this.ranges[0], vertical, { labels, noY: !this.ranges[1] });
    this.axes.paint(context, colours);
    context.textAlign = "left";
    for (const { style, number } of this.demos) {
      const [x, y] = this.place(style);
      disc(context, x, y, 5, colours.demo);
      context.fillStyle = colours.faint;
      if (this.demos.length <= 30) context.fillText(number, x + 7, y + 4);
    }
  }

  update(context, colours) {
    const [x, y] = this.place(this.style);
    const { left, right, top, bottom } = this.axes.box;
    line(context, 2, () => x, (k) => (k ? bottom : top), colours.movement, 1);
    line(context, 2, (k) => (k ? right : left), () => y, colours.movement, 1);
    disc(context, x, y, 6.5, colours.movement);
  }
}

/** Stick figure at the present time, with the path of its last point. */
class StickFigure extends Diagram {
  constructor(kinematics, movements, changed) {
    super("Robot", [], {});
    this.makeInteractive(kinematics.dimension === 3, "grab");
    this.kinematics = kinematics;
    this.view = new View();
    this.view.attach(this.canvas, () => kinematics.dimension === 3, () => {
      this.stale = true;
      changed();
    });
    const points = movements.flatMap((movement) => shares(8).flatMap((share) => this.pose(movement, share)));
    this.ranges = Array.from({ length: kinematics.dimension }, (_, i) => new AxisRange(points.map((point) => point[i])));
    this.traces = movements.map((movement) => this.tips(movement));
  }

  /** Returns the path of the last point. */
  tips(movement) {
    const last = this.kinematics.points.length - 1;
    return shares(60).map((share) => this.kinematics.point(last, positionAt(movement, share)));
  }

  pose(movement, share) {
    return this.kinematics.at(positionAt(movement, share));
  }

  follow(movement) {
    this.movement = movement;
    this.trace = this.tips(movement);
    this.ranges.forEach((range, i) => {
      if (range.extend(...extremes(this.trace.map((point) => point[i])))) this.stale = true;
    });
  }

  summarise() {
    const tip = this.trace[this.trace.length - 1].map(short).join(", ");
    const turn = this.kinematics.dimension === 3 ? "; arrow keys turn the view" : "";
    this.describe(`its last point ends at ${tip}${turn}`);
  }

  paint(context, colours) {
    const labels = ["x", "y", "z"].slice(0, this.kinematics.dimension);
    this.frame = frameOf(this, this.ranges, this.view, labels, true);
    this.frame.paint(context, colours);
    for (const trace of this.traces) this.stroke(context, trace, colours.demo, 1);
  }

  stroke(context, points, colour, width) {
    const at = points.map((point) => this.frame.at(point));
    line(context, at.length, (k) => at[k][0], (k) => at[k][1], colour, width);
  }

  update(context, colours) {
    this.stroke(context, this.trace, colours.movement, 2);
    const pose = this.pose(this.movement, this.share);
    for (const [a, b] of this.kinematics.links) this.stroke(context, [pose[a], pose[b]], colours.text, 4);
    for (const point of pose) disc(context, ...this.frame.at(point), 5, colours.mark);
  }
}
