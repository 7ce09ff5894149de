//! Terms that a proposed formula may be made of.

use std::f64::consts::PI;

use energy::effect::expression::{Definition, Lag, OwnParameter, TIME, readable};
use energy::{Channel, Facts, Model, System};

use crate::infer::frame::Frame;
use crate::measurement::short;

/// A shape with coefficients in front that are looked for.
#[derive(Debug, Clone)]
pub struct Term {
    /// The channel that it adds to.
    pub channel: Channel,
    /// What it would mean, for people.
    pub words: String,
    /// What stands behind each coefficient.
    pub parts: Vec<String>,
    /// Parameters that only shape it: name, value, range.
    shapes: Vec<(&'static str, f64, f64, f64)>,
    /// The input of its low-passed copy, if it has one.
    pub slow: Option<String>,
    /// Its period, s, if it has one: then every log may find it at another phase.
    pub period_s: Option<f64>,
}

/// Names of the coefficients of a term.
pub const COEFFICIENTS: [&str; 2] = ["k", "k2"];

/// Names of the parameters of something periodic: its period, s, and the level above which a cosine switches it on.
pub const PERIOD: &str = "period_s";
const LEVEL: &str = "level";

/// Name of the parameter that says how soft the edges of a switch are.
pub const EDGE: &str = "edge";

impl Term {
    fn new(channel: Channel, words: String, part: String) -> Term {
        Term { channel, words, parts: vec![part], shapes: Vec::new(), slow: None, period_s: None }
    }

    fn shaped(mut self, name: &'static str, value: f64, reach: f64) -> Term {
        self.shapes.push((name, value, value / reach, value * reach));
        self
    }

    /// The same at one phase in all logs: it begins anew at this time and every period after it.
    #[must_use]
    pub fn at_one_phase(&self, phase_s: f64) -> Term {
        let mut term = Term { period_s: None, ..self.clone() };
        term.parts.iter_mut().for_each(|part| *part = part.replace(TIME, &format!("({TIME} - phase_s)")));
        let reach_s = self.period_s.unwrap_or(0.0);
        term.shapes.push(("phase_s", phase_s, phase_s - reach_s, phase_s + reach_s));
        term
    }

    /// The effect, with these coefficients.
    #[must_use]
    pub fn definition(&self, name: String, sizes: &[f64]) -> Definition {
        let own = |name: &str, meaning: &str, value, null, min, max| OwnParameter {
            name: name.to_owned(),
            meaning: meaning.to_owned(),
            value,
            null,
            min,
            max,
        };
        let sized = COEFFICIENTS.iter().zip(sizes).map(|(name, &size)| {
            let reach = if size == 0.0 { 1e6 } else { 100.0 * size.abs() };
            own(name, "size", size, Some(0.0), -reach, reach)
        });
        let shapes = self.shapes.iter().map(|&(name, value, min, max)| own(name, "shape", value, None, min, max));
        let formula = self.parts.iter().zip(COEFFICIENTS).map(|(part, k)| if part == "1" { k.to_owned() } else { format!("{k} * {part}") });
        Definition {
            name,
            title: format!("Proposal: {}", self.words),
            channel: self.channel,
            phase: None,
            formula: formula.collect::<Vec<_>>().join(" + "),
            states: self.slow.iter().map(|input| Lag { name: "slow".to_owned(), input: input.clone(), tau: "tau_s".to_owned() }).collect(),
            parameters: sized.chain(shapes).collect(),
        }
    }
}

/// What is to be said of something periodic with these parameters beyond its words; nothing of what has no period.
#[must_use]
pub fn rhythm(value: impl Fn(&str) -> Option<f64>) -> String {
    let share = |level: f64| format!(", on for {:.0} % of it", 100.0 * level.clamp(-1.0, 1.0).acos() / PI);
    let Some(period_s) = value(PERIOD) else { return String::new() };
    format!(" with a period of {} s{}", short(period_s), value(LEVEL).map(share).unwrap_or_default())
}

/// Every term for the frame's model and logs; `period_s` is that of the residual, if it has one.
#[must_use]
pub fn dictionary(frame: &Frame, period_s: Option<f64>) -> Vec<Term> {
    let mut all = match frame.model.system {
        System::Battery => battery(&frame.model),
        System::Robot => loads(frame, Channel::PowerW),
        System::Station => loads(frame, Channel::PackPowerW),
    };
    if let Some(period_s) = period_s {
        let periodic = |channel: Channel, words: String, part: &str, shapes: &[(&'static str, f64, f64, f64)]| Term {
            shapes: [&[(PERIOD, period_s, 0.9 * period_s, 1.1 * period_s)], shapes].concat(),
            period_s: Some(period_s),
            ..Term::new(channel, words, part.to_owned())
        };
        let angle = format!("2 * pi * {TIME} / period_s");
        for &channel in beside(frame.model.system) {
            let words = || format!("something unmeasured on {}", channel.name());
            // On for a share of the period; the edges begin soft, so that a fit can move them, and sharpen with it.
            let part = format!("(1 + tanh((cos({angle}) - level) / {EDGE})) / 2");
            for share in [0.25, 0.35, 0.5, 0.65, 0.75] {
                let level = (PI * share).cos();
                all.push(periodic(channel, words(), &part, &[(LEVEL, level, -0.98, 0.98), (EDGE, 0.4, SHARP, 1.0)]));
            }
            all.push(periodic(channel, words(), &format!("sin({angle})"), &[]));
        }
    }
    all
}

/// The sharpest edge of a switch, as a part of the swing of its cosine: at half a period it takes a six-thousandth of it.
const SHARP: f64 = 1e-3;

/// Channels on which something periodic may act.
fn beside(system: System) -> &'static [Channel] {
    match system {
        System::Battery => &[Channel::OverpotentialV, Channel::CellCurrentA],
        System::Robot => &[Channel::PowerW],
        System::Station => &[Channel::PackPowerW],
    }
}

/// Time constants that are tried, s.
const TAUS_S: [f64; 6] = [10.0, 30.0, 100.0, 300.0, 1000.0, 3000.0];
/// How far from where it began a fit may take a shape.
const REACH: f64 = 10.0;

fn slow(channel: Channel, words: &str, input: &str, factor: &str, all: &mut Vec<Term>) {
    for tau_s in TAUS_S {
        let mut term = Term::new(channel, format!("a slow reaction to {words}"), format!("slow{factor}")).shaped("tau_s", tau_s, REACH);
        term.slow = Some(input.to_owned());
        all.push(term);
    }
}

/// Over what a cell's overpotential may depend on.
fn battery(model: &Model) -> Vec<Term> {
    let Facts::Battery(_) = &model.facts else { return Vec::new() };
    let channel = Channel::OverpotentialV;
    let term = |words: &str, part: &str| Term::new(channel, words.to_owned(), part.to_owned());
    let i = Channel::CellCurrentA.name();
    let warm = "(cell_degc - 25)";
    let mut all = vec![
        term("a constant voltage", "1"),
        term("a resistance", i),
        term("a voltage that follows the size of the current", &format!("abs({i})")),
        term("a resistance that grows with the current", &format!("{i} * abs({i})")),
        term("a voltage that follows the direction of the current", &format!("sign({i})")),
        term("a resistance that falls with the current", &format!("sign({i}) * sqrt(abs({i}))")),
        term("a voltage that follows the temperature", warm),
        term("a resistance that follows the temperature", &format!("{i} * {warm}")),
        term("a resistance that follows the charge", &format!("{i} * soc")),
        term("a resistance that follows the square of the charge", &format!("{i} * soc^2")),
    ];
    for a in [0.03, 0.08, 0.2] {
        for (end, share) in [("empty", "soc"), ("full", "(1 - soc)")] {
            all.push(term(&format!("a voltage near {end}"), &format!("exp(-{share} / a)")).shaped("a", a, REACH));
            all.push(term(&format!("a resistance near {end}"), &format!("{i} * exp(-{share} / a)")).shaped("a", a, REACH));
            let pole = term(&format!("a resistance that grows like a pole towards {end}"), &format!("{i} / ({share} + a)"));
            all.push(pole.shaped("a", a, REACH));
        }
    }
    for centre in [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9] {
        for (words, factor) in [("a voltage", String::new()), ("a resistance", format!("{i} * "))] {
            let mut hat =
                term(&format!("{words} about {:.0} % of charge", 100.0 * centre), &format!("{factor}exp(-((soc - centre) / width)^2)"));
            hat.shapes.push(("centre", centre, 0.0, 1.0));
            all.push(hat.shaped("width", 0.08, 5.0));
        }
    }
    slow(channel, "the current", i, "", &mut all);
    slow(channel, "the current squared", &format!("{i} * abs({i})"), "", &mut all);
    slow(channel, "the current, near empty", i, " * (1 - soc)", &mut all);
    all
}

/// Shares of an input's range that shape a term.
const SCALES: [f64; 4] = [0.05, 0.12, 0.3, 0.7];

/// Over what the power of loads may depend on: every input that moves.
fn loads(frame: &Frame, channel: Channel) -> Vec<Term> {
    let mut all = vec![Term::new(channel, "a constant load".to_owned(), "1".to_owned())];
    for tau_s in TAUS_S {
        // Something that warms up, or was warm when it began.
        for (words, part) in [("fades", format!("exp(-{TIME} / tau_s)")), ("comes up", format!("(1 - exp(-{TIME} / tau_s))"))] {
            all.push(Term::new(channel, format!("a load that {words} as a log goes on"), part).shaped("tau_s", tau_s, REACH));
        }
    }
    let allowed = readable(frame.model.system);
    let mut moving: Vec<(&str, f64, f64)> = Vec::new();
    for (input, _) in frame.evidence.logs.iter().flat_map(|log| &log.inputs) {
        let everywhere = frame.evidence.logs.iter().all(|log| log.inputs.iter().any(|(other, _)| other == input))
            && !frame.evidence.some_judge_lacks(*input);
        if !everywhere || !allowed.contains(input) || moving.iter().any(|(name, ..)| *name == input.name()) {
            continue;
        }
        let values =
            || frame.evidence.logs.iter().flat_map(|log| &log.inputs).filter(|(other, _)| other == input).flat_map(|(_, values)| values);
        let (low, high) = values().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &value| (low.min(value), high.max(value)));
        if high - low > 1e-9 * low.abs().max(high.abs()) {
            moving.push((input.name(), low, high));
        }
    }
    for (index, &(x, low, high)) in moving.iter().enumerate() {
        let size = low.abs().max(high.abs());
        let absolute = if low < 0.0 { format!("abs({x})") } else { x.to_owned() };
        let mut add = |words: String, part: String| all.push(Term::new(channel, words, part));
        add(format!("a load that follows {x}"), x.to_owned());
        add(format!("a load that follows the square of {x}"), format!("{x}^2"));
        add(format!("a load that follows the cube of {absolute}"), format!("{absolute}^3"));
        if low < 0.0 {
            add(format!("a load that follows the size of {x}"), absolute.clone());
            add(format!("a load that follows {x} on either side"), format!("{x} * abs({x})"));
        }
        let resists = if x == Channel::SpeedMps.name() { "friction (Stribeck)" } else { "a load in proportion" };
        for scale in SCALES {
            let shaped = |words: String, part: String| Term::new(channel, words, part).shaped("a", scale * size, REACH);
            all.push(shaped(format!("a load that is there at small {x}"), format!("exp(-({x} / a)^2)")));
            all.push(shaped(format!("{resists} that falls with {x}"), format!("{absolute} * exp(-({x} / a)^2)")));
            all.push(shaped(format!("a load that fades with {x}"), format!("exp(-{absolute} / a)")));
            all.push(shaped(format!("a load that saturates with {x}"), format!("tanh({absolute} / a)")));
        }
        slow(channel, x, x, "", &mut all);
        for &(y, ..) in &moving[index + 1..] {
            all.push(Term::new(channel, format!("a load that follows {x} times {y}"), format!("{x} * {y}")));
            all.push(Term::new(channel, format!("a load that follows {absolute} times abs({y})"), format!("{absolute} * abs({y})")));
        }
    }
    all
}
