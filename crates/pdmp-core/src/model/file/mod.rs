//! The model file: safetensors, with the constants as JSON beside the arrays.
//!
//! One metadata key holds the JSON, as several would be written in random order. A checksum over the constants and
//! all arrays finds damage that leaves every shape intact. It is no signature: anyone can write a file that passes.
//!
//! A file from elsewhere is data. It holds no code and names no other file, and a loaded model moves in finite numbers
//! or refuses to. Reading takes memory and time in proportion to the file: header, number of arrays, contexts of a map
//! and size of every number have the bounds of the interface and of [`crate::learning`]. What a file can do is
//! describe a harmful movement, under any names, labels and units: limits of the robot are to be kept by its driver.

mod draft;
mod header;
mod read;
mod write;

use std::fs;
use std::io::{Read, Write};
use std::path::Path;

use serde::{Deserialize, Serialize};

use draft::Draft;

use crate::context::{ContextColumn, Kernel, MapKind};
use crate::dynamics::canonical::Canonical;
use crate::error::{Error, Result};
use crate::model::Model;

/// Version of the file's layout.
const SCHEMA: u32 = 5;
/// The metadata key.
const KEY: &str = "pdmp";
/// Largest file that is read, in bytes.
const LARGEST_FILE: u64 = 1 << 32;
/// Largest header that is read, in bytes: nearly all of it labels.
const MAX_HEADER: u64 = 1 << 26;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Sealed {
    schema: u32,
    crc32: u32,
    model: Constants,
}

/// All of a model that is not an array.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Constants {
    canonical: Canonical,
    tau: f64,
    alpha_z: f64,
    beta_z: f64,
    /// κ past the end, where transport is learnt.
    braking: Option<f64>,
    names: Vec<String>,
    units: Vec<String>,
    nominal: usize,
    n_samples: usize,
    /// Bound of the slopes, where time was warped.
    slope: Option<f64>,
    left_out: f64,
    basis: String,
    table_error: f64,
    map: Option<Map>,
}

/// How a map comes about from what was demonstrated.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Map {
    columns: Vec<ContextColumn>,
    kind: MapKind,
    kernel: Option<Kernel>,
    errors: Vec<(MapKind, Option<f64>)>,
}

impl Model {
    /// Writes a model file. It appears whole or not at all, whatever interrupts the writing; what a link leads to is
    /// replaced, not the link, and a pipe or a device is written to. It is written beside its place as `.pdmp-*.draft`
    /// and then renamed: a process that is killed meanwhile leaves the draft, which can be deleted.
    ///
    /// # Errors
    /// A path that cannot be written.
    pub fn save(&self, path: &Path) -> Result<()> {
        let bytes = self.to_bytes()?;
        let io = |source| Error::Io { path: path.to_path_buf(), source };
        let place = fs::canonicalize(path)
            // What a link leads to need not be there yet.
            .or_else(|_| fs::read_link(path).map(|to| path.parent().unwrap_or(Path::new("")).join(to)))
            .unwrap_or_else(|_| path.to_path_buf());
        if fs::metadata(&place).is_ok_and(|found| !found.is_file() && !found.is_dir()) {
            return fs::write(&place, &bytes).map_err(io);
        }
        let folder = place.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let (draft, mut file) = Draft::create(folder).map_err(io)?;
        file.write_all(&bytes).map_err(io)?;
        file.sync_all().map_err(io)?;
        if let Ok(older) = fs::metadata(&place) {
            file.set_permissions(older.permissions()).map_err(io)?;
        }
        draft.persist(&place).map_err(io)
    }

    /// Reads a model file.
    ///
    /// # Errors
    /// A path that cannot be read, or a file that is not whole, not a model, or of another version.
    pub fn load(path: &Path) -> Result<Self> {
        let io = |source| Error::Io { path: path.to_path_buf(), source };
        let named = |error| match error {
            Error::File(reason) => Error::File(format!("{}: {reason}", path.display())),
            other => other,
        };
        let mut file = fs::File::open(path).map_err(io)?;
        let mut bytes = Vec::new();
        // The header's length first: what is no model need not be read.
        Read::by_ref(&mut file).take(8).read_to_end(&mut bytes).map_err(io)?;
        check_size(&bytes).map_err(named)?;
        file.take(LARGEST_FILE).read_to_end(&mut bytes).map_err(io)?;
        Self::from_bytes(&bytes).map_err(named)
    }
}

/// Checks the size of the file, and that of its header as the first eight bytes announce it.
fn check_size(bytes: &[u8]) -> Result<()> {
    let bad = |reason: &str| Error::File(reason.to_string());
    match bytes.first_chunk().map(|head| u64::from_le_bytes(*head)) {
        _ if bytes.len() as u64 > LARGEST_FILE => Err(bad("larger than any model")),
        None => Err(bad("shorter than a header")),
        Some(0) => Err(bad("not a safetensors file")),
        Some(length) if length > MAX_HEADER => {
            Err(bad("not a safetensors file, or damaged: it announces a header larger than any model has"))
        }
        Some(_) => Ok(()),
    }
}

/// CRC-32 of the constants and of all arrays, in the order in which a model lists them.
fn checksum<'a>(constants: &Constants, arrays: impl Iterator<Item = (&'a str, &'a [u8])>) -> Result<u32> {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(&serde_json::to_vec(constants).map_err(|error| Error::File(error.to_string()))?);
    for (name, bytes) in arrays {
        hasher.update(name.as_bytes());
        hasher.update(bytes);
    }
    Ok(hasher.finalize())
}
