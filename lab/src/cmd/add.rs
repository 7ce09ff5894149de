//! `lab add`: adds one effect that the user names, refits, and says what it is worth.

use std::sync::Arc;

use anyhow::{anyhow, bail};
use energy::document::hint;
use energy::effect::expression;
use energy::{EffectSpec, Model, catalogue};
use lab::compare::compare;
use lab::infer::candidate::candidates;
use lab::infer::judge::{Court, explained, refusals};
use lab::infer::score::Scoring;
use lab::infer::state::State;
use lab::infer::trial::{Trial, held_out};
use lab::learned::left_out;
use lab::report::addition::{Addition, Look};

use super::busy::busy;
use super::case::{Case, Written};
use super::inputs::{Answered, LogInputs, ModelArg};
use super::save::SaveArgs;
use super::{Answer, Format, print};

// What clap would print has the effect behind `--log`, which takes all that follows it.
#[derive(Debug, clap::Args)]
#[command(override_usage = "lab add <EFFECT> --model <MODEL> --log <LOG>... [OPTIONS]")]
pub(super) struct Args {
    /// The effect to add, by its id in `lab effects`.
    effect: String,
    #[command(flatten)]
    model: ModelArg,
    #[command(flatten)]
    logs: LogInputs,
    #[command(flatten)]
    save: SaveArgs,
}

pub(super) fn run(args: &Args, format: Format) -> anyhow::Result<Answer> {
    args.save.check()?;
    args.logs.spare(args.save.output())?;
    args.model.spare(args.save.output(), Answered::Model)?;
    let spec = absent(&args.model.load()?.model, &args.effect)?;
    let mut case = Case::read(&args.model, &args.logs)?;
    let bar = busy(format!("fitting {} with {}", case.source.model.name, spec.id));
    let base = case.fitted();
    let trial = trial(&case, &base, spec)?;
    bar.finish_and_clear();
    // Both are judged by the logs that the model with the effect can predict.
    let before = trial.held.as_ref().map_or_else(Vec::new, |held| held_out(base.told(), held));
    // Only this one was tried, and its name is not the logs' choice but the user's.
    let whatever_size = !explained(&base) && explained(&trial.state);
    let refused = refusals(&base, &trial, &before, Court { holdout: trial.held.as_ref(), tried: 1, begun: &[], whatever_size });
    let trial = Trial { state: trial.state.undiluted(), ..trial };
    let refitted = case.learned(base.told(), None, args.save.date())?;
    let extended = case.learned(trial.state.told(), args.save.output(), args.save.date())?;
    extended.unpredicted.iter().for_each(|one| eprintln!("lab: note: {}", one.words()));
    if let Some(path) = args.save.output() {
        extended.save(path)?;
    }
    let report = Addition {
        schema: 1,
        model: case.source.model.name.clone(),
        effect: spec.id,
        accepted: refused.is_empty(),
        refused,
        delta_bic: trial.delta_bic,
        parameters: Addition::parameters_of(&case.source.model, &trial),
        ladder: Addition::ladder_of(&base, &before, &trial),
        logs: Addition::logs_of(&[look(&case.given()?), look(&refitted), look(&extended)]),
        regimes: Addition::regimes_of(&look(&refitted).train, &look(&extended).train),
        words: look(&extended).train.words,
        decision: case.decisions(&extended),
        left_out: left_out(trial.state.told()),
        output: args.save.told(),
    };
    print(format, &report, || report.human())?;
    Ok(if report.accepted { Answer::Yes } else { Answer::No })
}

/// The effect of that name, which the model must lack.
fn absent(model: &Model, name: &str) -> anyhow::Result<&'static EffectSpec> {
    let all = || catalogue().iter().map(|effect| effect.spec()).filter(|spec| spec.system == model.system);
    let bare = name.strip_prefix(&format!("{}/", model.system.name())).unwrap_or(name);
    let has = |id: &str| model.effects().any(|effect| effect.spec().id == id);
    match all().find(|spec| spec.id == bare) {
        Some(spec) if has(spec.id) => {
            bail!("{} has the effect `{}` already; `lab fit --free {}` fits its parameters", model.name, spec.id, spec.id)
        }
        Some(spec) => Ok(spec),
        None if bare == expression::ID => bail!(
            "an effect of your own is written into the model file: an [[effect]] with id = \"{}\", name, channel and formula, which \
             `lab fit --free NAME` fits and `lab effects {}` explains; `lab propose` looks for one",
            expression::ID,
            expression::ID
        ),
        None => {
            let hint = hint(bare, all().map(|spec| spec.id));
            let absent: Vec<&str> = all().map(|spec| spec.id).filter(|id| !has(id)).collect();
            let system = model.system.name();
            bail!("a {system} has no effect `{name}`{hint} {} lacks: {}", model.name, absent.join(", "))
        }
    }
}

/// The base model with the effect, at its best.
fn trial(case: &Case<'_>, base: &State, spec: &'static EffectSpec) -> anyhow::Result<Trial> {
    let (able, unable) = candidates(&base.frame, &base.x);
    let Some(candidate) = able.iter().find(|candidate| candidate.spec.id == spec.id) else {
        let reason = unable.into_iter().find(|one| one.effect == spec.id).map_or_else(String::new, |one| format!(": {}", one.reason));
        return Err(anyhow!("{} cannot be fitted to these logs{reason}", spec.id));
    };
    match Scoring::new(base).score(candidate) {
        Some(score) => Ok(Trial::run(base, candidate, &score, case.held.as_ref())),
        None => bail!("{} changes nothing in these logs, so they cannot say how large it is", spec.id),
    }
}

fn look(written: &Written) -> Look {
    let values = written.model.values();
    let compared = |logs: &[_]| compare(&Arc::clone(&written.model), &values, logs);
    Look { train: compared(&written.train), holdout: (!written.holdout.is_empty()).then(|| compared(&written.holdout)) }
}
