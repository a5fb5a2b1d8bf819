//! Unit responses of a movement, and their cache.

use std::collections::VecDeque;
use std::fmt;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use ndarray::Array2;

use crate::dynamics::additional_forcing::AdditionalForcing;
use crate::error::{Error, Result};

/// Maximum number of responses in the cache of a primitive.
const MAX_ENTRIES: usize = 8;
/// Maximum memory of the responses in the cache, in bytes.
const MAX_BYTES: usize = 64 << 20;

/// Order of the derivative of a movement with respect to time.
///
/// ```
/// use pdmp_core::model::Derivative;
///
/// assert_eq!(Derivative::of_order("derivative", 1)?, Derivative::Velocity);
/// assert!(Derivative::of_order("derivative", 3).is_err());
/// # Ok::<(), pdmp_core::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Derivative {
    /// Positions, in the unit of each DoF.
    Position,
    /// Velocities, per second.
    Velocity,
    /// Accelerations, per second squared.
    Acceleration,
}

impl Derivative {
    /// Position, velocity and acceleration.
    pub const ALL: [Self; 3] = [Self::Position, Self::Velocity, Self::Acceleration];

    /// Returns the derivative of order `n`; `name` is the argument that an error names.
    ///
    /// # Errors
    /// An order above 2.
    pub fn of_order(name: &'static str, n: usize) -> Result<Self> {
        let allowed = "must be 0 (position), 1 (velocity) or 2 (acceleration)";
        Self::ALL.get(n).copied().ok_or(Error::Range { name, value: n as f64, allowed })
    }
}

/// Unit responses (T, D) of one derivative over time; see `motion/unit_responses.rs`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Curves {
    /// Responses Rⱼ to the styles.
    pub(crate) styles: Vec<Array2<f64>>,
    /// Response E to the start position, equal for all DoFs.
    pub(crate) start: Array2<f64>,
    /// Response V to the start velocity, equal for all DoFs.
    pub(crate) velocity: Array2<f64>,
    /// Response G to the final velocity, equal for all DoFs, if one is in force.
    pub(crate) goal_velocity: Option<Array2<f64>>,
}

impl Curves {
    /// Returns curves in the order of [`Self::iter`].
    pub(crate) fn new(curves: Vec<Array2<f64>>, has_goal_velocity: bool) -> Self {
        let mut curves = curves.into_iter();
        let mut next = || curves.next().unwrap_or_default();
        let (start, velocity) = (next(), next());
        let goal_velocity = has_goal_velocity.then(next);
        Self { start, velocity, goal_velocity, styles: curves.collect() }
    }

    /// Returns the responses to start, start velocity, final velocity if one is in force, and styles.
    pub(crate) fn iter(&self) -> impl Iterator<Item = &Array2<f64>> {
        [&self.start, &self.velocity].into_iter().chain(&self.goal_velocity).chain(&self.styles)
    }
}

/// Unit responses of positions, velocities and accelerations.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Responses {
    pub(crate) orders: [Curves; 3],
    /// Third derivatives, once a gradient of accelerations with respect to τ has needed them.
    third: OnceLock<Curves>,
}

impl Responses {
    pub(crate) fn new(orders: [Curves; 3]) -> Self {
        Self { orders, third: OnceLock::new() }
    }

    /// Returns the responses of one derivative.
    pub(crate) fn of(&self, derivative: Derivative) -> &Curves {
        &self.orders[derivative as usize]
    }

    /// Returns the third derivatives, computed by the first call.
    ///
    /// # Errors
    /// That of the computation.
    pub(crate) fn third(&self, compute: impl FnOnce() -> Result<Curves>) -> Result<&Curves> {
        match self.third.get() {
            Some(curves) => Ok(curves),
            // Concurrent calls compute equal curves.
            None => compute().map(|curves| self.third.get_or_init(|| curves)),
        }
    }

    /// Returns the responses with the displacement by an additional forcing as those of one more style; `step` is the interval of
    /// the samples on the clock, and `rate` that of the clock per second.
    pub(crate) fn with_forcing(&self, forcing: &AdditionalForcing, step: f64, rate: f64) -> Self {
        let mut extended = Self::new(self.orders.clone());
        let mut curves = [(); 3].map(|()| Array2::zeros(self.orders[0].start.dim()));
        for k in 0..curves[0].nrows() {
            for (order, jet) in forcing.displacement(k as f64 * step).into_iter().enumerate() {
                let scale = rate.powi(order as i32);
                curves[order].row_mut(k).iter_mut().zip(jet).for_each(|(to, x)| *to = scale * x);
            }
        }
        extended.orders.iter_mut().zip(curves).for_each(|(all, curve)| all.styles.push(curve));
        extended
    }

    /// Returns responses without samples.
    pub(crate) fn none() -> Self {
        let none = || Array2::zeros((0, 0));
        Self::new([(); 3].map(|()| Curves { styles: Vec::new(), start: none(), velocity: none(), goal_velocity: None }))
    }

    fn bytes(&self) -> usize {
        let all = self.orders.iter().chain(self.third.get());
        all.map(|curves| (curves.styles.len() + 3) * curves.start.len() * size_of::<f64>()).sum()
    }
}

/// Key of the cache: all quantities on which the responses of a primitive depend.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Key {
    pub(crate) dt: f64,
    pub(crate) tau: f64,
    pub(crate) steps: usize,
    /// True if a final velocity is in force.
    pub(crate) has_goal_velocity: bool,
}

/// Least-recently-used cache of responses. The cache of a cloned primitive is empty.
#[derive(Default)]
pub(crate) struct Cache(Mutex<VecDeque<(Key, Arc<Responses>)>>);

impl Cache {
    /// Calls `f` with the entries, the most recently used one last. Poison is ignored: each change leaves the entries
    /// consistent.
    fn with<T>(&self, f: impl FnOnce(&mut VecDeque<(Key, Arc<Responses>)>) -> T) -> T {
        f(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Returns the responses of a key and marks them as the most recently used ones.
    pub(crate) fn find(&self, key: Key) -> Option<Arc<Responses>> {
        self.with(|entries| {
            let entry = entries.iter().position(|(k, _)| *k == key).and_then(|index| entries.remove(index))?;
            let responses = Arc::clone(&entry.1);
            entries.push_back(entry);
            Some(responses)
        })
    }

    /// Inserts responses and evicts the least recently used ones beyond the limits. Responses larger than [`MAX_BYTES`]
    /// are not inserted.
    pub(crate) fn insert(&self, key: Key, responses: &Arc<Responses>) {
        if responses.bytes() > MAX_BYTES {
            return;
        }
        self.with(|entries| {
            entries.retain(|(k, _)| *k != key);
            entries.push_back((key, Arc::clone(responses)));
        });
        self.evict_excess();
    }

    /// Evicts the least recently used responses beyond the limits.
    pub(crate) fn evict_excess(&self) {
        self.with(|entries| {
            while entries.len() > MAX_ENTRIES || entries.iter().map(|(_, r)| r.bytes()).sum::<usize>() > MAX_BYTES {
                entries.pop_front();
            }
        });
    }
}

impl Clone for Cache {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl fmt::Debug for Cache {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("Cache")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn responses(n: usize) -> Arc<Responses> {
        let curve = || Array2::zeros((n, 1));
        let curves = || Curves { styles: vec![curve()], start: curve(), velocity: curve(), goal_velocity: None };
        Arc::new(Responses::new([(); 3].map(|()| curves())))
    }

    fn key(steps: usize) -> Key {
        Key { dt: 0.01, tau: 1.0, steps, has_goal_velocity: false }
    }

    /// The most recently used entries are kept, up to the limits of number and memory.
    #[test]
    fn memory_of_the_cache_is_bounded() {
        let cache = Cache::default();
        for n in 0..100 {
            cache.insert(key(n), &responses(3));
            assert!(cache.find(key(0)).is_some(), "an entry in constant use is evicted");
        }
        let kept = (0..100).filter(|&n| cache.find(key(n)).is_some()).collect::<Vec<_>>();
        assert_eq!(kept, [0, 93, 94, 95, 96, 97, 98, 99]);
        // Each takes three eighths of the memory.
        let large = responses(MAX_BYTES / (12 * 8) * 3 / 8);
        for n in 0..20 {
            cache.insert(key(n), &large);
            assert!(cache.with(|entries| entries.iter().map(|(_, r)| r.bytes()).sum::<usize>()) <= MAX_BYTES);
        }
        assert_eq!((0..20).filter(|&n| cache.find(key(n)).is_some()).collect::<Vec<_>>(), [18, 19]);
        cache.insert(key(50), &responses(MAX_BYTES));
        assert!(cache.find(key(50)).is_none(), "an entry above the limit is inserted");
        assert!(cache.find(key(18)).is_some() && cache.find(key(19)).is_some(), "it evicts others");
        // Two fit in without third derivatives, and one with them.
        let larger = responses(MAX_BYTES / (12 * 8) * 7 / 16);
        (30..32).for_each(|n| cache.insert(key(n), &larger));
        assert!(cache.find(key(30)).is_some() && cache.find(key(31)).is_some());
        larger.third(|| Ok(larger.of(Derivative::Position).clone())).unwrap();
        larger.third(|| panic!("computed again")).unwrap();
        cache.evict_excess();
        assert!(cache.find(key(30)).is_none() && cache.find(key(31)).is_some());
    }

    /// An entry is found by its whole key only; the clone of a cache is empty.
    #[test]
    fn other_keys_are_not_found() {
        let cache = Cache::default();
        cache.insert(key(5), &responses(6));
        cache.insert(key(5), &responses(6));
        assert_eq!(cache.with(|entries| entries.len()), 1);
        let with_velocity = Key { has_goal_velocity: true, ..key(5) };
        for other in [Key { dt: 0.02, ..key(5) }, Key { tau: 1.1, ..key(5) }, with_velocity, key(6)] {
            assert!(cache.find(other).is_none());
        }
        assert!(cache.clone().find(key(5)).is_none());
    }

    /// A panic while the cache was locked does not disable it.
    #[test]
    fn poisoned_cache_stays_usable() {
        let cache = Cache::default();
        let panic = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| cache.with(|_| panic!("on purpose"))));
        assert!(panic.is_err());
        cache.insert(key(5), &responses(6));
        assert!(cache.find(key(5)).is_some());
    }
}
