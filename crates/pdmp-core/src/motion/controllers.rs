//! Many movements of one primitive, stepped together.

use std::sync::Arc;

use crate::error::{Error, Result};
use crate::model::conditions::Conditions;
use crate::model::primitive::Primitive;
use crate::motion::commands::{Commands, Motions};
use crate::motion::controller::{Controller, Status};
use crate::motion::limits::Limits;
use crate::motion::shares::{Part, Shares, is_selected};
use crate::numerics::threads::Threads;
use crate::validate::check_length;

/// Controllers of B movements of one primitive, with ticks of one length.
///
/// Each moves as a [`Controller`] of its own would, to the bit. Between changes of their commands, movements are kept in
/// compact memory and advanced in one loop; a movement in transition, within limits, perturbed, past its end or with
/// rotations takes the tick of its controller. After [`Controllers::new`], ticks and commands do not allocate.
///
/// ```
/// use ndarray::array;
/// use pdmp_core::motion::{Commands, Controllers, Motions};
/// # use pdmp_core::{Conditions, Demonstration, FitOptions, Kind, Status, fit};
/// # fn main() -> pdmp_core::Result<()> {
/// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
/// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
/// let mut controllers = Controllers::new(model.primitive(), 1e-3, &vec![Conditions::default(); 2], None)?;
/// let (mut y, mut v, mut a) = ([0.0; 4], [0.0; 4], [0.0; 4]);
/// let mut motions = Motions { position: &mut y, velocity: &mut v, acceleration: &mut a };
/// let goals = array![[1.2, 0.1], [0.9, 0.0]];
/// controllers.update(&Commands { goal: Some(goals.view()), ..Commands::default() }, None, &mut motions)?;
/// while controllers.statuses().contains(&Status::Working) {
///     controllers.step(None, &mut motions)?;
/// }
/// assert!((motions.position[0] - 1.2).abs() < 0.01 && (motions.position[2] - 0.9).abs() < 0.01);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Controllers {
    /// Commands of all movements, and the state of those that are not steady.
    pub(super) controllers: Vec<Controller>,
    /// Steady movements.
    shares: Shares,
    statuses: Vec<Status>,
}

impl Controllers {
    /// Starts one movement for each of `conditions`, with the tick and the transition of [`Controller::new`].
    ///
    /// # Errors
    /// As for [`Controller::new`], no movement, or more movements than fit into memory.
    pub fn new(
        primitive: &Arc<Primitive>,
        dt: f64,
        conditions: &[Conditions],
        transition: Option<f64>,
    ) -> Result<Self> {
        Self::check_memory(primitive, conditions.len())?;
        let new = |(b, conditions)| match Controller::new(primitive, dt, conditions, transition) {
            Ok(controller) => Ok(controller.with_prefetch(0.0)),
            // These two are those of all movements.
            Err(error) if matches!(error.argument(), Some("dt" | "transition")) => Err(error),
            Err(error) => Err(error.in_movement(b)),
        };
        let controllers = conditions.iter().enumerate().map(new).collect::<Result<Vec<_>>>()?;
        let n = controllers.len();
        let first = controllers.first().ok_or(Error::Argument { name: "conditions", problem: "must not be empty" })?;
        let (shares, statuses) = (Shares::new(first, n, Threads::ONE), vec![Status::Working; n]);
        Ok(Self { controllers, shares, statuses })
    }

    /// Returns the movements with ticks on several threads, which wait for them until the movements are dropped; a copy has
    /// threads of its own.
    ///
    /// The motion is that of one thread, to the bit. A tick neither locks nor allocates. It wakes threads that sleep, by a system
    /// call: they sleep when no tick has followed for some fifty microseconds. It waits for movements that another thread is
    /// advancing, and takes all that no other has begun: a thread that the system does not run delays no tick that it has no part
    /// in. In the child of a fork, the calling thread performs all.
    ///
    /// ```
    /// # use pdmp_core::motion::Controllers;
    /// # use pdmp_core::numerics::Threads;
    /// # use pdmp_core::{Conditions, Demonstration, FitOptions, Kind, fit};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// let controllers = Controllers::new(model.primitive(), 1e-3, &vec![Conditions::default(); 4096], None)?;
    /// let controllers = controllers.with_threads(Threads::new(2)?);
    /// assert_eq!(controllers.threads().get(), 2);
    /// # Ok(())
    /// # }
    /// ```
    pub fn with_threads(mut self, threads: Threads) -> Self {
        for b in 0..self.len() {
            self.leave(b);
        }
        self.shares = Shares::new(&self.controllers[0], self.len(), threads);
        for (b, controller) in self.controllers.iter().enumerate() {
            self.shares.admit(b, controller);
        }
        self
    }

    /// Returns the number of threads of a tick.
    pub fn threads(&self) -> Threads {
        self.shares.threads()
    }

    /// Returns the number B of movements.
    #[allow(clippy::len_without_is_empty)]
    pub fn len(&self) -> usize {
        self.controllers.len()
    }

    /// Returns the primitive.
    pub fn primitive(&self) -> &Arc<Primitive> {
        self.controllers[0].primitive()
    }

    /// Returns the length of a tick, in seconds.
    pub fn dt(&self) -> f64 {
        self.controllers[0].dt()
    }

    /// Returns the status of each movement (B,) after its last tick.
    pub fn statuses(&self) -> &[Status] {
        &self.statuses
    }

    /// Returns the number of movements that the next tick advances in compact memory.
    pub fn n_steady(&self) -> usize {
        self.shares.n_steady()
    }

    /// Performs one tick without new commands of the movements that `mask` (B,) selects, or of all, and writes their motion.
    ///
    /// # Errors
    /// A mask or outputs of a wrong length, or a tick longer than 1000 τ of a movement. No movement is changed then.
    pub fn step(&mut self, mask: Option<&[bool]>, motions: &mut Motions) -> Result<()> {
        self.check(mask, motions)?;
        if self.n_steady() < self.len() {
            for b in 0..self.len() {
                if !self.shares.holds(b) && is_selected(mask, b) {
                    self.controllers[b].check_tick_length(self.dt(), None)?;
                }
            }
        }
        self.advance(mask, motions, &|controller, _| controller.step())
    }

    /// Performs one tick under commands of the movements that `mask` (B,) selects, or of all, and writes their motion.
    ///
    /// ```
    /// # use pdmp_core::motion::{Commands, Controllers, Motions};
    /// # use pdmp_core::{Conditions, Demonstration, FitOptions, Kind, fit};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// # let mut controllers = Controllers::new(model.primitive(), 1e-3, &vec![Conditions::default(); 2], None)?;
    /// # let (mut y, mut v, mut a) = ([0.0; 4], [0.0; 4], [0.0; 4]);
    /// # let mut motions = Motions { position: &mut y, velocity: &mut v, acceleration: &mut a };
    /// let slower = Commands { tau: Some(&[2.0, 2.0]), ..Commands::default() };
    /// controllers.update(&slower, Some(&[false, true]), &mut motions)?;
    /// assert_eq!((controllers.get(0)?.tau(), controllers.get(1)?.tau()), (model.tau(), 2.0));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// As for [`Controllers::step`] and [`Controller::update`]. No movement moves then, and of the commands only speeds take
    /// effect.
    pub fn update(&mut self, commands: &Commands, mask: Option<&[bool]>, motions: &mut Motions) -> Result<()> {
        self.check(mask, motions)?;
        commands.check(self.len())?;
        let selected = (0..self.len()).filter(|&b| is_selected(mask, b));
        selected.clone().try_for_each(|b| self.check_command(b, commands))?;
        for b in selected {
            if self.shares.holds(b) && self.controllers[b].is_changed_by(&commands.of(b)) {
                self.leave(b);
            }
            if let Some(speed) = commands.speed
                && speed[b] != self.controllers[b].speed()
            {
                self.set_speed(b, speed[b])?;
            }
            self.controllers[b].check_tick_length(self.dt(), commands.of(b).tau)?;
        }
        self.advance(mask, motions, &|controller, b| controller.step_with(&commands.of(b)))
    }

    /// Restarts some movements, each under conditions of its own.
    ///
    /// ```
    /// # use pdmp_core::motion::Controllers;
    /// # use pdmp_core::{Conditions, Demonstration, FitOptions, Kind, fit};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// let mut controllers = Controllers::new(model.primitive(), 1e-3, &vec![Conditions::default(); 8], None)?;
    /// let near = Conditions { goal: Some(vec![0.5, 0.0]), ..Conditions::default() };
    /// controllers.reset(&[2, 5], &[Conditions::default(), near])?;
    /// assert_eq!(controllers.get(5)?.centre(), [0.5, 0.0]);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// A movement that does not exist, another number of conditions, or conditions that [`Controller::reset`] rejects. No
    /// movement is changed then.
    pub fn reset(&mut self, movements: &[usize], conditions: &[Conditions]) -> Result<()> {
        check_length("conditions", conditions.len(), movements.len(), "movement")?;
        movements.iter().try_for_each(|&b| self.check_index(b))?;
        for (&b, conditions) in movements.iter().zip(conditions) {
            conditions.complete(self.primitive()).map_err(|error| error.in_movement(b))?;
        }
        for (&b, conditions) in movements.iter().zip(conditions) {
            self.shares.release(b);
            self.controllers[b].reset(conditions)?;
            self.statuses[b] = Status::Working;
        }
        Ok(())
    }

    /// Returns the controller of a movement, to read its state and commands.
    ///
    /// # Errors
    /// A movement that does not exist.
    pub fn get(&mut self, movement: usize) -> Result<&Controller> {
        self.check_index(movement)?;
        if self.shares.holds(movement) {
            self.shares.write(movement, &mut self.controllers[movement]);
        }
        Ok(&self.controllers[movement])
    }

    /// Replaces a movement by that of a controller, for all that has no command here: gains, tolerance, a state of its own.
    ///
    /// ```
    /// # use pdmp_core::motion::Controllers;
    /// # use pdmp_core::{Conditions, Demonstration, FitOptions, Kind, fit};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// let mut controllers = Controllers::new(model.primitive(), 1e-3, &vec![Conditions::default(); 8], None)?;
    /// let mut one = controllers.get(3)?.clone();
    /// one.set_tolerance(1e-3)?;
    /// controllers.replace(3, &one)?;
    /// assert_eq!(controllers.get(3)?.tolerance(), 1e-3);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// A movement that does not exist, or a controller of another primitive or tick.
    pub fn replace(&mut self, movement: usize, controller: &Controller) -> Result<()> {
        if !Arc::ptr_eq(controller.primitive(), self.primitive()) || controller.dt() != self.dt() {
            let problem = "must have the primitive and the tick of the others";
            return Err(Error::Argument { name: "controller", problem });
        }
        self.with(movement, |present| {
            present.clone_from(controller);
            Ok(())
        })
    }

    /// Sets the speed of a movement, as [`Controller::set_speed`].
    ///
    /// ```
    /// # use pdmp_core::motion::Controllers;
    /// # use pdmp_core::{Conditions, Demonstration, FitOptions, Kind, fit};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// let mut controllers = Controllers::new(model.primitive(), 1e-3, &vec![Conditions::default(); 8], None)?;
    /// controllers.set_speed(3, 0.0)?;
    /// assert_eq!(controllers.get(3)?.speed(), 0.0);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// A movement that does not exist, or a speed that [`Controller::set_speed`] rejects.
    pub fn set_speed(&mut self, movement: usize, speed: f64) -> Result<()> {
        self.with(movement, |controller| controller.set_speed(speed))
    }

    /// Sets the limits of a movement, as [`Controller::set_limits`].
    ///
    /// ```
    /// # use pdmp_core::motion::{Controllers, Limits};
    /// # use pdmp_core::{Conditions, Demonstration, FitOptions, Kind, fit};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// let mut controllers = Controllers::new(model.primitive(), 1e-3, &vec![Conditions::default(); 8], None)?;
    /// controllers.set_limits(3, &Limits { velocity: Some(vec![2.0; 2]), ..Limits::default() })?;
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// A movement that does not exist, or limits that [`Controller::set_limits`] rejects.
    pub fn set_limits(&mut self, movement: usize, limits: &Limits) -> Result<()> {
        self.with(movement, |controller| controller.set_limits(limits))
    }

    /// Discards the measured position of a movement, as [`Controller::release`].
    ///
    /// ```
    /// # use pdmp_core::motion::Controllers;
    /// # use pdmp_core::{Conditions, Demonstration, FitOptions, Kind, fit};
    /// # fn main() -> pdmp_core::Result<()> {
    /// # let demos: Vec<Demonstration> = include!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/common/reaches.in"));
    /// # let model = fit(&demos, &FitOptions::new(Kind::Discrete))?;
    /// # let mut controllers = Controllers::new(model.primitive(), 1e-3, &vec![Conditions::default(); 8], None)?;
    /// controllers.release(3)?;
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// A movement that does not exist.
    pub fn release(&mut self, movement: usize) -> Result<()> {
        self.with(movement, |controller| {
            controller.release();
            Ok(())
        })
    }

    /// Changes the controller of a movement, whose state it then has.
    fn with(&mut self, movement: usize, change: impl FnOnce(&mut Controller) -> Result<()>) -> Result<()> {
        self.check_index(movement)?;
        self.leave(movement);
        let result = change(&mut self.controllers[movement]);
        self.statuses[movement] = self.controllers[movement].status();
        result
    }

    /// Makes a controller hold the state of its movement, if that was a steady one.
    fn leave(&mut self, b: usize) {
        if self.shares.holds(b) {
            self.shares.write(b, &mut self.controllers[b]);
            self.shares.release(b);
        }
    }

    /// Advances the selected movements: the steady ones together, the others by `tick`.
    fn advance(
        &mut self,
        mask: Option<&[bool]>,
        motions: &mut Motions,
        tick: &(impl Fn(&mut Controller, usize) -> Result<Status> + Sync),
    ) -> Result<()> {
        let Self { controllers, shares, statuses } = self;
        shares.advance(Part::new(controllers, statuses, mask, motions), tick)
    }
}
