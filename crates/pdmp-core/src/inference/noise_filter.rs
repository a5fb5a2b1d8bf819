//! Whitening of a residual that is correlated over time.

/// Share of the variance of the residual that is white.
pub(crate) const WHITE: f64 = 0.1;

/// Kalman filter of the residual of each DoF, the sum of an Ornstein-Uhlenbeck process and white noise.
///
/// The gains depend on the times of the observations alone. The filter is linear in the observations, so that it whitens
/// those of every hypothesis by the same gains.
#[derive(Clone, Debug)]
pub(crate) struct NoiseFilter {
    correlation_time: f64,
    /// Variances of the residual (D,).
    variances: Vec<f64>,
    /// Variances of the error of the process (D,), given the observations.
    uncertain: Vec<f64>,
    /// Factor by which the process decays up to the sample.
    pub(crate) decay: f64,
    /// Gain and inverse deviation of the innovation of each DoF (D,); no gain for a missing one.
    pub(crate) gains: Vec<Option<(f64, f64)>>,
}

impl NoiseFilter {
    /// Returns the filter before the first observation of residuals with standard deviations (D,).
    pub(crate) fn new(residual: &[f64], correlation_time: f64) -> Self {
        let variances: Vec<f64> = residual.iter().map(|sd| sd * sd).collect();
        let n = variances.len();
        let mut filter =
            Self { correlation_time, variances, uncertain: vec![0.0; n], decay: 0.0, gains: vec![None; n] };
        filter.restart();
        filter
    }

    /// Returns to the state before the first observation, without allocation.
    pub(crate) fn restart(&mut self) {
        self.uncertain.iter_mut().zip(&self.variances).for_each(|(own, variance)| *own = (1.0 - WHITE) * variance);
        self.decay = 0.0;
        self.gains.fill(None);
    }

    /// Returns to the state of another filter of the same residuals.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.decay = other.decay;
        self.uncertain.copy_from_slice(&other.uncertain);
        self.gains.copy_from_slice(&other.gains);
    }

    /// Advances by an interval in seconds to an observation, of which missing DoFs are NaN.
    pub(crate) fn advance(&mut self, interval: f64, position: &[f64]) {
        self.decay = (-interval / self.correlation_time).exp();
        let squared = self.decay * self.decay;
        for (((gain, uncertain), variance), y) in
            self.gains.iter_mut().zip(&mut self.uncertain).zip(&self.variances).zip(position)
        {
            let process = (1.0 - WHITE) * variance;
            *uncertain = squared * *uncertain + (1.0 - squared) * process;
            *gain = None;
            if !y.is_nan() {
                let innovation = *uncertain + WHITE * variance;
                let share = *uncertain / innovation;
                *gain = Some((share, innovation.sqrt().recip()));
                *uncertain *= 1.0 - share;
            }
        }
    }

    /// Returns the factor by which the present error of the process decays over an interval in seconds, and the variance
    /// of the residual of a DoF after it.
    pub(crate) fn ahead(&self, interval: f64, dof: usize) -> (f64, f64) {
        let decay = (-interval / self.correlation_time).exp();
        let known = (1.0 - WHITE) * self.variances[dof] - self.uncertain[dof];
        (decay, self.variances[dof] - decay * decay * known)
    }
}
