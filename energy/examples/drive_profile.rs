//! Runs a drive profile through a battery model and says how long that takes.
//!
//! ```text
//! drive_profile MODEL PROFILE.csv OUT.csv [--soc 0.9] [--temperature-degc 25] [--split 1] [--repeat 200]
//! ```
//!
//! PROFILE has the columns `time_s,current_a`; the current of a row holds over the interval that
//! ends there. With `--split N` the current runs linearly from row to row instead, approximated by
//! N held pieces of equal length, each at the current of its middle. OUT gets
//! `time_s,voltage_v,temperature_degc,soc` at the rows. To stdout goes one line of JSON: steps
//! of a repetition and the seconds that repetitions took (least and median). Nothing but
//! stepping and keeping the voltage is timed.

use std::error::Error;
use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use energy::{Channel, Run, Start};

type Fallible<T> = Result<T, Box<dyn Error>>;

/// A held current and for how long.
struct Piece {
    dt_s: f64,
    current_a: f64,
    /// Whether a row of the profile ends with it.
    ends_row: bool,
}

struct Options {
    soc: f64,
    temperature_degc: f64,
    split: u32,
    repeat: usize,
}

fn options(arguments: &[String]) -> Fallible<Options> {
    let mut options = Options { soc: 0.9, temperature_degc: 25.0, split: 0, repeat: 200 };
    for pair in arguments.chunks(2) {
        let [name, value] = pair else { return Err(format!("{} needs a value", pair[0]).into()) };
        match name.as_str() {
            "--soc" => options.soc = value.parse()?,
            "--temperature-degc" => options.temperature_degc = value.parse()?,
            "--split" => options.split = value.parse()?,
            "--repeat" => options.repeat = value.parse::<usize>()?.max(1),
            other => return Err(format!("unknown option {other}").into()),
        }
    }
    Ok(options)
}

fn profile(text: &str) -> Fallible<Vec<(f64, f64)>> {
    let mut rows = Vec::new();
    for line in text.lines().skip(1) {
        let (time_s, current_a) = line.split_once(',').ok_or_else(|| format!("`{line}` is not time_s,current_a"))?;
        rows.push((time_s.trim().parse()?, current_a.trim().parse()?));
    }
    if rows.windows(2).any(|pair| pair[1].0 <= pair[0].0) {
        return Err("time_s must increase".into());
    }
    Ok(rows)
}

fn pieces(rows: &[(f64, f64)], split: u32) -> Vec<Piece> {
    let of_row = |pair: &[(f64, f64)]| {
        let ((from_s, from_a), (to_s, to_a)) = (pair[0], pair[1]);
        let count = split.max(1);
        let piece = move |index: u32| {
            let middle = (f64::from(index) + 0.5) / f64::from(count);
            let current_a = if split == 0 { to_a } else { from_a + (to_a - from_a) * middle };
            Piece { dt_s: (to_s - from_s) / f64::from(count), current_a, ends_row: index + 1 == count }
        };
        (0..count).map(piece).collect::<Vec<Piece>>()
    };
    rows.windows(2).flat_map(of_row).collect()
}

/// Walks the profile; keeps what a user of the model would keep.
fn walk(run: &mut Run<f64>, pieces: &[Piece], mut keep: impl FnMut(&Run<f64>)) {
    for piece in pieces {
        run.channels[Channel::CurrentA] = piece.current_a;
        run.step(piece.dt_s);
        if piece.ends_row {
            keep(run);
        }
    }
}

#[allow(clippy::disallowed_methods, reason = "this program measures time")]
fn now() -> Instant {
    Instant::now()
}

fn main() -> Fallible<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [model, profile_path, out, rest @ ..] = arguments.as_slice() else {
        return Err("usage: drive_profile MODEL PROFILE.csv OUT.csv [--soc S] [--temperature-degc T] [--split N] [--repeat N]".into());
    };
    let options = options(rest)?;
    let read = |path: &Path| fs::read_to_string(path).map_err(|error| format!("{}: {error}.", path.display()));
    let model = Arc::new(energy::load_model(model, &read)?);
    let rows = profile(&fs::read_to_string(profile_path)?)?;
    let pieces = pieces(&rows, options.split);
    let start = Start { temperature_degc: options.temperature_degc, ..Start::at_soc(options.soc) };

    let mut run = Run::new(Arc::clone(&model), start);
    let mut text = "time_s,voltage_v,temperature_degc,soc\n".to_owned();
    let mut time_s = rows.iter().skip(1).map(|row| row.0);
    walk(&mut run, &pieces, |run| {
        let shown = |channel| run.channels[channel];
        let time_s = time_s.next().unwrap_or(f64::NAN);
        text += &format!("{time_s},{},{},{}\n", shown(Channel::VoltageV), shown(Channel::TemperatureDegc), shown(Channel::Soc));
    });
    fs::write(out, text)?;

    let mut voltage_v = Vec::with_capacity(rows.len());
    let mut took_s: Vec<f64> = (0..options.repeat)
        .map(|_| {
            run.restart(start);
            voltage_v.clear();
            let began = now();
            walk(&mut run, &pieces, |run| voltage_v.push(run.channels[Channel::VoltageV]));
            let took_s = began.elapsed().as_secs_f64();
            assert!(voltage_v.iter().all(|voltage_v| voltage_v.is_finite()), "the model leaves the range of numbers");
            took_s
        })
        .collect();
    took_s.sort_by(f64::total_cmp);
    println!(r#"{{"steps": {}, "least_s": {:e}, "median_s": {:e}}}"#, pieces.len(), took_s[0], took_s[took_s.len() / 2]);
    Ok(())
}
