//! Conditions of the movements of a batch.

use std::sync::Arc;

use ndarray::{Array2, ArrayView1, aview1};

use crate::dynamics::additional_forcing::AdditionalForcing;
use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::model::Coordinates;
use crate::model::conditions::{
    Conditions, MAX_STYLE_MAGNITUDE, check_amplitude, check_phase, check_style, reject_for_kind, reject_goal_velocity,
};
use crate::model::primitive::Primitive;
use crate::validate::{check_matrix, check_vector, zeros};

/// Largest relative difference of time constants that count as equal: the rounding of predicted durations.
const MAX_DIFFERENCE: f64 = 1e-9;

/// One vector (n,) for all movements of a batch, or one for each.
#[derive(Clone, Debug, PartialEq)]
pub enum PerMovement {
    /// One vector (n,) for all movements.
    All(Vec<f64>),
    /// One vector for each of B movements (B, n).
    Each(Array2<f64>),
}

/// Conditions of the movements of a batch, with the names of [`Conditions`]. The default of each is the value of the
/// nominal demonstration.
///
/// The number of movements is the number of rows of the conditions given for each of them, or one without such conditions.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BatchConditions {
    /// Styles s (J,).
    pub style: Option<PerMovement>,
    /// Goals g (D,) of discrete movements.
    pub goal: Option<PerMovement>,
    /// Anchors y_a (D,) of rhythmic movements.
    pub anchor: Option<PerMovement>,
    /// Start positions (D,). The default of rhythmic movements is their limit cycle at φ = 0.
    pub start: Option<PerMovement>,
    /// Start velocities (D,), per second. The default is the velocity of the demonstrated movement.
    pub velocity: Option<PerMovement>,
    /// Final velocities (D,) of discrete movements, per second. The default is the velocity of the demonstrated movement.
    pub goal_velocity: Option<PerMovement>,
    /// Amplitudes r₀ (1,) of rhythmic movements. The default is 1.
    pub amplitude: Option<PerMovement>,
    /// Time constants τ (1,), in seconds. Different ones cost a rollout of each movement.
    pub tau: Option<PerMovement>,
    /// Times in the segments of the movement (K,), in seconds, in place of τ. They cost a rollout of each movement.
    pub segment_durations: Option<PerMovement>,
    /// Phases φ (1,) at which rhythmic movements start, in rad. They cost a rollout of each movement.
    pub phase: Option<PerMovement>,
    /// Common additional forcing. The default is none.
    pub forcing: Option<Arc<AdditionalForcing>>,
}

impl BatchConditions {
    /// Returns conditions that all movements share.
    ///
    /// ```
    /// # use ndarray::array;
    /// # use pdmp_core::{Conditions, Demonstration, FitOptions, Kind, fit};
    /// # use pdmp_core::motion::{BatchConditions, PerMovement};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// let mut conditions = BatchConditions::shared(model.primitive(), model.conditions(&[1])?)?;
    /// conditions.goal = Some(PerMovement::Each(array![[1.0, 0.0], [1.2, 0.1]]));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// A τ together with segment durations, or durations that do not fit the primitive.
    pub fn shared(primitive: &Primitive, conditions: Conditions) -> Result<Self> {
        conditions.time_constant(primitive)?;
        let Conditions { style, goal, anchor, start, velocity, goal_velocity, .. } = conditions;
        let Conditions { amplitude, tau, segment_durations, phase, forcing, .. } = conditions;
        let all = |vector: Option<Vec<f64>>| vector.map(PerMovement::All);
        let number = |number: Option<f64>| number.map(PerMovement::from);
        Ok(Self {
            style: all(style),
            goal: all(goal),
            anchor: all(anchor),
            start: all(start),
            velocity: all(velocity),
            goal_velocity: all(goal_velocity),
            amplitude: number(amplitude),
            tau: number(tau),
            segment_durations: all(segment_durations),
            phase: number(phase),
            forcing,
        })
    }

    /// Returns the conditions of one movement each.
    ///
    /// ```
    /// # use pdmp_core::{Conditions, Demonstration, FitOptions, Kind, fit};
    /// # use pdmp_core::motion::{BatchConditions, PerMovement};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// let near = Conditions { goal: Some(vec![1.0, 0.0]), ..Conditions::default() };
    /// let far = Conditions { goal: Some(vec![1.2, 0.1]), ..Conditions::default() };
    /// let conditions = BatchConditions::each(model.primitive(), &[near, far])?;
    /// assert_eq!(conditions.goal, Some(PerMovement::Each(ndarray::array![[1.0, 0.0], [1.2, 0.1]])));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// As for [`BatchConditions::shared`]; vectors of a wrong length; velocities, segment durations of several segments, or
    /// starts of rhythmic movements, that only some of the conditions have; additional forcings that differ.
    pub fn each(primitive: &Primitive, conditions: &[Conditions]) -> Result<Self> {
        let nominal = Conditions::default().complete(primitive)?;
        let (n_dofs, n_styles) = (primitive.n_dofs(), primitive.n_styles());
        let position = (primitive.n_coordinates(), primitive.per_coordinate());
        let centre = Some(nominal.centre);
        let outside =
            Conditions { goal: centre.clone(), anchor: centre, start: nominal.start, ..Conditions::default() };
        let Conditions { goal, anchor, start, .. } = match primitive.coordinates() {
            Some(coordinates) => coordinates.of_dofs(outside),
            None => outside,
        };
        let rows = |name, (n, per): (usize, _), default: Option<&[f64]>, of: fn(&Conditions) -> &Option<Vec<f64>>| {
            let mut rows = zeros("conditions", (conditions.len(), n))?;
            for (mut row, one) in rows.rows_mut().into_iter().zip(conditions) {
                let vector = of(one).as_deref().or(default).ok_or(Error::Single { name })?;
                check_vector(name, vector, n, per)?;
                row.assign(&aview1(vector));
            }
            Ok(Some(PerMovement::Each(rows)))
        };
        let optional = |name, size, default: Option<&[f64]>, of: fn(&Conditions) -> &Option<Vec<f64>>| {
            let given = conditions.iter().any(|one| of(one).is_some());
            if given { rows(name, size, default, of) } else { Ok(None) }
        };
        let taus = conditions.iter().map(|one| one.time_constant(primitive)).collect::<Result<Vec<_>>>()?;
        let is_warped = conditions.iter().any(|one| one.segment_durations.as_ref().is_some_and(|all| all.len() > 1));
        let is_paced = conditions.iter().any(|one| one.tau.is_some() || one.segment_durations.is_some());
        let n_segments = conditions.iter().find_map(|one| one.segment_durations.as_ref()).map_or(1, Vec::len);
        let numbers = |given: bool, of: &dyn Fn(usize) -> f64| {
            given.then(|| PerMovement::Each(Array2::from_shape_fn((conditions.len(), 1), |(b, _)| of(b))))
        };
        let has_amplitude = conditions.iter().any(|one| one.amplitude.is_some());
        let has_phase = conditions.iter().any(|one| one.phase.is_some());
        Ok(Self {
            style: rows("style", (n_styles, "style dimension"), Some(&nominal.style), |one| &one.style)?,
            goal: optional("goal", position, goal.as_deref(), |one| &one.goal)?,
            anchor: optional("anchor", position, anchor.as_deref(), |one| &one.anchor)?,
            start: optional("start", position, start.as_deref(), |one| &one.start)?,
            velocity: optional("velocity", (n_dofs, "DoF"), None, |one| &one.velocity)?,
            goal_velocity: optional("goal_velocity", (n_dofs, "DoF"), None, |one| &one.goal_velocity)?,
            amplitude: numbers(has_amplitude, &|b| conditions[b].amplitude.unwrap_or(1.0)),
            tau: numbers(is_paced && !is_warped, &|b| taus[b]),
            segment_durations: match is_warped {
                true => rows("segment_durations", (n_segments, "segment"), None, |one| &one.segment_durations)?,
                false => None,
            },
            phase: numbers(has_phase, &|b| conditions[b].phase.unwrap_or(0.0)),
            forcing: common_forcing(conditions)?,
        })
    }

    /// Converts conditions in coordinates to those of the degrees of freedom.
    ///
    /// # Errors
    /// Vectors that do not fit the coordinates, or different numbers of movements.
    pub(crate) fn in_dofs(mut self, coordinates: &Coordinates) -> Result<Self> {
        let given = [&self.goal, &self.anchor, &self.start, &self.velocity, &self.goal_velocity];
        let mut n_movements = None;
        for (name, rows) in self.named() {
            if let Some(PerMovement::Each(rows)) = rows {
                let (found, expected) = (rows.nrows(), *n_movements.get_or_insert(rows.nrows()));
                if found != expected {
                    return Err(Error::Rows { name, expected, found });
                }
            }
        }
        let n_dofs = coordinates.dofs().n_dofs();
        let mut converted = [(); 5].map(|()| Array2::zeros((n_movements.unwrap_or(1), n_dofs)));
        for b in 0..n_movements.unwrap_or(1) {
            let [goal, anchor, start, velocity, goal_velocity] =
                given.map(|rows| rows.as_ref().map(|rows| rows.row(b).to_vec()));
            let Conditions { tau, segment_durations, .. } = self.timing(b);
            let vectors = Conditions { goal, anchor, start, velocity, goal_velocity, ..Conditions::default() };
            let one = Conditions { tau, segment_durations, ..vectors };
            let one = coordinates.constant_in_dofs(&one)?;
            let vectors = [one.goal, one.anchor, one.start, one.velocity, one.goal_velocity];
            for (rows, vector) in converted.iter_mut().zip(vectors) {
                vector.iter().for_each(|vector| rows.row_mut(b).assign(&aview1(vector)));
            }
        }
        let [goal, anchor, start, velocity, goal_velocity] = converted.map(|rows| match n_movements {
            Some(_) => PerMovement::Each(rows),
            None => PerMovement::All(rows.into_raw_vec_and_offset().0),
        });
        for (to, from) in [
            (&mut self.goal, goal),
            (&mut self.anchor, anchor),
            (&mut self.start, start),
            (&mut self.velocity, velocity),
            (&mut self.goal_velocity, goal_velocity),
        ] {
            if to.is_some() {
                *to = Some(from);
            }
        }
        Ok(self)
    }

    /// Checks vectors and kind, and returns the number of movements.
    pub(crate) fn check(&self, primitive: &Primitive) -> Result<usize> {
        let (n_dofs, kind) = (primitive.n_dofs(), primitive.kind());
        reject_for_kind(kind, "anchor", kind == Kind::Discrete && self.anchor.is_some())?;
        reject_for_kind(kind, "goal", kind == Kind::Rhythmic && self.goal.is_some())?;
        reject_goal_velocity(primitive, self.goal_velocity.is_some())?;
        if let Some(forcing) = &self.forcing {
            forcing.check(primitive.canonical(), n_dofs)?;
        }
        let size = |name: &str, found: usize| match name {
            "amplitude" | "tau" | "phase" => (1, "movement"),
            // The time constant below refuses a wrong number of them.
            "segment_durations" => (found, "segment"),
            _ => (n_dofs, "DoF"),
        };
        let mut n_movements = None;
        for (name, vectors) in self.named() {
            match vectors {
                None => {}
                Some(PerMovement::All(style)) if name == "style" => check_style(style, primitive.n_styles())?,
                Some(PerMovement::All(vector)) => {
                    let (n, per) = size(name, vector.len());
                    check_vector(name, vector, n, per)?;
                }
                Some(PerMovement::Each(rows)) => {
                    let (found, expected) = (rows.nrows(), *n_movements.get_or_insert(rows.nrows()));
                    if found != expected {
                        return Err(Error::Rows { name, expected, found });
                    }
                    let (n, per) = size(name, rows.ncols());
                    match name {
                        "style" => check_styles(rows, primitive.n_styles())?,
                        _ => check_rows(name, rows, n, per)?,
                    }
                }
            }
        }
        let n_movements = n_movements.unwrap_or(1);
        let n_timings = self.n_timings(n_movements);
        let is_each = n_timings > 1;
        for b in 0..n_timings {
            let one = self.timing(b);
            reject_for_kind(kind, "amplitude", kind == Kind::Discrete && one.amplitude.is_some())?;
            let check = || {
                one.amplitude.map_or(Ok(()), check_amplitude)?;
                one.phase.map_or(Ok(()), |phase| check_phase(kind, phase))?;
                one.time_constant(primitive)
            };
            check().map_err(|error| if is_each { error.in_movement(b) } else { error })?;
        }
        Ok(n_movements)
    }

    /// Returns the conditions that may differ between the movements, by name.
    fn named(&self) -> [(&'static str, &Option<PerMovement>); 10] {
        [
            ("style", &self.style),
            ("goal", &self.goal),
            ("anchor", &self.anchor),
            ("start", &self.start),
            ("velocity", &self.velocity),
            ("goal_velocity", &self.goal_velocity),
            ("amplitude", &self.amplitude),
            ("tau", &self.tau),
            ("segment_durations", &self.segment_durations),
            ("phase", &self.phase),
        ]
    }

    /// Returns the number of movements, of `n`, from which on the timings repeat: one if all have the same.
    fn n_timings(&self, n: usize) -> usize {
        let vectors = [&self.amplitude, &self.tau, &self.segment_durations, &self.phase];
        if vectors.iter().any(|vectors| matches!(vectors, Some(PerMovement::Each(_)))) { n } else { n.min(1) }
    }

    /// Returns amplitude, time constant or segment durations, and phase of movement `b`.
    fn timing(&self, b: usize) -> Conditions {
        let vector = |rows: &Option<PerMovement>| rows.as_ref().map(|rows| rows.row(b).to_vec());
        let number = |rows: &Option<PerMovement>| rows.as_ref().map(|rows| rows.row(b)[0]);
        Conditions {
            amplitude: number(&self.amplitude),
            tau: number(&self.tau),
            segment_durations: vector(&self.segment_durations),
            phase: number(&self.phase),
            ..Conditions::default()
        }
    }

    /// Returns the conditions of `n` movements.
    pub(super) fn movements(&self, n: usize) -> Vec<Conditions> {
        (0..n).map(|b| self.movement(b)).collect()
    }

    /// Returns the conditions of movement `b`.
    pub(super) fn movement(&self, b: usize) -> Conditions {
        let vector = |rows: &Option<PerMovement>| rows.as_ref().map(|rows| rows.row(b).to_vec());
        Conditions {
            style: vector(&self.style),
            goal: vector(&self.goal),
            anchor: vector(&self.anchor),
            start: vector(&self.start),
            velocity: vector(&self.velocity),
            goal_velocity: vector(&self.goal_velocity),
            forcing: self.forcing.clone(),
            ..self.timing(b)
        }
    }

    /// Returns the τ of all `n` movements, which then have response curves in common: linear time from phase 0.
    pub(super) fn common_tau(&self, primitive: &Primitive, n: usize) -> Result<Option<f64>> {
        let mut common = None;
        for b in 0..self.n_timings(n) {
            let one = self.timing(b);
            let is_warped = one.segment_durations.as_ref().is_some_and(|durations| durations.len() > 1);
            let tau = one.time_constant(primitive)?;
            let first = *common.get_or_insert(tau);
            if is_warped || one.phase.is_some_and(|phase| phase != 0.0) || (tau - first).abs() > MAX_DIFFERENCE * first
            {
                return Ok(None);
            }
        }
        Ok(Some(common.unwrap_or(primitive.tau)))
    }
}

impl From<f64> for PerMovement {
    /// Returns a number that all movements have.
    fn from(number: f64) -> Self {
        Self::All(vec![number])
    }
}

impl PerMovement {
    /// Returns the vector (n,) of movement `b`.
    pub(crate) fn row(&self, b: usize) -> ArrayView1<'_, f64> {
        match self {
            Self::All(row) => aview1(row),
            Self::Each(rows) => rows.row(b),
        }
    }
}

/// Returns the common additional forcing.
fn common_forcing(conditions: &[Conditions]) -> Result<Option<Arc<AdditionalForcing>>> {
    let forcing = conditions.first().and_then(|first| first.forcing.clone());
    if conditions.iter().any(|each| each.forcing != forcing) {
        let problem = "differs between the movements: a batch has one; compute rollouts one by one";
        return Err(Error::Argument { name: "forcing", problem });
    }
    Ok(forcing)
}

/// Checks that rows have `expected` finite elements, one per `per`.
fn check_rows(name: &'static str, rows: &Array2<f64>, expected: usize, per: &'static str) -> Result<()> {
    if rows.ncols() != expected {
        return Err(Error::Length { name, expected, found: rows.ncols(), per });
    }
    check_matrix(name, rows.view())
}

/// Checks styles (B, J); the row-wise counterpart of [`check_style`].
fn check_styles(styles: &Array2<f64>, n_styles: usize) -> Result<()> {
    check_rows("style", styles, n_styles, "style dimension")?;
    match styles.indexed_iter().find(|(_, s)| s.abs() > MAX_STYLE_MAGNITUDE) {
        Some(((row, column), &value)) => {
            Err(Error::Magnitude { name: "style", row, column, value, limit: MAX_STYLE_MAGNITUDE })
        }
        None => Ok(()),
    }
}
