//! Model files: safetensors, with the constants as JSON in the metadata.
//!
//! The JSON has a single metadata key, because the order of several would be random. A checksum over the constants and
//! all arrays detects damage that leaves every shape intact. It is not a signature: anyone can write a valid file. A file may
//! contain the prior of the model too ([`section`]), with a version of its own.
//!
//! A file of unknown origin is data. It contains no code and refers to no other file. A loaded model moves in finite
//! numbers or returns an error. Reading takes memory and time in proportion to the size of the file: header, number of
//! arrays, contexts of a map and magnitude of every number have the bounds of the interface and of [`crate::learning`].
//! A file can still describe a harmful movement, under any names, labels and units: the driver of the robot must enforce
//! its limits.

mod draft;
mod header;
mod read;
pub(crate) mod section;
mod write;

use std::fmt::Display;
use std::fs;
use std::io::{self, Read, Write};
use std::path::Path;

use serde::{Deserialize, Serialize};

use draft::Draft;

use crate::context::{ContextColumn, ContextMapKind, Kernel};
use crate::demonstration::RotationColumns;
use crate::dynamics::canonical::Canonical;
use crate::error::{Error, Result};
use crate::model::{Frame, Model};

/// Version of the file format.
const SCHEMA: u32 = 6;
/// Metadata key of the constants.
const KEY: &str = "pdmp";
/// Maximum size of a file, in bytes.
const MAX_FILE_SIZE: u64 = 1 << 32;
/// Maximum size of a header, in bytes; labels make up nearly all of a large one.
const MAX_HEADER_SIZE: u64 = 1 << 26;

/// Constants of a model with the version of the format and the checksum of the file.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Sealed {
    schema: u32,
    crc32: u32,
    model: Constants,
    /// Version of the prior; absent without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    prior: Option<u32>,
}

/// Fields of a model that are not arrays.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Constants {
    canonical: Canonical,
    tau: f64,
    alpha_z: f64,
    beta_z: f64,
    /// Braking rate κ past the end; `None` for immediate transport.
    braking: Option<f64>,
    names: Vec<String>,
    units: Vec<String>,
    nominal: usize,
    n_samples: usize,
    /// Bound of the slopes of the time warp; `None` without one.
    slope: Option<f64>,
    truncation_error: f64,
    regression: String,
    table_error: f64,
    map: Option<Map>,
    /// Coordinates of a model with rotations; absent without.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    coordinates: Option<Layout>,
}

/// Layout of the coordinates of a model with rotations.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Layout {
    names: Vec<String>,
    units: Vec<String>,
    frame: Frame,
    rotations: Vec<RotationColumns>,
}

/// Constants from which the context map is restored, together with the parameters of the demonstrations.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Map {
    columns: Vec<ContextColumn>,
    /// Names of the columns; absent where unknown.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    names: Vec<String>,
    kind: ContextMapKind,
    kernel: Option<Kernel>,
    errors: Vec<(ContextMapKind, Option<f64>)>,
}

impl Model {
    /// Writes a model file atomically: an interrupted call leaves an existing file unchanged.
    ///
    /// A symbolic link is followed; a pipe or a device is written to directly. Otherwise the bytes are written to
    /// `.pdmp-*.draft` in the same folder, which is then renamed. A process that is killed leaves the draft, which can be
    /// deleted.
    ///
    /// ```
    /// # use pdmp_core::{Demonstration, FitOptions, Kind, Model, fit};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let path = folder.path().join("reach.safetensors");
    /// let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// model.save(&path)?;
    /// let loaded = Model::load(&path)?;
    /// assert_eq!(loaded.demonstrated(), model.demonstrated());
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// A path that cannot be written, or whose folder does not exist.
    pub fn save(&self, path: &Path) -> Result<()> {
        write_atomically(path, &self.to_bytes()?)
    }

    /// Reads a model file.
    ///
    /// ```
    /// # use pdmp_core::{Demonstration, FitOptions, Kind, Model, fit};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let path = folder.path().join("reach.safetensors");
    /// # model.save(&path)?;
    /// let loaded = Model::load(&path)?;
    /// assert_eq!(loaded.n_dofs(), 2);
    /// assert!(Model::load(folder.path()).is_err());
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// A path that cannot be read, or a file that is damaged, not a model, or of another version.
    pub fn load(path: &Path) -> Result<Self> {
        read_file(path, Self::from_bytes)
    }
}

/// Writes a file atomically: an interrupted call leaves an existing file unchanged.
pub(crate) fn write_atomically(path: &Path, bytes: &[u8]) -> Result<()> {
    let failed = |source| Error::Io { path: path.to_path_buf(), source };
    let target = fs::canonicalize(path)
        // The target of a link need not exist.
        .or_else(|_| fs::read_link(path).map(|to| path.parent().unwrap_or(Path::new("")).join(to)))
        .unwrap_or_else(|_| path.to_path_buf());
    if fs::metadata(&target).is_ok_and(|existing| !existing.is_file() && !existing.is_dir()) {
        return fs::write(&target, bytes).map_err(failed);
    }
    let folder = target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if !folder.is_dir() {
        let source = io::Error::new(io::ErrorKind::NotFound, "no such folder; create it first");
        return Err(Error::Io { path: folder.to_path_buf(), source });
    }
    let (draft, mut file) = Draft::create(folder).map_err(failed)?;
    file.write_all(bytes).map_err(failed)?;
    file.sync_all().map_err(failed)?;
    if let Ok(existing) = fs::metadata(&target) {
        file.set_permissions(existing.permissions()).map_err(failed)?;
    }
    draft.persist(&target).map_err(failed)
}

/// Reads a safetensors file, and converts its bytes.
pub(crate) fn read_file<T>(path: &Path, convert: impl FnOnce(&[u8]) -> Result<T>) -> Result<T> {
    let failed = |source| Error::Io { path: path.to_path_buf(), source };
    let with_path = |error| match error {
        Error::File(reason) => unreadable(format!("{}: {reason}", path.display())),
        other => other,
    };
    let mut file = fs::File::open(path).map_err(failed)?;
    let mut bytes = Vec::new();
    // The length of the header comes first: a large file of another format is rejected without reading it.
    Read::by_ref(&mut file).take(8).read_to_end(&mut bytes).map_err(failed)?;
    check_size(&bytes).map_err(with_path)?;
    file.take(MAX_FILE_SIZE).read_to_end(&mut bytes).map_err(failed)?;
    convert(&bytes).map_err(with_path)
}

/// Returns the error of a file that is damaged, not a model, or of another version.
pub(crate) fn unreadable(reason: impl Display) -> Error {
    Error::File(reason.to_string())
}

/// Checks a property of the contents of a file.
pub(crate) fn ensure(valid: bool, reason: &str) -> Result<()> {
    if valid { Ok(()) } else { Err(unreadable(reason)) }
}

/// Checks the size of the file, and the size of its header as announced in the first eight bytes.
fn check_size(bytes: &[u8]) -> Result<()> {
    match bytes.first_chunk().map(|head| u64::from_le_bytes(*head)) {
        _ if bytes.len() as u64 > MAX_FILE_SIZE => Err(unreadable("larger than any model")),
        None => Err(unreadable("shorter than a header")),
        Some(0) => Err(unreadable("not a safetensors file")),
        Some(length) if length > MAX_HEADER_SIZE => {
            Err(unreadable("not a safetensors file, or damaged: it announces a header larger than any model has"))
        }
        Some(_) => Ok(()),
    }
}

/// Returns the CRC-32 of the constants, the version of the prior, and the names and bytes of all arrays: those of
/// `Model::arrays`, then those of the prior.
fn checksum<'a>(
    constants: &Constants,
    prior: Option<u32>,
    arrays: impl Iterator<Item = (&'a str, &'a [u8])>,
) -> Result<u32> {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(&serde_json::to_vec(constants).map_err(unreadable)?);
    if let Some(version) = prior {
        hasher.update(&version.to_le_bytes());
    }
    for (name, bytes) in arrays {
        hasher.update(name.as_bytes());
        hasher.update(bytes);
    }
    Ok(hasher.finalize())
}
