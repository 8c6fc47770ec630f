//! Colours: the scheme of Okabe and Ito for actions and series, and the roles of everything else, in light and dark.

use std::fmt;

/// Okabe and Ito, "Color universal design" (2008), with grey in place of black, in the order in which they are given out.
const HUES: [Rgb; 8] = [
    Rgb(0x00, 0x72, 0xb2),
    Rgb(0xe6, 0x9f, 0x00),
    Rgb(0x00, 0x9e, 0x73),
    Rgb(0xd5, 0x5e, 0x00),
    Rgb(0x56, 0xb4, 0xe9),
    Rgb(0xcc, 0x79, 0xa7),
    Rgb(0xf0, 0xe4, 0x42),
    Rgb(0x99, 0x99, 0x99),
];

const WHITE: Rgb = Rgb(0xff, 0xff, 0xff);
const BLACK: Rgb = Rgb(0x11, 0x11, 0x11);
const DARK_PAPER: Rgb = Rgb(0x0d, 0x11, 0x17);

/// Least contrast of a line with the paper (WCAG 2.1, 1.4.11).
const LINE_CONTRAST: f64 = 3.0;

/// What a colour is for. It is drawn in its light form, with a class by which a dark scheme finds it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Paint {
    /// Background.
    Paper,
    /// Text and marks that matter most.
    Ink,
    /// Text and marks of second rank.
    Muted,
    /// Grid lines and frames.
    Grid,
    /// Arrows between nodes.
    Arrow,
    /// Areas of an action or series.
    Hue(usize),
    /// Text on such an area.
    OnHue(usize),
    /// Lines of an action or series, dark enough for the paper they are on.
    LineHue(usize),
}

impl Paint {
    /// Colour on light paper.
    pub fn light(self) -> Rgb {
        match self {
            Self::Paper => WHITE,
            Self::Ink => Rgb(0x1f, 0x23, 0x28),
            Self::Muted => Rgb(0x59, 0x63, 0x6e),
            Self::Grid => Rgb(0xd8, 0xde, 0xe4),
            Self::Arrow => Rgb(0x6e, 0x77, 0x81),
            Self::Hue(index) => hue(index),
            Self::OnHue(index) => hue(index).text(),
            Self::LineHue(index) => hue(index).until_contrast(WHITE, BLACK),
        }
    }

    /// Colour on dark paper.
    pub fn dark(self) -> Rgb {
        match self {
            Self::Paper => DARK_PAPER,
            Self::Ink => Rgb(0xe6, 0xed, 0xf3),
            Self::Muted => Rgb(0x9d, 0xa7, 0xb1),
            Self::Grid => Rgb(0x30, 0x36, 0x3d),
            Self::Arrow => Rgb(0x8b, 0x94, 0x9e),
            Self::LineHue(index) => hue(index).until_contrast(DARK_PAPER, WHITE),
            Self::Hue(_) | Self::OnHue(_) => self.light(),
        }
    }

    /// Name of the colour in a class.
    pub fn name(self) -> String {
        match self {
            Self::Paper => "paper".to_owned(),
            Self::Ink => "ink".to_owned(),
            Self::Muted => "muted".to_owned(),
            Self::Grid => "grid".to_owned(),
            Self::Arrow => "arrow".to_owned(),
            Self::Hue(index) => format!("hue{index}"),
            Self::OnHue(index) => format!("on{index}"),
            Self::LineHue(index) => format!("line{index}"),
        }
    }
}

/// The colour of an action or series: eight hues, then the same lighter, then darker, then over again.
fn hue(index: usize) -> Rgb {
    let base = HUES[index % HUES.len()];
    match index / HUES.len() % 3 {
        0 => base,
        1 => base.mixed(WHITE, 0.5),
        _ => base.mixed(BLACK, 0.45),
    }
}

/// A colour in sRGB.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rgb(pub u8, pub u8, pub u8);

impl Rgb {
    /// The colour moved by a share towards another.
    fn mixed(self, other: Self, share: f64) -> Self {
        let mix =
            |a: u8, b: u8| (f64::from(a) + share * (f64::from(b) - f64::from(a))).round() as u8;
        Self(
            mix(self.0, other.0),
            mix(self.1, other.1),
            mix(self.2, other.2),
        )
    }

    /// Relative luminance (WCAG 2.1).
    fn luminance(self) -> f64 {
        let linear = |channel: u8| {
            let c = f64::from(channel) / 255.0;
            if c <= 0.040_45 {
                c / 12.92
            } else {
                ((c + 0.055) / 1.055).powf(2.4)
            }
        };
        0.2126 * linear(self.0) + 0.7152 * linear(self.1) + 0.0722 * linear(self.2)
    }

    /// Contrast ratio (WCAG 2.1), from 1 to 21.
    pub fn contrast(self, other: Self) -> f64 {
        let (a, b) = (self.luminance(), other.luminance());
        (a.max(b) + 0.05) / (a.min(b) + 0.05)
    }

    /// Black or white, whichever is easier to read on it.
    fn text(self) -> Self {
        if self.contrast(WHITE) > self.contrast(BLACK) {
            WHITE
        } else {
            BLACK
        }
    }

    fn until_contrast(self, paper: Self, towards: Self) -> Self {
        (0..=20)
            .map(|step| self.mixed(towards, f64::from(step) / 20.0))
            .find(|colour| colour.contrast(paper) >= LINE_CONTRAST)
            .unwrap_or(towards)
    }
}

impl fmt::Display for Rgb {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "#{:02x}{:02x}{:02x}", self.0, self.1, self.2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_readable_on_every_hue_and_paper() {
        for index in 0..24 {
            let area = Paint::Hue(index);
            let text = Paint::OnHue(index);
            assert!(text.light().contrast(area.light()) >= 4.5, "hue {index}");
            assert!(text.dark().contrast(area.dark()) >= 4.5, "hue {index}");
        }
        for paint in [Paint::Ink, Paint::Muted] {
            assert!(paint.light().contrast(Paint::Paper.light()) >= 4.5);
            assert!(paint.dark().contrast(Paint::Paper.dark()) >= 4.5);
        }
    }

    #[test]
    fn lines_stand_out_from_the_paper() {
        for paint in (0..24).map(Paint::LineHue).chain([Paint::Arrow]) {
            assert!(paint.light().contrast(Paint::Paper.light()) >= LINE_CONTRAST);
            assert!(paint.dark().contrast(Paint::Paper.dark()) >= LINE_CONTRAST);
        }
    }
}
