//! Copies and walks of states.

use crate::error::Result;

/// Implements [`Clone`] for a struct, field by field. In contrast to the derived implementation, `clone_from` reuses the
/// vectors of the destination, so that a control loop can copy a state without allocation.
macro_rules! clone_in_place {
    ($state:ident { $($field:ident),+ $(,)? }) => {
        impl Clone for $state {
            fn clone(&self) -> Self {
                Self { $($field: self.$field.clone()),+ }
            }

            fn clone_from(&mut self, source: &Self) {
                // The pattern names every field, so that a new one cannot be forgotten.
                let Self { $($field),+ } = source;
                $(self.$field.clone_from($field);)+
            }
        }
    };
}

pub(crate) use clone_in_place;

/// Visitor of a state: receives the numbers of one quantity, with the least and the greatest value that it may have. It
/// reads or replaces them.
pub(crate) type Visitor<'a> = dyn FnMut(&mut [f64], [f64; 2]) -> Result<()> + 'a;

/// Visits a single number.
pub(crate) fn visit_number(visit: &mut Visitor, number: &mut f64, bounds: [f64; 2]) -> Result<()> {
    visit(std::slice::from_mut(number), bounds)
}

/// Visits a flag, as 0 or 1.
pub(crate) fn visit_flag(visit: &mut Visitor, flag: &mut bool) -> Result<()> {
    let mut number = f64::from(u8::from(*flag));
    visit_number(visit, &mut number, [0.0, 1.0])?;
    *flag = number >= 0.5;
    Ok(())
}
