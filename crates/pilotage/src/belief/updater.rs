//! What keeps the belief of an agent, whatever kind it is: the Kalman filter on its levels, or a belief in full that is read by a codebook.

use std::borrow::Cow;
use std::sync::Arc;

use super::codebook::Codebook;
use super::full::{Acted, Keeping, Moments};
use super::memory::Memory;
use super::{
    Belief, BeliefMdp, BeliefSpace, Cells, CellsKeeping, CodedSpace, Filter, Reading, SumKeeping,
    Tracker, Tracking,
};
use crate::error::Result;
use crate::model::{ActionId, Interval, Model, ModelText, Part, TrackerKind};

/// Keeps beliefs, and reads them as a stratum, a mode and a mean. It does not change: what changes is a [`Held`] belief.
// There are few at a time, so their size does not matter.
#[allow(clippy::large_enum_variant)]
#[derive(Debug, Clone, PartialEq)]
pub enum Updater {
    /// The Kalman filter on uncertainty levels.
    Linear(Filter),
    /// A sum of Gaussians.
    Sum(Coded<SumKeeping>),
    /// Probabilities of cells.
    Cells(Coded<CellsKeeping>),
}

/// How long a step of a belief takes, each a power of ten or more from the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Pace {
    /// A microsecond: a mean is moved.
    Fast,
    /// Some ten microseconds.
    Usual,
    /// Hundreds.
    Slow,
}

/// A way to keep beliefs in full, with the codebook that they are read by.
#[derive(Debug)]
pub struct Coded<K> {
    keeping: Arc<K>,
    codebook: Arc<Codebook>,
    text: ModelText,
    readings: usize,
    /// What the mode is, where the stratum does not say it.
    memory: Option<Memory>,
}

/// A belief as it is held from step to step.
#[derive(Debug, Clone)]
pub struct Held {
    kept: Kept,
    read: Belief,
}

#[derive(Debug, Clone)]
enum Kept {
    Linear { scratch: Vec<f64> },
    Sum(Running<<SumKeeping as Keeping>::Full>),
    Cells(Running<<CellsKeeping as Keeping>::Full>),
}

/// A belief in full in the course of an episode, with room to read it.
#[derive(Debug, Clone)]
struct Running<F> {
    full: F,
    step: usize,
    moments: Moments,
    code: Vec<f64>,
}

impl<K> Clone for Coded<K> {
    fn clone(&self) -> Self {
        Self {
            keeping: Arc::clone(&self.keeping),
            codebook: Arc::clone(&self.codebook),
            text: self.text.clone(),
            readings: self.readings,
            memory: self.memory.clone(),
        }
    }
}

impl<K> PartialEq for Coded<K> {
    fn eq(&self, other: &Self) -> bool {
        let of = |text: &ModelText| (text.text.clone(), text.part);
        of(&self.text) == of(&other.text)
            && self.codebook == other.codebook
            && self.memory == other.memory
    }
}

impl<K: Keeping> Coded<K> {
    /// Beliefs of a model that are kept in full, and read by a codebook, which is not empty.
    pub fn new(model: &Model, keeping: Arc<K>, codebook: Arc<Codebook>) -> Self {
        Self {
            keeping,
            codebook,
            text: model.text.clone(),
            readings: model.observation_dim(),
            memory: None,
        }
    }

    /// The codebook.
    pub fn codebook(&self) -> &Codebook {
        &self.codebook
    }

    fn start(&self) -> (Running<K::Full>, Belief) {
        let mut running = Running {
            full: self.keeping.start(),
            step: 0,
            moments: Moments::default(),
            code: Vec::new(),
        };
        let mut read = Belief {
            stratum: 0,
            mode: 0,
            mean: Vec::new(),
        };
        self.read(&mut running, &mut read);
        if let Some(Memory::Recall(recall)) = &self.memory {
            read.mode = recall.first(&self.codebook.place(&read));
        }
        (running, read)
    }

    fn act(&self, running: &mut Running<K::Full>, action: ActionId) -> Acted {
        self.keeping.act(&mut running.full, action, running.step)
    }

    fn go_on(&self, running: &mut Running<K::Full>, action: ActionId) {
        self.keeping.go_on(&mut running.full, action, running.step);
    }

    fn sense(
        &self,
        running: &mut Running<K::Full>,
        read: &mut Belief,
        action: ActionId,
        reading: Reading<'_>,
    ) {
        let step = running.step;
        let memory = self.memory.as_ref();
        let before = memory.and_then(|memory| memory.before(read, action, step));
        self.keeping.sense(&mut running.full, action, step, reading);
        running.step += 1;
        self.read(running, read);
        if let Some(memory) = memory {
            let place = self.codebook.place(read);
            read.mode = memory.after(before, read, (action, step), &place);
        }
    }

    fn read(&self, running: &mut Running<K::Full>, read: &mut Belief) {
        self.keeping.moments(&running.full, &mut running.moments);
        running.moments.step = running.step;
        read.stratum = self.codebook.nearest(&running.moments, &mut running.code);
        if self.memory.is_none() {
            read.mode = self.codebook.stratum(read.stratum).mode();
        }
        read.mean.clone_from(&running.moments.mean);
    }
}

impl Updater {
    /// The same for every start hypothesis of a space that someone may be told, from there on; itself alone where there is one start.
    pub(crate) fn told(&self, space: &dyn BeliefSpace) -> Vec<Self> {
        let starts = space.hypotheses();
        match self {
            Self::Linear(filter) if !starts.is_empty() => {
                let from = |start| filter.clone().starting_at(start).into();
                starts.iter().map(from).collect()
            }
            _ => vec![self.clone()],
        }
    }

    /// Which kind it is.
    pub fn kind(&self) -> TrackerKind {
        match self {
            Self::Linear(_) => TrackerKind::Linear,
            Self::Sum(_) => TrackerKind::Sum,
            Self::Cells(_) => TrackerKind::Cells,
        }
    }

    /// How long it takes to keep a belief for a step.
    pub(crate) fn pace(&self) -> Pace {
        match self {
            Self::Linear(_) => Pace::Fast,
            Self::Sum(coded) => match coded.keeping.is_light() {
                true => Pace::Usual,
                false => Pace::Slow,
            },
            Self::Cells(_) => Pace::Usual,
        }
    }

    /// The Kalman filter, where it is one.
    pub fn filter(&self) -> Option<&Filter> {
        match self {
            Self::Linear(filter) => Some(filter),
            Self::Sum(_) | Self::Cells(_) => None,
        }
    }

    /// How many numbers a reading has; 0 for a discrete sensor.
    pub fn readings(&self) -> usize {
        match self {
            Self::Linear(filter) => filter.readings(),
            Self::Sum(coded) => coded.readings,
            Self::Cells(coded) => coded.readings,
        }
    }

    /// The codebook by which beliefs in full are read.
    pub fn codebook(&self) -> Option<&Codebook> {
        match self {
            Self::Linear(_) => None,
            Self::Sum(coded) => Some(coded.codebook()),
            Self::Cells(coded) => Some(coded.codebook()),
        }
    }

    /// The beliefs of the model that it was made for, as it reads them.
    pub fn space(&self, model: &Model) -> Box<dyn BeliefSpace> {
        match self.codebook() {
            Some(codebook) => Box::new(CodedSpace::new(model, self.clone(), codebook)),
            None => Box::new(BeliefMdp::new(model)),
        }
    }

    /// The same with modes that are what is remembered, whatever the belief says of modes. By switches, a belief in full begins in mode 0.
    pub fn remembering(mut self, memory: Memory) -> Self {
        match (&mut self, memory) {
            (Self::Linear(filter), Memory::Recall(recall)) => {
                return filter.clone().recalling(recall).into();
            }
            (Self::Linear(filter), memory) => filter.memory = memory,
            (Self::Sum(coded), memory) => coded.memory = Some(memory),
            (Self::Cells(coded), memory) => coded.memory = Some(memory),
        }
        self
    }

    /// How the mode changes; `None` where it is what a belief in full says.
    pub(crate) fn memory(&self) -> Option<&Memory> {
        match self {
            Self::Linear(filter) => Some(&filter.memory),
            Self::Sum(coded) => coded.memory.as_ref(),
            Self::Cells(coded) => coded.memory.as_ref(),
        }
    }

    /// Where a belief is among [clusters](super::Clusters): its mean and, where it is kept in full, the traits of its stratum.
    pub(crate) fn place<'a>(&self, belief: &'a Belief) -> Cow<'a, [f64]> {
        match self.codebook() {
            Some(codebook) => codebook.place(belief).into(),
            None => belief.mean.as_slice().into(),
        }
    }

    /// What such places lie between, for the model that it was made for.
    pub(crate) fn extents(&self, model: &Model) -> Vec<Interval> {
        let bounds = model.state.iter().map(|variable| variable.bounds);
        let traits = self.codebook().map(Codebook::trait_bounds);
        bounds.chain(traits.into_iter().flatten()).collect()
    }

    /// The text of the model by which beliefs in full are kept, if it was read from a text.
    pub(crate) fn model_text(&self) -> Option<&str> {
        self.source().and_then(|source| source.text.as_deref())
    }

    /// What keeps beliefs of the whole model, where this one knows only its body.
    ///
    /// # Errors
    /// As [`Updater::coded`].
    pub(crate) fn whole(&self, model: &Model) -> Result<Self> {
        match (self.part(), self.codebook()) {
            (Part::Body, Some(codebook)) => {
                Self::coded(model, self.kind(), Arc::new(codebook.clone()))
            }
            _ => Ok(self.clone()),
        }
    }

    /// What of its model keeps the belief.
    pub(crate) fn part(&self) -> Part {
        self.source().map_or(Part::Whole, |source| source.part)
    }

    fn source(&self) -> Option<&ModelText> {
        match self {
            Self::Linear(_) => None,
            Self::Sum(coded) => Some(&coded.text),
            Self::Cells(coded) => Some(&coded.text),
        }
    }

    /// The updater of that kind for a model, with a codebook that is not empty.
    ///
    /// # Errors
    /// As [`CellsKeeping::new`].
    pub fn coded(model: &Model, kind: TrackerKind, codebook: Arc<Codebook>) -> Result<Self> {
        Ok(match kind {
            TrackerKind::Cells => {
                let keeping = Arc::new(CellsKeeping::new(model)?);
                Self::Cells(Coded::new(model, keeping, codebook))
            }
            _ => Self::Sum(Coded::new(
                model,
                Arc::new(SumKeeping::new(model)),
                codebook,
            )),
        })
    }

    /// The updater that a model asks for. Beliefs in full are read as one stratum, that of the start, however they are held.
    ///
    /// # Errors
    /// As [`CellsKeeping::new`].
    pub(crate) fn of(model: &Model) -> Result<Self> {
        let kind = model.tracker();
        if kind == TrackerKind::Linear {
            return Ok(BeliefMdp::new(model).filter().into());
        }
        let code = |moments: Moments| {
            let mut codebook = Codebook::new(model);
            codebook.cover(&[moments], 0.0, 1);
            Arc::new(codebook)
        };
        let mut moments = Moments::default();
        Ok(match kind {
            TrackerKind::Cells => {
                let keeping = Arc::new(CellsKeeping::new(model)?);
                keeping.moments(&keeping.start(), &mut moments);
                Self::Cells(Coded::new(model, keeping, code(moments)))
            }
            _ => {
                let keeping = Arc::new(SumKeeping::new(model));
                keeping.moments(&keeping.start(), &mut moments);
                Self::Sum(Coded::new(model, keeping, code(moments)))
            }
        })
    }

    /// What is believed at the start.
    pub fn start(&self) -> Held {
        let (kept, read) = match self {
            Self::Linear(filter) => {
                let scratch = vec![0.0; filter.states()];
                (Kept::Linear { scratch }, filter.initial())
            }
            Self::Sum(coded) => {
                let (running, read) = coded.start();
                (Kept::Sum(running), read)
            }
            Self::Cells(coded) => {
                let (running, read) = coded.start();
                (Kept::Cells(running), read)
            }
        };
        Held { kept, read }
    }

    /// Puts a belief back to the start.
    pub fn reset(&self, held: &mut Held) {
        match (self, &mut held.kept) {
            (Self::Linear(filter), Kept::Linear { .. }) => filter.reset(&mut held.read),
            _ => *held = self.start(),
        }
    }

    /// Takes in an action and what was sensed after it. A belief that another kind of updater holds stays as it is.
    pub fn update(&self, held: &mut Held, action: ActionId, reading: Reading<'_>) {
        match (self, &mut held.kept) {
            (Self::Linear(filter), Kept::Linear { scratch }) => {
                return filter.update(&mut held.read, action, reading, scratch);
            }
            (Self::Sum(coded), Kept::Sum(running)) => coded.go_on(running, action),
            (Self::Cells(coded), Kept::Cells(running)) => coded.go_on(running, action),
            _ => {}
        }
        self.sense(held, action, reading);
    }
}

/// A belief in full takes in a step in two halves, so that what an action is expected to pay can be known before anything is sensed.
impl Updater {
    /// Takes an action, and says what it is expected to pay and to do. Until [`Updater::sense`] follows the belief is not read anew.
    /// `None`, and nothing is done, where beliefs are not kept in full.
    pub fn act(&self, held: &mut Held, action: ActionId) -> Option<Acted> {
        match (self, &mut held.kept) {
            (Self::Sum(coded), Kept::Sum(running)) => Some(coded.act(running, action)),
            (Self::Cells(coded), Kept::Cells(running)) => Some(coded.act(running, action)),
            _ => None,
        }
    }

    /// Takes in what was sensed after an action that [`Updater::act`] has taken.
    pub fn sense(&self, held: &mut Held, action: ActionId, reading: Reading<'_>) {
        let read = &mut held.read;
        match (self, &mut held.kept) {
            (Self::Sum(coded), Kept::Sum(running)) => coded.sense(running, read, action, reading),
            (Self::Cells(coded), Kept::Cells(running)) => {
                coded.sense(running, read, action, reading);
            }
            _ => {}
        }
    }
}

impl Held {
    /// As a policy reads it.
    pub fn belief(&self) -> &Belief {
        &self.read
    }

    /// Mean, covariance and probabilities of modes of the belief itself, where it is kept in full.
    pub fn moments(&self) -> Option<&Moments> {
        match &self.kept {
            Kept::Linear { .. } => None,
            Kept::Sum(running) => Some(&running.moments),
            Kept::Cells(running) => Some(&running.moments),
        }
    }

    /// Probabilities of cells, where these are what is kept.
    pub fn cells(&self) -> Option<&Cells> {
        match &self.kept {
            Kept::Cells(running) => Some(&running.full),
            Kept::Linear { .. } | Kept::Sum(_) => None,
        }
    }
}

/// The belief that an [`Updater`] keeps.
struct Tracked<'a> {
    updater: &'a Updater,
    held: Held,
}

impl Tracker for Tracked<'_> {
    fn reset(&mut self) {
        self.updater.reset(&mut self.held);
    }

    fn update(&mut self, action: ActionId, reading: Reading<'_>) {
        self.updater.update(&mut self.held, action, reading);
    }

    fn belief(&self) -> &Belief {
        self.held.belief()
    }

    fn held(&self) -> Option<&Held> {
        Some(&self.held)
    }
}

impl Tracking for Updater {
    fn tracker(&self) -> Box<dyn Tracker + '_> {
        Box::new(Tracked {
            updater: self,
            held: self.start(),
        })
    }
}

impl From<Filter> for Updater {
    fn from(filter: Filter) -> Self {
        Self::Linear(filter)
    }
}
