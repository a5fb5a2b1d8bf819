// The page: state, controls, animation, summary.

const data = JSON.parse(document.getElementById("data").textContent);
const primitive = new Primitive(data);
const demoConditions = decodedDemos();
const MAX_DRAWN = 60; // demonstrations behind the movement
const drawn = demoConditions.filter((_, m) => m % Math.ceil(demoConditions.length / MAX_DRAWN) === 0);
const drawnMovements = drawn.map((demo) => primitive.movement(demo));
const byId = (id) => document.getElementById(id);
const centreName = primitive.rhythmic ? "anchor" : "goal";

const state = { demo: data.demos.nominal, context: [], share: 0, playing: false, speed: 1, conditions: null };
let movement = null;
let colours = palette();
let sliders = [];
let choices = [];
let diagrams = [];
let requested = false;
let before = 0;
let spoken = 0;
const frames = [];

/** Returns the conditions of the demonstrations. */
function decodedDemos() {
  const { styles, centres, starts, taus, names, numbers } = data.demos;
  const [J, C] = [primitive.nStyles, primitive.nCoordinates];
  const [s, c, y, t] = [styles, centres, starts, taus].map((packed) => packed && decode(packed));
  const row = (values, m, n) => values && values.subarray(m * n, m * n + n);
  return names.map((name, m) => ({
    ...primitive.conditions(row(s, m, J), row(c, m, C), row(y, m, C), t[m]),
    name,
    number: numbers[m],
  }));
}

/** Returns a copy of conditions. */
function copied({ style, centre, start, amplitude, tau }) {
  return { style: style.slice(), centre: centre.slice(), start: start && start.slice(), amplitude, tau };
}

/** Takes the conditions of a demonstration. */
function selectDemo(m) {
  state.conditions = copied(demoConditions[m]);
  state.demo = m;
  state.context = state.context.map(() => -1);
  refresh();
}

/** Changes conditions by a function of them. */
function change(edit) {
  edit(state.conditions);
  state.demo = -1;
  state.context = state.context.map(() => -1);
  refresh();
}

/** Takes the prediction for a context; columns without a value get that of their slider. */
function selectContext(column, index) {
  const { columns, table } = data.contexts;
  const context = choices.map((choice, q) => (q === column ? index : Math.max(0, Number(choice.input.value))));
  if (index < 0) return selectDemo(data.demos.nominal);
  let row = 0;
  columns.forEach(({ values }, q) => (row = row * values.length + context[q]));
  const [J, C] = [primitive.nStyles, primitive.nCoordinates];
  contextTable ??= decode(table);
  const width = J + (primitive.rhythmic ? C : 2 * C) + 1;
  const values = contextTable.subarray(row * width, (row + 1) * width);
  const start = primitive.rhythmic ? null : values.subarray(J + C, J + 2 * C);
  const { amplitude } = state.conditions;
  const conditions = primitive.conditions(values.subarray(0, J), values.subarray(J, J + C), start, values[width - 1]);
  Object.assign(state, { conditions: { ...conditions, amplitude }, demo: -1, context });
  refresh();
}
let contextTable = null;

/** Builds the form. */
function buildControls() {
  const { dofs, contexts } = data;
  const demos = [element("option", { value: -1 }, "own conditions")];
  demoConditions.forEach(({ name }, m) => demos.push(element("option", { value: m }, name)));
  const menu = element("select", { id: "demo", className: "wide" }, ...demos);
  menu.addEventListener("change", () => Number(menu.value) >= 0 && selectDemo(Number(menu.value)));
  const row = element("div", { className: "row" }, element("label", { htmlFor: "demo" }, "Demonstration"), menu);
  const reset = element("button", { type: "button" }, "Reset");
  reset.addEventListener("click", () => selectDemo(data.demos.nominal));
  const groups = [row, reset];

  if (contexts) {
    choices = contexts.columns.map((column, q) => new Choice({ ...column, set: (index) => selectContext(q, index) }));
    state.context = choices.map(() => -1);
    groups.push(group("Context", true, choices));
  }
  const add = (title, open, specs) => {
    const made = specs.map((spec) => new Slider(spec));
    sliders.push(...made);
    groups.push(group(title, open, made));
  };
  const styles = Array.from({ length: primitive.nStyles }, (_, j) => demoConditions.map(({ style }) => style[j]));
  const widest = Math.max(...styles.map(spanOf));
  add("Style", true, styles.map((values, j) => ({
    label: `style ${j + 1}`,
    ...sliderRange(values, 0.4, 0.2 * widest || 1),
    get: () => state.conditions.style[j],
    set: (value) => change(({ style }) => (style[j] = value)),
  })));
  const of = (key) => dofs.names.map((name, d) => {
    const reach = drawnMovements.flatMap((_, m) => extremes(primitive.curve(drawn[m], 0, d)));
    const [low, high] = extremes(reach);
    return {
      label: labelled(`${key} ${name}`, dofs.units[d]),
      unit: dofs.units[d],
      ...sliderRange(demoConditions.map((demo) => demo[key === "start" ? "start" : "centre"][d]), 0.4, 0.25 * (high - low) || 1),
      get: () => state.conditions[key === "start" ? "start" : "centre"][d],
      set: (value) => change((conditions) => (conditions[key === "start" ? "start" : "centre"][d] = value)),
    };
  });
  const few = dofs.names.length <= 4;
  add(primitive.rhythmic ? "Anchor" : "Goal", few, of(centreName));
  if (!primitive.rhythmic) add("Start", few, of("start"));
  const taus = demoConditions.map(({ tau }) => tau);
  const [fastest, slowest] = extremes(taus);
  const time = [{
    label: "τ [s]", unit: "s", low: fastest / 2, high: slowest * 2, least: 1e-6,
    get: () => state.conditions.tau,
    set: (value) => change((conditions) => (conditions.tau = value)),
  }];
  if (primitive.rhythmic) {
    time.push({
      label: "amplitude", low: 0, high: 2, least: 0,
      get: () => state.conditions.amplitude,
      set: (value) => change((conditions) => (conditions.amplitude = value)),
    });
  }
  add(primitive.rhythmic ? "Time and amplitude" : "Time", true, time);

  const shown = data.coordinates.names.map((name, c) => {
    const box = element("input", { type: "checkbox", id: `show-${c}`, checked: data.panels.includes(c) });
    box.addEventListener("change", () => showStrip(c, box.checked));
    return element("div", {}, box, element("label", { htmlFor: `show-${c}` }, ` ${name}`));
  });
  const bends = element("input", { type: "checkbox", id: "accelerations" });
  bends.addEventListener("change", () => {
    state.accelerations = bends.checked;
    byId("curves").classList.toggle("three", bends.checked);
    strips.forEach((strip, c) => strip && (showStrip(c, false), showStrip(c, true)));
  });
  shown.push(element("div", {}, bends, element("label", { htmlFor: "accelerations" }, " accelerations")));
  groups.push(group("Diagrams", false, shown));
  const code = element("textarea", { id: "code", readOnly: true, "aria-label": "Call of rollout for this movement" });
  const save = element("button", { type: "button" }, "Save movement as CSV");
  save.addEventListener("click", saveCsv);
  groups.push(group("In Python", false, [code, save]));
  byId("controls").append(...groups);
  byId("controls").addEventListener("submit", (event) => event.preventDefault());
}

/** Builds the playback bar. */
function buildPlayer() {
  const play = element("button", { type: "button", id: "play" }, "Play");
  play.addEventListener("click", () => setPlaying(!state.playing));
  const share = element("input", { type: "range", id: "share", min: 0, max: 1, step: "any", value: 0, "aria-label": "Time" });
  share.addEventListener("input", () => {
    state.share = share.valueAsNumber;
    request();
  });
  const speeds = [0.1, 0.25, 0.5, 1, 2, 5].map((x) => element("option", { value: x }, `${x}×`));
  const speed = element("select", { "aria-label": "Speed of playback" }, ...speeds);
  speed.value = "1";
  speed.addEventListener("change", () => (state.speed = Number(speed.value)));
  byId("player").append(play, share, element("output", { id: "clock" }), speed);
}

function setPlaying(playing) {
  if (playing && state.share >= 1) state.share = 0;
  state.playing = playing;
  byId("play").textContent = playing ? "Pause" : "Play";
  before = 0;
  request();
}

/** Builds all diagrams. */
function buildDiagrams() {
  const { coordinates, dofs, kinematics } = data;
  const quantities = coordinates.names.map((name, c) => ({
    label: labelled(name, coordinates.units[c]), unit: coordinates.units[c], of: (each) => each.position[c],
  }));
  dofs.names.forEach((name, d) => quantities.push({
    label: labelled(`velocity of ${name}`, `${dofs.units[d] || "1"}/s`),
    unit: `${dofs.units[d]}/s`,
    of: (each) => each.velocity[d],
  }));
  const views = [new PathView(quantities, data.path, drawnMovements, request)];
  plane = new StylePlane(primitive.nStyles, demoConditions, (changes, demo) => {
    if (demo !== null) selectDemo(demo);
    else change(({ style }) => changes.forEach(([j, value]) => (style[j] = value)));
  });
  if (kinematics) views.unshift(new StickFigure(new Kinematics(kinematics), drawnMovements.slice(0, 12), request));
  followers = views;
  diagrams = [...views, plane];
  byId("views").append(...diagrams.map(({ figure }) => figure));
  diagrams.forEach((diagram) => resizes.observe(diagram.canvas));
  for (const c of data.panels) showStrip(c, true);
}
let plane = null;
let followers = [];
const resizes = new ResizeObserver(() => request());

/** Computes the movement of the present conditions and shows it. */
function refresh() {
  const from = performance.now();
  movement = primitive.movement(state.conditions);
  for (const diagram of diagrams) diagram.follow(diagram === plane ? state.conditions.style : movement);
  for (const slider of sliders) slider.show();
  choices.forEach((choice, q) => choice.show(state.context[q]));
  byId("demo").value = state.demo;
  state.work = performance.now() - from;
  clearTimeout(spoken);
  spoken = setTimeout(speak, 150);
  request();
}

/** Updates texts, when conditions have rested. */
function speak() {
  const duration = `${primitive.rhythmic ? "Period" : "Duration"} ${short(primitive.duration(state.conditions.tau))} s.`;
  const [limits, beyond] = limitText();
  byId("status").textContent = `${duration} ${limits}`;
  byId("status").classList.toggle("beyond", beyond);
  byId("code").value = code();
  for (const diagram of diagrams) diagram.summarise();
}

/** Returns the call of `rollout` for the movement. */
function code() {
  const { style, centre, start, amplitude, tau } = state.conditions;
  const list = (values) => `[${Array.from(values).join(", ")}]`;
  const lines = [`style=${list(style)}`, `${centreName}=${list(primitive.toPosition(centre, primitive.centre))}`];
  if (start) lines.push(`start=${list(primitive.toPosition(start, 0))}`);
  if (amplitude !== 1) lines.push(`amplitude=${amplitude}`);
  lines.push(`tau=${tau}`, `dt=${primitive.duration(tau) / primitive.steps}`);
  return `model.rollout(\n    ${lines.join(",\n    ")},\n)`;
}

/** Returns the movement with the columns of Trajectory.to_csv. */
function csv() {
  const { coordinates, dofs } = data;
  const head = (labels, suffix, per) => labels.names.map((name, i) =>
    labels.units[i] ? `${name}${suffix} [${labels.units[i]}${per}]` : `${name}${suffix}`);
  const columns = [movement.time, ...movement.position, ...movement.velocity, ...movement.acceleration];
  const names = ["t", ...head(coordinates, "", ""), ...head(dofs, "_velocity", "/s"), ...head(dofs, "_acceleration", "/s²")];
  const quoted = names.map((name) => (/[",\n]/.test(name) ? `"${name.replaceAll('"', '""')}"` : name));
  const rows = Array.from(movement.time, (_, k) => columns.map((column) => column[k]).join(","));
  return [quoted.join(","), ...rows, ""].join("\n");
}

/** Saves the movement. */
function saveCsv() {
  const link = element("a", { download: "movement.csv" });
  link.href = URL.createObjectURL(new Blob([csv()], { type: "text/csv" }));
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

function request() {
  if (!requested) requestAnimationFrame(frame);
  requested = true;
}

/** Draws one frame; during playback, time advances with that of the screen. */
function frame(now) {
  requested = false;
  const from = performance.now();
  const duration = primitive.duration(state.conditions.tau);
  if (state.playing) {
    state.share += before ? ((now - before) / 1000 / duration) * state.speed : 0;
    before = now;
    if (state.share >= 1) {
      // Without motion on its own beyond what was asked for, playback stops at the end.
      const rests = matchMedia("(prefers-reduced-motion: reduce)").matches;
      state.share = rests ? 1 : state.share % 1;
      if (rests) setPlaying(false);
    }
  }
  const share = byId("share");
  if (share.valueAsNumber !== state.share && document.activeElement !== share || state.playing) share.value = state.share;
  const clock = `${short(state.share * duration)} s`;
  share.setAttribute("aria-valuetext", clock);
  byId("clock").value = `${(state.share * duration).toFixed(2)} s`;
  for (const diagram of diagrams) {
    diagram.share = state.share;
    diagram.measure();
    diagram.draw(colours);
  }
  frames.push({ at: now, work: performance.now() - from + (state.work ?? 0) });
  state.work = 0;
  if (frames.length > 600) frames.shift();
  if (state.playing) request();
}

function start() {
  byId("about").textContent = data.about;
  byId("footer").append(...data.notes.map((note) => element("p", {}, note)));
  state.conditions = copied(demoConditions[data.demos.nominal]);
  buildControls();
  buildPlayer();
  buildDiagrams();
  refresh();
  speak();
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    colours = palette();
    request();
  });
  // For programs that drive the page.
  window.explorer = { state, frames, primitive, movement: () => movement, csv, plane, followers };
}

start();
