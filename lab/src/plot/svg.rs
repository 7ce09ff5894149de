//! A picture under construction.

use std::fmt::Write as _;

/// A colour by what it stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ink {
    /// Words and axes.
    Text,
    /// Words that matter less.
    Muted,
    /// Lines of the grid.
    Grid,
    /// What lies behind everything.
    Paper,
    /// Measurements.
    Measured,
    /// Predictions.
    Predicted,
    /// Differences between them, and other single series.
    Residual,
    /// The sensor floor.
    Floor,
    /// What was held out.
    Holdout,
}

impl Ink {
    /// Every colour.
    pub const ALL: [Ink; 9] =
        [Ink::Text, Ink::Muted, Ink::Grid, Ink::Paper, Ink::Measured, Ink::Predicted, Ink::Residual, Ink::Floor, Ink::Holdout];

    /// Name, as a variable of a page calls it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Ink::Text => "text",
            Ink::Muted => "muted",
            Ink::Grid => "grid",
            Ink::Paper => "paper",
            Ink::Measured => "measured",
            Ink::Predicted => "predicted",
            Ink::Residual => "residual",
            Ink::Floor => "floor",
            Ink::Holdout => "holdout",
        }
    }

    /// On a light ground. The series are from the palette of Okabe and Ito (2008), which stays
    /// apart for colour-blind eyes and in print.
    #[must_use]
    pub fn light(self) -> &'static str {
        match self {
            Ink::Text => "#1f2328",
            Ink::Muted => "#59636e",
            Ink::Grid => "#dfe3e8",
            Ink::Paper => "#ffffff",
            Ink::Measured => "#8b949e",
            Ink::Predicted => "#d55e00",
            Ink::Residual => "#0072b2",
            Ink::Floor => "#009e73",
            Ink::Holdout => "#e69f00",
        }
    }

    /// On a dark ground.
    #[must_use]
    pub fn dark(self) -> &'static str {
        match self {
            Ink::Text => "#e6edf3",
            Ink::Muted => "#9da7b1",
            Ink::Grid => "#30363d",
            Ink::Paper => "#0d1117",
            Ink::Measured => "#848d97",
            Ink::Predicted => "#ff8c42",
            Ink::Residual => "#56b4e9",
            Ink::Floor => "#2fc79a",
            Ink::Holdout => "#f0c04a",
        }
    }
}

/// Where the colours and the font come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Look {
    /// A file of its own: light, with a font that comes along.
    File,
    /// Part of a page: variables of the page, which may be light or dark.
    Page,
}

/// Which end of a text stands at its place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    /// The text begins there.
    Start,
    /// The text is centred there.
    Middle,
    /// The text ends there.
    End,
}

/// A picture under construction. Lengths are pixels, y grows downwards.
#[derive(Debug, Clone)]
pub struct Svg {
    width: f64,
    height: f64,
    look: Look,
    body: String,
}

/// Width of a character over the size of its font: an upper estimate.
const CHARACTER: f64 = 0.62;

/// About how wide a text will be.
#[must_use]
pub fn text_width(text: &str, size: f64) -> f64 {
    text.chars().count() as f64 * CHARACTER * size
}

impl Svg {
    /// An empty picture; its height grows with what is drawn.
    #[must_use]
    pub fn new(width: f64, look: Look) -> Svg {
        Svg { width, height: 0.0, look, body: String::new() }
    }

    /// How wide it is.
    #[must_use]
    pub fn width(&self) -> f64 {
        self.width
    }

    /// How high it is so far.
    #[must_use]
    pub fn height(&self) -> f64 {
        self.height
    }

    /// Adds room below and says where it begins.
    pub fn grow(&mut self, by: f64) -> f64 {
        self.height += by;
        self.height - by
    }

    fn colour(&self, ink: Ink) -> String {
        match self.look {
            Look::File => ink.light().to_owned(),
            Look::Page => format!("var(--{})", ink.name()),
        }
    }

    /// A straight line.
    pub fn line(&mut self, from: (f64, f64), to: (f64, f64), ink: Ink, width: f64, dashed: bool) {
        self.path(&[from, to], ink, width, dashed);
    }

    /// A line through points.
    pub fn path(&mut self, points: &[(f64, f64)], ink: Ink, width: f64, dashed: bool) {
        let Some(((x, y), rest)) = points.split_first() else { return };
        let mut d = format!("M{x:.1} {y:.1}");
        // Of a single point a dot, as wide as the line.
        let dot = [(*x, *y)];
        for (x, y) in if rest.is_empty() { &dot[..] } else { rest } {
            let _ = write!(d, "L{x:.1} {y:.1}");
        }
        let dash = if dashed { ";stroke-dasharray:5 4" } else { "" };
        let colour = self.colour(ink);
        let _ = writeln!(
            self.body,
            "<path d=\"{d}\" style=\"fill:none;stroke:{colour};stroke-width:{width};stroke-linecap:round;stroke-linejoin:round{dash}\"/>"
        );
    }

    /// A filled rectangle.
    pub fn rect(&mut self, at: (f64, f64), size: (f64, f64), ink: Ink, opacity: f64) {
        let colour = self.colour(ink);
        let ((x, y), (w, h)) = (at, (size.0.max(0.0), size.1.max(0.0)));
        let _ = writeln!(
            self.body,
            "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{w:.1}\" height=\"{h:.1}\" style=\"fill:{colour};fill-opacity:{opacity:.2}\"/>"
        );
    }

    /// Words, at the height of their base line.
    pub fn text(&mut self, at: (f64, f64), anchor: Anchor, size: f64, ink: Ink, text: &str) {
        self.write(at, anchor, size, ink, "", text);
    }

    /// Words in bold.
    pub fn bold(&mut self, at: (f64, f64), size: f64, text: &str) {
        self.write(at, Anchor::Start, size, Ink::Text, ";font-weight:bold", text);
    }

    fn write(&mut self, (x, y): (f64, f64), anchor: Anchor, size: f64, ink: Ink, more: &str, text: &str) {
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let (colour, text) = (self.colour(ink), escape(text));
        let _ = writeln!(
            self.body,
            "<text x=\"{x:.1}\" y=\"{y:.1}\" style=\"fill:{colour};font-size:{size}px;text-anchor:{anchor}{more}\">{text}</text>"
        );
    }

    /// The whole picture. `alt` says in words what it shows.
    #[must_use]
    pub fn finish(self, alt: &str) -> String {
        let (w, h, alt, body) = (self.width, self.height, escape(alt), &self.body);
        match self.look {
            // Inside HTML an SVG needs no name space; its size is the page's to choose.
            Look::Page => format!("<svg viewBox=\"0 0 {w:.0} {h:.0}\" role=\"img\" aria-label=\"{alt}\">\n{body}</svg>\n"),
            Look::File => {
                let paper = Ink::Paper.light();
                format!(
                    "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w:.0}\" height=\"{h:.0}\" viewBox=\"0 0 {w:.0} {h:.0}\" \
                     font-family=\"DejaVu Sans, Verdana, sans-serif\">\n<title>{alt}</title>\n\
                     <rect width=\"{w:.0}\" height=\"{h:.0}\" style=\"fill:{paper}\"/>\n{body}</svg>\n"
                )
            }
        }
    }
}

/// Text that may stand in SVG, HTML and their attributes.
fn escape(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            // XML has no other control characters.
            c if c.is_control() => safe.push(' '),
            c => safe.push(c),
        }
    }
    safe
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_from_users_cannot_break_out() {
        let mut svg = Svg::new(100.0, Look::Page);
        svg.text((0.0, 0.0), Anchor::Start, 12.0, Ink::Text, "</text><script>\u{1}&");
        let svg = svg.finish("a \"quoted\" name");
        assert!(svg.contains("&lt;/text&gt;&lt;script&gt; &amp;") && svg.contains("a &quot;quoted&quot; name"), "{svg}");
        assert!(!svg.contains("http"), "{svg}");
    }
}
