//! Bars beside their names.

use super::svg::{Anchor, Ink, Svg, text_width};

/// A chart of bars that all begin at zero.
#[derive(Debug, Clone, PartialEq)]
pub struct Bars {
    /// Title above it; none when empty.
    pub title: String,
    /// What the lengths mean, for each colour.
    pub legend: Vec<(Ink, String)>,
    /// What a mark across a bar means; none when empty.
    pub mark: String,
    /// The rows.
    pub rows: Vec<Row>,
    /// Length that fills the width.
    pub full: f64,
}

/// One name with its bars.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Name at the left.
    pub name: String,
    /// Length, colour, and words at the end of each bar.
    pub bars: Vec<(f64, Ink, String)>,
    /// Where a mark crosses the bars.
    pub mark: Option<f64>,
}

const SIZE: f64 = 12.0;
const BAR: f64 = 15.0;

/// Draws a chart below what is there.
pub fn draw_bars(svg: &mut Svg, chart: &Bars) {
    if !chart.title.is_empty() {
        let y = svg.grow(26.0);
        svg.bold((8.0, y + 19.0), 14.0, &chart.title);
    }
    legend(svg, chart);
    let widest = |texts: &mut dyn Iterator<Item = &String>| texts.map(|text| text_width(text, SIZE)).fold(0.0, f64::max);
    let names = widest(&mut chart.rows.iter().map(|row| &row.name));
    let ends = widest(&mut chart.rows.iter().flat_map(|row| row.bars.iter().map(|bar| &bar.2)));
    // Where there is little room, names stand above their bars.
    let above = names > svg.width() * 0.35;
    let left = if above { 8.0 } else { 16.0 + names };
    let room = (svg.width() - left - ends - 16.0).max(20.0);
    let length = |value: f64| (value / chart.full).clamp(0.0, 1.0) * room;
    for row in &chart.rows {
        if above {
            let y = svg.grow(18.0);
            svg.text((8.0, y + 13.0), Anchor::Start, SIZE, Ink::Text, &row.name);
        }
        let height = BAR * row.bars.len() as f64;
        let top = svg.grow(height + 7.0);
        if !above {
            svg.text((left - 8.0, top + height / 2.0 + 4.0), Anchor::End, SIZE, Ink::Text, &row.name);
        }
        for (index, (value, ink, words)) in row.bars.iter().enumerate() {
            let y = top + BAR * index as f64;
            svg.rect((left, y), (room, BAR - 2.0), Ink::Grid, 0.45);
            svg.rect((left, y), (length(*value), BAR - 2.0), *ink, 0.9);
            svg.text((left + room + 8.0, y + BAR - 4.0), Anchor::Start, SIZE, Ink::Muted, words);
        }
        if let Some(mark) = row.mark {
            let x = left + length(mark);
            svg.line((x, top - 2.0), (x, top + height), Ink::Text, 2.0, false);
        }
    }
    svg.grow(4.0);
}

fn legend(svg: &mut Svg, chart: &Bars) {
    let entries = chart.legend.iter().map(|(ink, words)| (Some(*ink), words)).chain([(None, &chart.mark)]);
    let entries: Vec<_> = entries.filter(|(_, words)| !words.is_empty()).collect();
    if entries.is_empty() {
        return;
    }
    let mut base = svg.grow(22.0) + 14.0;
    let mut x = 8.0;
    for (ink, words) in entries {
        let width = 34.0 + text_width(words, SIZE);
        if x > 8.0 && x + width > svg.width() {
            base = svg.grow(18.0) + 12.0;
            x = 8.0;
        }
        match ink {
            Some(ink) => svg.rect((x, base - 10.0), (20.0, 11.0), ink, 0.9),
            None => svg.line((x + 10.0, base - 11.0), (x + 10.0, base + 2.0), Ink::Text, 2.0, false),
        }
        svg.text((x + 26.0, base), Anchor::Start, SIZE, Ink::Text, words);
        x += width;
    }
    svg.grow(6.0);
}
