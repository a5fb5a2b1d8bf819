//! Control loop at 1 kHz in real time, with a new goal half-way through the movement.
//!
//!     cargo run --release --example control_loop -- reach.safetensors
//!
//! Without an argument, a small model is learnt and saved first.

use std::env;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread::sleep;
use std::time::{Duration, Instant};

use ndarray::Array2;
use pdmp_core::learning::regression::{Basis, NGnet};
use pdmp_core::{
    Command, Conditions, Controller, Demonstration, FitOptions, Kind, Model, Motion, Result, Sampling, Status, fit,
};

const PERIOD: Duration = Duration::from_millis(1);
/// Largest number of degrees of freedom, for the arrays of the loop are on the stack.
const MAX_DOFS: usize = 16;

/// Statistics of a loop, and its goal and last position.
struct Report {
    ticks: u32,
    missed_deadlines: u32,
    max_delay: Duration,
    goal: Vec<f64>,
    position: Vec<f64>,
}

/// Fits a model to reaches over obstacles of two heights, and saves it.
fn learn(path: &Path) -> Result<()> {
    let reach = |height: f64| {
        let position = Array2::from_shape_fn((101, 2), |(c, d)| {
            let s = c as f64 / 100.0;
            if d == 0 { s * s * (3.0 - 2.0 * s) } else { height * (4.0 * s * (1.0 - s)).powi(2) }
        });
        Demonstration::new(position, Sampling::Uniform { dt: 0.003 })
    };
    let options = FitOptions::new(Kind::Discrete).basis(Basis::NGnet(NGnet::default()));
    fit(&[reach(0.2)?, reach(0.5)?], &options)?.save(path)
}

/// Runs the nominal movement of the model until it has settled. Tick k is due at start + k periods. A tick that is late
/// by one or more periods counts them as missed deadlines, and advances the movement by their time too.
fn run(path: &Path) -> Result<Report> {
    let model = Arc::new(Model::load(path)?);
    let n_dofs = model.n_dofs();
    assert!(n_dofs <= MAX_DOFS, "{n_dofs} degrees of freedom: raise MAX_DOFS");
    let dt = PERIOD.as_secs_f64();
    let mut controller = Controller::new(model.primitive(), dt, &Conditions::default(), None)?;
    let mut vectors = [[0.0; MAX_DOFS]; 4];
    let [goal, position, velocity, acceleration] = vectors.each_mut().map(|vector| &mut vector[..n_dofs]);
    goal.copy_from_slice(controller.centre());
    goal[0] += 0.1;
    let mut motion = Motion { position, velocity, acceleration };

    let half_time = 0.5 * model.duration();
    let (mut ticks, mut periods, mut max_delay, mut status) = (0, 0, Duration::ZERO, Status::Working);
    let start = Instant::now();
    while status == Status::Working {
        let due = start + (periods + 1) * PERIOD;
        sleep(due.saturating_duration_since(Instant::now()));
        let delay = due.elapsed();
        let elapsed = 1 + delay.div_duration_f64(PERIOD) as u32;
        let command = Command {
            dt: Some(f64::from(elapsed) * dt),
            goal: (controller.time() >= half_time).then_some(goal),
            ..Command::default()
        };
        status = controller.update(&command, &mut motion)?;
        // Here motion.position and motion.velocity would be sent to the robot.
        (ticks, periods, max_delay) = (ticks + 1, periods + elapsed, max_delay.max(delay));
    }
    let (goal, position) = (goal.to_vec(), motion.position.to_vec());
    Ok(Report { ticks, missed_deadlines: periods - ticks, max_delay, goal, position })
}

fn main() -> Result<()> {
    let path = match env::args_os().nth(1) {
        Some(path) => PathBuf::from(path),
        None => {
            let path = env::temp_dir().join("control_loop.safetensors");
            learn(&path)?;
            path
        }
    };
    let Report { ticks, missed_deadlines, max_delay, goal, position } = run(&path)?;
    println!(
        "{}: {ticks} ticks at 1 kHz, {missed_deadlines} missed deadlines, maximum delay {max_delay:.1?}",
        path.display()
    );
    println!("goal {goal:.3?}, final position {position:.3?}");
    Ok(())
}

#[test]
fn the_movement_reaches_the_new_goal_in_real_time() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("model.safetensors");
    learn(&path).expect("a model");
    let begin = Instant::now();
    let report = run(&path).expect("a movement");
    let duration = (report.ticks + report.missed_deadlines) * PERIOD;
    assert!(duration >= Duration::from_millis(300) && duration <= begin.elapsed());
    assert!((report.goal[0] - 1.1).abs() < 1e-3);
    assert!(report.position.iter().zip(&report.goal).all(|(y, g)| (y - g).abs() < 6e-3));
}
