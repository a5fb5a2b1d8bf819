//! Bodies of the fuzz targets, which the tests replay over `corpus/` too.

pub mod c_abi;
pub mod input;
pub mod model_file;
