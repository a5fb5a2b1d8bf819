//! Text and HTML summaries of models and trajectories.

use std::fmt::Write;

use numpy::PyArrayMethods;
use pdmp_core::Kind;
use pdmp_core::context::{ContextColumn, ContextMap};
use pyo3::prelude::*;

use crate::error::{ascii, printable};
use crate::model::Model;
use crate::trajectory::Trajectory;

/// Largest number of degrees of freedom, context columns or labels in a summary, which then fits on a screen.
const MAX_LISTED: usize = 12;
/// Number of first and of last samples in the summary of a trajectory.
const N_ROWS: usize = 3;

#[pymethods]
impl Model {
    fn __repr__(&self) -> String {
        let model = &self.0;
        let (n_demos, n_styles) = (model.n_demos(), model.n_styles());
        let counts = [count(n_demos, "demonstration"), count(model.n_dofs(), "DoF"), count(n_styles, "style")];
        let [n_demos, n_dofs, n_styles] = counts;
        let mut text = format!("<pdmp.Model: {}, {n_demos}, {n_dofs} ({}), {n_styles}", model.kind(), dofs(model));
        let _ = write!(text, ", {}", timing(model));
        if let Some((noise, share)) = largest_noise(model) {
            let _ = write!(text, "; measurement noise {noise}, {share}");
        }
        if let Some(map) = model.map() {
            let _ = write!(text, "; contexts {}; context map {}", contexts(model, map), map_summary(map));
        }
        ascii(&format!("{text}; regression {}>", model.learnt().regression))
    }

    /// Returns a table for notebooks.
    fn _repr_html_(&self) -> String {
        let model = &self.0;
        let mut rows = vec![
            ("kind", model.kind().to_string()),
            ("demonstrations", format!("{}, nominal {}", model.n_demos(), model.demonstrated().nominal)),
            ("DoFs", format!("{}: {}", model.n_dofs(), dofs(model))),
            ("time", timing(model)),
            ("styles J", format!("{}, truncation error {:.2e}", model.n_styles(), model.learnt().truncation_error)),
            (
                "measurement noise",
                largest_noise(model).map_or("none found".into(), |(noise, share)| format!("{noise}, {share}")),
            ),
        ];
        if let Some(map) = model.map() {
            rows.extend([("contexts", contexts(model, map)), ("context map", map_summary(map))]);
        }
        rows.push(("regression", model.learnt().regression.clone()));
        let rows = rows.iter().fold(String::new(), |mut html, (name, text)| {
            let _ = write!(html, "<tr><th>{}</th><td>{}</td></tr>", escaped(name), escaped(text));
            html
        });
        format!("<table><caption>pdmp.Model</caption><tbody>{rows}</tbody></table>")
    }
}

#[pymethods]
impl Trajectory {
    fn __repr__(&self, py: Python<'_>) -> String {
        ascii(&format!("<pdmp.Trajectory: {}>", self.summary(py)))
    }

    /// Returns a table of the first and last samples for notebooks.
    fn _repr_html_(&self, py: Python<'_>) -> String {
        let (time, position) = (self.time.bind(py).readonly(), self.position.bind(py).readonly());
        let (time, position) = (time.as_array(), position.as_array());
        let (n_samples, n_shown) = (time.len(), self.names.len().min(MAX_LISTED));
        let cells = |tag: &str, texts: Vec<String>| {
            let more = (self.names.len() > n_shown).then(|| "…".to_string());
            let cells = texts.into_iter().chain(more).map(|text| format!("<{tag}>{}</{tag}>", escaped(&text)));
            format!("<tr>{}</tr>", cells.collect::<String>())
        };
        let labels = self.names.iter().zip(&self.units).take(n_shown).map(|(name, unit)| label(name, unit));
        let head = cells("th", std::iter::once("time [s]".to_string()).chain(labels).collect());
        let omitted = N_ROWS..n_samples.saturating_sub(N_ROWS).max(N_ROWS);
        let mut body = String::new();
        for k in (0..n_samples).filter(|k| !omitted.contains(k) || *k == omitted.start) {
            let row = if omitted.contains(&k) {
                vec!["…".to_string(); n_shown + 1]
            } else {
                let row = position.row(k);
                let numbers = std::iter::once(&time[k]).chain(row.iter().take(n_shown));
                numbers.map(|&number| decimal(number)).collect()
            };
            body += &cells("td", row);
        }
        let caption = escaped(&format!("pdmp.Trajectory: {}; positions", self.summary(py)));
        format!("<table><caption>{caption}</caption><thead>{head}</thead><tbody>{body}</tbody></table>")
    }
}

impl Trajectory {
    fn summary(&self, py: Python<'_>) -> String {
        let time = self.time.bind(py).readonly();
        let (n_samples, last) = (time.as_array().len(), time.as_array().last().copied().unwrap_or(0.0));
        format!("{n_samples} samples x {}, {last:.4} s", count(self.names.len(), "DoF"))
    }
}

/// Escapes a text for HTML, and its control characters: names, units and labels come from files.
fn escaped(text: &str) -> String {
    let mut html = String::with_capacity(text.len());
    for c in printable(text).chars() {
        match c {
            '&' => html.push_str("&amp;"),
            '<' => html.push_str("&lt;"),
            '>' => html.push_str("&gt;"),
            '"' => html.push_str("&quot;"),
            '\'' => html.push_str("&#39;"),
            _ => html.push(c),
        }
    }
    html
}

/// Returns a number with four decimals, or with an exponent if these would not show it.
fn decimal(number: f64) -> String {
    let fits = number == 0.0 || (1e-3..1e7).contains(&number.abs());
    if fits { format!("{number:.4}") } else { format!("{number:.4e}") }
}

/// Returns a name with its unit if that is known.
fn label(name: &str, unit: &str) -> String {
    if unit.is_empty() { name.to_string() } else { format!("{name} [{unit}]") }
}

/// Joins at most [`MAX_LISTED`] texts and states the number of the others.
fn listed(texts: impl ExactSizeIterator<Item = String>, separator: &str) -> String {
    let n_more = texts.len().saturating_sub(MAX_LISTED);
    let list = texts.take(MAX_LISTED).collect::<Vec<_>>().join(separator);
    if n_more > 0 { format!("{list}{separator}and {n_more} more") } else { list }
}

fn dofs(model: &pdmp_core::Model) -> String {
    listed(model.names().iter().zip(model.units()).map(|(name, unit)| label(name, unit)), ", ")
}

/// Returns the nominal duration, or the nominal period: the time constant of a rhythmic movement is its period over 2π.
fn timing(model: &pdmp_core::Model) -> String {
    let tau = model.tau();
    match model.kind() {
        Kind::Discrete => format!("tau {tau:.4} s"),
        Kind::Rhythmic => format!("period {:.4} s (tau {tau:.4} s)", std::f64::consts::TAU * tau),
    }
}

/// Returns the largest measurement noise relative to the range of its degree of freedom, with that share.
fn largest_noise(model: &pdmp_core::Model) -> Option<(String, String)> {
    let levels = model.learnt().noise.levels();
    let ranges = model.ranges();
    let largest = ranges.iter().fold(0.0f64, |most, range| most.max(*range));
    let share = |d: usize| levels[d] / ranges[d].max(f64::MIN_POSITIVE);
    // The range of a constant is that of its rounding errors.
    let moving = (0..model.n_dofs()).filter(|&d| ranges[d] > 1e-12 * largest);
    let d = moving.max_by(|&a, &b| share(a).total_cmp(&share(b))).filter(|&d| share(d) > 0.0)?;
    let (name, unit) = (&model.names()[d], &model.units()[d]);
    let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
    Some((format!("{}{unit}", three_digits(levels[d])), format!("{:.2} % of the range, in {name}", 100.0 * share(d))))
}

/// Formats a number with three significant digits, without an exponent where it stays short.
fn three_digits(value: f64) -> String {
    let text = format!("{value:.2e}");
    let rounded = text.parse::<f64>().unwrap_or(value);
    if (1e-4..1e6).contains(&rounded.abs()) { format!("{rounded}") } else { text }
}

/// Returns the labels of each context column, or the range of its numbers.
fn contexts(model: &pdmp_core::Model, map: &ContextMap) -> String {
    let columns = map.columns();
    let column_name = |q: usize| map.names().get(q).map_or_else(|| format!("[{q}]"), String::clone);
    listed(
        columns.iter().enumerate().map(|(q, column)| match column {
            ContextColumn::Label(labels) => {
                format!("{} {}", column_name(q), listed(labels.iter().map(|label| format!("'{label}'")), " or "))
            }
            ContextColumn::Number => {
                let values = model.demonstrated().contexts.as_ref().map(|contexts| contexts.column(q).to_vec());
                let range = values
                    .iter()
                    .flatten()
                    .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &value| (low.min(value), high.max(value)));
                format!("{} from {} to {}", column_name(q), range.0, range.1)
            }
        }),
        ", ",
    )
}

/// Returns the kind of a context map with its leave-one-out error, and those of the other kinds for comparison.
fn map_summary(map: &ContextMap) -> String {
    let (name, text) = (map.kind().name(), map.kind().to_string());
    let mut summary = if name == text { format!("\"{name}\"") } else { format!("\"{name}\" ({text})") };
    let (own, others): (Vec<_>, Vec<_>) =
        map.errors().iter().filter(|(_, error)| error.is_finite()).partition(|(kind, _)| *kind == map.kind());
    for (_, error) in &own {
        let _ = write!(summary, ", mean squared leave-one-out error {error:.1e}");
    }
    let others: Vec<String> = others.iter().map(|(kind, error)| format!("{} {error:.1e}", kind.name())).collect();
    if !own.is_empty() && !others.is_empty() {
        let _ = write!(summary, " (for comparison: {})", others.join(", "));
    }
    summary
}

/// Returns a number of things, with their name in the singular or plural.
pub(crate) fn count(n: usize, name: &str) -> String {
    format!("{n} {name}{}", if n == 1 { "" } else { "s" })
}
