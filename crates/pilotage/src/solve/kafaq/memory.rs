//! Memory by predecessor regions (thesis 4.2.4.1): what an agent that saw its rewards would remember. An automaton, which sees none,
//! has to tell from where it is and where it came from.

use serde::{Deserialize, Serialize};

use crate::model::ActionId;

/// Places that hold less than this share of the events are strays.
const STRAY: f64 = 0.01;

/// More places than can each hold that share.
const MOST_PLACES: usize = 100;

/// What is remembered. Memory 0 is that of the start.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Memory {
    pub kind: Kind,
    /// Where events happen: belief means.
    places: Vec<Vec<f64>>,
    /// Least reward of an event.
    threshold: f64,
    /// What counts as one along each variable when distances are measured.
    unit: Vec<f64>,
}

/// Kinds of memory, in the order in which they are tried.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Kind {
    /// Nothing.
    None,
    /// The place of the last event.
    Place,
    /// That, and whether an action has been taken an even or odd number of times since.
    PlaceAndParity(ActionId),
}

impl Memory {
    /// The memory that remembers nothing.
    pub(super) fn none() -> Self {
        Self {
            kind: Kind::None,
            places: Vec::new(),
            threshold: f64::MAX,
            unit: Vec::new(),
        }
    }

    /// A memory of events at these places.
    pub(super) fn of_events(
        kind: Kind,
        places: Vec<Vec<f64>>,
        threshold: f64,
        unit: Vec<f64>,
    ) -> Self {
        Self {
            kind,
            places,
            threshold,
            unit,
        }
    }

    /// Whether it is one that so many state variables and actions can have.
    pub(super) fn fits(&self, states: usize, actions: usize) -> bool {
        let events = match self.kind {
            Kind::None => return true,
            Kind::Place => true,
            Kind::PlaceAndParity(action) => action < actions,
        };
        events
            && (1..=MOST_PLACES).contains(&self.places.len())
            && self.places.iter().all(|place| place.len() == states)
            && self.unit.len() == states
            && self.unit.iter().all(|unit| *unit > 0.0)
    }

    /// Number of memories.
    pub(super) fn len(&self) -> usize {
        match self.kind {
            Kind::None => 1,
            Kind::Place => 1 + self.places.len(),
            Kind::PlaceAndParity(_) => 2 * (1 + self.places.len()),
        }
    }

    /// Whether the reward is that of an event.
    pub(super) fn is_event(&self, reward: f64) -> bool {
        self.kind != Kind::None && reward >= self.threshold
    }

    /// The memory after an action, the reward seen and the mean reached.
    pub(super) fn next(&self, memory: usize, action: ActionId, reward: f64, mean: &[f64]) -> usize {
        if !self.is_event(reward) {
            return self.without_event(memory, action);
        }
        let place = 1 + nearest(&self.places, mean, &self.unit).map_or(0, |(place, _)| place);
        match self.kind {
            Kind::PlaceAndParity(_) => 2 * place,
            _ => place,
        }
    }

    /// The memory after an action that brought no event.
    pub(super) fn without_event(&self, memory: usize, action: ActionId) -> usize {
        match self.kind {
            Kind::PlaceAndParity(counted) if counted == action => memory ^ 1,
            _ => memory,
        }
    }

    /// The memory in words.
    pub(super) fn name(&self, memory: usize) -> String {
        let (place, odd) = match self.kind {
            Kind::None => return String::new(),
            Kind::Place => (memory, false),
            Kind::PlaceAndParity(_) => (memory / 2, memory % 2 == 1),
        };
        let place = match place.checked_sub(1) {
            None => "start".to_owned(),
            Some(place) => {
                let numbers: Vec<String> = self.places[place]
                    .iter()
                    .map(|x| format!("{x:.1}"))
                    .collect();
                format!("after ({})", numbers.join(", "))
            }
        };
        if odd { format!("{place}, odd") } else { place }
    }

    /// The memory in a sentence.
    pub(super) fn describe(&self, actions: &[String]) -> String {
        match self.kind {
            Kind::None => "no memory".to_owned(),
            Kind::Place => format!("the place of the last event, of {}", self.places.len()),
            Kind::PlaceAndParity(action) => format!(
                "the place of the last event, of {}, and the parity of {} since",
                self.places.len(),
                actions[action]
            ),
        }
    }
}

/// Nearest of the places, with its largest distance along a variable.
fn nearest(places: &[Vec<f64>], mean: &[f64], unit: &[f64]) -> Option<(usize, f64)> {
    let apart = |place: &[f64]| {
        (0..mean.len())
            .map(|i| (place[i] - mean[i]).abs() / unit[i])
            .fold(0.0, f64::max)
    };
    let places = places
        .iter()
        .enumerate()
        .map(|(i, place)| (i, apart(place)));
    places.min_by(|a, b| a.1.total_cmp(&b.1))
}

/// Where events happened: leader clustering (J. A. Hartigan, 1975) of the means at which they were seen, with a radius in units,
/// most frequent first.
pub(super) fn places(means: &[&[f64]], radius: f64, unit: &[f64]) -> Vec<Vec<f64>> {
    let mut leaders: Vec<Vec<f64>> = Vec::new();
    let mut counts: Vec<f64> = Vec::new();
    for mean in means {
        match nearest(&leaders, mean, unit) {
            Some((leader, apart)) if apart <= radius => {
                counts[leader] += 1.0;
                for (x, m) in leaders[leader].iter_mut().zip(*mean) {
                    *x += (m - *x) / counts[leader];
                }
            }
            _ => {
                leaders.push(mean.to_vec());
                counts.push(1.0);
            }
        }
    }
    let mut order: Vec<usize> = (0..leaders.len()).collect();
    order.retain(|&i| counts[i] >= STRAY * means.len() as f64);
    order.sort_by(|&a, &b| counts[b].total_cmp(&counts[a]));
    // Leaders move as they follow their cluster, and two may have met.
    let mut kept: Vec<Vec<f64>> = Vec::new();
    for i in order {
        if nearest(&kept, &leaders[i], unit).is_none_or(|(_, apart)| apart > radius) {
            kept.push(leaders[i].clone());
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clusters_lie_where_events_are_dense_and_strays_are_dropped() {
        let mut means: Vec<Vec<f64>> = (0..300)
            .map(|i| vec![0.3 + 0.001 * f64::from(i % 7)])
            .collect();
        means.extend((0..500).map(|i| vec![3.7 - 0.001 * f64::from(i % 5)]));
        means.push(vec![2.0]);
        let means: Vec<&[f64]> = means.iter().map(Vec::as_slice).collect();
        let found = places(&means, 3.0, &[0.4]);
        assert_eq!(found.len(), 2);
        assert!((found[0][0] - 3.698).abs() < 1e-3 && (found[1][0] - 0.303).abs() < 1e-3);
    }

    #[test]
    fn an_event_is_remembered_by_its_place_and_turns_are_counted_since() {
        let places = vec![vec![0.0], vec![3.0]];
        let memory = Memory::of_events(Kind::PlaceAndParity(1), places, 10.0, vec![1.0]);
        assert_eq!(memory.len(), 6);
        assert_eq!(memory.next(0, 0, 9.0, &[2.9]), 0);
        assert_eq!(memory.next(0, 1, 9.0, &[2.9]), 1);
        assert_eq!(memory.next(1, 1, 10.0, &[2.9]), 4);
        assert_eq!(memory.next(4, 1, 0.0, &[2.9]), 5);
        assert_eq!(memory.next(5, 0, 0.0, &[0.1]), 5);
        assert_eq!(memory.name(5), "after (3.0), odd");
        assert_eq!(Memory::none().next(0, 1, 1e9, &[0.0]), 0);
    }
}
