//! Coordinates of a primitive, and the primitive of its degrees of freedom.

use std::borrow::Cow;
use std::sync::Arc;

use crate::demonstration::points;
use crate::error::Result;
use crate::model::conditions::Conditions;
use crate::model::coordinates::Coordinates;
use crate::model::primitive::Primitive;
use crate::validate::check_vector;

impl Primitive {
    /// Returns the primitive with coordinates that are not its degrees of freedom.
    pub(crate) fn with_coordinates(mut self, coordinates: Coordinates) -> Self {
        self.coordinates = Some(Arc::new(coordinates));
        self
    }

    /// Returns the coordinates of a primitive with rotations; `None` where the coordinates are the degrees of freedom.
    pub fn coordinates(&self) -> Option<&Coordinates> {
        self.coordinates.as_deref()
    }

    /// Returns the primitive of the degrees of freedom, which is the primitive itself without rotations.
    pub(crate) fn inside(self: &Arc<Self>) -> &Arc<Self> {
        self.coordinates.as_ref().map_or(self, |coordinates| coordinates.dofs())
    }

    /// Returns the primitive of the degrees of freedom, and conditions for it.
    pub(crate) fn inside_with<'a>(
        self: &'a Arc<Self>,
        conditions: &'a Conditions,
    ) -> Result<(&'a Arc<Self>, Cow<'a, Conditions>)> {
        match &self.coordinates {
            Some(coordinates) => Ok((coordinates.dofs(), Cow::Owned(coordinates.constant_in_dofs(conditions)?))),
            None => Ok((self, Cow::Borrowed(conditions))),
        }
    }

    /// Returns the number of coordinates, the length of positions: the number of DoFs, and one more for each rotation.
    pub fn n_coordinates(&self) -> usize {
        self.names.len() + self.coordinates.as_ref().map_or(0, |coordinates| coordinates.rotations().len())
    }

    /// Returns the names of the coordinates.
    pub fn coordinate_names(&self) -> &[String] {
        self.coordinates.as_ref().map_or(&self.names, |coordinates| coordinates.names())
    }

    /// Returns the DoFs of some coordinates in their order, all three of a rotation in place of the first of its coordinates.
    pub fn dofs_of(&self, coordinates: &[usize]) -> Vec<usize> {
        let Some(all) = &self.coordinates else { return coordinates.to_vec() };
        let (mut dofs, mut done) = (Vec::new(), Vec::new());
        for column in coordinates {
            let owns = |first: usize| (first..first + 4).contains(column);
            match all.rotations().iter().find(|rotation| owns(rotation.columns.column)) {
                Some(rotation) if done.contains(&rotation.dof) => {}
                Some(rotation) => {
                    done.push(rotation.dof);
                    dofs.extend(rotation.dof..rotation.dof + 3);
                }
                None => dofs.extend(all.plain().iter().filter(|[own, _]| own == column).map(|[_, dof]| *dof)),
            }
        }
        dofs
    }

    /// Returns the units of the coordinates; an unknown unit is "".
    pub fn coordinate_units(&self) -> &[String] {
        self.coordinates.as_ref().map_or(&self.units, |coordinates| coordinates.units())
    }

    /// Returns the owner of an element of a position, in an error text.
    pub(crate) fn per_coordinate(&self) -> &'static str {
        if self.coordinates.is_some() { "coordinate" } else { "DoF" }
    }

    /// Checks a position: its length and numbers, and the norms of quaternions.
    pub(crate) fn check_position(&self, name: &'static str, position: &[f64]) -> Result<()> {
        match &self.coordinates {
            Some(coordinates) => coordinates.check(name, position),
            None => check_vector(name, position, self.n_dofs(), "DoF"),
        }
    }

    /// Returns the first DoF of each rotation.
    pub(crate) fn rotation_dofs(&self) -> impl Iterator<Item = usize> + '_ {
        self.coordinates.iter().flat_map(|coordinates| coordinates.rotations().iter().map(|rotation| rotation.dof))
    }

    /// Returns the first DoF of each rotation, and of the point of each pose.
    pub(crate) fn vector_dofs(&self) -> Vec<usize> {
        let points =
            self.coordinates.iter().flat_map(|coordinates| points(coordinates.units(), &coordinates.columns()));
        self.rotation_dofs().chain(points.map(|point| point.start)).collect()
    }
}
