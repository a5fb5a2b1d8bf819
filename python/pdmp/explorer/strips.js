// Diagrams over time of each coordinate, and limits.

/** Returns the limits of a derivative of a degree of freedom: lower and upper, infinite without one. */
function limitsOf(derivative, dof) {
  const { lower, upper, velocity, acceleration } = data.limits ?? {};
  if (derivative === 0) return [lower?.[dof] ?? -Infinity, upper?.[dof] ?? Infinity];
  const bound = (derivative === 1 ? velocity : acceleration)?.[dof] ?? Infinity;
  return [-bound, bound];
}

const strips = [];

/** Shows or hides the diagrams of a coordinate: position, velocity and acceleration of its degree of freedom. */
function showStrip(c, visible) {
  if (strips[c]) {
    diagrams = diagrams.filter((diagram) => !strips[c].diagrams.includes(diagram));
    strips[c].node.remove();
    strips[c] = null;
  }
  if (visible) {
    const made = curvesOf(c);
    const node = element("div", { className: "strip" }, ...made.map(({ figure }) => figure));
    const next = strips.find((strip, k) => k > c && strip);
    byId("curves").insertBefore(node, next ? next.node : null);
    strips[c] = { node, diagrams: made };
    diagrams.push(...made);
    made.forEach((diagram) => resizes.observe(diagram.canvas));
  }
  if (movement) refresh();
}

/** Returns the diagrams of a coordinate. */
function curvesOf(c) {
  const { coordinates, dofs, recordings } = data;
  const plain = data.plain.find(([column]) => column === c);
  const rotation = data.rotations.find(({ column }) => c >= column && c < column + 4);
  const dof = plain ? plain[1] : c - rotation.column < 3 ? rotation.dof + c - rotation.column : -1;
  const recorded = recordings?.map(({ time, position }) => {
    const [times, values] = [decode(time), decode(position)];
    const n = coordinates.names.length;
    return { time: times, values: times.map((_, k) => values[k * n + c]) };
  });
  const reproduced = (pick) => drawnMovements.map((each) => ({ time: each.time, values: pick(each) }));
  const diagram = (label, unit, pick, limits, demos) => new TimeCurve(label, unit, demos ?? reproduced(pick), limits, pick);
  const position = (each) => each.position[c];
  const name = coordinates.names[c];
  const unit = coordinates.units[c];
  const none = [-Infinity, Infinity];
  const made = [diagram(labelled(name, unit), unit, position, plain ? limitsOf(0, dof) : none, recorded)];
  if (dof < 0) return made;
  const derivatives = [["velocity", "/s", "velocity"], ["acceleration", "/s²", "acceleration"]];
  derivatives.slice(0, state.accelerations ? 2 : 1).forEach(([word, per, key], i) => {
    const own = plain ? `${word} of ${name}` : `angular ${word} ${"xyz"[dof - rotation.dof]}`;
    const ownUnit = `${dofs.units[dof] || (rotation ? "rad" : "1")}${per}`;
    made.push(diagram(labelled(own, ownUnit), ownUnit, (each) => each[key][dof], limitsOf(i + 1, dof)));
  });
  return made;
}

/** Returns the largest ratio of the movement to its limits as text, or "" without limits. */
function limitText() {
  if (!data.limits) return ["", false];
  let [worst, text] = [0, ""];
  const kinds = [["position", "position"], ["velocity", "velocity"], ["acceleration", "acceleration"]];
  kinds.forEach(([key, word], derivative) => {
    for (let d = 0; d < primitive.nDofs; d++) {
      const [lower, upper] = limitsOf(derivative, d);
      if (lower === -Infinity && upper === Infinity) continue;
      const column = data.plain.find(([, dof]) => dof === d)?.[0];
      const values = derivative ? movement[key][d] : movement.position[column];
      const [low, high] = extremes(values);
      const per = ["", "/s", "/s²"][derivative];
      const unit = per ? `${data.dofs.units[d] || "1"}${per}` : data.dofs.units[d];
      const size = derivative ? upper : Math.min(upper - lower, Math.max(Math.abs(lower), Math.abs(upper)));
      const excess = Math.max(high - upper, lower - low) / size;
      if (excess > worst) {
        const [value, bound] = high - upper > lower - low ? [high, upper] : [low, lower];
        worst = excess;
        text = `Beyond a limit: ${word} of ${data.dofs.names[d]} reaches ${`${short(value)} ${unit}`.trim()}, limit ${short(bound)}.`;
      }
    }
  });
  return [text || "Within the limits.", worst > 0];
}

