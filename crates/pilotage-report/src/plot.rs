//! Numbers on paper: linear scales, round ticks, short figures.

/// A linear map from data to paper.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    /// Least and greatest value shown.
    pub data: (f64, f64),
    /// Where they are on paper.
    pub paper: (f64, f64),
}

impl Scale {
    /// A scale; a range without width is widened.
    pub fn new(data: (f64, f64), paper: (f64, f64)) -> Self {
        let (low, high) = data;
        let data = if high > low {
            data
        } else {
            let reach = 0.5 * low.abs().max(1.0);
            (low - reach, low + reach)
        };
        Self { data, paper }
    }

    /// Place of a value on paper.
    pub fn at(&self, value: f64) -> f64 {
        let (low, high) = self.data;
        let share = (value - low) / (high - low);
        self.paper.0 + share * (self.paper.1 - self.paper.0)
    }

    /// As [`Scale::at`], kept within the paper.
    pub fn clamped(&self, value: f64) -> f64 {
        self.at(value.clamp(self.data.0, self.data.1))
    }
}

/// Round values in a range with their labels, about so many.
pub fn ticks((low, high): (f64, f64), about: usize) -> Vec<(f64, String)> {
    let rough = (high - low) / about.max(1) as f64;
    if !(rough > 0.0 && rough.is_finite()) {
        return vec![(low, figure(low))];
    }
    let magnitude = 10f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|factor| factor * magnitude)
        .find(|step| *step >= rough * 0.999)
        .unwrap_or(10.0 * magnitude);
    let decimals = (-step.log10().floor()).clamp(0.0, 12.0) as usize;
    let first = (low / step - 1e-9).ceil() as i64;
    let last = (high / step + 1e-9).floor() as i64;
    (first..=last)
        .map(|k| k as f64 * step)
        .map(|value| (value, tick_label(value, decimals)))
        .collect()
}

fn tick_label(value: f64, decimals: usize) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    match value.abs() {
        large if large >= 1e7 => figure(value),
        _ if decimals > 4 => figure(value),
        large if large >= 1e5 => signed(&format!("{}k", figure(value / 1e3))),
        _ => signed(&format!("{value:.decimals$}")),
    }
}

/// A value to three figures.
pub fn figure(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 {
        return "0".to_owned();
    }
    if !value.is_finite() {
        return signed(if value > 0.0 { "∞" } else { "-∞" });
    }
    if !(1e-3..1e5).contains(&size) {
        return signed(&format!("{value:.1e}"));
    }
    let decimals = (2.0 - size.log10().floor()).clamp(0.0, 5.0) as usize;
    let text = format!("{value:.decimals$}");
    let text = if decimals > 0 {
        text.trim_end_matches('0').trim_end_matches('.')
    } else {
        &text
    };
    signed(text)
}

/// A share as a percentage.
pub fn percent(share: f64) -> String {
    match 100.0 * share {
        none if none <= 0.0 => "0%".to_owned(),
        tiny if tiny < 0.1 => "<0.1%".to_owned(),
        small if small < 9.95 => format!("{small:.1}%"),
        large => format!("{large:.0}%"),
    }
}

/// One figure, or two with a dash where they differ.
pub fn range(low: f64, high: f64) -> String {
    let (low, high) = (figure(low), figure(high));
    if low == high {
        low
    } else {
        format!("{low}–{high}")
    }
}

fn signed(text: &str) -> String {
    text.replace('-', "−")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        let labels = |range, about| {
            ticks(range, about)
                .into_iter()
                .map(|tick| tick.1)
                .collect::<Vec<_>>()
        };
        assert_eq!(labels((0.0, 4.0), 4), ["0", "1", "2", "3", "4"]);
        assert_eq!(labels((-0.3, 0.31), 4), ["−0.2", "0", "0.2"]);
        assert_eq!(labels((0.0, 1e6), 2), ["0", "500k", "1000k"]);
        assert_eq!(labels((3.0, 3.0), 4), ["3"]);
    }

    #[test]
    fn figures_are_short() {
        let given = [
            0.0,
            2.0,
            -0.23294,
            123.4,
            9.999,
            0.000_12,
            4.5e7,
            f64::NEG_INFINITY,
        ];
        let wanted = ["0", "2", "−0.233", "123", "10", "1.2e−4", "4.5e7", "−∞"];
        assert_eq!(given.map(figure), wanted);
        assert_eq!(
            [0.0, 0.0004, 0.031, 0.5, 1.0].map(percent),
            ["0%", "<0.1%", "3.1%", "50%", "100%"]
        );
    }
}
