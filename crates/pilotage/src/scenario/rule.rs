//! A rule of thumb, as somebody who knows the problem would write it down.

use crate::model::{ActionId, Expression, Fault, Path};

/// What somebody who knows the problem would do, said of the belief: the first clause that holds says which action is taken. Plans are
/// compared with it; no planner sees it.
#[derive(Debug, Clone, PartialEq)]
pub struct HandRule {
    clauses: Vec<RuleClause>,
    /// What is done where no clause holds.
    otherwise: ActionId,
}

/// One line of a [`HandRule`].
#[derive(Debug, Clone, PartialEq)]
pub struct RuleClause {
    /// Holds where it is not 0. Knows what [`HandRule::names`] lists.
    pub when: Expression,
    /// Index of the action that is then taken.
    pub action: ActionId,
}

impl HandRule {
    /// A rule of some clauses, the first that holds first, and of what is done where none does.
    pub fn new(clauses: Vec<RuleClause>, otherwise: ActionId) -> Self {
        Self { clauses, otherwise }
    }

    /// What conditions may name, in the order in which they are told of it: means of the state variables by name, their standard
    /// deviations `sd_NAME`, probabilities of the modes `p_MODE`, and the step `t`, counted from 0.
    pub fn names<'a>(
        state: impl IntoIterator<Item = &'a str> + Clone,
        modes: impl IntoIterator<Item = &'a str>,
    ) -> Vec<String> {
        let means = state.clone().into_iter().map(str::to_owned);
        let deviations = state.into_iter().map(|name| format!("sd_{name}"));
        let weights = modes.into_iter().map(|name| format!("p_{name}"));
        means
            .chain(deviations)
            .chain(weights)
            .chain(["t".to_owned()])
            .collect()
    }

    /// The action for a belief: the mean of every state variable, their standard deviations, the probabilities of the modes, and the
    /// step of the episode. A condition without a value, such as one with `ln(-1)`, does not hold.
    pub fn action(
        &self,
        mean: &[f64],
        deviations: &[f64],
        weights: &[f64],
        step: usize,
    ) -> ActionId {
        if self.clauses.is_empty() {
            return self.otherwise;
        }
        let told = [mean, deviations, weights, &[step as f64]].concat();
        let holds = |clause: &&RuleClause| {
            let value = clause.when.value(&told);
            value != 0.0 && !value.is_nan()
        };
        let first = self.clauses.iter().find(holds);
        first.map_or(self.otherwise, |clause| clause.action)
    }

    /// The clauses in the order in which they are asked.
    pub fn clauses(&self) -> &[RuleClause] {
        &self.clauses
    }

    /// What is done where no clause holds.
    pub fn otherwise(&self) -> ActionId {
        self.otherwise
    }
}

/// Reads a condition; an error is placed at its column.
pub(super) fn condition(source: &str, names: &[String], path: Path) -> Result<Expression, Fault> {
    let known: Vec<&str> = names.iter().map(String::as_str).collect();
    Expression::parse(source, &known).map_err(|error| {
        let column = source[..error.span.start.min(source.len())].chars().count();
        Fault::new(path.index(0).index(column), error.what, error.hint)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rule(clauses: &[(&str, ActionId)], otherwise: ActionId) -> HandRule {
        let names = HandRule::names(["x", "v"], ["calm", "storm"]);
        let clauses = clauses.iter().map(|(when, action)| RuleClause {
            when: condition(when, &names, Path::default()).unwrap(),
            action: *action,
        });
        HandRule::new(clauses.collect(), otherwise)
    }

    #[test]
    fn conditions_know_means_deviations_modes_and_the_step() {
        let names = HandRule::names(["x", "v"], ["calm", "storm"]);
        let known = ["x", "v", "sd_x", "sd_v", "p_calm", "p_storm", "t"];
        assert_eq!(names, known);
        for (i, name) in known.iter().enumerate() {
            let rule = rule(&[(&format!("{name} == 7"), 1)], 0);
            let mut told = [0.0; 7];
            let ask =
                |told: &[f64]| rule.action(&told[..2], &told[2..4], &told[4..6], told[6] as usize);
            assert_eq!(ask(&told), 0, "{name}");
            told[i] = 7.0;
            assert_eq!(ask(&told), 1, "{name}");
        }
    }

    #[test]
    fn the_first_condition_that_holds_counts() {
        let rule = rule(&[("sd_x > 0.5 and x < 4", 2), ("x > 3", 1)], 0);
        let ask = |x, sd| rule.action(&[x, 0.0], &[sd, 0.0], &[1.0, 0.0], 0);
        assert_eq!(ask(3.5, 1.0), 2);
        assert_eq!(ask(3.5, 0.1), 1);
        assert_eq!(ask(5.0, 1.0), 1);
        assert_eq!(ask(0.0, 0.1), 0);
    }

    #[test]
    fn a_condition_without_a_value_does_not_hold() {
        let rule = rule(&[("ln(x)", 1)], 0);
        assert_eq!(rule.action(&[-1.0, 0.0], &[0.0; 2], &[1.0, 0.0], 0), 0);
        assert_eq!(rule.action(&[2.0, 0.0], &[0.0; 2], &[1.0, 0.0], 0), 1);
    }

    #[test]
    fn without_conditions_there_is_one_thing_to_do() {
        assert_eq!(HandRule::new(Vec::new(), 3).action(&[], &[], &[], 0), 3);
    }
}
