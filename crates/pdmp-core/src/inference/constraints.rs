//! Scalar constraints of via-points on a movement.

use super::linear_path::Samples;
use super::passage::{Constraint, Constraints, Jet, Prior};
use super::residual::Functional;
use super::via_points::{At, ViaPoint};
use crate::dynamics::canonical::{Canonical, turn};
use crate::dynamics::time_warp::WarpingFunction;
use crate::error::{Error, Result};
use crate::kind::Kind;
use crate::model::conditions::ResolvedConditions;
use crate::model::primitive::Primitive;
use crate::validate::{check_range, check_vector};

/// Distance of two places, or of a place from an end, that is rounding.
const SAME_PLACE: f64 = 1e-9;
/// Standard deviation of a position, relative to the range, below which the conditions fix it.
const FIXED: f64 = 1e-9;

/// Movement that points constrain.
pub(super) struct Request<'a> {
    pub(super) primitive: &'a Primitive,
    pub(super) conditions: &'a ResolvedConditions,
    pub(super) prior: &'a Prior<'a>,
    /// Ranges (D,), none of them zero.
    pub(super) scales: &'a [f64],
    pub(super) time: &'a WarpingFunction,
    /// Place from which on the movement departs from its conditions.
    pub(super) from: Option<f64>,
    /// Values of the parameters θ₀.
    pub(super) parameters: Vec<f64>,
}

/// A DoF with its position and velocity at a point.
type OfDof = (usize, Option<f64>, Option<f64>);

impl Request<'_> {
    /// Returns the constraints of points.
    ///
    /// # Errors
    /// As for [`super::through`].
    pub(super) fn constraints(&self, points: &[ViaPoint]) -> Result<Constraints> {
        let mut constraints = Constraints::default();
        for point in points {
            self.add(point, &mut constraints)?;
        }
        Ok(constraints)
    }

    /// Adds the constraints of a point.
    fn add(&self, point: &ViaPoint, constraints: &mut Constraints) -> Result<()> {
        let allowed = "must be a share of the range, finite and not negative";
        check_range("tolerance", point.tolerance, (0.0..=1e6).contains(&point.tolerance), allowed)?;
        let [v, rate] = self.place(point.at)?;
        let n = self.primitive.n_coordinates();
        let given = point.dofs.clone().unwrap_or_else(|| (0..n).collect());
        if let Some(&dof) = given.iter().find(|&&dof| dof >= n) {
            let allowed = "must be below the number of DoFs, or of coordinates with rotations";
            return Err(Error::Range { name: "dofs", value: dof as f64, allowed });
        }
        if given.is_empty() || (point.position.is_none() && point.velocity.is_none()) {
            let problem = "constrain nothing: give each a position or a velocity of at least one DoF";
            return Err(Error::Argument { name: "points", problem });
        }
        let dofs = self.primitive.dofs_of(&given);
        if let Some(position) = &point.position {
            check_vector("position", position, given.len(), "element of the point's dofs")?;
        }
        if let Some(velocity) = &point.velocity {
            check_vector("velocity", velocity, dofs.len(), "DoF of the point, of which a rotation has three")?;
        }
        for (dof, position, velocity) in self.of_dofs(point, &given, &dofs, [v, rate])? {
            if let Some(position) = position {
                let jet = self.jet(constraints, v, 0);
                self.constrain(constraints, [jet, dof], position, point.tolerance)?;
            }
            if let Some(velocity) = velocity {
                let jet = self.jet(constraints, v, 1);
                self.constrain(constraints, [jet, dof], velocity / rate, point.tolerance)?;
            }
        }
        Ok(())
    }

    /// Returns DoF, position and velocity of each constraint on a DoF, for coordinates with their DoFs.
    fn of_dofs(&self, point: &ViaPoint, given: &[usize], dofs: &[usize], [v, rate]: [f64; 2]) -> Result<Vec<OfDof>> {
        let at = |vector: &Option<Vec<f64>>, i: usize| vector.as_ref().map(|vector| vector[i]);
        let Some(coordinates) = self.primitive.coordinates() else {
            let all = dofs.iter().enumerate();
            return Ok(all.map(|(i, dof)| (*dof, at(&point.position, i), at(&point.velocity, i))).collect());
        };
        for rotation in coordinates.rotations() {
            let columns = rotation.columns.column..rotation.columns.column + 4;
            match columns.filter(|column| given.contains(column)).count() {
                0 => {}
                4 if point.position.is_none() => {
                    let problem = "of a rotation depends on its orientation: give the point a position, too, or leave the \
                                   rotation out of dofs";
                    return Err(Error::Argument { name: "velocity", problem });
                }
                4 => {}
                _ => {
                    let problem = "have a part of a quaternion: give all four of its coordinates or none";
                    return Err(Error::Argument { name: "dofs", problem });
                }
            }
        }
        // Coordinates that are not given are those of the prior mean.
        let extent = self.canonical().extent();
        let u = v * extent;
        let mean = self.jet_at(Functional { place: v, order: 0 }).mean;
        let mut position = vec![0.0; self.primitive.n_coordinates()];
        coordinates.to_position(u, &mean, &mut position);
        for (i, &coordinate) in given.iter().enumerate() {
            position[coordinate] = at(&point.position, i).unwrap_or(position[coordinate]);
        }
        coordinates.check("position", &position)?;
        let (mut places, mut velocities) = (vec![0.0; self.scales.len()], vec![0.0; self.scales.len()]);
        coordinates.to_dofs(u, &position, Some(&mean), &mut places);
        if let Some(velocity) = &point.velocity {
            dofs.iter().zip(velocity).for_each(|(dof, x)| velocities[*dof] = *x);
            coordinates.relative_velocity(u, &places, &mut velocities);
            coordinates.for_each_drift(u, &places, |dof, drift| {
                drift.iter().enumerate().for_each(|(i, drift)| velocities[dof + i] -= drift * rate * extent);
            });
        }
        let of = |vector: &Option<Vec<f64>>, values: &[f64], dof: usize| vector.as_ref().map(|_| values[dof]);
        Ok(dofs
            .iter()
            .map(|&dof| (dof, of(&point.position, &places, dof), of(&point.velocity, &velocities, dof)))
            .collect())
    }

    /// Adds the constraint that a derivative of a DoF has a value.
    fn constrain(
        &self,
        constraints: &mut Constraints,
        [jet, dof]: [usize; 2],
        value: f64,
        tolerance: f64,
    ) -> Result<()> {
        let Jet { functional: Functional { place: v, order }, rows, mean } = &constraints.jets[jet];
        let residual = value - mean[dof];
        let scale = self.scales[dof];
        let repeated = |other: &&Constraint| (other.jet, other.dof) == (jet, dof);
        if let Some(other) = constraints.rows.iter().find(repeated)
            && tolerance == 0.0
            && other.tolerance == 0.0
        {
            if (other.residual - residual).abs() <= SAME_PLACE * scale {
                return Ok(());
            }
            let problem = "differ at one place: leave one out, or give them a tolerance";
            return Err(Error::Argument { name: "points", problem });
        }
        let is_end = *v <= SAME_PLACE || *v >= 1.0 - SAME_PLACE;
        if self.canonical().kind() == Kind::Discrete && is_end && (*order > 0 || self.is_fixed(rows, dof)) {
            let problem = "constrain an end of the movement, which the conditions fix: change start, goal, velocity or \
                           goal_velocity instead";
            return Err(Error::Argument { name: "points", problem });
        }
        constraints.rows.push(Constraint { jet, dof, residual, tolerance: tolerance * scale, scale });
        Ok(())
    }

    /// Returns whether the parameters do not change a DoF, with coefficients (width, D) of all of them.
    fn is_fixed(&self, rows: &[f64], dof: usize) -> bool {
        let (path, covariance) = (self.prior.path, &self.prior.covariance);
        let row = || (0..path.width()).map(|c| (path.parameter(c, dof), rows[c * self.scales.len() + dof]));
        let variance: f64 = row().map(|(p, a)| row().map(|(q, b)| a * covariance[(p, q)] * b).sum::<f64>()).sum();
        self.from.is_some() || variance <= (FIXED * self.scales[dof]).powi(2)
    }

    fn canonical(&self) -> Canonical {
        self.primitive.canonical()
    }

    /// Returns the index of a derivative at a place, which is added if it is not there.
    fn jet(&self, constraints: &mut Constraints, v: f64, order: usize) -> usize {
        let jets = &mut constraints.jets;
        let there = jets.iter().find(|jet| (jet.functional.place - v).abs() <= SAME_PLACE);
        let place = there.map_or(v, |jet| jet.functional.place);
        let same = |jet: &Jet| jet.functional.place == place && jet.functional.order == order;
        jets.iter().position(same).unwrap_or_else(|| {
            jets.push(self.jet_at(Functional { place, order }));
            jets.len() - 1
        })
    }

    /// Returns a derivative of the movement under the conditions.
    fn jet_at(&self, functional: Functional) -> Jet {
        let (path, extent) = (self.prior.path, self.canonical().extent());
        let Functional { place, order } = functional;
        let (rows, mut mean) = path.rows(&Samples::at(place, order));
        path.products(&rows, &self.parameters, &mut mean);
        if let Some(forcing) = &self.conditions.forcing {
            let displacement = &forcing.displacement(place * extent)[order];
            mean.iter_mut().zip(displacement).for_each(|(mean, x)| *mean += x * extent.powi(order as i32));
        }
        Jet { functional, rows, mean }
    }

    /// Returns the place v of a point and dv/dt there.
    fn place(&self, at: At) -> Result<[f64; 2]> {
        let kind = self.canonical().kind();
        let v = match at {
            At::Time(time) => {
                let last = if kind == Kind::Discrete { self.time.duration() * (1.0 + SAME_PLACE) } else { f64::MAX };
                let allowed =
                    "seconds must lie between the start and the end of the movement; see tau and segment_durations";
                check_range("time", time, (0.0..=last).contains(&time), allowed)?;
                self.time.phase(time)[0] + self.conditions.phase / self.canonical().extent()
            }
            At::Phase(phase) => share_at(self.canonical(), "phase", phase)?,
        };
        let v = if kind == Kind::Discrete { v.min(1.0) } else { v.rem_euclid(1.0) };
        if let (Kind::Discrete, Some(from)) = (kind, self.from)
            && v <= from + SAME_PLACE
        {
            return Err(Error::Argument { name: "points", problem: "must lie after from_phase" });
        }
        Ok([v, self.time.slope(v).recip()])
    }
}

/// Returns the share of the movement or period at a phase.
///
/// # Errors
/// A phase outside of the movement.
pub(super) fn share_at(canonical: Canonical, name: &'static str, phase: f64) -> Result<f64> {
    let allowed = "must lie between x at the end of the movement and 1, or be a finite angle in rad of a rhythmic one";
    let valid = match canonical {
        Canonical::Discrete { .. } => phase <= 1.0 && phase > 0.0,
        Canonical::Rhythmic { .. } => phase.is_finite(),
    };
    check_range(name, phase, valid, allowed)?;
    let share = match canonical {
        Canonical::Discrete { u_end, .. } => canonical.clock_at(phase) / u_end,
        Canonical::Rhythmic { .. } => turn(phase) / canonical.extent(),
    };
    check_range(name, phase, share <= 1.0 + SAME_PLACE, allowed)?;
    Ok(share.min(1.0))
}
