//! Conversion of arguments that are one of a few texts, with errors that name argument, value and choices.

use std::convert::Infallible;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::convert::quoted;

/// Text argument that is converted once its name and choices are known.
pub(crate) struct Choice<'py>(Option<Bound<'py, PyAny>>);

impl<'py> FromPyObject<'_, 'py> for Choice<'py> {
    type Error = Infallible;

    fn extract(value: pyo3::Borrowed<'_, 'py, PyAny>) -> Result<Self, Infallible> {
        Ok(Self(Some(value.to_owned())))
    }
}

impl<'py> Choice<'py> {
    /// Value of an argument that is absent: the first choice.
    pub(crate) const FIRST: Self = Self(None);

    /// Returns the argument, or the text `other` if it is absent.
    pub(crate) fn or(self, other: Option<Bound<'py, PyAny>>) -> Self {
        Self(self.0.or(other))
    }

    /// Returns the value of the chosen text, or that of the first choice if the argument is absent.
    pub(crate) fn of<T: Copy>(self, name: &str, choices: &[(&str, T)]) -> PyResult<T> {
        let text = self.0.as_ref().map(|value| value.extract::<String>());
        let chosen = match (&text, choices) {
            (None, [(_, first), ..]) => Some(*first),
            (Some(Ok(text)), _) => choices.iter().find(|(choice, _)| choice == text).map(|(_, value)| *value),
            _ => None,
        };
        let texts: Vec<String> = choices.iter().map(|(choice, _)| format!("{choice:?}")).collect();
        chosen.ok_or_else(|| unknown(name, self.0.as_ref(), &texts))
    }

    /// Returns a truth value, `False` if the argument is absent.
    pub(crate) fn flag(self, name: &str) -> PyResult<bool> {
        let Some(value) = &self.0 else { return Ok(false) };
        value.extract().map_err(|_| unknown(name, Some(value), &["True".to_string(), "False".to_string()]))
    }
}

fn unknown(name: &str, value: Option<&Bound<'_, PyAny>>, choices: &[String]) -> PyErr {
    let (last, others) = choices.split_last().map_or(("", &[][..]), |(last, others)| (last.as_str(), others));
    let value = value.map_or_else(String::new, quoted);
    PyValueError::new_err(format!("{name} = {value}: must be {} or {last}", others.join(", ")))
}
