//! Checks of the fuzz targets, which the tests also replay over `corpus/`.

pub mod c_abi;
pub mod input;
pub mod model_file;
