//! Angles that jump by a full turn, and angles that lie whole turns apart in different demonstrations.
//!
//! Where the unit says that a degree of freedom is an angle, whole turns between demonstrations are taken off. Where no
//! unit is known, what looks like an angle is reported alone: a length of 6.28 m is no turn.

use std::borrow::Cow;
use std::f64::consts::TAU;

use super::{Finding, Survey};
use crate::demonstration::Demonstration;

/// Deviation from whole turns, in turns, up to which an angle lies whole turns apart: a movement that starts elsewhere
/// deviates more.
const MAX_DEVIATION: f64 = 0.25;
/// The same where no unit is known, and the most turns that are considered there.
const MAX_DEVIATION_UNKNOWN: f64 = 0.03;
const MAX_TURNS_UNKNOWN: f64 = 3.0;
/// Jumps of a wrapped angle of unknown unit, in turns: from just inside one end of the interval to just inside the other.
const WRAPS: [f64; 2] = [0.9, 1.02];
/// Largest step of such an angle elsewhere, in turns.
const MAX_STEP: f64 = 0.1;

/// A full turn in a unit of angles; none in other units.
pub fn turn_of(unit: &str) -> Option<f64> {
    match unit.trim() {
        "rad" | "radian" | "radians" => Some(TAU),
        "deg" | "degree" | "degrees" | "°" => Some(360.0),
        _ => None,
    }
}

/// What a full turn may be.
enum Unit {
    Angle(f64),
    Unknown,
    Other,
}

fn unit(demo: &Demonstration, d: usize) -> Unit {
    match demo.units().map(|units| units[d].as_str()) {
        None | Some("") => Unit::Unknown,
        Some(unit) => turn_of(unit).map_or(Unit::Other, Unit::Angle),
    }
}

/// The first jump by a full turn of each angle of a demonstration.
pub(super) fn wraps(demo: usize, survey: &Survey) -> Vec<Finding> {
    let mut findings = Vec::new();
    // Smaller steps are none of a half turn.
    let suspects = if survey.step > 0.5 * TAU { 0..survey.n_dofs } else { 0..0 };
    for d in suspects.filter(|d| !matches!(unit(survey.demo, *d), Unit::Other)) {
        let (column, extent) = (survey.column(d), survey.extent(d));
        let jumps = |turn: f64, least: f64, most: f64| {
            let jump = |c: usize| column[c] - column[c - 1];
            let found = (1..column.len()).find(|&c| (least..=most).contains(&(jump(c).abs() / turn)))?;
            Some((found, jump(found), turn))
        };
        let found = match unit(survey.demo, d) {
            Unit::Other => None,
            Unit::Angle(turn) if extent.step <= 0.5 * turn => None,
            Unit::Angle(turn) => jumps(turn, 0.5, f64::INFINITY),
            Unit::Unknown => [TAU, 360.0].into_iter().find_map(|turn| {
                let alike = extent.step >= WRAPS[0] * turn && extent.high - extent.low <= WRAPS[1] * turn;
                // A sensor that returns zero jumps as well.
                let smooth = || {
                    (1..column.len()).all(|c| {
                        let step = (column[c] - column[c - 1]).abs();
                        step <= MAX_STEP * turn || (step >= WRAPS[0] * turn && column[c] != 0.0 && column[c - 1] != 0.0)
                    })
                };
                if alike && smooth() { jumps(turn, WRAPS[0], WRAPS[1]) } else { None }
            }),
        };
        if let Some((at, jump, turn)) = found {
            findings.push(Finding::Wrap { demo, dof: survey.name(d), place: survey.place(at), jump, turn });
        }
    }
    findings
}

/// Angles that lie whole turns from those of most demonstrations.
pub(super) fn apart(surveys: &[Survey]) -> Vec<Finding> {
    let demos: Vec<&Demonstration> = surveys.iter().map(|survey| survey.demo).collect();
    let Some(first) = surveys.first() else { return Vec::new() };
    let mut findings = Vec::new();
    for d in 0..first.n_dofs {
        for (demo, turns, turn, mended) in turns(&demos, d) {
            findings.push(Finding::TurnsApart { demo, dof: surveys[demo].name(d), turns, turn, mended });
        }
    }
    findings
}

/// The demonstrations without the whole turns by which angles lie apart, where units say that they are angles.
pub fn unwound(demos: &[Demonstration]) -> Cow<'_, [Demonstration]> {
    let mut whole = Cow::Borrowed(demos);
    let all: Vec<&Demonstration> = demos.iter().collect();
    for d in 0..demos.first().map_or(0, Demonstration::n_dofs) {
        for (m, turns, turn, mended) in turns(&all, d) {
            if mended {
                whole.to_mut()[m].shift(d, -turns * turn);
            }
        }
    }
    whole
}

/// For each demonstration that lies whole turns apart in a degree of freedom: its index, the turns, a turn, and whether
/// its unit says that it is an angle.
fn turns(demos: &[&Demonstration], d: usize) -> Vec<(usize, f64, f64, bool)> {
    let start = |demo: &Demonstration| demo.position()[[0, d]];
    if demos.iter().any(|demo| d >= demo.n_dofs()) {
        return Vec::new();
    }
    let [low, high] = demos
        .iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], demo| [low.min(start(demo)), high.max(start(demo))]);
    // The unit of any demonstration is that of all.
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
        // The turn in which most demonstrations start; the first of equals.
        let counts = |reference: &Demonstration| {
            demos.iter().filter(|demo| offset(demo, reference, d, turn, deviation) == Some(0.0)).count()
        };
        let tried = demos.iter().take(MAX_REFERENCES).enumerate();
        let Some((_, reference)) = tried.max_by_key(|(m, demo)| (counts(demo), std::cmp::Reverse(*m))) else {
            continue;
        };
        let offsets: Vec<Option<f64>> = demos.iter().map(|demo| offset(demo, reference, d, turn, deviation)).collect();
        // Of unknown unit all must be alike but for turns, or a few lengths would be turns by chance.
        let alike = |offset: &Option<f64>| offset.is_some_and(|turns| turns.abs() <= MAX_TURNS_UNKNOWN);
        if !mended && !offsets.iter().all(alike) {
            continue;
        }
        let found = offsets.iter().enumerate().filter_map(|(m, turns)| turns.filter(|t| *t != 0.0).map(|t| (m, t)));
        let found: Vec<_> = found.map(|(m, turns)| (m, turns, turn, mended)).collect();
        if !found.is_empty() {
            return found;
        }
    }
    Vec::new()
}

/// Most demonstrations tried as the one from which turns are counted.
const MAX_REFERENCES: usize = 20;
/// Places at which two demonstrations are compared.
const PLACES: usize = 9;

/// The whole turns from one demonstration to another, if they lie that far apart all the way, at equal shares of time.
fn offset(demo: &Demonstration, from: &Demonstration, d: usize, turn: f64, deviation: f64) -> Option<f64> {
    let at = |demo: &Demonstration, k: usize| demo.position()[[k * (demo.n_samples() - 1) / (PLACES - 1), d]];
    let turns = ((at(demo, 0) - at(from, 0)) / turn).round();
    let close = |k: usize| ((at(demo, k) - at(from, k)) / turn - turns).abs() <= deviation;
    (0..PLACES).all(close).then_some(turns)
}
