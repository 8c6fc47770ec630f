//! Building an automaton from beliefs as they are met, by the thesis' two rules (5.4.1 and 5.4.2).

use crate::belief::Belief;
use crate::model::ActionId;
use crate::policy::{Automaton, Matching, Node, NodeId, Place};

impl Automaton {
    /// Takes in a belief with its best action and value, by the rule of the automaton's own form, points for a tree; returns its node.
    pub fn learn(&mut self, belief: &Belief, action: ActionId, value: f64) -> NodeId {
        match self.matching {
            Matching::Nearest | Matching::Tree => self.learn_point(belief, action, value),
            Matching::Segments => self.learn_segment(belief, action, value),
        }
    }

    /// Nearest neighbour (5.4.2): the belief becomes a node unless the nearest one at its level already does the same. This is
    /// the condensed nearest-neighbour rule of P. E. Hart, 1968.
    fn learn_point(&mut self, belief: &Belief, action: ActionId, value: f64) -> NodeId {
        match self.closest(self.at_level(belief).into_iter(), &belief.mean) {
            Some(id) if self.nodes[id].action == action => id,
            Some(id) if self.distance(id, belief) == 0.0 => {
                (self.nodes[id].action, self.nodes[id].value) = (action, Some(value));
                id
            }
            _ => self.push(belief, Place::Point(belief.mean.clone()), action, value),
        }
    }

    /// Belief segments (5.4.1): a belief inside a segment with its action changes nothing but the segment's point of least value;
    /// inside one with another action it splits it; outside all, it extends the nearest with its action, or starts its own where
    /// that would swallow part of another.
    fn learn_segment(&mut self, belief: &Belief, action: ActionId, value: f64) -> NodeId {
        let here = self.at_level(belief);
        let holding = self
            .closest(here.iter().copied(), &belief.mean)
            .filter(|&id| self.distance(id, belief) == 0.0);
        match holding {
            Some(id) if self.nodes[id].action == action => {
                self.lower_minimum(id, &belief.mean, value);
                id
            }
            Some(id) => self.split(id, &here, belief, action, value),
            None => match self.extensible(&here, &belief.mean, action) {
                Some((id, lower, upper)) => {
                    if let Place::Segment {
                        lower: low,
                        upper: high,
                        ..
                    } = &mut self.nodes[id].place
                    {
                        (*low, *high) = (lower, upper);
                    }
                    self.lower_minimum(id, &belief.mean, value);
                    id
                }
                None => {
                    let mean = belief.mean.clone();
                    let place = Place::Segment {
                        lower: mean.clone(),
                        minimum: mean.clone(),
                        upper: mean,
                    };
                    self.push(belief, place, action, value)
                }
            },
        }
    }

    fn at_level(&self, belief: &Belief) -> Vec<NodeId> {
        let stands = |node: &Node| {
            node.mode == belief.mode
                && node.levels.0 <= belief.stratum
                && belief.stratum <= node.levels.1
        };
        (0..self.nodes.len())
            .filter(|&id| stands(&self.nodes[id]))
            .collect()
    }

    fn push(&mut self, belief: &Belief, place: Place, action: ActionId, value: f64) -> NodeId {
        self.nodes.push(Node::new(
            belief.stratum..=belief.stratum,
            belief.mode,
            place,
            action,
            Some(value),
        ));
        self.nodes.len() - 1
    }

    fn lower_minimum(&mut self, id: NodeId, mean: &[f64], value: f64) {
        let node = &mut self.nodes[id];
        if node.value.is_none_or(|least| value < least) {
            node.value = Some(value);
            if let Place::Segment { minimum, .. } = &mut node.place {
                minimum.copy_from_slice(mean);
            }
        }
    }

    /// Takes the belief out of every segment with another action. The part cut off the one that held it becomes a segment with the
    /// new action, or only the belief itself where that part lies over yet another segment.
    fn split(
        &mut self,
        id: NodeId,
        here: &[NodeId],
        belief: &Belief,
        action: ActionId,
        value: f64,
    ) -> NodeId {
        let mean = belief.mean.clone();
        let (mut lower, mut upper) = (mean.clone(), mean.clone());
        let mut turned = None;
        for &other in here {
            if self.nodes[other].action == action || self.distance(other, belief) > 0.0 {
                continue;
            }
            match self.cut(other, &mean) {
                Some(cut_off) if other == id => (lower, upper) = cut_off,
                Some(_) => {}
                None => turned = Some(other),
            }
        }
        if let Some(id) = turned {
            (self.nodes[id].action, self.nodes[id].value) = (action, Some(value));
            return id;
        }
        if !self.is_free(here, action, &lower, &upper) {
            (lower, upper) = (mean.clone(), mean.clone());
        }
        let place = Place::Segment {
            lower,
            minimum: mean,
            upper,
        };
        self.push(belief, place, action, value)
    }

    /// Cuts a segment in two between its point of least value, whose side it keeps, and a mean; across the variable in which the
    /// two lie farthest apart, measured by the segment's width. Returns the corners of the other side; `None` for a segment that is
    /// nothing but that mean.
    fn cut(&mut self, id: NodeId, mean: &[f64]) -> Option<(Vec<f64>, Vec<f64>)> {
        let Place::Segment {
            lower,
            minimum,
            upper,
        } = &mut self.nodes[id].place
        else {
            return None;
        };
        if minimum.as_slice() == mean {
            for (i, value) in minimum.iter_mut().enumerate() {
                let low_is_farther = mean[i] - lower[i] > upper[i] - mean[i];
                *value = if low_is_farther { lower[i] } else { upper[i] };
            }
        }
        let apart =
            |i: usize| (mean[i] - minimum[i]).abs() / (upper[i] - lower[i]).max(f64::MIN_POSITIVE);
        let across =
            (0..lower.len()).fold(0, |best, i| if apart(i) > apart(best) { i } else { best });
        if mean[across] == minimum[across] {
            return None;
        }
        let cut = 0.5 * (mean[across] + minimum[across]);
        let (mut low, mut high) = (lower.clone(), upper.clone());
        if mean[across] < minimum[across] {
            high[across] = cut;
            lower[across] = cut;
        } else {
            low[across] = cut;
            upper[across] = cut;
        }
        Some((low, high))
    }

    fn distance(&self, id: NodeId, belief: &Belief) -> f64 {
        self.nodes[id].place.distance(&belief.mean, &self.scale)
    }

    /// Whether a box touches no segment with another action.
    fn is_free(&self, here: &[NodeId], action: ActionId, low: &[f64], high: &[f64]) -> bool {
        here.iter().all(|&other| {
            self.nodes[other].action == action || !overlaps(&self.nodes[other].place, low, high)
        })
    }

    /// The nearest segment with the action that can be stretched to the mean without touching one with another action.
    fn extensible(
        &self,
        here: &[NodeId],
        mean: &[f64],
        action: ActionId,
    ) -> Option<(NodeId, Vec<f64>, Vec<f64>)> {
        let mut same: Vec<NodeId> = here
            .iter()
            .copied()
            .filter(|&id| self.nodes[id].action == action)
            .collect();
        let distance = |id: NodeId| self.nodes[id].place.distance(mean, &self.scale);
        same.sort_by(|&a, &b| distance(a).total_cmp(&distance(b)));
        same.into_iter().find_map(|id| {
            let Place::Segment { lower, upper, .. } = &self.nodes[id].place else {
                return None;
            };
            let low: Vec<f64> = lower.iter().zip(mean).map(|(a, b)| a.min(*b)).collect();
            let high: Vec<f64> = upper.iter().zip(mean).map(|(a, b)| a.max(*b)).collect();
            self.is_free(here, action, &low, &high)
                .then_some((id, low, high))
        })
    }

    /// Joins segments of the same action whose common box touches no segment of another.
    pub fn merge_segments(&mut self) {
        let mut first = 0;
        while first < self.nodes.len() {
            let partner = (first + 1..self.nodes.len())
                .find_map(|second| self.joined(first, second).map(|place| (second, place)));
            let Some((second, place)) = partner else {
                first += 1;
                continue;
            };
            let removed = self.nodes.remove(second);
            let kept = &mut self.nodes[first];
            kept.place = place;
            kept.value = kept.value.into_iter().chain(removed.value).reduce(f64::min);
        }
    }

    fn joined(&self, first: NodeId, second: NodeId) -> Option<Place> {
        let (a, b) = (&self.nodes[first], &self.nodes[second]);
        if a.action != b.action || a.mode != b.mode || a.levels != b.levels {
            return None;
        }
        let (
            Place::Segment {
                lower: al,
                minimum: am,
                upper: au,
            },
            Place::Segment {
                lower: bl,
                minimum: bm,
                upper: bu,
            },
        ) = (&a.place, &b.place)
        else {
            return None;
        };
        let lower: Vec<f64> = al.iter().zip(bl).map(|(a, b)| a.min(*b)).collect();
        let upper: Vec<f64> = au.iter().zip(bu).map(|(a, b)| a.max(*b)).collect();
        let free = self
            .nodes
            .iter()
            .filter(|other| {
                other.mode == a.mode && other.levels == a.levels && other.action != a.action
            })
            .all(|other| !overlaps(&other.place, &lower, &upper));
        let minimum = if a.value <= b.value {
            am.clone()
        } else {
            bm.clone()
        };
        free.then_some(Place::Segment {
            lower,
            minimum,
            upper,
        })
    }
}

/// Whether a place and a box share more than a border, or anything at all where one of them is nothing but border: a point or a
/// flat box.
fn overlaps(place: &Place, low: &[f64], high: &[f64]) -> bool {
    let (lower, upper) = (place.lower(), place.upper());
    let flat = (0..lower.len()).any(|i| lower[i] == upper[i] || low[i] == high[i]);
    (0..lower.len()).all(|i| {
        if flat {
            lower[i] <= high[i] && low[i] <= upper[i]
        } else {
            lower[i] < high[i] && low[i] < upper[i]
        }
    })
}
