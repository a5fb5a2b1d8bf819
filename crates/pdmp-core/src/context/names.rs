//! Names of context columns.

use crate::context::ContextMap;
use crate::demonstration::ContextValue;
use crate::error::{Error, Result};
use crate::validate::check_names;

impl ContextMap {
    /// Returns the names of the context columns (Q,), or none where they are unknown.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Sets the names of the context columns (Q,); an empty list stands for unknown ones.
    ///
    /// # Errors
    /// A number of names other than Q, a repeated name, or one longer than 1000 bytes.
    pub(crate) fn with_names(self, names: Vec<String>) -> Result<Self> {
        if !names.is_empty() {
            check_names("context_names", &names, self.columns().len(), "context column")?;
        }
        Ok(Self { names, ..self })
    }

    /// Returns the context (Q,) of named values, in the order of the columns.
    ///
    /// ```
    /// # use pdmp_core::{Demonstration, FitOptions, Kind, fit};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// let contexts = (0..demos.len()).map(|m| vec![0.1 * m as f64].into_iter().map(Into::into).collect()).collect();
    /// let options = FitOptions::new(Kind::Discrete).contexts(contexts).context_names(vec!["height".into()]);
    /// let model = fit(&demos, &options)?;
    /// let map = model.map().expect("contexts");
    /// let context = map.named(&[("height".into(), 0.15.into())])?;
    /// assert_eq!(model.predict(&context)?, model.predict(&[0.15])?);
    /// assert!(map.named(&[("width".into(), 0.15.into())]).is_err());
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// Columns without names, or other names than those of the columns.
    pub fn named(&self, values: &[(String, ContextValue)]) -> Result<Vec<ContextValue>> {
        if self.names.is_empty() {
            let problem = "has names, but the contexts of the demonstrations had none: pass the values in their order";
            return Err(Error::Argument { name: "context", problem });
        }
        let value = |name: &String| values.iter().find(|(own, _)| own == name).map(|(_, value)| value.clone());
        let context: Option<Vec<ContextValue>> = self.names.iter().map(value).collect();
        context.filter(|context| context.len() == values.len()).ok_or_else(|| {
            let found = values.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", ");
            Error::ContextNames { expected: self.names.join(", "), found }
        })
    }

    /// Adds the name of a column to an error of its value.
    pub(super) fn with_column_name(&self, error: Error) -> Error {
        let named = |column: usize| self.names.get(column).cloned();
        match error {
            Error::Label { column, value, known, .. } => Error::Label { column, name: named(column), value, known },
            Error::NoNumber { column, label, .. } => Error::NoNumber { column, name: named(column), label },
            error => error,
        }
    }
}
