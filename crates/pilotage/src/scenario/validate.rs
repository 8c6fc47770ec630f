//! What every scenario fulfils besides what its model does: the truth goes with the model.

use super::{CartPole, Scenario, Simulator, TrueMotion, Walls};
use crate::model::error::{Fault, Path};
use crate::model::validate::positive;
use crate::model::{Interval, Region};

impl Scenario {
    /// Checks the model, and that the truth goes with it.
    ///
    /// # Errors
    /// The first fault found, with the key of the model file that it belongs to.
    pub fn validate(&self) -> Result<(), Fault> {
        self.model.validate()?;
        let model = &self.model;
        let path = Path::new("world");
        if self.truth.simulator != Simulator::Linear && !model.later.is_empty() {
            return Err(Fault::of_key(
                Path::new("later"),
                "the simulator has its own motion, the same at every step",
                "delete this table, or `world.kind`",
            ));
        }
        if let Simulator::CartPole(parameters) = &self.truth.simulator {
            parameters.validate(&path.clone().key("cart-pole"))?;
            if (model.state_dim(), model.motion.b.ncols()) != (4, 1) {
                return Err(Fault::new(
                    path.key("kind"),
                    format!(
                        "the cart and pole have 4 state variables and 1 control, this model {} and {}",
                        model.state_dim(),
                        model.motion.b.ncols()
                    ),
                    "name position, velocity, angle and angular velocity, in this order",
                ));
            }
        }
        if let Simulator::Robot(robot) = &self.truth.simulator {
            robot.validate(self)?;
        }
        let unbounded = model
            .state
            .iter()
            .all(|variable| variable.bounds == Interval::ALL);
        if self.truth.walls == Walls::Clamp && unbounded {
            return Err(Fault::new(
                path.key("walls"),
                "walls at the bounds, and there are no bounds",
                "add `bounds` to [state], or delete `walls`",
            ));
        }
        self.check_world_motion(&path.clone().key("motion"))?;
        match &self.truth.start {
            Some(start) => model.check_hypotheses(start, &path.key("start")),
            None => Ok(()),
        }
    }

    fn check_world_motion(&self, path: &Path) -> Result<(), Fault> {
        let motion = &self.truth.motion;
        if *motion == TrueMotion::default() {
            return Ok(());
        }
        if self.truth.simulator != Simulator::Linear {
            return Err(Fault::of_key(
                path.clone(),
                "the simulator has its own motion",
                "delete this table, or `kind`",
            ));
        }
        self.model.check_motion_noise(motion.noise.as_ref(), path)?;
        for (i, entry) in motion.controls.iter().enumerate() {
            let path = path.clone().key("control").index(i);
            self.model
                .check_condition(&entry.actions, entry.mode, &Region::everywhere(), &path)?;
            self.model.check_control(&entry.control, &path)?;
        }
        Ok(())
    }
}

impl CartPole {
    /// Checks that the parameters are physical; `path` is where the model has them.
    pub(super) fn validate(&self, path: &Path) -> Result<(), Fault> {
        for (key, value) in [
            ("cart_mass", self.cart_mass),
            ("pole_mass", self.pole_mass),
            ("length", self.length),
            ("gravity", self.gravity),
            ("step", self.step),
        ] {
            positive(value, false, path.clone().key(key))?;
        }
        for (key, value) in [
            ("friction", self.friction),
            ("inertia", self.inertia),
            ("force_noise", self.force_noise),
        ] {
            positive(value, true, path.clone().key(key))?;
        }
        Ok(())
    }
}
