// Movement under constant conditions, from the curves that Model._unit_curves computes.

/** Decodes an array: {shape, f64 or f32: base64 of little-endian numbers}. */
function decode(packed) {
  const bytes = Uint8Array.from(atob(packed.f64 ?? packed.f32), (c) => c.charCodeAt(0));
  const numbers = packed.f64 !== undefined ? Float64Array : Float32Array;
  return new numbers(bytes.buffer);
}

const dot = (a, b) => a.reduce((sum, x, i) => sum + x * b[i], 0);
const cross = (a, b) => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];
const inverse = (q) => [q[0], -q[1], -q[2], -q[3]];

/** Returns the product of two quaternions w, x, y, z. */
function product(a, b) {
  return [
    a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
    a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
    a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
    a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
  ];
}

/** Returns a vector, rotated by a unit quaternion. */
function rotated(q, v) {
  const axis = [q[1], q[2], q[3]];
  const once = cross(axis, v);
  const twice = cross(axis, once);
  return v.map((x, i) => x + 2 * (q[0] * once[i] + twice[i]));
}

/** Returns the unit quaternion of a rotation vector. */
function exponential(delta) {
  const square = dot(delta, delta);
  const angle = Math.sqrt(square);
  const sine = square < 1e-6 ? 0.5 - square / 48 + square ** 2 / 3840 : Math.sin(angle / 2) / angle;
  return [Math.cos(angle / 2), ...delta.map((x) => sine * x)];
}

/** Returns the rotation vector of a unit quaternion that is closest to a reference. */
function logarithm(q, near) {
  const sign = q[0] < 0 ? -1 : 1;
  const part = [sign * q[1], sign * q[2], sign * q[3]];
  const sine = Math.hypot(...part);
  const angle = 2 * Math.atan2(sine, Math.abs(q[0]));
  const delta = part.map((x) => (sine > 1e-10 ? (x * angle) / sine : 2 * x));
  const size = Math.hypot(...near);
  if (size <= Math.PI - angle) return delta;
  const axis = angle > 1e-10 ? delta.map((x) => x / angle) : near.map((x) => x / size);
  const turns = Math.round((dot(axis, near) - angle) / (2 * Math.PI));
  return delta.map((x, i) => x + turns * 2 * Math.PI * axis[i]);
}

/**
 * Returns c₁ = (1 − cos θ)/θ², c₂ = (θ − sin θ)/θ³ and their derivatives with respect to θ²/2, with which the right
 * Jacobian of the exponential is J(δ)v = v − c₁ δ×v + c₂ δ×(δ×v).
 */
function jacobianCoefficients(square) {
  if (square > 1) {
    const angle = Math.sqrt(square);
    const [s, c] = [Math.sin(angle), 2 * Math.sin(angle / 2) ** 2];
    return [
      c / square,
      (angle - s) / (square * angle),
      (angle * s - 2 * c) / square ** 2,
      (angle * c - 3 * (angle - s)) / (square ** 2 * angle),
    ];
  }
  // Taylor series in θ²: the terms of c₁ are those of the cosine, those of c₂ of the sine.
  const sums = [0, 0, 0, 0];
  let [power, before, even, odd] = [1, 0, 1 / 2, 1 / 6];
  for (let k = 0; k < 12; k++) {
    sums[0] += even * power;
    sums[1] += odd * power;
    sums[2] += 2 * k * even * before;
    sums[3] += 2 * k * odd * before;
    [before, power] = [power, power * square];
    even /= -(2 * k + 3) * (2 * k + 4);
    odd /= -(2 * k + 4) * (2 * k + 5);
  }
  return sums;
}

/** Returns rotation, angular velocity and acceleration in the body frame of q̄ ⊗ exp(δ), from those of q̄ and δ, δ̇, δ̈. */
function turned(mean, omega, alpha, delta, slope, bend) {
  const [first, second, firstSlope, secondSlope] = jacobianCoefficients(dot(delta, delta));
  const turn = exponential(delta);
  const back = inverse(turn);
  const [once, carried] = [cross(delta, slope), rotated(back, omega)];
  const twice = cross(delta, once);
  const own = slope.map((x, i) => x - first * once[i] + second * twice[i]);
  const onceBent = cross(delta, bend);
  const twiceBent = cross(delta, onceBent);
  const [coriolis, change, carriedAlpha] = [cross(carried, own), cross(slope, once), rotated(back, alpha)];
  const growth = dot(delta, slope);
  const acceleration = bend.map(
    (x, i) =>
      x - first * onceBent[i] + second * twiceBent[i] + carriedAlpha[i] + coriolis[i] + second * change[i] +
      growth * (secondSlope * twice[i] - firstSlope * once[i]),
  );
  return [product(mean, turn), own.map((x, i) => x + carried[i]), acceleration];
}

/** Movements of a model. Conditions are {style, centre, start, amplitude, tau}, positions among them in degrees of freedom. */
class Primitive {
  constructor(data) {
    Object.assign(this, data);
    this.rhythmic = data.kind === "rhythmic";
    this.nStyles = data.n_styles;
    this.nDofs = data.dofs.names.length;
    this.nCoordinates = data.coordinates.names.length;
    this.nSamples = data.steps + 1;
    this.curves = decode(data.styles);
    this.startCurves = decode(data.start);
    this.means = data.rotations.map((_, r) => decode(data.means).subarray(r * 10 * this.nSamples));
  }

  /** Returns the duration or period in seconds at a time constant. */
  duration(tau) {
    return this.extent * tau;
  }

  /** Returns the mean of a rotation at a sample: quaternion, angular velocity and acceleration per unit of the clock. */
  mean(r, k) {
    const row = Array.from(this.means[r].subarray(10 * k, 10 * k + 10));
    return [row.slice(0, 4), row.slice(4, 7), row.slice(7)];
  }

  /** Returns the columns w, x, y, z of a rotation. */
  columns({ column, order }) {
    return (order === "wxyz" ? [0, 1, 2, 3] : [3, 0, 1, 2]).map((i) => column + i);
  }

  /** Converts a position in coordinates to degrees of freedom, at the sample to which it is relative. */
  toDofs(position, sample, near) {
    const dofs = new Float64Array(this.nDofs);
    for (const [column, dof] of this.plain) dofs[dof] = position[column];
    this.rotations.forEach((rotation, r) => {
      const q = this.columns(rotation).map((column) => position[column]);
      const norm = Math.hypot(...q);
      const off = product(inverse(this.mean(r, sample)[0]), q.map((x) => x / norm));
      const reference = near ? Array.from(near.subarray(rotation.dof, rotation.dof + 3)) : [0, 0, 0];
      dofs.set(logarithm(off, reference), rotation.dof);
    });
    return dofs;
  }

  /** Converts degrees of freedom at a sample to a position in coordinates. */
  toPosition(dofs, sample) {
    const position = new Array(this.nCoordinates);
    for (const [column, dof] of this.plain) position[column] = dofs[dof];
    this.rotations.forEach((rotation, r) => {
      const delta = Array.from(dofs.slice(rotation.dof, rotation.dof + 3));
      const q = product(this.mean(r, sample)[0], exponential(delta));
      this.columns(rotation).forEach((column, i) => (position[column] = q[i]));
    });
    return position;
  }

  /** Returns conditions whose goal, or anchor, and start are given in coordinates. */
  conditions(style, centre, start, tau) {
    const inner = this.rhythmic ? null : this.toDofs(start, 0, null);
    return {
      style: Float64Array.from(style),
      centre: this.toDofs(centre, this.centre, inner),
      start: inner,
      amplitude: 1,
      tau,
    };
  }

  /** Computes one derivative of one degree of freedom over the samples. */
  curve({ style, centre, start, amplitude, tau }, derivative, dof) {
    const [T, D, J] = [this.nSamples, this.nDofs, this.nStyles];
    const [scale, offset] = [tau ** -derivative, derivative ? 0 : centre[dof]];
    const values = new Float64Array(T).fill(offset);
    if (!this.rhythmic) {
      const step = start[dof] - centre[dof];
      for (let k = 0; k < T; k++) values[k] += step * this.startCurves[derivative * T + k];
    }
    for (let j = 0; j < J; j++) {
      const [s, from] = [amplitude * style[j], (derivative * J + j) * T * D + dof];
      for (let k = 0; k < T; k++) values[k] += s * this.curves[from + k * D];
    }
    if (derivative) for (let k = 0; k < T; k++) values[k] *= scale;
    return values;
  }

  /** Computes times, positions by coordinate, velocities and accelerations by degree of freedom. */
  movement(conditions) {
    const dofs = [0, 1, 2].map((derivative) =>
      Array.from({ length: this.nDofs }, (_, dof) => this.curve(conditions, derivative, dof)),
    );
    const dt = this.duration(conditions.tau) / this.steps;
    const time = Float64Array.from({ length: this.nSamples }, (_, k) => k * dt);
    const position = new Array(this.nCoordinates);
    for (const [column, dof] of this.plain) position[column] = dofs[0][dof];
    const [, velocity, acceleration] = dofs;
    this.rotations.forEach((_, r) => this.rotate(r, 1 / conditions.tau, dofs, position));
    return { time, position, velocity, acceleration };
  }

  /** Writes the quaternion of a rotation, and replaces the derivatives of δ by angular velocity and acceleration. */
  rotate(r, rate, dofs, position) {
    const rotation = this.rotations[r];
    const columns = this.columns(rotation);
    for (const column of columns) position[column] = new Float64Array(this.nSamples);
    let before = null;
    for (let k = 0; k < this.nSamples; k++) {
      const [mean, omega, alpha] = this.mean(r, k);
      const at = dofs.map((curves) => [0, 1, 2].map((i) => curves[rotation.dof + i][k]));
      const clock = [omega.map((x) => x * rate), alpha.map((x) => x * rate ** 2)];
      let [q, ...derivatives] = turned(mean, ...clock, ...at);
      if (before && dot(q, before) < 0) q = q.map((x) => -x);
      if (this.frame === "world") derivatives = derivatives.map((v) => rotated(q, v));
      columns.forEach((column, i) => (position[column][k] = q[i]));
      derivatives.forEach((v, n) => v.forEach((x, i) => (dofs[n + 1][rotation.dof + i][k] = x)));
      before = q;
    }
  }
}

/** Returns the products of all pairs of components of a quaternion, relative to its squared length. */
function pairProducts(q) {
  const square = dot(q, q);
  return q.flatMap((a, i) => q.slice(i).map((b) => (a * b) / square));
}

/**
 * Points of a stick figure: sums of products of 1, cos q and sin q, or 1 and q, of the degrees of freedom, and of products of
 * two components of rotations.
 */
class Kinematics {
  constructor({ dimension, links, points }) {
    this.dimension = dimension;
    this.links = links;
    this.points = points.map((point) => ({ ...point, coefficients: decode(point.coefficients) }));
  }

  /** Returns the factors of a joint, or of the rotation from a column on. */
  static factors(position, column, turn) {
    if (turn === "rotation") return pairProducts(Array.from(position).slice(column, column + 4));
    if (turn === null) return [1, position[column]];
    const angle = (position[column] / turn) * 2 * Math.PI;
    return [1, Math.cos(angle), Math.sin(angle)];
  }

  /** Returns one point at a position. */
  point(p, position) {
    const { dofs, turns, coefficients } = this.points[p];
    let values = coefficients;
    dofs.forEach((dof, i) => {
      const factors = Kinematics.factors(position, dof, turns[i]);
      const rest = values.length / factors.length;
      const sums = new Float64Array(rest);
      factors.forEach((factor, f) => {
        for (let n = 0; n < rest; n++) sums[n] += factor * values[f * rest + n];
      });
      values = sums;
    });
    return Array.from(values);
  }

  /** Returns the points at a position. */
  at(position) {
    return this.points.map((_, p) => this.point(p, position));
  }
}
