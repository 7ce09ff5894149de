//! A square of numbers between 0 and 1, as shades with the numbers in them.

use super::svg::{Anchor, Ink, Svg, text_width};

const SIZE: f64 = 12.0;

/// Draws the table below what is there. Columns carry the numbers of the rows, so that no name
/// must be read sideways.
pub fn draw_heat(svg: &mut Svg, names: &[String], values: &[Vec<f64>]) {
    let numbered: Vec<String> = names.iter().enumerate().map(|(index, name)| format!("{} {name}", index + 1)).collect();
    let left = (16.0 + numbered.iter().map(|name| text_width(name, SIZE)).fold(0.0, f64::max)).min(svg.width() * 0.5);
    let cell = ((svg.width() - left - 8.0) / names.len().max(1) as f64).min(44.0);
    let height = cell.clamp(20.0, 28.0);
    let top = svg.grow(20.0 + height * names.len() as f64 + 6.0) + 20.0;
    let centre = |column: usize| left + cell * (column as f64 + 0.5);
    for (index, name) in numbered.iter().enumerate() {
        let y = top + height * index as f64;
        svg.text((centre(index), top - 6.0), Anchor::Middle, SIZE, Ink::Muted, &(index + 1).to_string());
        svg.text((left - 8.0, y + height / 2.0 + 4.0), Anchor::End, SIZE, Ink::Text, name);
        for (column, value) in values.get(index).into_iter().flatten().enumerate().take(names.len()) {
            let shade = value.abs().clamp(0.0, 1.0);
            let at = (left + cell * column as f64, y);
            svg.rect((at.0 + 1.0, at.1 + 1.0), (cell - 2.0, height - 2.0), Ink::Grid, 0.35);
            svg.rect(
                (at.0 + 1.0, at.1 + 1.0),
                (cell - 2.0, height - 2.0),
                Ink::Residual,
                if value.is_finite() { shade * shade } else { 0.0 },
            );
            // Numbers on a dark shade take the colour of the paper; narrow cells have none.
            if cell >= 30.0 {
                let ink = if shade > 0.75 { Ink::Paper } else { Ink::Text };
                let words = if value.is_finite() { format!("{value:.2}") } else { "-".to_owned() };
                svg.text((centre(column), y + height / 2.0 + 4.0), Anchor::Middle, 11.0, ink, &words);
            }
        }
    }
}
