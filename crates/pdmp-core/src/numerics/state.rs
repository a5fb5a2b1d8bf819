//! Copies of states that reuse the memory of their destination.

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
