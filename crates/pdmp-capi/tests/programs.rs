//! C and C++ programs, built with the system's compilers against the static and the shared library, produce the motion
//! of Rust to the bit.
#![cfg(unix)]
#![allow(missing_docs)]

#[path = "../../pdmp-core/tests/common/mod.rs"]
mod common;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command as Process, Output};

use common::*;
use ndarray::Array2;
use pdmp_core::inference::{At, PassageOptions, Recogniser, Timing, ViaPoint, through};
use pdmp_core::learning::learn_prior;
use pdmp_core::motion::Compliance;
use pdmp_core::motion::Coupling;
use pdmp_core::motion::{Limits, TimeGrid};
use pdmp_core::numerics::Threads;
use pdmp_core::{Command, Conditions, Controller, Demonstration, Kind, Model, Sampling, Status, rollout};
use tempfile::TempDir;

const C: [&str; 2] = ["cc", "-std=c11"];
const CPP: [&str; 2] = ["c++", "-std=c++17"];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap()
}

fn run(process: &mut Process) -> Output {
    process.output().unwrap_or_else(|error| panic!("{:?} is needed for this test: {error}", process.get_program()))
}

/// Returns the version of the ABI, which before 1.0 changes with each minor version.
fn abi_version() -> String {
    match env!("CARGO_PKG_VERSION_MAJOR") {
        "0" => format!("0.{}", env!("CARGO_PKG_VERSION_MINOR")),
        major => major.to_string(),
    }
}

/// Builds a program with each library, runs both in `folder`, and returns their outputs.
fn outputs(compiler: [&str; 2], source: &Path, folder: &Path, arguments: &[&str]) -> [String; 2] {
    // Cargo builds the libraries into the folder of the tests.
    let libraries = std::env::current_exe().unwrap().parent().unwrap().to_path_buf();
    // The SONAME of the shared library has the version of the ABI.
    let link = folder.join(format!("libpdmp.so.{}", abi_version()));
    if !link.exists() {
        std::os::unix::fs::symlink(libraries.join("libpdmp.so"), &link).unwrap();
    }
    let search = format!("-L{}", libraries.display());
    let rpath = format!("-Wl,-rpath,{}", folder.canonicalize().unwrap().display());
    let archive = libraries.join("libpdmp.a").display().to_string();
    let links: [&[&str]; 2] = [&[&archive, "-lpthread", "-ldl", "-lm"], &[&search, "-lpdmp", &rpath]];
    links.map(|link| {
        let program = folder.join("program");
        let [compiler, standard] = compiler;
        let built = run(Process::new(compiler)
            .args([standard, "-O2", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-I"])
            .arg(root().join("crates/pdmp-capi/include"))
            .arg(source)
            .arg("-o")
            .arg(&program)
            .args(link));
        assert!(built.status.success(), "{compiler} {link:?}: {}", String::from_utf8_lossy(&built.stderr));
        let ran = run(Process::new(&program).args(arguments).current_dir(folder));
        assert!(ran.status.success(), "{link:?}: {}", String::from_utf8_lossy(&ran.stderr));
        String::from_utf8(ran.stdout).unwrap()
    })
}

/// Parses a number that C printed with `%a`: ±0xh.hhhp±d.
fn parse_hexadecimal(text: &str) -> f64 {
    let (sign, digits) = text.strip_prefix('-').map_or((1.0, text), |digits| (-1.0, digits));
    let (mantissa, exponent) = digits.strip_prefix("0x").unwrap().split_once('p').unwrap();
    let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    let digits = u64::from_str_radix(&format!("{whole}{fraction}"), 16).unwrap();
    // All factors are exact. The power of two is split in half, for the exponent of a subnormal number is out of range.
    let exponent: i32 = exponent.parse::<i32>().unwrap() - 4 * fraction.len() as i32;
    sign * digits as f64 * 2f64.powi(exponent / 2) * 2f64.powi(exponent - exponent / 2)
}

/// Returns the bits of the numbers in each line, without the first `skip` words.
fn bits(printed: &str, skip: usize) -> Vec<Vec<u64>> {
    let line = |line: &str| line.split_whitespace().skip(skip).map(|text| parse_hexadecimal(text).to_bits()).collect();
    printed.lines().map(line).collect()
}

/// Returns the bits of position, velocity and acceleration.
fn motion(controller: &Controller) -> Vec<u64> {
    let vectors = [controller.position(), controller.velocity(), controller.acceleration()];
    vectors.concat().iter().map(|number| number.to_bits()).collect()
}

fn saved(model: &Model, name: &str) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    model.save(&folder.path().join(name)).unwrap();
    folder
}

#[test]
fn hexadecimal_numbers_are_parsed_exactly() {
    for (text, number) in [("0x1.999999999999ap-4", 0.1), ("-0x1p+1", -2.0), ("0x0p+0", 0.0), ("0x1.8p-1", 0.75)] {
        assert_eq!(parse_hexadecimal(text).to_bits(), f64::to_bits(number));
    }
}

#[test]
fn the_c_example_matches_rust_to_the_bit() {
    let model = learn(&reaches(), &options(Kind::Discrete));
    let conditions = conditions_of(&model, model.n_demos() - 1);
    let goal: Vec<f64> = conditions.goal.as_ref().unwrap().iter().map(|g| g + 0.125).collect();
    let mut controller = Controller::new(model.primitive(), 1e-3, &conditions, None).unwrap();
    let (mut expected, mut robot) = (Vec::new(), Vec::new());
    for tick in 0.. {
        let held = (500..700).contains(&tick);
        let command =
            Command { goal: (tick >= 300).then_some(&goal), measured: held.then_some(&robot), ..Command::default() };
        let status = common::tick(&mut controller, &command).unwrap();
        expected.push(motion(&controller));
        if status == Status::Finished {
            break;
        }
        if !held {
            robot = controller.position().to_vec();
        }
    }
    assert!(expected.len() > 1000);

    let folder = saved(&model, "reach.safetensors");
    let source = root().join("examples/c/control_loop.c");
    for printed in outputs(C, &source, folder.path(), &["reach.safetensors"]) {
        assert_eq!(bits(&printed, 1), expected);
        let statuses: String = printed.lines().map(|line| &line[..1]).collect();
        assert_eq!(statuses, "1".repeat(expected.len() - 1) + "2");
    }
}

#[test]
fn the_cpp_example_matches_rust_to_the_bit() {
    let model = learn(&cycles(), &options(Kind::Rhythmic));
    let conditions = conditions_of(&model, 0);
    let anchor: Vec<f64> = conditions.anchor.as_ref().unwrap().iter().map(|y_a| y_a + 0.25).collect();
    let mut controller = Controller::new(model.primitive(), 1e-3, &conditions, None).unwrap();
    let limits = Limits { velocity: Some(vec![3.0]), acceleration: Some(vec![60.0]), ..Limits::default() };
    controller.set_limits(&limits).unwrap();
    let mut n_limited = 0;
    let expected: Vec<_> = (0..3000)
        .map(|tick| {
            let late = tick >= 2000;
            let command = Command {
                anchor: (tick >= 1000).then_some(&anchor),
                tau: late.then_some(1.5 * model.tau()),
                amplitude: late.then_some(0.5),
                ..Command::default()
            };
            common::tick(&mut controller, &command).unwrap();
            n_limited += controller.limited().iter().flatten().count();
            motion(&controller)
        })
        .collect();
    assert!(n_limited > 0);

    let folder = saved(&model, "cycle.safetensors");
    let source = root().join("examples/c/control_loop.cpp");
    for printed in outputs(CPP, &source, folder.path(), &["cycle.safetensors"]) {
        assert_eq!(bits(&printed, 1), expected);
    }
}

#[test]
fn the_snippet_of_the_readme_matches_rust_to_the_bit() {
    let demos: Vec<_> = [0.0, 0.15, 0.3, 0.45, 0.6].map(bend).into();
    let model = learn(&demos, &options(Kind::Discrete));
    let mut controller = Controller::new(model.primitive(), 1e-3, &Conditions::default(), None).unwrap();
    let command = Command { goal: Some(&[1.2, 0.1]), ..Command::default() };
    let mut expected: Vec<Vec<u64>> = Vec::new();
    while common::tick(&mut controller, &command).unwrap() == Status::Working {
        expected.push([controller.position(), controller.velocity()].concat().iter().map(|x| x.to_bits()).collect());
    }

    let readme = fs::read_to_string(root().join("README.md")).unwrap();
    let snippet = readme.split("```c\n").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
    let (includes, body): (Vec<&str>, Vec<&str>) = snippet.lines().partition(|line| line.starts_with('#'));
    let send = r#"
        static void send(const double *y, const double *v) { printf("%a %a %a %a\n", y[0], y[1], v[0], v[1]); }
    "#;
    let program =
        format!("#include <stdio.h>\n{}{send}int main(void) {{\n{}\n}}", includes.join("\n"), body.join("\n"));
    let folder = saved(&model, "reach.safetensors");
    let source = folder.path().join("snippet.c");
    fs::write(&source, program).unwrap();
    for printed in outputs(C, &source, folder.path(), &[]) {
        assert_eq!(bits(&printed, 0), expected);
    }
}

/// Returns a demonstration of the README.
fn bend(h: f64) -> Demonstration {
    let position = Array2::from_shape_fn((101, 2), |(c, d)| {
        let s = c as f64 / 100.0;
        if d == 0 { minimum_jerk(s) } else { h * 64.0 * (s - s * s).powi(3) }
    });
    Demonstration::new(position, Sampling::Uniform { dt: 0.01 }).unwrap()
}

#[test]
fn the_c_example_of_recognition_matches_rust_to_the_bit() {
    let demos = reaches();
    let model = learn(&demos, &options(Kind::Discrete));
    let prior = learn_prior(&model, &demos, None, Threads::ONE).unwrap();
    let folder = tempfile::tempdir().unwrap();
    prior.save(&model, &folder.path().join("reach.safetensors")).unwrap();

    let last = model.conditions(&[model.n_demos() - 1]).unwrap();
    let tau = Some(last.time_constant(model.primitive()).unwrap());
    let last = Conditions { tau, segment_durations: None, ..last };
    let movement = rollout(model.primitive(), &last, TimeGrid { dt: 0.01, duration: Some(0.49) }).unwrap();
    let mut recogniser = Recogniser::new(&model, &prior, Timing::default()).unwrap();
    let of = |numbers: &[f64]| numbers.iter().map(|number| number.to_bits()).collect::<Vec<u64>>();
    let mut expected = Vec::new();
    for (k, position) in movement.position.rows().into_iter().enumerate() {
        recogniser.update(0.01 * k as f64, &position.to_vec()).unwrap();
        let estimate = recogniser.estimate().unwrap();
        expected.push(of(&[&[estimate.arrival], estimate.goal()].concat()));
    }
    let times: Vec<f64> = (0..10).map(|k| 0.01 * 49.0 + 0.02 * f64::from(k + 1)).collect();
    let ahead = recogniser.continuation(&times).unwrap();
    let rows = ahead.position.rows().into_iter().zip(ahead.deviation.rows());
    expected.extend(rows.map(|(mean, deviation)| of(&[mean.to_vec(), deviation.to_vec()].concat())));

    let estimate = recogniser.estimate().unwrap();
    let tau = estimate.duration / (model.duration() / model.tau());
    let estimated = Conditions { tau: Some(tau), segment_durations: None, ..estimate.conditions() };
    let height = ahead.position[[9, 1]] + 0.05;
    let point = ViaPoint { dofs: Some(vec![1]), ..ViaPoint::new(At::Time(times[9]), vec![height]) };
    let passage = through(&model, &[point], &estimated, &PassageOptions::default()).unwrap();
    let mut controller = Controller::new(model.primitive(), 1e-3, &passage.conditions, None).unwrap();
    for tick in 1..=700 {
        controller.step().unwrap();
        expected.push(of(controller.position()));
        if tick == 690 {
            assert!((controller.position()[1] - height).abs() < 1e-9);
        }
    }
    let source = root().join("examples/c/recognition.c");
    for printed in outputs(C, &source, folder.path(), &["reach.safetensors"]) {
        assert_eq!(bits(&printed, 0), expected);
    }
}

#[test]
fn every_member_of_the_cpp_wrapper_matches_rust_to_the_bit() {
    let units = ["rad", "rad", "m"].map(String::from).to_vec();
    let demos: Vec<_> = reaches().into_iter().map(|demo| demo.with_units(units.clone()).unwrap()).collect();
    let model = learn(&demos, &options(Kind::Discrete));
    let mut conditions = model.predict(&[0.2]).unwrap().conditions;
    conditions.velocity = Some(vec![0.0; 3]);
    let mut controller = Controller::new(model.primitive(), 2e-3, &conditions, Some(0.0)).unwrap();
    let (goal, measured) = ([0.75, 0.5, 0.25], [0.5, 0.25, 0.0]);
    let each = |limit| Some(vec![limit; 3]);
    let limits = Limits {
        upper: each(1.0),
        velocity: each(0.25),
        acceleration: each(5.0),
        jerk: each(100.0),
        ..Limits::default()
    };
    let mut expected: Vec<_> = (0..500)
        .map(|tick| {
            match tick {
                100 => controller.set_style(&conditions_of(&model, 0).style.unwrap()).unwrap(),
                150 => controller.set_goal(&goal).unwrap(),
                200 => controller.set_tau(1.5).unwrap(),
                220 => controller.set_tolerance(0.05).unwrap(),
                230 => controller.set_limits(&limits).unwrap(),
                450 => controller.set_limits(&Limits::default()).unwrap(),
                250 => controller.set_compliance(Compliance { stopping: 100.0, tracking: 5.0 }).unwrap(),
                _ => {}
            }
            // The program sends commands at even ticks.
            let commanded = |from, to| tick % 2 == 0 && (from..to).contains(&tick);
            let command = Command {
                measured: commanded(300, 350).then_some(&measured),
                coupling: commanded(400, 500).then_some(Coupling { velocity: &measured, acceleration: &goal }),
                ..Command::default()
            };
            common::tick(&mut controller, &command).unwrap();
            motion(&controller)
        })
        .collect();

    let grid = TimeGrid { dt: 0.01, duration: Some(0.39) };
    let rolled = rollout(model.primitive(), &model.predict(&[0.2]).unwrap().conditions, grid).unwrap();
    expected.extend((0..40).map(|k| {
        let rows = [&rolled.position, &rolled.velocity, &rolled.acceleration].map(|samples| samples.row(k));
        rows.iter().flatten().map(|number| number.to_bits()).collect()
    }));

    let folder = tempfile::tempdir().unwrap();
    let prior = learn_prior(&model, &demos, None, Threads::ONE).unwrap();
    prior.save(&model, &folder.path().join("reach.safetensors")).unwrap();
    let source = root().join("crates/pdmp-capi/tests/wrapper.cpp");
    for printed in outputs(CPP, &source, folder.path(), &["reach.safetensors"]) {
        assert_eq!(bits(&printed, 0), expected);
    }
}
