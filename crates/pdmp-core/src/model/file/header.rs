//! Header of a model file, checked in one pass before anything is allocated from it.

use std::fmt;

use serde::Deserialize;
use serde::de::{Deserializer, Error as _, IgnoredAny, MapAccess, Visitor};

use super::{check_size, ensure, unreadable};
use crate::error::Result;

/// Maximum number of entries of a header: the metadata and the arrays, of which a model has fewer.
const MAX_ENTRIES: usize = 64;
/// Maximum size of a header outside of JSON strings, in bytes: that of a model with 200,000 labels.
const MAX_STRUCTURE: usize = 1 << 20;

/// Metadata with the only key of a model, or that of a part of a fit of blocks.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Metadata {
    pdmp: Option<String>,
    #[serde(rename = "pdmp-partial")]
    partial: Option<IgnoredAny>,
}

/// Constants in a header, as JSON text, and whether it is that of a part of a fit of blocks.
struct Header {
    json: Option<String>,
    is_partial: bool,
}

impl<'de> Deserialize<'de> for Header {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        struct Entries;
        impl<'de> Visitor<'de> for Entries {
            type Value = Header;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("the entries of a header")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> std::result::Result<Header, A::Error> {
                let (mut json, mut is_partial, mut count) = (None, false, 0);
                while let Some(key) = map.next_key::<String>()? {
                    count += 1;
                    if count > MAX_ENTRIES {
                        return Err(A::Error::custom("more arrays than any model has"));
                    }
                    if key != "__metadata__" {
                        map.next_value::<IgnoredAny>()?;
                        continue;
                    }
                    let Metadata { pdmp, partial } = map.next_value()?;
                    if json.is_some() || is_partial {
                        return Err(A::Error::custom("metadata twice"));
                    }
                    (json, is_partial) = (pdmp, partial.is_some());
                }
                Ok(Header { json, is_partial })
            }
        }
        deserializer.deserialize_map(Entries)
    }
}

/// Returns the constants as JSON, after a check of the size of the header with and without its strings.
pub(super) fn constants(bytes: &[u8]) -> Result<String> {
    check_size(bytes)?;
    let (head, rest) = bytes.split_first_chunk().ok_or(unreadable("shorter than a header"))?;
    let length = usize::try_from(u64::from_le_bytes(*head)).map_err(|_| unreadable("not a safetensors file"))?;
    let header = rest.get(..length).ok_or(unreadable("truncated: it ends within its header"))?;
    let read = serde_json::from_slice(header).map_err(|error| unreadable(format!("header: {error}")));
    let Header { json, is_partial } = read?;
    ensure(!is_partial, "a partial fit, not a model: load it as a partial fit")?;
    let json = json.ok_or(unreadable("no pdmp metadata"))?;
    let structure = header.len() - json.len().min(header.len()) + structure(&json);
    ensure(structure <= MAX_STRUCTURE, "a header larger than any model has")?;
    Ok(json)
}

/// Returns the number of bytes of a JSON text outside of strings.
fn structure(json: &str) -> usize {
    let (mut count, mut in_string, mut escaped) = (0, false, false);
    for byte in json.bytes() {
        match byte {
            _ if escaped => escaped = false,
            b'\\' if in_string => escaped = true,
            b'"' => (in_string, count) = (!in_string, count + 1),
            _ if !in_string => count += 1,
            _ => {}
        }
    }
    count
}

#[cfg(test)]
mod tests {
    use super::structure;

    #[test]
    fn contents_of_strings_are_not_counted() {
        for (json, expected) in [("[1,2]", 5), (r#"["abc"]"#, 4), (r#"["a\"],","b"]"#, 7), (r#"["\\"]"#, 4)] {
            assert_eq!(structure(json), expected, "{json}");
        }
    }
}
