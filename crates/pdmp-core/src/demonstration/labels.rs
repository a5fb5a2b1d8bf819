//! Comparison of the names, units and rotations of demonstrations.

use super::{QuaternionOrder, RotationColumns};
use crate::error::{Error, Mismatch, Result};

/// Checks that labels, if there are any, are the `expected` ones, which belong to `of`.
///
/// # Errors
/// The first label that differs.
pub(crate) fn check_labels(name: &'static str, found: Option<&[String]>, expected: &[String], of: &str) -> Result<()> {
    let Some(found) = found.filter(|found| *found != expected) else { return Ok(()) };
    let remedy = match name {
        "units" => "convert the positions to the same units, or correct the units",
        _ => "put the columns into the same order, or correct the names",
    };
    let index = found.iter().zip(expected).position(|(found, expected)| found != expected);
    let [found, expected] = [found, expected].map(|labels| match index {
        Some(index) => format!("{:?}", labels[index]),
        None => format!("{labels:?}"),
    });
    Err(Error::Mismatch(Box::new(Mismatch { name, index, found, expected, of: of.into(), remedy })))
}

/// Checks that rotations are the `expected` ones, which belong to `of`.
///
/// # Errors
/// Rotations that differ.
pub(crate) fn check_rotations(found: &[RotationColumns], expected: &[RotationColumns], of: &str) -> Result<()> {
    if found == expected {
        return Ok(());
    }
    let remedy = "declare the rotations in the same columns, with the same order of components";
    let [found, expected] = [found, expected].map(text);
    Err(Error::Mismatch(Box::new(Mismatch { name: "rotations", index: None, found, expected, of: of.into(), remedy })))
}

/// Returns the first columns of rotations with their orders, or "none".
fn text(rotations: &[RotationColumns]) -> String {
    let each = |rotation: &RotationColumns| {
        let order = match rotation.order {
            QuaternionOrder::Wxyz => "wxyz",
            QuaternionOrder::Xyzw => "xyzw",
        };
        format!("{order} from column {}", rotation.column)
    };
    if rotations.is_empty() { "none".into() } else { rotations.iter().map(each).collect::<Vec<_>>().join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An error gives the values that differ, their place and a remedy.
    #[test]
    fn errors_give_both_values() {
        let [own, other] = [["hip", "knee"], ["hip", "ankle"]].map(|names| names.map(String::from));
        check_labels("names", Some(&own), &own, "demo 0").unwrap();
        check_labels("names", None, &own, "demo 0").unwrap();
        let error = check_labels("names", Some(&own), &other, "demo 0").unwrap_err();
        let text = error.to_string();
        assert!(text.starts_with("names[1] = \"knee\", but demo 0 has \"ankle\": put the columns"), "{text}");
        assert_eq!(error.argument(), Some("names"));
        let rotation = RotationColumns { column: 3, order: QuaternionOrder::Wxyz };
        let text = check_rotations(&[rotation], &[], "the model").unwrap_err().to_string();
        assert!(text.starts_with("rotations = wxyz from column 3, but the model has none: "), "{text}");
    }
}
