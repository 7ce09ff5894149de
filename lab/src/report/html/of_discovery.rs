//! The part of a report that a search for missing effects fills.

use super::sections::{Answer, Confounding, Epc, Evidence, Files, Ladder, LadderStep, Page, ParameterRow, Tone};
use crate::infer::answer::{ByChannel, Discovery, Ranked, Verdict};
use crate::infer::judges::Unpredicted;
use crate::infer::score::Score;
use crate::report::discovery::{
    DiscoveryReport, floor_name, headline, held_out, in_few_rows, learned_lines, left, other_numbers, other_starts, untested, why_not,
    within_stated,
};
use crate::report::quantity::unit_of;

/// Effects in the picture of what looks alike: more cannot be read.
const ALIKE: usize = 12;

impl Page {
    /// Adds what a search found. `scores` are those of its first look.
    pub fn add_discovery(&mut self, report: &DiscoveryReport, scores: &[Score]) {
        let found = &report.discovery;
        self.verdict = Some(answer(report, self.verdict.take()));
        self.ladders = ladders(found);
        self.evidence = found.ranking.iter().map(|ranked| evidence(ranked, found)).collect();
        self.confounding = confounding(scores);
        self.parameters = parameters(found);
        self.files = Files {
            rows: report.files.clone(),
            warning: report.file_warning().unwrap_or_default().to_owned(),
            without: report.without().unwrap_or_default(),
            left_out: learned_lines(&report.left_out).lines().map(|line| line.trim().to_owned()).collect(),
        };
        self.decisions = report.decision.rows();
    }
}

/// The search's answer, then what the comparison with the given model said.
fn answer(report: &DiscoveryReport, compared: Option<Answer>) -> Answer {
    let found = &report.discovery;
    let tone = match found.verdict {
        Verdict::Complete => Tone::Good,
        Verdict::Missing => Tone::Bad,
        Verdict::Ambiguous | Verdict::Unknown => Tone::Unsure,
    };
    let headline = headline(found, report.reach);
    let mut capitals = headline.chars();
    let headline = capitals.next().map_or_else(String::new, |first| first.to_uppercase().collect::<String>() + capitals.as_str());
    let mut words: Vec<String> = held_out(found, &report.holdout_unexplained).into_iter().collect();
    words.extend(report.holdout_unpredicted.iter().map(Unpredicted::words));
    words.extend(other_starts(&report.other_starts));
    words.extend(within_stated(&report.within_stated));
    words.extend(other_numbers(&report.other_numbers));
    words.extend(in_few_rows(&report.unexplained).lines().map(str::to_owned));
    words.extend(left(found).lines().map(|line| format!("At the end of the search: {line}.")));
    words.extend(compared.into_iter().flat_map(|compared| std::iter::once(compared.headline).chain(compared.words)));
    words.extend(untested(&found.untested).lines().map(|line| format!("Not to be tested with these logs: {line}.")));
    Answer { tone, headline, words, experiment: Some(found.experiment.clone()).filter(|words| !words.is_empty()) }
}

fn ladders(found: &Discovery) -> Vec<Ladder> {
    let channels: Vec<&'static str> = found.ladder.first().map_or_else(Vec::new, |rung| rung.train_rms.keys().copied().collect());
    let of = |channel: &'static str| Ladder {
        channel: channel.to_owned(),
        unit: unit_of(channel).to_owned(),
        floor: found.ladder.first().and_then(|rung| rung.floor.get(channel).copied()),
        floor_name: found.ladder.first().map_or("", |rung| floor_name(rung, channel)).to_owned(),
        steps: found
            .ladder
            .iter()
            .filter_map(|rung| {
                Some(LadderStep {
                    effect: rung.effect.map_or_else(|| "the model, refitted".to_owned(), |effect| format!("+ {effect}")),
                    train_rms: *rung.train_rms.get(channel)?,
                    holdout_rms: rung.holdout_rms.get(channel).copied(),
                })
            })
            .collect(),
    };
    channels.into_iter().map(of).collect()
}

fn evidence(ranked: &Ranked, found: &Discovery) -> Evidence {
    // Of several channels the one that the effect explains best.
    let fall = |channel: &&str| {
        let after = ranked.rms_after.get(*channel).copied().unwrap_or(f64::INFINITY);
        ranked.rms_before.get(*channel).map_or(0.0, |before| before / after.max(f64::MIN_POSITIVE))
    };
    let channel = ranked.rms_before.keys().copied().max_by(|a, b| fall(a).total_cmp(&fall(b)));
    let of = |numbers: &ByChannel| channel.and_then(|channel| numbers.get(channel).copied());
    let epc =
        |(name, value): (&&'static str, &f64)| Epc { name: (*name).to_owned(), value: *value, sigma: ranked.sigma.get(*name).copied() };
    Evidence {
        effect: ranked.effect.to_owned(),
        accepted: found.selected.contains(&ranked.effect),
        refused: why_not(ranked, found).join(", "),
        delta_bic: ranked.delta_bic,
        p_value: Some(ranked.p_value),
        epc: ranked.epc.iter().map(epc).collect(),
        uniqueness: Some(ranked.uniqueness),
        unit: channel.map_or("", unit_of).to_owned(),
        rms_before: of(&ranked.rms_before),
        rms_after: of(&ranked.rms_after),
        holdout_before: of(&ranked.holdout_before),
        holdout_after: of(&ranked.holdout_after),
    }
}

fn confounding(scores: &[Score]) -> Option<Confounding> {
    let (shown, absorbed): (Vec<&Score>, Vec<&Score>) = scores.iter().take(ALIKE).partition(|one| one.confounded(one) > 0.0);
    let names = |scores: &[&Score]| scores.iter().map(|score| score.spec.id.to_owned()).collect();
    let row = |one: &&Score| shown.iter().map(|other| one.confounded(other)).collect();
    (shown.len() > 1).then(|| Confounding { effects: names(&shown), rho: shown.iter().map(row).collect(), absorbed: names(&absorbed) })
}

fn parameters(found: &Discovery) -> Vec<ParameterRow> {
    let mut rows = Vec::new();
    for (effect, own) in &found.parameters {
        for (name, value) in own {
            let remarks = [(value.given.is_none(), "new"), (value.at_end_of_range, "at the end of its range")];
            let remarks: Vec<&str> = remarks.iter().filter(|(holds, _)| *holds).map(|(_, remark)| *remark).collect();
            rows.push(ParameterRow {
                effect: (*effect).to_owned(),
                name: (*name).to_owned(),
                unit: unit_of(name).to_owned(),
                before: value.given,
                value: value.value,
                sigma: value.sigma,
                remark: remarks.join(", "),
            });
        }
    }
    rows
}
