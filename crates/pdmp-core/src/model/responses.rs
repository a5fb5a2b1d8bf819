//! Responses of a movement to a unit of each condition, and a cache of them.

use std::collections::VecDeque;
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

use ndarray::Array2;

use crate::error::{Error, Result};

/// Most responses that a model keeps, and the most memory that they take, in bytes.
const MOST_KEPT: usize = 8;
const MOST_BYTES: usize = 64 << 20;

/// How often a movement is differentiated with respect to time.
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
    /// All, in order.
    pub const ALL: [Self; 3] = [Self::Position, Self::Velocity, Self::Acceleration];

    /// The derivative of order `n`, where `name` is the argument that says so.
    ///
    /// # Errors
    /// An order above 2.
    pub fn of_order(name: &'static str, n: usize) -> Result<Self> {
        let allowed = "must be 0 (position), 1 (velocity) or 2 (acceleration)";
        Self::ALL.get(n).copied().ok_or(Error::Range { name, value: n as f64, allowed })
    }
}

/// Responses over time (T, D), of one derivative.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Curves {
    /// Rⱼ.
    pub(crate) styles: Vec<Array2<f64>>,
    /// E, the same for every DoF, as is V.
    pub(crate) start: Array2<f64>,
    pub(crate) velocity: Array2<f64>,
}

/// Curves of positions, velocities and accelerations.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Responses(pub(crate) [Curves; 3]);

impl Responses {
    pub(crate) fn of(&self, derivative: Derivative) -> &Curves {
        &self.0[derivative as usize]
    }

    fn bytes(&self) -> usize {
        self.0.iter().map(|curves| (curves.styles.len() + 2) * curves.start.len() * size_of::<f64>()).sum()
    }
}

/// What responses depend on, apart from the model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Key {
    pub(crate) dt: f64,
    pub(crate) tau: f64,
    pub(crate) steps: usize,
}

/// The responses used last. A copied model starts without any.
#[derive(Default)]
pub(crate) struct Cache(Mutex<VecDeque<(Key, Arc<Responses>)>>);

impl Cache {
    /// Does `work` on what is kept, the latest last. Whatever panicked meanwhile left it whole.
    fn with<T>(&self, work: impl FnOnce(&mut VecDeque<(Key, Arc<Responses>)>) -> T) -> T {
        work(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }

    pub(crate) fn find(&self, key: Key) -> Option<Arc<Responses>> {
        self.with(|kept| {
            let entry = kept.iter().position(|(k, _)| *k == key).and_then(|index| kept.remove(index))?;
            let found = Arc::clone(&entry.1);
            kept.push_back(entry);
            Some(found)
        })
    }

    /// Keeps responses as long as no later ones need their place; those that are too large not at all.
    pub(crate) fn keep(&self, key: Key, responses: &Arc<Responses>) {
        if responses.bytes() > MOST_BYTES {
            return;
        }
        self.with(|kept| {
            kept.retain(|(k, _)| *k != key);
            kept.push_back((key, Arc::clone(responses)));
            while kept.len() > MOST_KEPT || kept.iter().map(|(_, kept)| kept.bytes()).sum::<usize>() > MOST_BYTES {
                kept.pop_front();
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
        Arc::new(Responses([(); 3].map(|()| Curves { styles: vec![curve()], start: curve(), velocity: curve() })))
    }

    fn key(steps: usize) -> Key {
        Key { dt: 0.01, tau: 1.0, steps }
    }

    /// Those asked for last are kept, up to a number of entries and of bytes.
    #[test]
    fn memory_of_the_cache_is_bounded() {
        let cache = Cache::default();
        for n in 0..100 {
            cache.keep(key(n), &responses(3));
            assert!(cache.find(key(0)).is_some(), "what is asked for again and again stays");
        }
        let kept = (0..100).filter(|&n| cache.find(key(n)).is_some()).collect::<Vec<_>>();
        assert_eq!(kept, [0, 93, 94, 95, 96, 97, 98, 99]);
        // Three eighths of the bytes each.
        let large = responses(MOST_BYTES / (9 * 8) * 3 / 8);
        for n in 0..20 {
            cache.keep(key(n), &large);
            assert!(cache.with(|kept| kept.iter().map(|(_, kept)| kept.bytes()).sum::<usize>()) <= MOST_BYTES);
        }
        assert_eq!((0..20).filter(|&n| cache.find(key(n)).is_some()).collect::<Vec<_>>(), [18, 19]);
        cache.keep(key(50), &responses(MOST_BYTES));
        assert!(cache.find(key(50)).is_none(), "too large to be kept");
        assert!(cache.find(key(18)).is_some() && cache.find(key(19)).is_some(), "others stay");
    }

    /// A key is the whole of what responses depend on; a copy of a cache is empty.
    #[test]
    fn other_times_are_not_found() {
        let cache = Cache::default();
        cache.keep(key(5), &responses(6));
        cache.keep(key(5), &responses(6));
        assert_eq!(cache.with(|kept| kept.len()), 1);
        for other in [Key { dt: 0.02, ..key(5) }, Key { tau: 1.1, ..key(5) }, key(6)] {
            assert!(cache.find(other).is_none());
        }
        assert!(cache.clone().find(key(5)).is_none());
    }

    /// A panic elsewhere while the cache was held does not close it.
    #[test]
    fn poisoned_cache_works_on() {
        let cache = Cache::default();
        let panic = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| cache.with(|_| panic!("on purpose"))));
        assert!(panic.is_err());
        cache.keep(key(5), &responses(6));
        assert!(cache.find(key(5)).is_some());
    }
}
