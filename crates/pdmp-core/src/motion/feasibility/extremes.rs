//! Extremes of sampled movements between their samples.
//!
//! In a cell of length h between two samples, with s = t/h, position and velocity are the cubics with the values and
//! derivatives of both ends, and the acceleration is the derivative of the velocity. All of them are linear in the samples,
//! hence in the conditions of the movement.

use ndarray::{Array2, ArrayView1};

use crate::model::responses::Derivative;
use crate::motion::trajectory::Trajectory;
use crate::validate::row_major;

/// Minimum length of a cell with extremes inside, relative to the duration: differences of velocities over shorter ones are
/// rounding errors, and a movement hardly bends there.
const MIN_LENGTH: f64 = 1e-7;
/// Maximum of s(1 − s)², the cubic of a slope at an end.
const SLOPE_EXCURSION: f64 = 4.0 / 27.0;

/// Sampled movement.
#[derive(Clone, Debug)]
pub(super) struct Movement {
    /// Times (T,), in seconds.
    time: Vec<f64>,
    /// Positions, velocities and accelerations (D, T), by DoFs, along which extremes are searched.
    curves: [Array2<f64>; 3],
}

/// Place on a movement: a cell, and the share s of its length.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    cell: usize,
    share: f64,
}

impl Place {
    /// Place of the first sample.
    pub(super) const START: Self = Self { cell: 0, share: 0.0 };
}

impl From<Trajectory> for Movement {
    fn from(Trajectory { time, position, velocity, acceleration }: Trajectory) -> Self {
        let by_dofs = |curve: Array2<f64>| curve.t().as_standard_layout().into_owned();
        Self { time, curves: [position, velocity, acceleration].map(by_dofs) }
    }
}

impl Movement {
    /// Returns the difference to another movement at the same times, divided by `scale` (D,).
    pub(super) fn difference(mut self, other: &Self, scale: &[f64]) -> Self {
        let scale = ArrayView1::from(scale).insert_axis(ndarray::Axis(1));
        for (curve, other) in self.curves.iter_mut().zip(&other.curves) {
            *curve -= other;
            *curve /= &scale;
        }
        self
    }

    /// Adds multiples of a response at the same times, with the factor of each DoF.
    pub(super) fn add(&mut self, response: &Self, factor: impl Fn(usize) -> f64) {
        for (curve, response) in self.curves.iter_mut().zip(&response.curves) {
            for (dof, (mut curve, response)) in curve.rows_mut().into_iter().zip(response.rows()).enumerate() {
                curve.scaled_add(factor(dof), &response);
            }
        }
    }

    /// Returns the time of a place, in seconds.
    pub(super) fn time(&self, Place { cell, share }: Place) -> f64 {
        self.time[cell] + share * (self.time[cell + 1] - self.time[cell])
    }

    /// Returns the value of a DoF at a place.
    pub(super) fn value(&self, derivative: Derivative, dof: usize, Place { cell, share }: Place) -> f64 {
        let curve = self.curve(derivative, dof);
        if share == 0.0 { curve[cell] } else { self.cubic(derivative, dof, cell).at(share) }
    }

    /// Returns the largest value of ±y, ±ẏ or ±ÿ of a DoF, and its place.
    pub(super) fn largest(&self, derivative: Derivative, dof: usize, sign: f64) -> (f64, Place) {
        let mut largest = (f64::NEG_INFINITY, Place::START);
        self.visit(derivative, dof, sign, |value, place| {
            if value > largest.0 {
                largest = (value, place);
            }
            largest.0
        });
        largest
    }

    /// Calls `visit` in order of time with the values of ±y, ±ẏ or ±ÿ of a DoF at samples, and at extremes between them that
    /// are above the number it returned last.
    pub(super) fn visit(
        &self,
        derivative: Derivative,
        dof: usize,
        sign: f64,
        mut visit: impl FnMut(f64, Place) -> f64,
    ) {
        // Together with the curve, these samples determine its course in a cell.
        let companion = match derivative {
            Derivative::Position | Derivative::Acceleration => Derivative::Velocity,
            Derivative::Velocity => Derivative::Acceleration,
        };
        let (curve, companion) = (self.curve(derivative, dof), self.curve(companion, dof));
        let last = self.time.len() - 1;
        let min_length = MIN_LENGTH * self.time[last];
        for (cell, ((time, ends), companions)) in
            self.time.windows(2).zip(curve.windows(2)).zip(companion.windows(2)).enumerate()
        {
            let least = visit(sign * ends[0], Place { cell, share: 0.0 });
            let length = time[1] - time[0];
            let excursion = match derivative {
                Derivative::Position | Derivative::Velocity => {
                    SLOPE_EXCURSION * length * (companions[0].abs() + companions[1].abs())
                }
                // A parabola with this mean over the cell.
                Derivative::Acceleration => {
                    (1.5 * (companions[1] - companions[0]) / length - 0.75 * (ends[0] + ends[1])).abs()
                }
            };
            if length < min_length || (sign * ends[0]).max(sign * ends[1]) + excursion <= least {
                continue;
            }
            let cubic = self.cubic(derivative, dof, cell);
            for share in cubic.turns() {
                let value = sign * cubic.at(share);
                if value > least {
                    visit(value, Place { cell, share });
                }
            }
        }
        visit(sign * curve[last], Place { cell: last - 1, share: 1.0 });
    }

    /// Returns the samples of a DoF.
    fn curve(&self, derivative: Derivative, dof: usize) -> &[f64] {
        let n = self.time.len();
        &row_major(&self.curves[derivative as usize])[dof * n..(dof + 1) * n]
    }

    /// Returns the curve of a DoF on a cell.
    fn cubic(&self, derivative: Derivative, dof: usize, cell: usize) -> Cubic {
        let length = self.time[cell + 1] - self.time[cell];
        let hermite = |value: Derivative, slope: Derivative| {
            let (curve, slopes) = (self.curve(value, dof), self.curve(slope, dof));
            Cubic::hermite([curve[cell], curve[cell + 1]], [slopes[cell] * length, slopes[cell + 1] * length])
        };
        match derivative {
            Derivative::Position => hermite(Derivative::Position, Derivative::Velocity),
            Derivative::Velocity => hermite(Derivative::Velocity, Derivative::Acceleration),
            Derivative::Acceleration => hermite(Derivative::Velocity, Derivative::Acceleration).derivative(length),
        }
    }
}

/// Coefficients of c₀ + c₁s + c₂s² + c₃s³.
struct Cubic([f64; 4]);

impl Cubic {
    /// Returns the cubic with given values, and slopes per cell, at both ends.
    fn hermite([from, to]: [f64; 2], [slope, end_slope]: [f64; 2]) -> Self {
        let rise = to - from;
        Self([from, slope, 3.0 * rise - 2.0 * slope - end_slope, slope + end_slope - 2.0 * rise])
    }

    /// Returns the derivative with respect to time in a cell of a given length.
    fn derivative(&self, length: f64) -> Self {
        let [_, slope, square, cube] = self.0;
        Self([slope / length, 2.0 * square / length, 3.0 * cube / length, 0.0])
    }

    fn at(&self, s: f64) -> f64 {
        let [constant, slope, square, cube] = self.0;
        constant + s * (slope + s * (square + s * cube))
    }

    /// Returns the shares 0 < s < 1 at which the derivative is zero.
    fn turns(&self) -> impl Iterator<Item = f64> {
        let [_, slope, square, cube] = self.0;
        // Half the sum that does not cancel; NaN without real roots.
        let half = -(square + (square * square - 3.0 * slope * cube).sqrt().copysign(square));
        [half / (3.0 * cube), slope / half].into_iter().filter(|s| 0.0 < *s && *s < 1.0)
    }
}
