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

/// Metadata with its only key.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Metadata {
    pdmp: String,
}

/// Constants in a header, as JSON text.
struct Header(Option<String>);

impl<'de> Deserialize<'de> for Header {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        struct Entries;
        impl<'de> Visitor<'de> for Entries {
            type Value = Header;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("the entries of a header")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> std::result::Result<Header, A::Error> {
                let (mut json, mut count) = (None, 0);
                while let Some(key) = map.next_key::<String>()? {
                    count += 1;
                    if count > MAX_ENTRIES {
                        return Err(A::Error::custom("more arrays than any model has"));
                    }
                    if key != "__metadata__" {
                        map.next_value::<IgnoredAny>()?;
                    } else if json.replace(map.next_value::<Metadata>()?.pdmp).is_some() {
                        return Err(A::Error::custom("metadata twice"));
                    }
                }
                Ok(Header(json))
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
    let Header(json) = serde_json::from_slice(header).map_err(|error| unreadable(format!("header: {error}")))?;
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
