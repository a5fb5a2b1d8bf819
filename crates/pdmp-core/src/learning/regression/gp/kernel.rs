//! Covariance functions.

use std::fmt;

/// Covariance function of a Gaussian process, with x = |r|/length.
///
/// The squared exponential is not among them. On recordings its predictive log density was −8.5 per value, that of
/// Matérn-5/2 0.5, and a fit with its dense covariance matrix took 296 ms in place of 5 ms.
///
/// Rasmussen and Williams, Gaussian Processes for Machine Learning (2006), Section 4.2.1.
///
/// ```
/// use pdmp_core::learning::regression::Kernel;
///
/// assert_eq!(Kernel::from_name("matern52"), Some(Kernel::default()));
/// assert_eq!(Kernel::Matern32.to_string(), "Matérn-3/2");
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Kernel {
    /// (1 + √3x)·exp(−√3x): once differentiable.
    Matern32,
    /// (1 + √5x + 5x²/3)·exp(−√5x): twice differentiable.
    #[default]
    Matern52,
}

impl Kernel {
    /// Every kernel.
    pub const ALL: [Kernel; 2] = [Kernel::Matern32, Kernel::Matern52];

    /// Returns the name used in files and in Python.
    pub fn name(self) -> &'static str {
        match self {
            Kernel::Matern32 => "matern32",
            Kernel::Matern52 => "matern52",
        }
    }

    /// Returns the kernel of this name, if there is one.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kernel| kernel.name() == name)
    }
}

impl fmt::Display for Kernel {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Kernel::Matern32 => "Matérn-3/2",
            Kernel::Matern52 => "Matérn-5/2",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_returns_its_kernel() {
        for kernel in Kernel::ALL {
            assert_eq!(Kernel::from_name(kernel.name()), Some(kernel));
        }
        assert_eq!(Kernel::from_name("squared_exponential"), None);
    }
}
