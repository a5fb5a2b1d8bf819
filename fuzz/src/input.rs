//! Decoder from input bytes to choices and numbers, and the initial models of both targets.

use std::f64::consts::TAU;
use std::sync::LazyLock;

use ndarray::Array2;
use pdmp_core::context::{ContextMapKind, MapSelection};
use pdmp_core::demonstration::ContextValue;
use pdmp_core::learning::regression::{Basis, NGnet};
use pdmp_core::learning::{TimeScaling, Truncation};
use pdmp_core::model::TimeWarp;
use pdmp_core::{Demonstration, FitOptions, Kind, Sampling, fit};

/// Edge cases of floating-point arithmetic and of range checks.
const EDGE_CASES: [f64; 32] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    0.5,
    2.0,
    1e-3,
    -1e-3,
    1e-9,
    1e-12,
    1e-15,
    1e-100,
    1e-150,
    1e-300,
    5e-324,
    f64::MIN_POSITIVE,
    1e3,
    -1e3,
    1e9,
    1e12,
    -1e12,
    1e15,
    1e18,
    1e100,
    1e149,
    1e150,
    -1e150,
    1e300,
    f64::MAX,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::NAN,
];

/// Reader of the bytes of an input, which yields zeros past the end.
pub struct Input<'a> {
    rest: &'a [u8],
}

impl<'a> Input<'a> {
    /// Creates a reader of all bytes.
    pub fn new(rest: &'a [u8]) -> Self {
        Self { rest }
    }

    /// Returns the next byte, or `None` at the end.
    pub fn next(&mut self) -> Option<u8> {
        let (&first, rest) = self.rest.split_first()?;
        self.rest = rest;
        Some(first)
    }

    /// Returns the next byte, or 0 at the end.
    pub fn byte(&mut self) -> u8 {
        self.next().unwrap_or(0)
    }

    /// Returns a number below `n`, from one byte.
    pub fn below(&mut self, n: usize) -> usize {
        usize::from(self.byte()) % n.max(1)
    }

    /// Returns an index below `n`, from two bytes.
    pub fn index(&mut self, n: usize) -> usize {
        usize::from(u16::from_le_bytes([self.byte(), self.byte()])) % n.max(1)
    }

    /// Returns a small number, an edge case or arbitrary bits, with weights 96, 144 and 16.
    pub fn number(&mut self) -> f64 {
        let kind = self.byte();
        match kind {
            0..96 => (f64::from(kind) - 32.0) / 16.0,
            96..240 => EDGE_CASES[usize::from(kind) % EDGE_CASES.len()],
            _ => f64::from_le_bytes(std::array::from_fn(|_| self.byte())),
        }
    }
}

/// Small model files: discrete with labels and a time warp, rhythmic, and one with each kind of context map.
pub static MODELS: LazyLock<Vec<Vec<u8>>> = LazyLock::new(|| {
    let reaches = [0.0, 0.1, 0.2, 0.4, 0.5, 0.7, 0.8, 1.0].map(|h| reach(h).with_context(vec![h]).unwrap());
    let labelled = |h: f64| {
        let label = ContextValue::Label(if h < 0.5 { "low" } else { "high" }.to_string());
        reach(h).with_context(vec![label, ContextValue::Number(h)]).unwrap()
    };
    let mut warped = options(Kind::Discrete);
    warped.time_scaling = TimeScaling::Warp(TimeWarp { n_segments: 4, max_slope: 1.5 });
    let maps = ContextMapKind::ALL
        .into_iter()
        .map(|kind| (reaches.to_vec(), options(Kind::Discrete).map(MapSelection::Given(kind))));
    let others = [
        ([0.1, 0.3, 0.4, 0.6, 0.8, 1.0].map(labelled).to_vec(), warped),
        ([0.0, 0.1, 0.25, 0.4].map(cycle).to_vec(), options(Kind::Rhythmic)),
    ];
    // In this order, a new kind of map does not change the indices in the corpus.
    others.into_iter().chain(maps).map(|(demos, options)| fit(&demos, &options).unwrap().to_bytes().unwrap()).collect()
});

fn options(kind: Kind) -> FitOptions {
    FitOptions::new(kind).n_styles(Truncation::Rank(2)).basis(Basis::NGnet(NGnet { n_basis: 10, ..NGnet::default() }))
}

/// Returns a reach with D = 2 over an obstacle of height `h`.
fn reach(h: f64) -> Demonstration {
    let position = Array2::from_shape_fn((41, 2), |(c, d)| {
        let s = c as f64 / 40.0;
        let bump = 64.0 * (s * (1.0 - s)).powi(3);
        if d == 0 { s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s) } else { h * bump * (1.0 + h * s) }
    });
    Demonstration::new(position, Sampling::Uniform { dt: 0.02 + 0.005 * h }).unwrap()
}

/// Returns a cycle with D = 2.
fn cycle(style: f64) -> Demonstration {
    let position = Array2::from_shape_fn((40, 2), |(c, d)| {
        let phi = TAU * c as f64 / 40.0;
        if d == 0 { (0.5 + style) * phi.sin() + 0.2 * style * (2.0 * phi).cos() } else { (phi + style).cos() }
    });
    Demonstration::new(position, Sampling::Uniform { dt: 0.025 }).unwrap()
}
