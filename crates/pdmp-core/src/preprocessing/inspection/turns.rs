//! Angles that jump by a full turn, and angles that are offset by whole turns between demonstrations.
//!
//! If the unit of a degree of freedom is one of angles, whole turns between demonstrations are subtracted. If the unit is
//! unknown, a probable angle is only reported: 6.28 may be a length in metres.

use std::borrow::Cow;
use std::f64::consts::TAU;

use ndarray::{Array2, ArrayView1};

use super::{Finding, Survey, jumps};

use crate::demonstration::{Demonstration, turn_of};
use crate::numerics::statistics::{extremes, range};

/// Maximum deviation of an offset from whole turns, in turns; movements from different starts deviate more.
const MAX_DEVIATION: f64 = 0.25;
/// Maximum deviation for unknown units.
const MAX_DEVIATION_UNKNOWN: f64 = 0.03;
/// Maximum offset for unknown units, in turns.
const MAX_TURNS_UNKNOWN: f64 = 3.0;
/// Jumps of a wrapped angle of unknown unit, in turns: from near one end of the interval to near the other.
const WRAPS: [f64; 2] = [0.9, 1.02];
/// Maximum step of such an angle elsewhere, in turns.
const MAX_STEP: f64 = 0.1;

/// Maximum step that remains of a wrap of an angle of known unit without whole turns, in turns.
const MAX_REMAINDER: f64 = 0.1;
/// Maximum step that remains of such a wrap, relative to the steps nearby.
const MAX_REMAINDER_RATIO: f64 = 3.0;

/// Kind of the unit of a degree of freedom.
enum Unit {
    /// Unit of angles, with the size of a full turn.
    Angle(f64),
    /// No unit.
    Unknown,
    /// Any other unit.
    Other,
}

fn unit(demo: &Demonstration, d: usize) -> Unit {
    match demo.units().map(|units| units[d].as_str()) {
        None | Some("") => Unit::Unknown,
        Some(unit) => turn_of(unit).map_or(Unit::Other, Unit::Angle),
    }
}

/// Finds the first jump by full turns of each angle of a demonstration.
pub(super) fn wraps(demo: usize, survey: &Survey) -> Vec<Finding> {
    let mut findings = Vec::new();
    // A wrap is a step of more than half a turn, π in the smallest unit.
    let candidates = if survey.largest_step() > 0.5 * TAU { 0..survey.n_dofs } else { 0..0 };
    for d in candidates.filter(|d| !matches!(unit(survey.demo, *d), Unit::Other)) {
        let (column, largest_step) = (survey.column(d), survey.steps[d]);
        let first_jump = |turn: f64, min: f64, max: f64| {
            let jump = |c: usize| column[c] - column[c - 1];
            let at = (1..column.len()).find(|&c| (min..=max).contains(&(jump(c).abs() / turn)))?;
            Some((at, jump(at), turn))
        };
        let wrap = match unit(survey.demo, d) {
            Unit::Other => None,
            Unit::Angle(turn) if largest_step <= 0.5 * turn => None,
            Unit::Angle(turn) => {
                let at = (1..column.len()).find(|&c| is_wrap(column, c, turn));
                at.map(|c| (c, column[c] - column[c - 1], turn))
            }
            Unit::Unknown => [TAU, 360.0].into_iter().find_map(|turn| {
                let may_wrap = largest_step >= WRAPS[0] * turn && range(column) <= WRAPS[1] * turn;
                // Jumps to or from zero may be lost samples.
                let smooth = || {
                    (1..column.len()).all(|c| {
                        let step = (column[c] - column[c - 1]).abs();
                        step <= MAX_STEP * turn || (step >= WRAPS[0] * turn && column[c] != 0.0 && column[c - 1] != 0.0)
                    })
                };
                if may_wrap && smooth() { first_jump(turn, WRAPS[0], WRAPS[1]) } else { None }
            }),
        };
        if let Some((at, jump, turn)) = wrap {
            findings.push(Finding::Wrap { demo, dof: survey.name(d), place: survey.place(at), jump, turn });
        }
    }
    findings
}

/// Returns whether the step to the sample `c` is like those nearby but for whole turns.
fn is_wrap(column: ArrayView1<f64>, c: usize, turn: f64) -> bool {
    let step = |c: usize| column[c] - column[c - 1];
    let within_turn = |c: usize| (step(c) - (step(c) / turn).round() * turn).abs();
    let usual = jumps::second_largest(c, column.len(), within_turn);
    step(c).abs() > 0.5 * turn && within_turn(c) <= f64::max(MAX_REMAINDER * turn, MAX_REMAINDER_RATIO * usual)
}

/// Finds the angles that are offset by whole turns from those of most demonstrations.
pub(super) fn apart(surveys: &[Survey]) -> Vec<Finding> {
    let demos: Vec<&Demonstration> = surveys.iter().map(|survey| survey.demo).collect();
    let Some(first) = surveys.first() else { return Vec::new() };
    let mut findings = Vec::new();
    for d in 0..first.n_dofs {
        for (demo, turns, turn, mended) in offsets(&demos, d) {
            findings.push(Finding::TurnsApart { demo, dof: surveys[demo].name(d), turns, turn, mended });
        }
    }
    findings
}

/// Subtracts the whole turns by which angles are offset between demonstrations, for degrees of freedom whose unit is one of
/// angles.
///
/// ```
/// # use ndarray::Array2;
/// # use pdmp_core::{Demonstration, Sampling};
/// # use pdmp_core::preprocessing::inspection::unwound;
/// # fn main() -> pdmp_core::Result<()> {
/// let demo = |offset: f64| {
///     let position = Array2::from_shape_fn((50, 1), |(c, _)| c as f64 + offset);
///     Demonstration::new(position, Sampling::Uniform { dt: 0.01 })?.with_units(vec!["deg".to_string()])
/// };
/// let demos = [demo(0.0)?, demo(360.0)?, demo(0.0)?];
/// assert_eq!(unwound(&demos)[1], demos[0]);
/// # Ok(())
/// # }
/// ```
pub fn unwound(demos: &[Demonstration]) -> Cow<'_, [Demonstration]> {
    let mut unwound = Cow::Borrowed(demos);
    let all: Vec<&Demonstration> = demos.iter().collect();
    for d in 0..demos.first().map_or(0, Demonstration::n_coordinates) {
        for (m, turns, turn, mended) in offsets(&all, d) {
            if mended {
                unwound.to_mut()[m].shift(d, -turns * turn);
            }
        }
    }
    unwound
}

/// Number of samples of a [`reference`].
pub(crate) const REFERENCE_SAMPLES: usize = N_COMPARED;

/// Returns the samples of a demonstration (9, D) from which the whole turns of others are counted.
pub(crate) fn reference(demo: &Demonstration) -> Array2<f64> {
    let position = demo.position();
    let sample = |k: usize| k * (demo.n_samples() - 1) / (N_COMPARED - 1);
    Array2::from_shape_fn((N_COMPARED, demo.n_coordinates()), |(k, d)| position[[sample(k), d]])
}

/// Subtracts the whole turns by which angles are offset from those of a reference with units.
pub(crate) fn unwound_from<'a>(from: &Demonstration, demos: &'a [Demonstration]) -> Cow<'a, [Demonstration]> {
    let mut unwound = Cow::Borrowed(demos);
    for d in 0..from.n_coordinates() {
        let Unit::Angle(turn) = unit(from, d) else { continue };
        for (m, demo) in demos.iter().enumerate() {
            if let Some(turns) = offset(demo, from, d, turn, MAX_DEVIATION).filter(|turns| *turns != 0.0) {
                unwound.to_mut()[m].shift(d, -turns * turn);
            }
        }
    }
    unwound
}

/// Returns for each demonstration that is offset by whole turns in a degree of freedom its index, the number of turns, the
/// size of a turn, and whether the unit is one of angles.
fn offsets(demos: &[&Demonstration], d: usize) -> Vec<(usize, f64, f64, bool)> {
    let start = |demo: &Demonstration| demo.position()[[0, d]];
    if demos.iter().any(|demo| d >= demo.n_coordinates()) {
        return Vec::new();
    }
    let [low, high] = extremes(demos.iter().map(|demo| start(demo)));
    // The unit of one demonstration applies to all.
    let known = demos.iter().map(|demo| unit(demo, d)).find(|unit| !matches!(unit, Unit::Unknown));
    let (candidates, mended, deviation): (&[f64], bool, f64) = match known {
        Some(Unit::Angle(turn)) => (if turn == TAU { &[TAU] } else { &[360.0] }, true, MAX_DEVIATION),
        Some(_) => return Vec::new(),
        None => (&[TAU, 360.0], false, MAX_DEVIATION_UNKNOWN),
    };
    for &turn in candidates {
        if high - low < (1.0 - 2.0 * deviation) * turn {
            continue;
        }
        // The reference is the first demonstration of the largest group without offsets to each other.
        let counts = |reference: &Demonstration| {
            demos.iter().filter(|demo| offset(demo, reference, d, turn, deviation) == Some(0.0)).count()
        };
        let references = demos.iter().take(MAX_REFERENCES).enumerate();
        let Some((_, reference)) = references.max_by_key(|(m, demo)| (counts(demo), std::cmp::Reverse(*m))) else {
            continue;
        };
        let offsets: Vec<Option<f64>> = demos.iter().map(|demo| offset(demo, reference, d, turn, deviation)).collect();
        // For an unknown unit all must differ by whole turns, or a few lengths could be taken for turns by chance.
        let plausible = |offset: &Option<f64>| offset.is_some_and(|turns| turns.abs() <= MAX_TURNS_UNKNOWN);
        if !mended && !offsets.iter().all(plausible) {
            continue;
        }
        let nonzero = offsets.iter().enumerate().filter_map(|(m, turns)| turns.filter(|t| *t != 0.0).map(|t| (m, t)));
        let nonzero: Vec<_> = nonzero.map(|(m, turns)| (m, turns, turn, mended)).collect();
        if !nonzero.is_empty() {
            return nonzero;
        }
    }
    Vec::new()
}

/// Maximum number of demonstrations that are tried as the reference of the offsets.
const MAX_REFERENCES: usize = 20;
/// Number of samples at which two demonstrations are compared.
const N_COMPARED: usize = 9;

/// Returns the offset between two demonstrations in whole turns, if it is the same at all compared fractions of time.
fn offset(demo: &Demonstration, from: &Demonstration, d: usize, turn: f64, deviation: f64) -> Option<f64> {
    let at = |demo: &Demonstration, k: usize| demo.position()[[k * (demo.n_samples() - 1) / (N_COMPARED - 1), d]];
    let turns = ((at(demo, 0) - at(from, 0)) / turn).round();
    let close = |k: usize| ((at(demo, k) - at(from, k)) / turn - turns).abs() <= deviation;
    (0..N_COMPARED).all(close).then_some(turns)
}
