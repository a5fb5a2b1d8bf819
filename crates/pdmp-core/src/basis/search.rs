//! Maximum of an expensive function of few variables: a scan of a grid, then the simplex method from its best point.

use crate::error::Result;

/// Simplex searches from the best point so far, while each still gains more than `GAIN`.
const ROUNDS: usize = 3;
const GAIN: f64 = 0.01;
/// Steps granted to each search, and the size at which its simplex has converged.
const STEPS: usize = 60;
const TOLERANCE: f64 = 0.01;

/// The range of one variable.
pub(super) struct Axis {
    pub(super) low: f64,
    pub(super) high: f64,
    /// Points of the scan, ends included; at least 2.
    pub(super) points: usize,
}

impl Axis {
    fn step(&self) -> f64 {
        (self.high - self.low) / (self.points - 1) as f64
    }
}

/// A point and the function there.
#[derive(Clone)]
struct Vertex {
    at: Vec<f64>,
    value: f64,
}

/// Where in the box f is largest; it may be −∞ where it does not exist.
///
/// The scan avoids local maxima and plateaus. The simplex may collapse onto a face of the box, to which it is clamped:
/// hence the further rounds.
///
/// Nelder and Mead, The Computer Journal 7 (1965) 308–313.
pub(super) fn maximise(axes: &[Axis], mut f: impl FnMut(&[f64]) -> Result<f64>) -> Result<Vec<f64>> {
    let mut evaluate = |mut at: Vec<f64>| -> Result<Vertex> {
        at.iter_mut().zip(axes).for_each(|(x, axis)| *x = x.clamp(axis.low, axis.high));
        Ok(Vertex { value: f(&at)?, at })
    };
    let mut best = evaluate(axes.iter().map(|axis| axis.low).collect())?;
    for cell in 1..axes.iter().map(|axis| axis.points).product() {
        let mut rest = cell;
        let digit = |axis: &Axis| {
            let k = rest % axis.points;
            rest /= axis.points;
            axis.low + k as f64 * axis.step()
        };
        let vertex = evaluate(axes.iter().map(digit).collect())?;
        if vertex.value > best.value {
            best = vertex;
        }
    }
    for _ in 0..ROUNDS {
        let start = best.value;
        best = climb(best, axes, &mut evaluate)?;
        if best.value - start < GAIN {
            break;
        }
    }
    Ok(best.at)
}

/// The simplex method from `start`, never to a point below it.
fn climb(start: Vertex, axes: &[Axis], evaluate: &mut impl FnMut(Vec<f64>) -> Result<Vertex>) -> Result<Vertex> {
    let n = axes.len();
    let mut simplex = vec![start];
    for (k, axis) in axes.iter().enumerate() {
        let mut at = simplex[0].at.clone();
        // Half a cell of the scan, to the farther side.
        at[k] += 0.5 * axis.step() * if at[k] > 0.5 * (axis.low + axis.high) { -1.0 } else { 1.0 };
        simplex.push(evaluate(at)?);
    }
    for _ in 0..STEPS {
        simplex.sort_by(|a, b| b.value.total_cmp(&a.value));
        if size(&simplex) < TOLERANCE {
            break;
        }
        // A point on the line from the worst vertex through the centre of the others.
        let along = |factor: f64| -> Vec<f64> {
            let centre = |k: usize| simplex[..n].iter().map(|vertex| vertex.at[k]).sum::<f64>() / n as f64;
            (0..n).map(|k| centre(k) + factor * (centre(k) - simplex[n].at[k])).collect()
        };
        let (first, last, worst) = (simplex[0].value, simplex[n - 1].value, simplex[n].value);
        let reflected = evaluate(along(1.0))?;
        let further = match reflected.value {
            value if value > first => Some(2.0),
            value if value > last => None,
            value if value > worst => Some(0.5),
            _ => Some(-0.5),
        };
        let second = further.map(|factor| evaluate(along(factor))).transpose()?;
        let candidate = second.filter(|second| second.value > reflected.value).unwrap_or(reflected);
        if candidate.value > worst {
            simplex[n] = candidate;
        } else {
            for k in 1..=n {
                let halfway = simplex[0].at.iter().zip(&simplex[k].at).map(|(a, b)| 0.5 * (a + b)).collect();
                simplex[k] = evaluate(halfway)?;
            }
        }
    }
    simplex.sort_by(|a, b| b.value.total_cmp(&a.value));
    Ok(simplex.swap_remove(0))
}

/// Largest distance of a vertex from the first, along any axis.
fn size(simplex: &[Vertex]) -> f64 {
    let pairs = simplex.iter().flat_map(|vertex| vertex.at.iter().zip(&simplex[0].at));
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Error;
    use approx::assert_abs_diff_eq;

    fn square() -> Vec<Axis> {
        vec![Axis { low: -4.0, high: 4.0, points: 6 }, Axis { low: -10.0, high: 0.0, points: 6 }]
    }

    #[test]
    fn finds_the_top_of_a_slanting_ridge() {
        let f = |x: &[f64]| Ok(-(x[0] - 0.7).powi(2) - 30.0 * (x[1] + 5.0 * x[0] - 0.3).powi(2));
        let top = maximise(&square(), f).unwrap();
        assert_abs_diff_eq!(top[0], 0.7, epsilon = 0.1);
        assert_abs_diff_eq!(top[1], -3.2, epsilon = 0.5);
    }

    #[test]
    fn finds_the_top_on_an_edge_and_in_a_corner() {
        let edge = maximise(&square(), |x| Ok(-(x[0] - 1.1).powi(2) + x[1])).unwrap();
        assert_abs_diff_eq!(edge[0], 1.1, epsilon = 0.05);
        assert_eq!(edge[1], 0.0);
        assert_eq!(maximise(&square(), |x| Ok(x[0] - x[1])).unwrap(), [4.0, -10.0]);
    }

    #[test]
    fn crosses_a_plateau_and_avoids_where_the_function_does_not_exist() {
        let f = |x: &[f64]| Ok(if x[0] < 0.0 { f64::NEG_INFINITY } else { (-(x[0] - 3.0).powi(2) * 9.0).exp() });
        assert_abs_diff_eq!(maximise(&square(), f).unwrap()[0], 3.0, epsilon = 0.05);
    }

    #[test]
    fn stays_in_the_box_and_ends_on_any_function() {
        for constant in [0.0, f64::NEG_INFINITY] {
            let mut n = 0;
            let at = maximise(&square(), |x| {
                n += 1;
                assert!((-4.0..=4.0).contains(&x[0]) && (-10.0..=0.0).contains(&x[1]));
                Ok(constant)
            });
            assert!(at.is_ok() && n < 300);
        }
    }

    #[test]
    fn hands_an_interruption_on() {
        assert!(matches!(maximise(&square(), |_| Err(Error::Interrupted)), Err(Error::Interrupted)));
    }
}
