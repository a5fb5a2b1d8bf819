//! Python bindings: every function converts, detaches where it is long, calls the core, and converts back.

mod basis;
mod batch;
mod conditions;
mod context;
mod controller;
mod convert;
mod demo;
mod error;
mod factor;
mod fit;
mod inspection;
mod jacobian;
mod learnt;
mod model;
mod prediction;
mod recording;
mod warp;

use pyo3::prelude::*;

/// The compiled half of pdmp.
#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("PdmpError", py.get_type::<error::PdmpError>())?;
    module.add("FitError", py.get_type::<error::FitError>())?;
    module.add("ModelFileError", py.get_type::<error::ModelFileError>())?;
    module.add_class::<demo::Demonstration>()?;
    module.add_class::<demo::Trajectory>()?;
    module.add_class::<basis::Gp>()?;
    module.add_class::<basis::GpRegression>()?;
    module.add_class::<basis::NGnet>()?;
    module.add_class::<basis::NGnetRegression>()?;
    module.add_class::<warp::TimeWarp>()?;
    module.add_class::<factor::Factors>()?;
    module.add_class::<model::Model>()?;
    module.add_class::<batch::RolloutChunks>()?;
    module.add_class::<context::ContextMap>()?;
    module.add_class::<conditions::Conditions>()?;
    module.add_class::<prediction::Prediction>()?;
    module.add_class::<controller::Status>()?;
    module.add_class::<controller::Controller>()?;
    module.add_function(wrap_pyfunction!(fit::fit, module)?)?;
    module.add_function(wrap_pyfunction!(conditions::blend, module)?)?;
    module.add_function(wrap_pyfunction!(factor::factorise, module)?)?;
    module.add_function(wrap_pyfunction!(inspection::inspected, module)?)?;
    module.add_function(wrap_pyfunction!(model::load, module)?)?;
    module.add_function(wrap_pyfunction!(recording::resample, module)?)?;
    module.add_function(wrap_pyfunction!(recording::trim, module)?)?;
    module.add_function(wrap_pyfunction!(recording::cut, module)?)?;
    module.add_function(wrap_pyfunction!(recording::lowpass, module)?)?;
    module.add_function(wrap_pyfunction!(recording::residuals, module)?)?;
    module.add_function(wrap_pyfunction!(recording::period, module)?)?;
    module.add_function(wrap_pyfunction!(recording::fill, module)?)?;
    module.add_function(wrap_pyfunction!(recording::cycles, module)?)?;
    Ok(())
}
