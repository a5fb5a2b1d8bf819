//! A control loop at 1 kHz on the clock, with a new goal half way.
//!
//!     cargo run --release --example control_loop -- reach.safetensors
//!
//! Without a model file it learns a small model and writes one first.

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
/// The loop's vectors live on the stack: room for as many degrees of freedom.
const MOST_DOFS: usize = 16;

/// What a loop did.
struct Report {
    ticks: u32,
    missed: u32,
    worst: Duration,
    goal: Vec<f64>,
    position: Vec<f64>,
}

/// Reaches over two obstacles, learnt and saved.
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

/// Runs the model's nominal movement until it has settled: tick k is due at start + k periods. One that comes whole
/// periods late has missed deadlines, and makes good for them at once.
fn run(path: &Path) -> Result<Report> {
    let model = Arc::new(Model::load(path)?);
    let n_dofs = model.n_dofs();
    assert!(n_dofs <= MOST_DOFS, "{n_dofs} degrees of freedom: raise MOST_DOFS");
    let dt = PERIOD.as_secs_f64();
    let mut controller = Controller::new(model.primitive(), dt, &Conditions::default(), None)?;
    let mut vectors = [[0.0; MOST_DOFS]; 4];
    let [goal, position, velocity, acceleration] = vectors.each_mut().map(|vector| &mut vector[..n_dofs]);
    goal.copy_from_slice(controller.centre());
    goal[0] += 0.1;
    let mut motion = Motion { position, velocity, acceleration };

    let half_way = 0.5 * model.duration();
    let (mut ticks, mut periods, mut worst, mut status) = (0, 0, Duration::ZERO, Status::Working);
    let start = Instant::now();
    while status == Status::Working {
        let due = start + (periods + 1) * PERIOD;
        sleep(due.saturating_duration_since(Instant::now()));
        let late = due.elapsed();
        let passed = 1 + late.div_duration_f64(PERIOD) as u32;
        let command = Command {
            dt: Some(f64::from(passed) * dt),
            goal: (controller.time() >= half_way).then_some(goal),
            ..Command::default()
        };
        status = controller.update(&command, &mut motion)?;
        // A robot would be sent motion.position and motion.velocity here.
        (ticks, periods, worst) = (ticks + 1, periods + passed, worst.max(late));
    }
    Ok(Report { ticks, missed: periods - ticks, worst, goal: goal.to_vec(), position: motion.position.to_vec() })
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
    let Report { ticks, missed, worst, goal, position } = run(&path)?;
    println!("{ticks} ticks at 1 kHz, {missed} deadlines missed, at worst {worst:.1?} late");
    println!("from {}: to {goal:.3?}, at {position:.3?}", path.display());
    Ok(())
}

#[test]
fn arrives_at_the_new_goal_on_time() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("model.safetensors");
    learn(&path).expect("a model");
    let begin = Instant::now();
    let report = run(&path).expect("a movement");
    let moved = (report.ticks + report.missed) * PERIOD;
    assert!(moved > Duration::from_millis(300) && moved <= begin.elapsed());
    assert!((report.goal[0] - 1.1).abs() < 1e-3);
    assert!(report.position.iter().zip(&report.goal).all(|(y, g)| (y - g).abs() < 2e-3));
}
