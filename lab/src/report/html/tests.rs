//! A report parses, loads nothing, and lets no name break out.

use std::cell::RefCell;

use html5ever::tendril::StrTendril;
use html5ever::tokenizer::{BufferQueue, TagKind, Token, TokenSink, TokenSinkResult, Tokenizer, TokenizerOpts};

use super::*;
use crate::compare::{Calibrated, RegimeError};
use crate::floor::FloorCheck;
use crate::plot::Trace;
use crate::report::discovery::FileErrors;
use crate::residual::Size;

/// What a browser's tokenizer finds: open elements, mistakes, and attributes that could load.
#[derive(Default)]
struct Seen {
    open: RefCell<Vec<String>>,
    mistakes: RefCell<Vec<String>>,
    headings: RefCell<Vec<String>>,
    images: RefCell<(usize, usize)>,
}

/// Elements that have no end.
const VOID: [&str; 3] = ["meta", "br", "hr"];
/// What may point elsewhere, here only to parts of the page itself.
const REFERENCES: [&str; 8] = ["src", "href", "srcset", "data", "action", "poster", "xlink:href", "background"];

impl TokenSink for Seen {
    type Handle = ();

    fn process_token(&self, token: Token, _line: u64) -> TokenSinkResult<()> {
        let mut mistakes = self.mistakes.borrow_mut();
        match token {
            Token::ParseError(words) => mistakes.push(words.into_owned()),
            Token::TagToken(tag) => {
                let name = tag.name.to_string();
                if ["script", "link", "iframe", "img", "object", "embed", "base"].contains(&name.as_str()) {
                    mistakes.push(format!("<{name}>"));
                }
                if ["h1", "h2", "h3"].contains(&name.as_str()) && tag.kind == TagKind::StartTag {
                    self.headings.borrow_mut().push(name.clone());
                }
                let attribute =
                    |wanted: &str| tag.attrs.iter().find(|attribute| &*attribute.name.local == wanted).map(|a| a.value.to_string());
                if name == "svg" && tag.kind == TagKind::StartTag {
                    let mut images = self.images.borrow_mut();
                    images.0 += 1;
                    images.1 += usize::from(
                        attribute("role").as_deref() == Some("img") && attribute("aria-label").is_some_and(|alt| alt.len() > 20),
                    );
                }
                for reference in REFERENCES.iter().filter_map(|name| attribute(name)) {
                    if !reference.starts_with('#') {
                        mistakes.push(format!("<{name}> refers to {reference}"));
                    }
                }
                let mut open = self.open.borrow_mut();
                if tag.kind == TagKind::StartTag {
                    if !tag.self_closing && !VOID.contains(&name.as_str()) {
                        open.push(name);
                    }
                } else if open.pop().as_deref() != Some(&name) {
                    mistakes.push(format!("</{name}> closes nothing"));
                }
            }
            _ => {}
        }
        TokenSinkResult::Continue
    }
}

fn check(text: &str) -> Seen {
    let queue = BufferQueue::default();
    queue.push_back(StrTendril::from(text));
    let tokenizer = Tokenizer::new(Seen::default(), TokenizerOpts { exact_errors: true, ..TokenizerOpts::default() });
    let _ = tokenizer.feed(&queue);
    tokenizer.end();
    let seen = tokenizer.sink;
    assert_eq!(*seen.mistakes.borrow(), Vec::<String>::new());
    assert_eq!(*seen.open.borrow(), Vec::<String>::new());
    assert!(!text.contains("http") && !text.contains("url(") && !text.contains("@import"));
    seen
}

/// A name that tries to break out of text, attribute, comment and style.
const NASTY: &str = "a\"'><script>alert(1)</script><!-- </style>&amp;";

/// A page with every section filled.
pub(crate) fn full(name: &str) -> Page {
    let size = Size { rows: 100, rms: 0.004, mean: 0.001, max_abs: 0.012 };
    let line = || vec![(0..50).map(|k| (f64::from(k) * 60.0, 3.7 + 0.01 * f64::from(k % 7))).collect()];
    let rows: Vec<usize> = (0..100).collect();
    let noise: Vec<f64> = rows.iter().map(|row| 0.001 * ((row * 7 % 11) as f64 - 5.0)).collect();
    let time_s: Vec<f64> = rows.iter().map(|&row| row as f64).collect();
    let error = crate::compare::ChannelError {
        log: name.to_owned(),
        channel: "voltage_v",
        unit: "V",
        size,
        floor: Some(0.001),
        floor_of_inputs: 0.0,
        ratio: Some(4.0),
        floor_check: FloorCheck::of(&rows, &noise, 0.001, None),
        whiteness: crate::whiteness::Whiteness::of(&time_s, &noise),
    };
    let band = |band: &str, share| RegimeError {
        channel: "voltage_v",
        dimension: "soc",
        band: band.to_owned(),
        unit: "V",
        size,
        share,
        share_of_rows: 0.5,
    };
    let step = |effect: &str, train_rms, holdout_rms| LadderStep { effect: effect.to_owned(), train_rms, holdout_rms: Some(holdout_rms) };
    let evidence = |effect: &str, accepted| Evidence {
        effect: effect.to_owned(),
        accepted,
        refused: if accepted { String::new() } else { "evidence too weak".to_owned() },
        delta_bic: Some(812.4),
        p_value: Some(1e-9),
        epc: vec![Epc { name: "resistance_ohm".to_owned(), value: 0.021, sigma: Some(0.002) }],
        uniqueness: Some(0.83),
        unit: "V".to_owned(),
        rms_before: Some(0.012),
        rms_after: Some(0.002),
        holdout_before: Some(0.013),
        holdout_after: None,
    };
    Page {
        header: Header {
            title: name.to_owned(),
            model: name.to_owned(),
            logs: vec![
                LogLine { name: name.to_owned(), holdout: false, rows: 100, span_s: 3600.0 },
                LogLine { name: "held out".to_owned(), holdout: true, rows: 50, span_s: 60.0 },
            ],
            notes: vec!["discharge: 3 rows have the time of the row before".to_owned()],
            date: Some("2026-01-31".to_owned()),
            version: "0.1.0".to_owned(),
        },
        verdict: Some(Answer {
            tone: Tone::Bad,
            headline: format!("Missing: {name}"),
            words: vec![name.to_owned(), "It is the second RC pair.".to_owned()],
            experiment: Some("a rest over one hour".to_owned()),
        }),
        holdout_errors: Errors { all: vec![error.clone()], calibrated: None },
        errors: Errors {
            calibrated: Some(vec![Calibrated {
                log: name.to_owned(),
                channel: error.channel,
                unit: error.unit,
                rms: 0.0012,
                ratio: Some(1.2),
            }]),
            all: vec![error],
        },
        traces: vec![Trace {
            log: name.to_owned(),
            channel: "voltage_v".to_owned(),
            unit: "V".to_owned(),
            floor: Some(0.001),
            rows: 50,
            measured: line(),
            predicted: line(),
            residual: vec![(0..50).map(|k| (f64::from(k) * 60.0, 0.001 * f64::from(k % 5 - 2))).collect()],
        }],
        regimes: vec![band(name, 0.8), band("> 50 % SoC", 0.2)],
        ladders: vec![Ladder {
            channel: "voltage_v".to_owned(),
            unit: "V".to_owned(),
            floor: Some(0.001),
            floor_name: "sensor floor".to_owned(),
            steps: vec![step("as given", 0.024, 0.026), step("+ rc1", 0.0067, 0.0081), step(&format!("+ {name}"), 0.0019, 0.0025)],
        }],
        evidence: vec![evidence(name, true), evidence("warburg", false)],
        confounding: Some(Confounding {
            effects: vec![name.to_owned(), "rc2".to_owned(), "warburg".to_owned()],
            rho: vec![vec![1.0, 0.3, 0.2], vec![0.3, 1.0, 0.97], vec![0.2, 0.97, f64::NAN]],
            absorbed: vec!["weak_cell".to_owned()],
        }),
        spectra: vec![SpectrumCurve {
            log: name.to_owned(),
            channel: "voltage_v".to_owned(),
            points: (1..=50).map(|k| (0.01 * f64::from(k), (f64::from(k) / 50.0).sqrt())).collect(),
            distance_5_percent: 0.19,
            p_value: 1e-6,
        }],
        parameters: vec![ParameterRow {
            effect: "rc1".to_owned(),
            name: "tau_s".to_owned(),
            unit: "s".to_owned(),
            before: Some(60.0),
            value: 41.3,
            sigma: Some(2.2),
            remark: name.to_owned(),
        }],
        files: Files {
            rows: vec![
                FileErrors { channel: "voltage_v", holdout: false, given: 0.012, found: 0.004 },
                FileErrors { channel: "voltage_v", holdout: true, given: 0.012, found: 0.034 },
            ],
            warning: "Where the model found is worse: look.".to_owned(),
            without: "A model file cannot hold what follows".to_owned(),
            left_out: vec![format!("state of charge at the start of {name}: +0.0051 +- 0.0012")],
        },
        decisions: vec![DecisionRow {
            what: "run time left".to_owned(),
            unit: "min".to_owned(),
            before: 62.0,
            before_sigma: Some(4.0),
            after: 48.0,
            after_sigma: Some(1.0),
        }],
    }
}

#[test]
fn every_section_parses_loads_nothing_and_escapes_names() {
    let text = render(&full(NASTY));
    let seen = check(&text);
    assert_eq!(seen.headings.borrow().iter().filter(|heading| *heading == "h1").count(), 1);
    // The verdict and eleven sections.
    assert_eq!(seen.headings.borrow().iter().filter(|heading| *heading == "h2").count(), 12);
    let (images, described) = *seen.images.borrow();
    assert!(images >= 10 && images == described, "{images} pictures, {described} described");
    assert!(text.contains("prefers-color-scheme:dark") && text.contains("width=device-width"));
    assert!(text.contains("evidence too weak") && text.contains("does all of their work: weak_cell."));
    assert!(
        text.matches(">worse</td>").count() == 1 && text.contains("34.0 mV") && text.contains("<strong>Where the model found is worse")
    );
    assert!(text.contains("cannot hold what follows:</p>") && text.contains("<li>state of charge at the start of a&quot;"));
    assert!(!text.contains("NaN"), "a number that is none has slipped through");
    assert!(text.contains("1.20 mV") && text.matches(">calibrated</th>").count() == 1, "only where calibration changes something");
}

#[test]
fn what_is_not_filled_is_left_out() {
    let text = render(&Page::default());
    let seen = check(&text);
    assert!(!seen.headings.borrow().contains(&"h2".to_owned()), "{text}");
}
