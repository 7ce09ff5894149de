//! What a station says of itself, and when.

use super::*;

#[test]
fn what_is_expected_is_told_with_its_time_and_that_moves_only_when_it_is_another() {
    let mut bench = bench();
    let mut told = |back_s: f64, arrives_s: Option<f64>| {
        bench.observe(|shown| {
            (shown.packs[1].connected, shown.packs[1].back) = (false, Some((back_s, energy::Estimate::new(0.97, 0.01))));
            shown.arrives_s = arrives_s;
        });
        let state = bench.agent.state_message(bench.now);
        let back = state.packs[1].back.unwrap();
        assert_eq!(back.soc.value, 0.97);
        [Some(back.at), state.arrives].map(|at| at.map(|at| at.seconds_since(Timestamp::from_unix_ms(0))))
    };
    // A second passes before each.
    assert_eq!(told(600.0, Some(300.0)), [Some(601.0), Some(301.0)]);
    assert_eq!(told(599.4, Some(298.7)), [Some(601.0), Some(301.0)], "the same but for rounding");
    assert_eq!(told(700.0, None), [Some(703.0), None]);
}

#[test]
fn a_reading_is_told_once_and_one_that_makes_no_sense_not_at_all() {
    let mut bench = bench();
    let mut told = |change: &dyn Fn(&mut Observation)| {
        bench.now = bench.now.plus_s(10.0);
        let mut observation = bench.shown.clone();
        change(&mut observation);
        bench.agent.handle(bench.now, Input::Observed(observation));
        let (mut gauges, mut note) = (0, None);
        while let Some(output) = bench.agent.poll() {
            match output {
                Output::Gauge(..) => gauges += 1,
                Output::State(state) => note = state.note,
                _ => {}
            }
        }
        (gauges, note)
    };
    assert_eq!(told(&|_| {}), (2, None));
    assert_eq!(told(&|seen| seen.packs[0].sample = None), (1, None));
    let wrong = |seen: &mut Observation| seen.packs[0].sample.as_mut().unwrap().voltage_v = -1.0;
    let (gauges, note) = told(&wrong);
    assert!(
        gauges == 1 && note.as_ref().is_some_and(|note| note.starts_with("pack-1: the gauge makes no sense of what is measured")),
        "{note:?}"
    );
    assert_eq!(told(&|_| {}), (2, None));
}

#[test]
fn a_station_says_nothing_of_itself_before_it_knows_how_it_stands() {
    let mut bench = bench();
    let mut states = |known: bool| {
        bench.now = bench.now.plus_s(30.0);
        bench.agent.handle(bench.now, Input::Observed(Observation { known, ..bench.shown.clone() }));
        std::iter::from_fn(|| bench.agent.poll()).filter(|output| matches!(output, Output::State(_))).count()
    };
    assert_eq!([states(false), states(false), states(true), states(true)], [0, 0, 1, 1]);
}
