//! Python bindings of pdmp-core. Each function converts its arguments, releases the interpreter if the call is long,
//! calls the core and converts the result.

mod batch;
mod batch_conditions;
mod blocks;
mod choice;
mod conditions;
mod context;
mod controller;
mod controller_state;
mod convert;
mod demonstration;
mod display;
mod error;
mod euler;
mod explorer;
mod factorised_fit;
mod factorization;
mod feasibility;
mod fit;
mod inspection;
mod instance;
mod labelled;
mod limits;
mod model;
mod model_getters;
mod motion;
mod named_contexts;
mod orientation;
mod output;
mod partial_fit;
mod prediction;
mod preprocessing;
mod regression;
mod rotations;
mod scalar;
mod status;
mod trajectory;
mod two_arms;
mod warp;

use pyo3::prelude::*;

/// Compiled part of pdmp.
#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("PdmpError", py.get_type::<error::PdmpError>())?;
    module.add("FitError", py.get_type::<error::FitError>())?;
    module.add("ModelFileError", py.get_type::<error::ModelFileError>())?;
    module.add_class::<demonstration::Demonstration>()?;
    module.add_class::<trajectory::Trajectory>()?;
    module.add_class::<regression::Gp>()?;
    module.add_class::<regression::GpRegression>()?;
    module.add_class::<regression::NGnet>()?;
    module.add_class::<regression::NGnetRegression>()?;
    module.add_class::<warp::TimeWarp>()?;
    module.add_class::<factorization::Factors>()?;
    module.add_class::<model::Model>()?;
    module.add_class::<batch::RolloutChunks>()?;
    module.add_class::<context::ContextMap>()?;
    module.add_class::<conditions::Conditions>()?;
    module.add_class::<limits::Limits>()?;
    module.add_class::<feasibility::Margins>()?;
    module.add_class::<prediction::Prediction>()?;
    module.add_class::<partial_fit::PartialFit>()?;
    module.add_class::<factorised_fit::FactorisedFit>()?;
    module.add_class::<factorised_fit::StyleProjection>()?;
    module.add_class::<factorised_fit::BlockStyles>()?;
    module.add_class::<status::Status>()?;
    module.add_class::<controller::Controller>()?;
    module.add_function(wrap_pyfunction!(fit::fit, module)?)?;
    module.add_function(wrap_pyfunction!(named_contexts::context_rows, module)?)?;
    module.add_function(wrap_pyfunction!(conditions::blend, module)?)?;
    module.add_function(wrap_pyfunction!(factorization::factorise, module)?)?;
    module.add_function(wrap_pyfunction!(inspection::inspected, module)?)?;
    module.add_function(wrap_pyfunction!(model::load, module)?)?;
    module.add_function(wrap_pyfunction!(preprocessing::resample, module)?)?;
    module.add_function(wrap_pyfunction!(preprocessing::trim, module)?)?;
    module.add_function(wrap_pyfunction!(preprocessing::split_at, module)?)?;
    module.add_function(wrap_pyfunction!(preprocessing::lowpass, module)?)?;
    module.add_function(wrap_pyfunction!(preprocessing::residuals, module)?)?;
    module.add_function(wrap_pyfunction!(preprocessing::turn_of, module)?)?;
    module.add_function(wrap_pyfunction!(preprocessing::period, module)?)?;
    module.add_function(wrap_pyfunction!(preprocessing::fill_gaps, module)?)?;
    module.add_function(wrap_pyfunction!(preprocessing::cycles, module)?)?;
    module.add_function(wrap_pyfunction!(orientation::axis_angles_to_quaternions, module)?)?;
    module.add_function(wrap_pyfunction!(euler::euler_to_quaternions, module)?)?;
    module.add_function(wrap_pyfunction!(orientation::matrices_to_quaternions, module)?)?;
    module.add_function(wrap_pyfunction!(orientation::poses_to_transforms, module)?)?;
    module.add_function(wrap_pyfunction!(euler::quaternions_to_euler, module)?)?;
    module.add_function(wrap_pyfunction!(orientation::quaternions_to_matrices, module)?)?;
    module.add_function(wrap_pyfunction!(orientation::quaternions_to_rotation_vectors, module)?)?;
    module.add_function(wrap_pyfunction!(orientation::rotation_vectors_to_quaternions, module)?)?;
    module.add_function(wrap_pyfunction!(orientation::transforms_to_poses, module)?)?;
    module.add_function(wrap_pyfunction!(rotations::from_tangent, module)?)?;
    module.add_function(wrap_pyfunction!(rotations::mean_positions, module)?)?;
    module.add_function(wrap_pyfunction!(rotations::to_tangent, module)?)?;
    module.add_function(wrap_pyfunction!(two_arms::absolute_relative, module)?)?;
    module.add_function(wrap_pyfunction!(two_arms::left_right, module)?)?;
    module.add_function(wrap_pyfunction!(two_arms::mean_pose, module)?)?;
    Ok(())
}
