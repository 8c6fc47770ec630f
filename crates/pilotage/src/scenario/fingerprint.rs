//! What a learning run depends on besides the model: the canonical bytes of what is true.

use super::{CartPole, Robot, Simulator, TrueControl, TrueMotion, Truth, Walls};
use crate::digest::Digest;
use crate::model::Fingerprint;
use crate::model::fingerprint::{Canonical, Fields};

impl Truth {
    /// Changes when anything changes that is said of the world alone. No plan depends on it; what is learned in the world does.
    pub fn fingerprint(&self) -> Fingerprint {
        Fingerprint::of(self)
    }
}

impl Canonical for Walls {
    fn write(&self, digest: &mut Digest) {
        match self {
            Self::None => "none",
            Self::Clamp => "clamp",
        }
        .write(digest);
    }
}

impl Canonical for Truth {
    fn write(&self, digest: &mut Digest) {
        let Self {
            simulator,
            walls,
            start,
            motion: TrueMotion { noise, controls },
        } = self;
        Fields(digest)
            .unless(&Simulator::default(), "simulator", simulator)
            .unless(&Walls::default(), "walls", walls)
            .given("start", start.as_ref())
            .given("motion noise", noise.as_ref())
            .list("controls", controls)
            .end();
    }
}

impl Canonical for TrueControl {
    fn write(&self, digest: &mut Digest) {
        let Self {
            actions,
            mode,
            control,
        } = self;
        Fields(digest)
            .given("actions", actions.as_ref())
            .given("mode", mode.as_ref())
            .field("control", control)
            .end();
    }
}

impl Canonical for Simulator {
    fn write(&self, digest: &mut Digest) {
        match self {
            Self::Linear => "linear".write(digest),
            Self::CartPole(parameters) => {
                Fields(digest).field("cart-pole", parameters).end();
            }
            Self::Robot(robot) => Fields(digest).field("robot", robot).end(),
        }
    }
}

impl Canonical for CartPole {
    fn write(&self, digest: &mut Digest) {
        let Self {
            cart_mass,
            pole_mass,
            friction,
            length,
            inertia,
            gravity,
            step,
            force_noise,
        } = self;
        Fields(digest)
            .field("cart mass", cart_mass)
            .field("pole mass", pole_mass)
            .field("friction", friction)
            .field("length", length)
            .field("inertia", inertia)
            .field("gravity", gravity)
            .field("step", step)
            .field("force noise", force_noise)
            .end();
    }
}

impl Canonical for Robot {
    fn write(&self, digest: &mut Digest) {
        let Self {
            cell,
            hallway,
            radius,
            axle,
            speed,
            tick,
            slip,
            compass_noise,
            range_noise,
            range,
        } = self;
        Fields(digest)
            .field("cell", cell)
            .given("hallway", hallway.as_ref())
            .field("radius", radius)
            .field("axle", axle)
            .field("speed", speed)
            .field("tick", tick)
            .field("slip", slip)
            .field("compass noise", compass_noise)
            .field("range noise", range_noise)
            .field("range", range)
            .end();
    }
}
