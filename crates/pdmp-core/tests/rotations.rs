//! Rotations as coordinates: learning, movements and control loops.
#![cfg(feature = "learning")]
#![allow(missing_docs)]

mod common;
#[path = "common/poses.rs"]
mod poses;
#[path = "common/random.rs"]
mod random;

use common::*;
use ndarray::{Array2, s};
use pdmp_core::demonstration::{QuaternionOrder, RotationColumns};
use pdmp_core::learning::{StyleOptions, Truncation, style_of};
use pdmp_core::model::{Derivative, Finding, Frame};
use pdmp_core::motion::{
    BatchConditions, Coupling, Limits, Trajectory, WithRespectTo, batch, fastest_tau, feasible, jacobian,
    prediction_band,
};
use pdmp_core::numerics::Threads;
use pdmp_core::{
    Command, Conditions, Controller, Demonstration, Error, FitOptions, Kind, Model, Motion, RotationError, Sampling,
    Status, fit, rollout,
};
use poses::*;
use random::Random;

fn demonstrations(poses: &[Array2<f64>]) -> Vec<Demonstration> {
    poses.iter().cloned().map(pose).collect()
}

fn rotating(poses: &[Array2<f64>]) -> Vec<Demonstration> {
    poses.iter().map(turning).collect()
}

fn fitted(demos: &[Demonstration], n_styles: usize) -> Model {
    fit(demos, &FitOptions::discrete().n_styles(Truncation::Rank(n_styles))).unwrap()
}

/// Largest angle between a movement and a recording over its samples.
fn largest_angle(found: &Array2<f64>, recorded: &Array2<f64>, column: usize) -> f64 {
    let rows = found.rows().into_iter().zip(recorded.rows());
    rows.map(|(a, b)| angle(rotation(a, column), rotation(b, column))).fold(0.0, f64::max)
}

/// Largest deviations of velocity and acceleration from central differences of rotation and velocity, in the body frame.
fn inconsistency(movement: &Trajectory, column: usize, dof: usize) -> [f64; 2] {
    let dt = movement.time[1] - movement.time[0];
    let [mut velocity, mut acceleration] = [0.0f64; 2];
    for k in 1..movement.time.len() - 1 {
        let at = |k: usize| rotation(movement.position.row(k), column);
        let found = angular_velocity(at(k - 1), at(k + 1), 2.0 * dt);
        for (i, found) in found.into_iter().enumerate() {
            let omega = |k: usize| movement.velocity[[k, dof + i]];
            velocity = velocity.max((found - omega(k)).abs());
            let change = (omega(k + 1) - omega(k - 1)) / (2.0 * dt);
            acceleration = acceleration.max((change - movement.acceleration[[k, dof + i]]).abs());
        }
    }
    [velocity, acceleration]
}

/// Runs a control loop, and records its motion. `command` is called before each tick.
fn run(controller: &mut Controller, ticks: usize, mut command: impl FnMut(&mut Controller, usize)) -> Trajectory {
    let (n, n_dofs) = (controller.primitive().n_coordinates(), controller.primitive().n_dofs());
    let mut movement = Trajectory {
        time: (0..ticks).map(|k| k as f64 * controller.dt()).collect(),
        position: Array2::zeros((ticks, n)),
        velocity: Array2::zeros((ticks, n_dofs)),
        acceleration: Array2::zeros((ticks, n_dofs)),
    };
    for k in 0..ticks {
        command(controller, k);
        let Trajectory { position, velocity, acceleration, .. } = &mut movement;
        let row = |rows: &mut Array2<f64>, values: &[f64]| rows.row_mut(k).assign(&ndarray::aview1(values));
        row(position, controller.position());
        row(velocity, controller.velocity());
        row(acceleration, controller.acceleration());
        controller.step().unwrap();
    }
    movement
}

#[test]
fn coordinates_and_degrees_of_freedom_are_counted_and_named() {
    let demos: Vec<Demonstration> = screws(4, 1.0, 0.4, 101, 1).into_iter().map(pose).collect();
    let names = ["x", "y", "z", "qw", "qx", "qy", "qz"].map(str::to_string);
    let demos: Vec<_> = demos.into_iter().map(|demo| demo.with_names(names.to_vec()).unwrap()).collect();
    let model = fitted(&demos, 2);
    assert_eq!((model.n_coordinates(), model.n_dofs()), (7, 6));
    assert_eq!(model.coordinate_names(), names);
    assert_eq!(model.names(), ["x", "y", "z", "qx_rot", "qy_rot", "qz_rot"]);
    assert_eq!((model.units()[0].as_str(), model.units()[5].as_str()), ("", "rad"));
    let movement = rollout(model.primitive(), &Conditions::default(), grid(0.01, 1.0)).unwrap();
    assert_eq!((movement.position.ncols(), movement.velocity.ncols(), movement.acceleration.ncols()), (7, 6, 6));
    assert_eq!((model.goals().dim(), model.starts().dim(), model.anchors().dim()), ((4, 7), (4, 7), (4, 7)));
}

/// With one style for each demonstration, all of them are reproduced, at several turns of the screw.
#[test]
fn every_style_reproduces_the_demonstrations() {
    for turned in [1.5, 4.7, 15.0] {
        let recorded = screws(6, turned, 0.5, 501, 3);
        let model = fitted(&demonstrations(&recorded), 6);
        for (m, recorded) in recorded.iter().enumerate() {
            let movement = rollout(model.primitive(), &model.conditions(&[m]).unwrap(), grid(0.01, 5.0)).unwrap();
            let error = largest_angle(&movement.position, recorded, 3);
            assert!(error <= 1e-6, "{turned}: {error:e}");
        }
    }
}

/// Three styles describe unseen rotations of three true styles, beyond half a turn too.
#[test]
fn three_styles_describe_unseen_rotations() {
    for turned in [90.0f64, 162.0, 270.0] {
        let poses = screws(64, turned.to_radians(), 0.5, 201, 5);
        let recorded: Vec<_> = poses.iter().map(|one| one.slice(s![.., 3..]).to_owned()).collect();
        let demos = rotating(&recorded);
        let model = fitted(&demos[..24], 3);
        let mut squares = 0.0;
        for (demo, recorded) in demos[24..].iter().zip(&recorded[24..]) {
            let style = style_of(&model, demo, &StyleOptions::default()).unwrap();
            let [start, goal] = [0, 200].map(|c| Some(recorded.row(c).to_vec()));
            let conditions = Conditions { style: Some(style), start, goal, ..Conditions::default() };
            let movement = rollout(model.primitive(), &conditions, grid(0.01, 2.0)).unwrap();
            let rows = movement.position.rows().into_iter().zip(recorded.rows());
            squares += rows.map(|(a, b)| angle(rotation(a, 0), rotation(b, 0)).powi(2)).sum::<f64>() / 201.0;
        }
        let error = (squares / 40.0).sqrt().to_degrees();
        println!("{turned} degrees: {error:.4} degrees rms");
        assert!(error <= 0.05, "{turned}: {error}");
    }
}

/// A model learnt in another world and with another tool frame, from quaternions of any sign, moves alike in these frames:
/// rollouts, and control loops with measurements and moved goals, with noisy positions and rotations too.
#[test]
fn movements_do_not_depend_on_the_frames() {
    let random = &mut Random(11);
    let mut worst = 0.0f64;
    for case in 0..12 {
        let noise = if case % 2 == 0 { 0.0 } else { 2e-3 };
        let mut recorded = screws(5, 1.0 + case as f64, 0.5, 151, 20 + case);
        for row in recorded.iter_mut().flat_map(|one| one.rows_mut()) {
            let shaken = times(rotation(row.view(), 3), of_vector([(); 3].map(|()| noise * random.between(-1.7, 1.7))));
            let mut row = row;
            row.slice_mut(s![3..]).assign(&ndarray::aview1(&shaken));
            row.slice_mut(s![..3]).mapv_inplace(|x| x + 0.5 * noise * random.between(-1.7, 1.7));
        }
        let (world, tool) = (random_rotation(random), random_rotation(random));
        let turned: Vec<_> = recorded.iter().map(|one| in_frames(one, world, tool, random)).collect();
        let [own, other] = [recorded, turned]
            .map(|poses| fit(&demonstrations(&poses), &FitOptions::discrete().n_styles(Truncation::Rank(3))).unwrap());
        let convert = |position: &[f64]| in_frame(position, world, tool);
        let mut compare = |a: &[f64], b: &[f64]| {
            let (a, b) = (convert(a), b);
            let position = (0..3).map(|i| (a[i] - b[i]).abs()).fold(0.0, f64::max);
            let [qa, qb] = [&a[..], b].map(|q| std::array::from_fn(|i| q[3 + i]));
            worst = worst.max(position).max(angle(qa, qb));
        };
        let [a, b] = [&own, &other]
            .map(|model| rollout(model.primitive(), &model.conditions(&[2]).unwrap(), grid(0.01, 2.5)).unwrap());
        let to_tool = matrix(back(tool));
        for k in 0..251 {
            compare(a.position.row(k).as_slice().unwrap(), b.position.row(k).as_slice().unwrap());
            let omega = apply(to_tool, std::array::from_fn(|i| a.velocity[[k, 3 + i]]));
            (0..3).for_each(|i| assert!((omega[i] - b.velocity[[k, 3 + i]]).abs() < 1e-10));
        }
        let mut loops = [&own, &other]
            .map(|model| Controller::new(model.primitive(), 0.01, &model.conditions(&[1]).unwrap(), None).unwrap());
        for k in 0..300 {
            if k == 60 {
                let goal: Vec<f64> = [0.1, 0.3, 0.2].into_iter().chain(random_rotation(random)).collect();
                loops[0].set_goal(&goal).unwrap();
                loops[1].set_goal(&convert(&goal)).unwrap();
            }
            let mut measured = loops[0].position().to_vec();
            measured[..3].iter_mut().for_each(|x| *x += random.between(-0.02, 0.02));
            let off = times(rotation(ndarray::aview1(&measured), 3), of_vector([0.05, random.next() * 0.2, -0.1]));
            measured[3..].copy_from_slice(&off);
            let converted = convert(&measured);
            for (controller, measured) in loops.iter_mut().zip([&measured, &converted]) {
                let measured = (90..120).contains(&k).then_some(&measured[..]);
                controller.step_with(&Command { measured, ..Command::default() }).unwrap();
            }
            compare(loops[0].position(), loops[1].position());
            assert_eq!(loops[0].status(), loops[1].status());
        }
    }
    println!("largest deviation {worst:e}");
    assert!(worst < 1e-10, "{worst:e}");
}

/// Velocity and acceleration are the derivatives of the rotation, in rollouts and in loops whose commands change.
#[test]
fn angular_velocity_is_the_derivative_of_the_rotation() {
    let model = fitted(&demonstrations(&screws(6, 4.7, 0.5, 301, 3)), 3);
    let conditions = model.conditions(&[2]).unwrap();
    let movement = rollout(model.primitive(), &conditions, grid(1e-3, 2.9)).unwrap();
    let [velocity, acceleration] = inconsistency(&movement, 3, 3);
    assert!(velocity < 2e-5 && acceleration < 2e-3, "{velocity:e} {acceleration:e}");

    let changed = |dt: f64| {
        let mut controller = Controller::new(model.primitive(), dt, &conditions, None).unwrap();
        let at = |seconds: f64| (seconds / dt).round() as usize;
        let events = [at(0.7), at(1.5), at(1.2)];
        let movement = run(&mut controller, at(2.5), |controller, k| match k {
            _ if events[..2].contains(&k) => {
                let mut goal = controller.centre().to_vec();
                let moved = times(rotation(ndarray::aview1(&goal), 3), of_vector([1.4, 0.0, 0.9]));
                goal[3..].copy_from_slice(&moved);
                controller.set_goal(&goal).unwrap();
            }
            _ if k == events[2] => controller.set_tau(0.8 * model.tau()).unwrap(),
            _ => {}
        });
        inconsistency(&movement, 3, 3)
    };
    // Differences of a continuous acceleration, whose slope may jump, shrink with the interval.
    let [coarse, fine] = [1e-3, 1e-4].map(changed);
    println!("{coarse:?} {fine:?}");
    assert!(coarse[0] < 5e-4 && coarse[1] < 0.1, "{coarse:?}");
    assert!(fine[0] < 0.02 * coarse[0] && fine[1] < 0.2 * coarse[1], "{coarse:?} {fine:?}");

    // A phase that a measurement slows leaves the angular velocity continuous, but for the pull of the measurement.
    let compliance = pdmp_core::motion::Compliance { stopping: 1e4, tracking: 0.0 };
    let mut controller = Controller::new(model.primitive(), 1e-3, &conditions, None).unwrap();
    controller.set_compliance(compliance).unwrap();
    let mut largest = 0.0f64;
    for k in 0..1500 {
        let before = controller.velocity().to_vec();
        let mut measured = controller.position().to_vec();
        measured[0] += 0.05;
        let measured = (500..900).contains(&k).then_some(&measured[..]);
        controller.step_with(&Command { measured, ..Command::default() }).unwrap();
        let steps = controller.velocity()[3..].iter().zip(&before[3..]).map(|(a, b)| (a - b).abs());
        largest = steps.fold(largest, f64::max);
    }
    assert!(controller.phase() > 0.1 && largest < 0.06, "{largest}");
}

#[test]
fn world_frame_expresses_the_same_movement() {
    let model = fitted(&demonstrations(&screws(6, 4.7, 0.5, 151, 3)), 3);
    let world = model.in_frame(Frame::World).unwrap();
    let conditions = model.conditions(&[2]).unwrap();
    let [a, b] = [&model, &world].map(|model| rollout(model.primitive(), &conditions, grid(0.01, 2.0)).unwrap());
    assert_eq!(a.position, b.position);
    for k in 0..201 {
        let to_world = matrix(rotation(a.position.row(k), 3));
        for (a, b) in [(&a.velocity, &b.velocity), (&a.acceleration, &b.acceleration)] {
            let expected = apply(to_world, std::array::from_fn(|i| a[[k, 3 + i]]));
            (0..3).for_each(|i| assert!((expected[i] - b[[k, 3 + i]]).abs() < 1e-12));
        }
    }
    // Commands are in that frame, too: the movement passes its goal with the given angular velocity.
    let velocity = vec![0.0, 0.0, 0.0, 0.3, -0.2, 0.5];
    let command = Conditions { goal_velocity: Some(velocity.clone()), velocity: Some(velocity.clone()), ..conditions };
    let movement = rollout(world.primitive(), &command, grid(0.01, model.duration())).unwrap();
    let last = movement.velocity.nrows() - 1;
    for k in [0, last] {
        (3..6).for_each(|d| assert!((movement.velocity[[k, d]] - velocity[d]).abs() < 1e-6));
    }
    assert_eq!(Model::from_bytes(&world.to_bytes().unwrap()).unwrap().coordinates().unwrap().frame(), Frame::World);
}

/// A movement starts at any rotation and velocity, and reaches any goal, those half a turn away included.
#[test]
fn any_start_and_goal_is_reached() {
    let model = fitted(&demonstrations(&screws(6, 4.7, 0.5, 151, 3)), 3);
    let random = &mut Random(5);
    for _ in 0..50 {
        let place = |random: &mut Random| -> Vec<f64> {
            [0.0; 3].map(|_: f64| random.between(-1.0, 1.0)).into_iter().chain(random_rotation(random)).collect()
        };
        let (start, goal) = (place(random), place(random));
        let velocity: Vec<f64> = (0..6).map(|_| random.between(-2.0, 2.0)).collect();
        let conditions = Conditions {
            start: Some(start.clone()),
            goal: Some(goal.clone()),
            velocity: Some(velocity.clone()),
            ..Conditions::default()
        };
        let mut controller = Controller::new(model.primitive(), 0.01, &conditions, None).unwrap();
        let at = |position: &[f64]| std::array::from_fn(|i| position[3 + i]);
        assert!(angle(at(controller.position()), at(&start)) < 1e-12);
        assert!(controller.velocity().iter().zip(&velocity).all(|(a, b)| (a - b).abs() < 1e-9));
        let ticks = (0..2000).take_while(|_| controller.step().unwrap() == Status::Working).count();
        assert!(ticks < 2000 && angle(at(controller.position()), at(&goal)) < 0.05, "{ticks}");
    }
}

/// A goal that turns on and on is followed without a whole turn back.
#[test]
fn goal_that_keeps_turning_is_followed_by_the_shorter_way() {
    let model = fitted(&demonstrations(&screws(6, 1.0, 0.3, 151, 3)), 3);
    let mut controller = Controller::new(model.primitive(), 0.01, &Conditions::default(), None).unwrap();
    for _ in 0..400 {
        controller.step().unwrap();
    }
    // The goal moves by half a radian each time; the rotation lags by less than twice as much.
    for _ in 0..40 {
        let mut goal = controller.centre().to_vec();
        let turned = times(rotation(ndarray::aview1(&goal), 3), of_vector([0.0, 0.0, 0.5]));
        goal[3..].copy_from_slice(&turned);
        let before = (rotation(ndarray::aview1(controller.position()), 3), controller.velocity().to_vec());
        controller.set_goal(&goal).unwrap();
        assert!(angle(before.0, rotation(ndarray::aview1(controller.position()), 3)) < 1e-12);
        assert!(controller.velocity().iter().zip(&before.1).all(|(a, b)| (a - b).abs() < 1e-12));
        for _ in 0..100 {
            controller.step().unwrap();
            let off = angle(turned, rotation(ndarray::aview1(controller.position()), 3));
            assert!(off < 1.0, "{off}");
        }
    }
}

/// Cycles are reproduced as recorded: wobbles, and a full turn a cycle, after which the quaternion has the other sign.
#[test]
fn cycles_are_reproduced_and_continuous() {
    for turns in [0.0, 1.0, 2.0] {
        let recorded = wobbles(5, turns, 200);
        let model = fit(&rotating(&recorded), &FitOptions::rhythmic().n_styles(Truncation::Rank(5))).unwrap();
        assert!(model.learnt().findings.is_empty(), "{:?}", model.learnt().findings);
        let movement = rollout(model.primitive(), &model.conditions(&[1]).unwrap(), grid(0.01, 6.0)).unwrap();
        for (k, row) in movement.position.rows().into_iter().enumerate() {
            assert!(angle(rotation(row, 0), rotation(recorded[1].row(k % 200), 0)) < 1e-6);
        }
        let next = movement.position.slice(s![1.., ..]);
        let products = (&movement.position.slice(s![..-1, ..]) * &next).sum_axis(ndarray::Axis(1));
        assert!(products.iter().all(|p| *p > 0.99));
        let [velocity, acceleration] = inconsistency(&movement, 0, 0);
        assert!(velocity < 0.02 && acceleration < 0.2, "{velocity} {acceleration}");

        let mut controller = Controller::new(model.primitive(), 1e-3, &model.conditions(&[1]).unwrap(), None).unwrap();
        for _ in 0..700 {
            controller.step().unwrap();
        }
        let before = (rotation(ndarray::aview1(controller.position()), 0), controller.velocity().to_vec());
        controller.set_phase(1.0).unwrap();
        assert!(angle(before.0, rotation(ndarray::aview1(controller.position()), 0)) < 1e-12);
        assert!(controller.velocity().iter().zip(&before.1).all(|(a, b)| (a - b).abs() < 1e-12));
    }
}

#[test]
fn batches_agree_with_rollouts() {
    for frame in [Frame::Body, Frame::World] {
        let model = fitted(&demonstrations(&screws(6, 4.7, 0.5, 151, 3)), 3).in_frame(frame).unwrap();
        let random = &mut Random(9);
        let one = |m: usize, random: &mut Random| {
            let mut conditions = model.conditions(&[m]).unwrap();
            let moved = times(rotation(ndarray::aview1(conditions.goal.as_ref().unwrap()), 3), random_rotation(random));
            conditions.goal.as_mut().unwrap()[3..].copy_from_slice(&moved);
            conditions.velocity = Some((0..6).map(|_| random.between(-1.0, 1.0)).collect());
            conditions.goal_velocity = Some((0..6).map(|_| random.between(-1.0, 1.0)).collect());
            (conditions.segment_durations, conditions.tau) = (None, Some(1.2));
            conditions
        };
        let conditions: Vec<Conditions> = (0..6).map(|m| one(m, random)).collect();
        let grid = grid(0.01, 2.0);
        let prepared = BatchConditions::each(model.primitive(), &conditions).unwrap();
        let batch = batch(model.primitive(), prepared, grid, &mut |_| Ok(())).unwrap();
        assert_eq!([batch.n_columns(Derivative::Position), batch.n_columns(Derivative::Velocity)], [7, 6]);
        let all = batch.rollouts(0..6, Derivative::Acceleration, Threads::ONE, &mut |_| Ok(())).unwrap();
        for (m, conditions) in conditions.iter().enumerate() {
            let single = rollout(model.primitive(), conditions, grid).unwrap();
            let parts = [&single.position, &single.velocity, &single.acceleration];
            for (all, single) in all.iter().zip(parts) {
                let off = (&all.index_axis(ndarray::Axis(0), m) - single).fold(0.0f64, |most, x| most.max(x.abs()));
                assert!(off < 1e-10, "{off:e}");
            }
        }
    }
}

/// Poses of a batch that differ in τ are rollouts to the bit.
#[test]
fn batches_of_different_tau_are_rollouts() {
    let model = fitted(&demonstrations(&screws(6, 4.7, 0.5, 151, 3)), 3);
    let of = |m: usize| {
        let conditions = model.conditions(&[m]).unwrap();
        let (velocity, tau) = (Some(vec![0.1 * m as f64; 6]), Some(0.8 + 0.2 * m as f64));
        Conditions { velocity, segment_durations: None, tau, ..conditions }
    };
    let (conditions, grid) = ((0..6).map(of).collect::<Vec<_>>(), grid(0.01, 2.0));
    let prepared = BatchConditions::each(model.primitive(), &conditions).unwrap();
    let batch = batch(model.primitive(), prepared, grid, &mut |_| Ok(())).unwrap();
    let all = batch.rollouts(0..6, Derivative::Velocity, Threads::ONE, &mut |_| Ok(())).unwrap();
    for (m, conditions) in conditions.iter().enumerate() {
        let single = rollout(model.primitive(), conditions, grid).unwrap();
        assert_eq!(all.position.index_axis(ndarray::Axis(0), m), single.position);
        assert_eq!(all.velocity.as_ref().unwrap().index_axis(ndarray::Axis(0), m), single.velocity);
    }
}

/// Jacobians are the small rotations that small changes of the conditions cause, in the frame of the model.
#[test]
fn jacobians_are_derivatives_of_the_movement() {
    for frame in [Frame::Body, Frame::World] {
        let model = fitted(&demonstrations(&screws(6, 4.7, 0.5, 151, 3)), 3).in_frame(frame).unwrap();
        let random = &mut Random(4);
        let mut base = model.conditions(&[2]).unwrap();
        base.segment_durations = None;
        let far = times(rotation(ndarray::aview1(base.goal.as_ref().unwrap()), 3), random_rotation(random));
        base.goal.as_mut().unwrap()[3..].copy_from_slice(&far);
        let grid = grid(0.02, 2.0);
        let turned = |position: &[f64], i: usize, h: f64| -> Vec<f64> {
            let mut moved = position.to_vec();
            if i < 3 {
                moved[i] += h;
            } else {
                let step = of_vector(std::array::from_fn(|k| if k + 3 == i { h } else { 0.0 }));
                let q = rotation(ndarray::aview1(position), 3);
                let q = if frame == Frame::Body { times(q, step) } else { times(step, q) };
                moved[3..].copy_from_slice(&q);
            }
            moved
        };
        let h = 1e-5;
        for variable in [WithRespectTo::Style, WithRespectTo::Goal, WithRespectTo::Start] {
            let found =
                jacobian(model.primitive(), variable, Derivative::Position, &base, grid, &mut |_| Ok(())).unwrap();
            for i in 0..found.dim().2 {
                let [before, after] = [-h, h].map(|h| {
                    let mut changed = base.clone();
                    match variable {
                        WithRespectTo::Style => changed.style.as_mut().unwrap()[i] += h,
                        WithRespectTo::Goal => changed.goal = Some(turned(base.goal.as_ref().unwrap(), i, h)),
                        _ => changed.start = Some(turned(base.start.as_ref().unwrap(), i, h)),
                    }
                    rollout(model.primitive(), &changed, grid).unwrap().position
                });
                for k in 0..before.nrows() {
                    let [a, b] = [&before, &after].map(|position| rotation(position.row(k), 3));
                    let body = angular_velocity(a, b, 2.0 * h);
                    let small = if frame == Frame::Body { body } else { apply(matrix(a), body) };
                    let expected = (0..3).map(|d| (after[[k, d]] - before[[k, d]]) / (2.0 * h)).chain(small);
                    for (d, expected) in expected.enumerate() {
                        assert!((found[[k, d, i]] - expected).abs() < 1e-7, "{variable:?} {k} {d} {i}");
                    }
                }
            }
        }
    }
}

/// The order of components is that of the demonstrations, everywhere.
#[test]
fn order_of_components_is_kept() {
    let recorded = screws(4, 2.0, 0.4, 101, 3);
    let swapped = recorded.iter().map(|one| {
        let mut one = one.clone();
        for mut row in one.rows_mut() {
            let [w, x, y, z] = rotation(row.view(), 3);
            row.slice_mut(s![3..]).assign(&ndarray::aview1(&[x, y, z, w]));
        }
        let columns = RotationColumns { column: 3, order: QuaternionOrder::Xyzw };
        let demo = Demonstration::new(one, Sampling::Uniform { dt: 0.01 }).unwrap();
        demo.with_rotations(vec![columns]).unwrap()
    });
    let (own, other) = (fitted(&demonstrations(&recorded), 2), fitted(&swapped.collect::<Vec<_>>(), 2));
    let [a, b] =
        [&own, &other].map(|model| rollout(model.primitive(), &Conditions::default(), grid(0.01, 1.0)).unwrap());
    for (a, b) in a.position.rows().into_iter().zip(b.position.rows()) {
        assert_eq!([a[3], a[4], a[5], a[6]], [b[6], b[3], b[4], b[5]]);
    }
    assert_eq!(a.velocity, b.velocity);
}

#[test]
fn model_file_keeps_the_coordinates() {
    let model = fitted(&demonstrations(&screws(4, 4.7, 0.5, 151, 3)), 2);
    let bytes = model.to_bytes().unwrap();
    let same = Model::from_bytes(&bytes).unwrap();
    assert_eq!(same.to_bytes().unwrap(), bytes);
    let [a, b] =
        [&model, &same].map(|model| rollout(model.primitive(), &Conditions::default(), grid(0.01, 2.0)).unwrap());
    assert_eq!(a, b);
    let mut running = Controller::new(model.primitive(), 0.01, &Conditions::default(), None).unwrap();
    for _ in 0..50 {
        running.step().unwrap();
    }
    let mut restored = Controller::restore(model.primitive(), &running.snapshot()).unwrap();
    for _ in 0..100 {
        running.step().unwrap();
        restored.step().unwrap();
        assert_eq!((running.position(), running.velocity()), (restored.position(), restored.velocity()));
    }
    assert_eq!(running.centre(), restored.centre());
}

/// A measured pose pulls the rotation towards it by the shorter way, and coupling terms add to angular velocities.
#[test]
fn measurements_and_couplings_act_on_rotations() {
    let model = fitted(&demonstrations(&screws(6, 1.0, 0.3, 151, 3)), 3);
    let mut controller = Controller::new(model.primitive(), 0.01, &Conditions::default(), None).unwrap();
    for _ in 0..50 {
        controller.step().unwrap();
    }
    let phase = controller.phase();
    let blocked = controller.position().to_vec();
    let held: [f64; 4] = std::array::from_fn(|i| blocked[3 + i]);
    for k in 0..300 {
        // The sign of a measured quaternion has no meaning.
        let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
        let measured: Vec<f64> = blocked[..3].iter().copied().chain(held.map(|x| sign * x)).collect();
        controller.step_with(&Command { measured: Some(&measured), ..Command::default() }).unwrap();
    }
    assert!(angle(held, rotation(ndarray::aview1(controller.position()), 3)) < 0.2);
    assert!(controller.phase() > 0.3 * phase, "3 s are two durations: {} {phase}", controller.phase());

    let mut free = Controller::new(model.primitive(), 1e-3, &Conditions::default(), None).unwrap();
    for _ in 0..500 {
        free.step().unwrap();
    }
    let mut coupled = free.clone();
    let (velocity, none) = ([0.0, 0.0, 0.0, 0.2, -0.1, 0.3], [0.0; 6]);
    free.step().unwrap();
    let coupling = Some(Coupling { velocity: &velocity, acceleration: &none });
    coupled.step_with(&Command { coupling, ..Command::default() }).unwrap();
    for (d, expected) in velocity.into_iter().enumerate() {
        let added = coupled.velocity()[d] - free.velocity()[d];
        assert!((added - expected).abs() < 0.01, "{d}: {added}");
    }
}

#[test]
fn other_degrees_of_freedom_keep_their_limits() {
    let model = fitted(&demonstrations(&screws(6, 4.7, 0.5, 151, 3)), 3);
    let with = |bound: f64, of_rotation: f64| Limits {
        velocity: Some([[bound; 3], [of_rotation; 3]].concat()),
        ..Limits::default()
    };
    let free = f64::INFINITY;
    let mut controller = Controller::new(model.primitive(), 0.01, &Conditions::default(), None).unwrap();
    controller.set_limits(&with(0.2, free)).unwrap();
    for _ in 0..400 {
        controller.step().unwrap();
        assert!(controller.velocity()[..3].iter().all(|v| v.abs() <= 0.2 * (1.0 + 1e-12)));
    }
    let conditions = Conditions::default();
    assert!(!feasible(model.primitive(), &with(0.2, free), &conditions).unwrap().is_feasible());
    assert!(fastest_tau(model.primitive(), &with(0.2, free), &conditions).unwrap() > model.tau());
}

#[test]
fn quaternions_that_are_none_are_refused() {
    let good = screws(1, 1.0, 0.3, 101, 3).remove(0);
    let with = |row: usize, factor: f64| {
        let mut bad = good.clone();
        bad.slice_mut(s![row, 3..]).mapv_inplace(|x| x * factor);
        Demonstration::new(bad, Sampling::Uniform { dt: 0.01 }).unwrap().with_rotations(vec![COLUMNS])
    };
    for factor in [0.0, 0.998, 1.002, 2.0] {
        let error = with(17, factor).unwrap_err();
        assert!(matches!(error, Error::Rotation(RotationError::Norm { row: Some(17), column: 3, .. })), "{error}");
        assert!(error.to_string().contains("position[17, 3:7] has norm"), "{error}");
    }
    let mended = with(17, 1.0005).unwrap();
    let square: f64 = mended.position().slice(s![17, 3..]).iter().map(|x| x * x).sum();
    assert!((square - 1.0).abs() < 1e-15);

    let model = fitted(&[pose(good.clone())], 1);
    let zero = vec![0.0; 7];
    let mut controller = Controller::new(model.primitive(), 0.01, &Conditions::default(), None).unwrap();
    assert!(matches!(
        controller.set_goal(&zero),
        Err(Error::Rotation(RotationError::Norm { name: "goal", row: None, .. }))
    ));
    let measured = Command { measured: Some(&zero), ..Command::default() };
    assert!(matches!(
        controller.step_with(&measured),
        Err(Error::Rotation(RotationError::Norm { name: "measured", .. }))
    ));
    assert!(matches!(controller.set_goal(&zero[..6]), Err(Error::Length { expected: 7, .. })));
    let mut short = [vec![0.0; 6], vec![0.0; 6], vec![0.0; 6]];
    let [position, velocity, acceleration] = &mut short;
    let mut motion = Motion { position, velocity, acceleration };
    assert!(matches!(controller.update(&Command::default(), &mut motion), Err(Error::Length { expected: 7, .. })));

    let columns = |column| RotationColumns { column, order: QuaternionOrder::Wxyz };
    for wrong in [vec![columns(4)], vec![columns(usize::MAX)], vec![columns(0), columns(3)]] {
        let demo = Demonstration::new(good.clone(), Sampling::Uniform { dt: 0.01 }).unwrap();
        assert!(demo.with_rotations(wrong).is_err());
    }
}

#[test]
fn suspicious_rotations_are_reported_or_refused() {
    let recorded = screws(5, 1.0, 0.3, 101, 3);
    let plain: Vec<_> =
        recorded.iter().map(|one| Demonstration::new(one.clone(), Sampling::Uniform { dt: 0.01 }).unwrap()).collect();
    let findings = fit(&plain, &FitOptions::discrete()).unwrap().learnt().findings.clone();
    assert!(matches!(&findings[..], [Finding::Quaternion { column: 3, .. }]), "{findings:?}");
    assert!(findings[0].to_string().contains("rotations={3: \"wxyz\"}"));

    let away = |angle: f64| {
        let mut poses = recorded.clone();
        poses[4] = in_frames(&poses[4], [1.0, 0.0, 0.0, 0.0], turn([1.0, 0.0, 0.0], angle), &mut Random(1));
        fit(&demonstrations(&poses), &FitOptions::discrete())
    };
    let findings = away(2.2).unwrap().learnt().findings.clone();
    assert!(matches!(&findings[..], [Finding::FarRotation { demo: 4, .. }]), "{findings:?}");
    // Four equal demonstrations, and one that is half a turn from their mean and turns through it.
    let mut poses = vec![recorded[0].clone(); 60];
    for (c, mut row) in poses[59].rows_mut().into_iter().enumerate() {
        let q = times(rotation(row.view(), 3), turn([1.0, 0.0, 0.0], 2.0 + 0.02 * c as f64));
        row.slice_mut(s![3..]).assign(&ndarray::aview1(&q));
    }
    let error = fit(&demonstrations(&poses), &FitOptions::discrete()).unwrap_err();
    assert!(error.to_string().starts_with("demo 59: position["), "{error}");

    let mixed = [pose(recorded[0].clone()), plain[1].clone()];
    assert!(fit(&mixed, &FitOptions::discrete()).unwrap_err().to_string().contains("rotations"));
}

/// A band has the degrees of freedom as columns; those of a rotation are about the prediction, in any frame as wide.
#[test]
fn bands_of_rotations_are_about_the_prediction() {
    let recorded = screws(5, 1.0, 0.3, 101, 3);
    let model = fit(
        &demonstrations(&recorded),
        &FitOptions::discrete()
            .contexts((0..5).map(|m| vec![pdmp_core::demonstration::ContextValue::from(f64::from(m))]).collect()),
    )
    .unwrap();
    let prediction = model.predict(&[1.5]).unwrap();
    assert_eq!(prediction.conditions.goal.as_ref().unwrap().len(), 7);
    let band = prediction_band(&model, &prediction, 0.9, grid(0.01, 1.0)).unwrap();
    assert_eq!(band.lower.dim(), (101, 6));
    let world = prediction_band(&model.in_frame(Frame::World).unwrap(), &prediction, 0.9, grid(0.01, 1.0)).unwrap();
    let squares = |band: &Array2<f64>, k: usize| (3..6).map(|d| band[[k, d]].powi(2)).sum::<f64>();
    for k in 0..101 {
        assert!((3..6).all(|d| band.lower[[k, d]] == -band.upper[[k, d]]));
        // The trace of a covariance does not depend on the frame.
        let (own, other) = (squares(&band.upper, k), squares(&world.upper, k));
        assert!((own - other).abs() < 1e-9 * own, "{k}: {own} {other}");
    }
    assert!(squares(&band.upper, 50) > 1e-4);
}

/// Two demonstrations nearly half a turn apart have a mean between them, and both are reproduced.
#[test]
fn demonstrations_nearly_opposite_are_reproduced() {
    let one = screws(1, 1.0, 0.3, 201, 3).remove(0);
    let other = in_frames(&one, [1.0, 0.0, 0.0, 0.0], turn([1.0, 0.4, 0.0], 3.1), &mut Random(2));
    let recorded = [one, other];
    let model = fitted(&demonstrations(&recorded), 2);
    for (m, recorded) in recorded.iter().enumerate() {
        let movement = rollout(model.primitive(), &model.conditions(&[m]).unwrap(), grid(0.01, 2.0)).unwrap();
        assert!(largest_angle(&movement.position, recorded, 3) < 1e-5);
    }
}

/// A length weighs rotations against positions; styles of the heavier ones come first.
#[test]
fn rotation_length_weighs_rotations() {
    let demos = demonstrations(&screws(6, 1.0, 0.4, 151, 3));
    let error = |length: f64| {
        let options = FitOptions::discrete().n_styles(Truncation::Rank(1)).rotation_length(length);
        let model = fit(&demos, &options).unwrap();
        let movement = rollout(model.primitive(), &model.conditions(&[3]).unwrap(), grid(0.01, 1.5)).unwrap();
        largest_angle(&movement.position, &demos[3].position().to_owned(), 3)
    };
    assert!(error(100.0) < 0.8 * error(1e-3));
    let scale = fit(&demos, &FitOptions::discrete().rotation_length(0.25)).unwrap().learnt().dof_scale.clone();
    assert_eq!(scale, [1.0, 1.0, 1.0, 4.0, 4.0, 4.0]);
    assert!(fit(&demos, &FitOptions::discrete().rotation_length(-1.0)).is_err());
    assert_eq!(fit(&demos, &FitOptions::new(Kind::Discrete)).unwrap().n_dofs(), 6);
}
