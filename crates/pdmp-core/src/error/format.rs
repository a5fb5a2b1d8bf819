//! Formats of numbers and gaps in error texts.

use std::fmt;

/// A ratio.
pub(super) struct Times(pub(super) f64);

impl fmt::Display for Times {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        if self.0 < 1e4 { write!(f, "{:.1} times", self.0) } else { f.write_str("over 10 000 times") }
    }
}

/// A stretch without samples, and its remedy.
pub(super) struct Gap<'a>(pub(super) &'a str, pub(super) f64, pub(super) f64, pub(super) f64);

impl fmt::Display for Gap<'_> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Gap(column, from, to, max_gap) = *self;
        let missing = if column.is_empty() { "row" } else { "sample" };
        if !column.is_empty() {
            write!(f, "column '{column}': ")?;
        }
        match (from.is_finite(), to.is_finite()) {
            (true, true) => write!(
                f,
                "no {missing} between t = {from} s and t = {to} s: that is longer than max_gap = {max_gap} s; raise max_gap, \
                 or cut the recording there"
            ),
            (false, true) => write!(f, "no sample before t = {to} s, where none can be interpolated: cut the rows out"),
            (true, false) => {
                write!(f, "no sample after t = {from} s, where none can be interpolated: cut the rows out")
            }
            (false, false) => write!(f, "no sample at all: leave the column out"),
        }
    }
}

/// A number in its shortest form: integers plainly, very large and small numbers with an exponent.
pub(super) struct Number(pub(super) f64);

impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        if self.0.fract() == 0.0 && self.0.abs() < 1e9 { write!(f, "{}", self.0) } else { write!(f, "{:?}", self.0) }
    }
}

/// A measured number, to six significant digits.
pub(super) struct Rounded(pub(super) f64);

impl fmt::Display for Rounded {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        Number(format!("{:.5e}", self.0).parse().unwrap_or(self.0)).fmt(f)
    }
}

/// A number of things, with their name in the singular or plural.
pub(super) struct Count(pub(super) usize, pub(super) &'static str);

impl fmt::Display for Count {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{} {}{}", self.0, self.1, if self.0 == 1 { "" } else { "s" })
    }
}

/// Index of a context column, or its name.
pub(super) struct Column<'a>(pub(super) usize, pub(super) &'a Option<String>);

impl fmt::Display for Column<'_> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self.1 {
            Some(name) => write!(f, "{name:?}"),
            None => write!(f, "{}", self.0),
        }
    }
}

/// The four columns of a rotation, with the row of a matrix.
pub(super) struct Columns(pub(super) Option<usize>, pub(super) usize);

impl fmt::Display for Columns {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        self.0.map_or(Ok(()), |row| write!(f, "{row}, "))?;
        write!(f, "{}:{}", self.1, self.1 + 4)
    }
}
