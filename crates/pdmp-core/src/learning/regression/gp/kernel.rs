//! Which covariance function.

use std::fmt;

/// Covariance function of a Gaussian process, with x = |r|/length.
///
/// Rasmussen and Williams, Gaussian Processes for Machine Learning (2006), Section 4.2.1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Kernel {
    /// (1 + √3x)·exp(−√3x): once differentiable.
    Matern32,
    /// (1 + √5x + 5x²/3)·exp(−√5x): twice differentiable.
    #[default]
    Matern52,
    /// exp(−x²/2): infinitely differentiable.
    SquaredExponential,
}

impl Kernel {
    /// All kernels.
    pub const ALL: [Kernel; 3] = [Kernel::Matern32, Kernel::Matern52, Kernel::SquaredExponential];

    /// The name used in files and in Python.
    pub fn name(self) -> &'static str {
        match self {
            Kernel::Matern32 => "matern32",
            Kernel::Matern52 => "matern52",
            Kernel::SquaredExponential => "squared_exponential",
        }
    }

    /// The kernel of this name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kernel| kernel.name() == name)
    }
}

impl fmt::Display for Kernel {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Kernel::Matern32 => "Matérn-3/2",
            Kernel::Matern52 => "Matérn-5/2",
            Kernel::SquaredExponential => "squared exponential",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_lead_back_to_their_kernels() {
        for kernel in Kernel::ALL {
            assert_eq!(Kernel::from_name(kernel.name()), Some(kernel));
        }
        assert_eq!(Kernel::from_name("rbf"), None);
    }
}
