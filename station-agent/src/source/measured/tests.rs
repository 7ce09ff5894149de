use std::path::Path;
use std::sync::Arc;

use device::{Report, Script, Unmeasured};
use energy::Model;
use proto::{BayId, RobotId, SpareId};

use super::*;
use crate::source::{Lifted, Swapped};

/// A device that says that, one entry a second, and the last one for good.
fn script(says: impl IntoIterator<Item = Vec<Report>>) -> Box<Script> {
    let says: Vec<_> = says.into_iter().collect();
    let last = says.last().cloned();
    Script::new(says.into_iter().chain(last.into_iter().cycle()))
}

fn shows(voltage_v: f64, current_a: f64) -> Vec<Report> {
    vec![Report { voltage_v: Some(voltage_v), current_a: Some(current_a), soc: Some(0.8), ..Report::default() }]
}

fn model() -> Arc<Model> {
    Arc::new(energy::load_model("mds-3s4p-7600mah", &|_| unreachable!("built in")).unwrap())
}

fn pack_id(number: u32) -> PackId {
    PackId::new(format!("pack-{number}")).unwrap()
}

fn pack(number: u32, says: impl IntoIterator<Item = Vec<Report>>) -> MeasuredPack {
    let model = model();
    MeasuredPack::new(pack_id(number), Reader::new(script(says), Arc::clone(&model), Unmeasured::default()), model.battery())
}

fn robot() -> RobotId {
    RobotId::new("r1").unwrap()
}

fn lift(bay: u32, into: bool) -> Lifted {
    Lifted { robot: robot(), bay: BayId::new(format!("bay-{bay}")).unwrap(), into }
}

/// A program that notes its arguments and then does as the script says.
fn operated(folder: &Path, does: &str) -> Hands {
    let path = folder.join("operate.sh");
    std::fs::write(&path, format!("echo \"$@\" >> {}/acts\n{does}\n", folder.display())).unwrap();
    Hands::new(vec!["/bin/sh".to_owned(), path.display().to_string()], PATIENCE_S, 0.05)
}

/// Longer than any program here needs, in the steps that these tests make.
const PATIENCE_S: f64 = 900.0;

/// Nobody works this station.
fn no_hands() -> Hands {
    Hands::new(Vec::new(), PATIENCE_S, 0.05)
}

fn acts(folder: &Path) -> String {
    std::fs::read_to_string(folder.join("acts")).unwrap_or_default()
}

/// Moves on by `dt_s` at a time until that is seen; programs need their own time.
fn until(station: &mut MeasuredStation, dt_s: f64, what: impl Fn(&Observation) -> bool) -> Observation {
    for _ in 0..2000 {
        let seen = station.advance(dt_s).unwrap();
        if what(&seen) {
            return seen;
        }
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    panic!("it never came to be so")
}

#[test]
fn the_pack_that_gives_current_is_the_active_one_and_stays_it_while_it_does() {
    let nothing = || shows(12.0, 0.0);
    let first = [nothing(), shows(11.9, 1.0), shows(11.9, 1.0), nothing(), nothing()];
    let second = [nothing(), nothing(), shows(11.8, 2.0), shows(11.8, 2.0), nothing()];
    let mut station = MeasuredStation::new(vec![pack(1, first), pack(2, second)], Vec::new(), no_hands());
    let mut actives = (0..5).map(|_| station.advance(1.0).unwrap()).map(|seen| seen.active_pack.unwrap());
    // None gives any: the first. Then the first; both; the second; and as before.
    assert_eq!(actives.next(), Some(pack_id(1)));
    assert_eq!(actives.next(), Some(pack_id(1)));
    assert_eq!(actives.next(), Some(pack_id(1)));
    assert_eq!(actives.next(), Some(pack_id(2)));
    assert_eq!(actives.next(), Some(pack_id(2)));
}

#[test]
fn a_pack_that_gave_out_stays_so_until_it_is_charged_and_one_that_is_silent_is_away() {
    let eod_v = model().battery().eod_v();
    let low = || shows(eod_v - 0.1, 2.0);
    let says = [shows(12.0, 2.0), low(), low(), low(), shows(eod_v + 0.8, 0.0), shows(eod_v + 1.0, -1.0)];
    let mut station = MeasuredStation::new(vec![pack(1, says), pack(2, [])], Vec::new(), no_hands());
    let seen: Vec<Observation> = (0..62).map(|_| station.advance(1.0).unwrap()).collect();
    let depleted: Vec<bool> = seen.iter().take(6).map(|seen| seen.packs[0].depleted).collect();
    assert_eq!(depleted, [false, false, false, true, true, false]);
    assert_eq!(seen.iter().take(6).map(|seen| seen.powered).collect::<Vec<_>>(), [true, true, true, false, false, true]);
    assert!(seen.iter().all(|seen| !seen.packs[1].connected && seen.packs[1].sample.is_none()));
    assert_eq!(seen[61].trouble.as_deref(), Some("pack-2: no reading of script for 62 s: unplugged"));
}

#[test]
fn a_pack_that_had_given_out_before_a_restart_is_empty_until_it_is_charged_or_is_another() {
    let at = |voltage_v: f64, current_a: f64, soc: f64| {
        vec![Report { voltage_v: Some(voltage_v), current_a: Some(current_a), soc: Some(soc), ..Report::default() }]
    };
    let powered = |says: Vec<Vec<Report>>| {
        let steps = says.len();
        let mut station = MeasuredStation::new(vec![pack(1, says)], Vec::new(), no_hands());
        station.gave_out(&[(pack_id(1), Some(Estimate::new(0.02, 0.05)))]);
        (0..steps).map(|_| station.advance(1.0).unwrap().powered).collect::<Vec<_>>()
    };
    // It has recovered some volts; its gauge begins anew, and after a minute of silence once more.
    let rests = at(11.0, 0.0, 0.05);
    let silence = std::iter::repeat_n(Vec::new(), 70);
    let all = std::iter::once(rests.clone()).chain(silence).chain([rests.clone(), rests.clone()]).collect();
    assert!(powered(all).iter().all(|powered| !powered));
    assert_eq!(powered(vec![rests.clone(), at(11.2, -1.0, 0.05)]), [false, true]);
    assert_eq!(powered(vec![at(12.0, 0.0, 0.9)]), [true]);
    // Put in while its gauge said little of itself, and told of it by a later report: what it held when it gave out is what counts.
    assert_eq!(powered(vec![at(12.0, 0.0, 0.1), at(12.0, 0.0, 0.12), at(12.0, 0.0, 0.9)]), [false, false, true]);
}

#[test]
fn one_reading_below_its_end_is_no_empty_pack_however_long_the_device_took() {
    let eod_v = model().battery().eod_v();
    let mut station =
        MeasuredStation::new(vec![pack(1, [shows(12.0, 2.0), shows(eod_v - 0.1, 9.0), shows(12.0, 2.0)])], Vec::new(), no_hands());
    assert!((0..3).all(|_| !station.advance(3.5).unwrap().packs[0].depleted));
}

#[test]
fn nothing_is_known_of_a_station_before_each_pack_has_spoken_or_been_silent_for_a_minute() {
    let late = [vec![], vec![], vec![], shows(12.0, 1.0)];
    let mut station = MeasuredStation::new(vec![pack(1, late.clone()), pack(2, [shows(12.0, 0.0)])], Vec::new(), no_hands());
    let seen: Vec<_> = (0..4).map(|_| station.advance(1.0).unwrap()).map(|seen| seen.known).collect();
    assert_eq!(seen, [false, false, false, true]);
    let mut station = MeasuredStation::new(vec![pack(1, []), pack(2, [])], Vec::new(), no_hands());
    let known = (1..100).find(|_| station.advance(1.0).unwrap().known);
    assert_eq!(known, Some(61));
}

#[test]
fn a_lift_that_draws_the_voltage_down_for_a_moment_has_not_emptied_the_pack() {
    let eod_v = model().battery().eod_v();
    let says = [12.0, eod_v - 0.5, 11.8, eod_v - 0.5, 11.8].map(|voltage_v| shows(voltage_v, 2.0));
    let mut station = MeasuredStation::new(vec![pack(1, says)], Vec::new(), no_hands());
    (0..10).map(|_| station.advance(1.0).unwrap()).for_each(|seen| assert!(seen.powered && !seen.packs[0].depleted));
}

#[test]
fn the_program_is_told_what_to_do_and_says_what_it_has_done() {
    let folder = tempfile::tempdir().unwrap();
    let hands = operated(folder.path(), "case $1 in swap) echo soc 0.15 0.02;; esac");
    let mut station = MeasuredStation::new(vec![pack(1, [shows(12.0, 0.5)]), pack(2, [shows(12.1, 0.0)])], Vec::new(), hands);
    station.act(&Act::Lift(lift(2, true)));
    assert!(station.advance(1.0).unwrap().lift_active);
    assert_eq!(until(&mut station, 0.1, |seen| seen.lifted.is_some()).lifted, Some(lift(2, true)));
    station.act(&Act::Lift(lift(2, false)));
    assert_eq!(until(&mut station, 0.1, |seen| seen.lifted.is_some()).lifted, Some(lift(2, false)));
    let spare = SpareId::new("spare-1").unwrap();
    station.act(&Act::Swap { robot: robot(), spare: spare.clone() });
    let swapped = until(&mut station, 0.1, |seen| seen.swapped.is_some());
    assert_eq!(swapped.swapped, Some(Swapped { robot: robot(), spare, given_soc: Estimate::new(0.15, 0.02) }));
    // Asked for every second while it is wanted, and done once.
    (0..3).for_each(|_| station.act(&Act::Select { pack: pack_id(2) }));
    until(&mut station, 0.1, |_| acts(folder.path()).lines().count() == 4);
    assert!(!station.advance(1.0).unwrap().lift_active);
    assert_eq!(acts(folder.path()), "load r1 bay-2\nunload r1 bay-2\nswap r1 spare-1\nselect pack-2\n");
}

#[test]
fn what_fails_is_tried_again_later_and_a_lift_that_goes_on_failing_puts_its_bay_out_of_order_until_it_is_mended() {
    let folder = tempfile::tempdir().unwrap();
    let mended = folder.path().join("mended");
    let hands = operated(folder.path(), &format!("test -e {} || exit 7", mended.display()));
    let mut station = MeasuredStation::new(vec![pack(1, [shows(12.0, 0.5)])], Vec::new(), hands);
    station.act(&Act::Lift(lift(1, true)));
    let failed = until(&mut station, 0.01, |seen| seen.trouble.is_some());
    assert_eq!(failed.trouble.as_deref(), Some("source.operate: `load r1 bay-1` failed: exit status: 7"));
    assert!(failed.lift_active && failed.given_up.is_none());
    // Ten seconds have to pass, and then twenty.
    (0..20).for_each(|_| drop(station.advance(0.01)));
    assert_eq!(acts(folder.path()), "load r1 bay-1\n");
    let given_up = until(&mut station, 1.0, |seen| seen.given_up.is_some());
    assert_eq!((given_up.given_up, given_up.lift_active), (Some(lift(1, true)), false));
    assert_eq!(given_up.trouble.as_deref(), Some("bay bay-1 is out of order"));
    assert_eq!(acts(folder.path()).lines().count(), 3);
    // What is looked at from now on holds nobody up: the next movement begins when the check has ended.
    until(&mut station, 1.0, |_| acts(folder.path()).ends_with("check bay-1\n"));
    std::fs::write(&mended, "").unwrap();
    station.act(&Act::Lift(lift(2, true)));
    assert_eq!(until(&mut station, 0.1, |seen| seen.lifted.is_some()).lifted, Some(lift(2, true)));
    let again = until(&mut station, 1.0, |seen| !seen.mended.is_empty());
    assert_eq!((again.mended, again.trouble), (vec![lift(1, true).bay], None));
}

#[test]
fn a_robot_that_cannot_be_let_out_is_tried_until_it_is_out() {
    let folder = tempfile::tempdir().unwrap();
    let hands = operated(folder.path(), &format!("test $(grep -c unload {}/acts) -gt 4", folder.path().display()));
    let mut station = MeasuredStation::new(vec![pack(1, [shows(12.0, 0.5)])], Vec::new(), hands);
    station.act(&Act::Lift(lift(1, false)));
    until(&mut station, 1.0, |seen| seen.given_up == Some(lift(1, false)));
    assert_eq!(until(&mut station, 1.0, |seen| seen.lifted.is_some()).lifted, Some(lift(1, false)));
    assert_eq!(acts(folder.path()), "unload r1 bay-1\n".repeat(5));
}

#[test]
fn without_a_program_robots_move_by_themselves() {
    let mut station = MeasuredStation::new(vec![pack(1, [shows(12.0, 0.5)])], Vec::new(), no_hands());
    station.act(&Act::Lift(lift(1, true)));
    assert_eq!(station.advance(1.0).unwrap().lifted, Some(lift(1, true)));
}

#[test]
fn a_spare_is_ready_when_its_device_says_that_it_is_charged() {
    let says = |soc: f64| vec![Report { soc: Some(soc), ..Report::default() }];
    let id = SpareId::new("spare-1").unwrap();
    let spare = MeasuredSpare::new(id.clone(), script([0.5, 0.94, 0.96, 0.962, 0.98, 0.3, 0.97].map(says)), 0.95, 0.05);
    let mut station = MeasuredStation::new(vec![pack(1, [shows(12.0, 0.5)])], vec![spare], no_hands());
    let told: Vec<Option<f64>> = (0..7)
        .map(|_| station.advance(1.0).unwrap().charged.first().map(|(spare, soc)| (spare == &id).then_some(soc.value).unwrap()))
        .collect();
    // Told once it is, when it has moved by a percent, and again after another one lay there.
    assert_eq!(told, [None, None, Some(0.96), None, Some(0.98), None, Some(0.97)]);
}

/// What is told of a spare whose device says that: its charge, and whether it can be handed out.
fn told_of(station: &mut MeasuredStation, dt_s: f64) -> Option<(f64, bool)> {
    let seen = station.advance(dt_s).unwrap();
    let both = seen.charged.iter().map(|(_, soc)| (soc.value, true)).chain(seen.uncharged.iter().map(|(_, soc)| (soc.value, false)));
    both.last()
}

#[test]
fn a_spare_that_runs_down_or_is_taken_away_is_ready_no_longer() {
    let says = |soc: f64| vec![Report { soc: Some(soc), ..Report::default() }];
    let says = [0.96, 0.952, 0.87, 0.865].map(says).into_iter().chain([Vec::new()]);
    let spare = MeasuredSpare::new(SpareId::new("spare-1").unwrap(), script(says), 0.95, 0.05);
    let mut station = MeasuredStation::new(vec![pack(1, [shows(12.0, 0.5)])], vec![spare], no_hands());
    let told: Vec<_> = (0..4).map(|_| told_of(&mut station, 1.0)).collect();
    assert_eq!(told, [Some((0.96, true)), None, Some((0.87, false)), None]);
    (0..60).for_each(|_| assert_eq!(told_of(&mut station, 1.0), None));
    assert_eq!([1.0, 1.0].map(|dt_s| told_of(&mut station, dt_s)), [Some((UNKNOWN_SOC.value, false)), None]);
}

#[test]
fn a_noisy_charge_near_the_level_of_a_spare_does_not_take_it_away_and_give_it_back() {
    let says = |soc: f64| vec![Report { soc: Some(soc), soc_sigma: Some(0.02), ..Report::default() }];
    // Charged to the level, and noise as large as its deviation around that; then used up below it, with the same noise.
    let noisy = [0.93, 0.951, 0.932, 0.968, 0.93, 0.97, 0.931, 0.966];
    let used = [0.915, 0.94, 0.92, 0.949, 0.951];
    let spare = MeasuredSpare::new(SpareId::new("spare-1").unwrap(), script(noisy.into_iter().chain(used).map(says)), 0.95, 0.05);
    let mut station = MeasuredStation::new(vec![pack(1, [shows(12.0, 0.5)])], vec![spare], no_hands());
    let mut ready = || {
        station.advance(1.0);
        station.spares[0].told.unwrap().1
    };
    // By hand: it is ready from 0.95 on, and no longer below 0.95 - sqrt(2) 0.02 = 0.922.
    assert_eq!([(); 8].map(|()| ready()), [false, true, true, true, true, true, true, true]);
    assert_eq!([(); 5].map(|()| ready()), [false, false, false, false, true]);
}

#[test]
fn what_a_robot_left_in_the_place_of_a_spare_is_told_when_the_exchange_is_done() {
    let folder = tempfile::tempdir().unwrap();
    let done = folder.path().join("done");
    let hands = operated(folder.path(), &format!("while ! test -e {}; do sleep 0.01; done", done.display()));
    let id = SpareId::new("spare-1").unwrap();
    let says = [0.96, 0.2, 0.2].map(|soc| vec![Report { soc: Some(soc), ..Report::default() }]);
    let spare = MeasuredSpare::new(id.clone(), script(says), 0.95, 0.05);
    let mut station = MeasuredStation::new(vec![pack(1, [shows(12.0, 0.5)])], vec![spare], hands);
    assert_eq!(told_of(&mut station, 1.0), Some((0.96, true)));
    station.act(&Act::Swap { robot: robot(), spare: id.clone() });
    (0..3).for_each(|_| assert_eq!(told_of(&mut station, 1.0), None));
    std::fs::write(&done, "").unwrap();
    let seen = until(&mut station, 1.0, |seen| seen.swapped.is_some());
    assert_eq!(seen.uncharged, [(id, Estimate::new(0.2, 0.05))]);
}

#[test]
fn an_exchange_that_has_moved_nothing_is_called_off_and_any_other_failure_is_tried_again() {
    for (status, is_called_off) in [(75, true), (1, false)] {
        let folder = tempfile::tempdir().unwrap();
        let hands = operated(folder.path(), &format!("exit {status}"));
        let mut station = MeasuredStation::new(vec![pack(1, [shows(12.0, 1.0)])], Vec::new(), hands);
        let spare = SpareId::new("spare-1").unwrap();
        station.act(&Act::Swap { robot: robot(), spare: spare.clone() });
        let seen = until(&mut station, 0.1, |seen| seen.trouble.is_some());
        assert_eq!(seen.called_off, is_called_off.then(|| (robot(), spare.clone())));
        assert_eq!((seen.swapped, seen.lift_active), (None, !is_called_off));
        let told =
            if is_called_off { "the exchange of r1 with spare-1 was called off" } else { "`swap r1 spare-1` failed: exit status: 1" };
        assert!(seen.trouble.as_ref().unwrap().contains(told), "{:?}", seen.trouble);
    }
}

#[test]
fn a_log_stands_in_for_a_device_and_a_pack_whose_log_has_ended_goes_away() {
    let mut file = tempfile::NamedTempFile::new().unwrap();
    std::io::Write::write_all(&mut file, b"time_s,current_a,voltage_v\n0,1,12\n10,1,11.9\n20,2,11.8\n").unwrap();
    let model = model();
    let reader = Reader::new(Box::new(device::Log::read(file.path()).unwrap()), Arc::clone(&model), Unmeasured::default());
    let mut station = MeasuredStation::new(vec![MeasuredPack::new(pack_id(1), reader, model.battery())], Vec::new(), no_hands());
    let seen: Vec<Observation> = (0..90).map(|_| station.advance(1.0).unwrap()).collect();
    let samples: Vec<Sample> = seen.iter().filter_map(|seen| seen.packs[0].sample).collect();
    assert_eq!(samples.iter().map(|sample| sample.current_a).collect::<Vec<_>>(), [1.0, 2.0]);
    assert_eq!((seen[8].packs[0].connected, seen[30].packs[0].connected, seen[89].packs[0].connected), (false, true, false));
    assert!(seen[89].trouble.as_ref().unwrap().ends_with("the log has ended"), "{:?}", seen[89].trouble);
}

#[test]
fn a_program_that_hangs_is_ended_with_all_that_it_has_started_before_its_act_is_tried_again() {
    let folder = tempfile::tempdir().unwrap();
    let pid = folder.path().join("pid");
    // The first time it waits for something that does not end when it is asked to, and not for long where nobody ends it.
    let stubborn = format!("sh -c 'trap \"\" TERM; echo $$ > {}; exec sleep 100' > /dev/null 2>&1 & wait", pid.display());
    let hands = operated(folder.path(), &format!("test -e {} || {{ {stubborn}; }}", pid.display()));
    let mut station = MeasuredStation::new(vec![pack(1, [shows(12.0, 0.5)])], Vec::new(), hands);
    station.act(&Act::Lift(lift(1, true)));
    until(&mut station, 0.01, |_| std::fs::read_to_string(&pid).is_ok_and(|pid| pid.ends_with('\n')));
    let slept = station.advance(28_800.0).unwrap().trouble;
    assert!(slept.is_some_and(|pack| !pack.contains(KEY)), "the program slept as well");
    (0..29).for_each(|_| assert_eq!(station.advance(30.0).unwrap().trouble, None));
    let stopped = until(&mut station, 30.0, |seen| seen.trouble.is_some());
    assert_eq!(stopped.trouble.as_deref(), Some("source.operate: `load r1 bay-1` has not ended in 900 s and was stopped"));
    // One that has ended is a zombie until somebody asks for it.
    let stat = format!("/proc/{}/stat", std::fs::read_to_string(&pid).unwrap().trim());
    let ended = (0..1500).any(|_| {
        std::thread::sleep(std::time::Duration::from_millis(10));
        station.advance(30.0);
        let goes_on = std::fs::read_to_string(&stat).is_ok_and(|status| !status.contains(") Z "));
        assert!(!goes_on || acts(folder.path()).lines().count() == 1, "two of them are at one lift");
        !goes_on
    });
    assert!(ended, "what the program has started goes on");
    until(&mut station, 30.0, |seen| seen.lifted == Some(lift(1, true)));
}
