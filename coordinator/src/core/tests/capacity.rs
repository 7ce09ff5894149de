//! What packs can still service follows the plan.

use proto::{Mode, Promise, Service, ServiceStatus, StationCapacity};

use super::*;

/// Two stations with a full pack each.
fn core_of_two() -> Core {
    let station = |name: &str| {
        format!(
            "[stations.{name}]\nload = \"mds-station\"\nload_s = 30\nunload_s = 30\nswap_s = 60\npacks = {{ p = \"mds-3s4p-7600mah\" }}\n"
        )
    };
    let text = format!("schema = 1\nsite = \"test\"\n{}{}", station("s"), station("t"));
    let (settings, models) = toml::from_str::<Config>(&text).unwrap().load(None).unwrap();
    Core::new(settings, models, Numbering::default())
}

/// These robots, with this charge each and a minute from both stations.
fn come(core: &mut Core, socs: &[f64]) {
    for (n, soc) in socs.iter().enumerate() {
        let robot: RobotId = id(&format!("r{n}"));
        core.handle(at(0.0), Input::RobotState(robot.clone(), working(0.0, &["s", "t"])));
        core.handle(at(0.0), Input::RobotGauge(robot, gauge(0.0, *soc, 14.6)));
    }
    core.handle(at(2.0), Input::Tick);
}

fn opens(core: &mut Core, station: &str, state: StationState) {
    core.handle(at(0.0), Input::StationState(id(station), state));
    core.handle(at(0.0), Input::PackGauge(id(station), id("p"), gauge(0.0, 1.0, 84.0)));
}

fn named(promises: &[Promise]) -> Vec<&RobotId> {
    promises.iter().filter_map(|promise| promise.robot.as_ref()).collect()
}

#[test]
fn each_robot_counts_where_the_plan_has_it_and_in_its_order() {
    let mut core = core_of_two();
    ["s", "t"].iter().for_each(|station| opens(&mut core, station, ready(0.0)));
    come(&mut core, &[0.24, 0.21, 0.23, 0.22]);
    let capacity = core.capacity(at(2.0));
    let planned = |station: &StationId| -> Vec<&RobotId> {
        let there = |service: &&Service| service.station == *station && service.status == ServiceStatus::Planned;
        core.schedule().services.iter().filter(there).map(|service| &service.robot).collect()
    };
    assert!(["s", "t"].iter().all(|station| !planned(&id(station)).is_empty()), "{:?}", core.schedule());
    let told = |station: &StationCapacity| (station.station.clone(), named(&station.promises).into_iter().cloned().collect::<Vec<_>>());
    for (station, robots) in capacity.stations.iter().map(told) {
        assert_eq!(robots.iter().collect::<Vec<_>>(), planned(&station), "{station}");
    }
}

#[test]
fn who_has_no_place_in_the_plan_counts_at_one_station_only() {
    let mut core = core_of_two();
    let mut without_bays = ready(0.0);
    without_bays.bays.clear();
    ["s", "t"].iter().for_each(|station| opens(&mut core, station, without_bays.clone()));
    come(&mut core, &[0.21, 0.22]);
    let capacity = core.capacity(at(2.0));
    assert_eq!(core.schedule().services, []);
    // There is energy for them and no bay: nothing is promised, and a bay is what is lacking.
    assert_eq!((capacity.robots_expected, capacity.robots_promised), (0, 0));
    assert!(capacity.stations.iter().all(|station| station.lacks_bay), "{:?}", capacity.stations);
    let mut core = core_of_two();
    ["s", "t"].iter().for_each(|station| opens(&mut core, station, ready(0.0)));
    // Both would be there, were it not that they are too empty to get there: nobody waits for them.
    come(&mut core, &[0.001, 0.002]);
    let capacity = core.capacity(at(2.0));
    assert!(capacity.stations.iter().all(|station| named(&station.promises).is_empty()), "{:?}", capacity.stations);
}

#[test]
fn an_exchange_takes_the_arm_and_no_bay_and_its_spare_pays_for_itself() {
    let mut core = core_of_two();
    let full = SpareState { spare: id("spare-1"), soc: Estimate::new(1.0, 0.01), ready: true, battery: None };
    opens(&mut core, "s", StationState { bays: Vec::new(), spares: vec![full], ..ready(0.0) });
    opens(&mut core, "t", StationState { powered: false, packs: Vec::new(), active_pack: None, ..ready(0.0) });
    come(&mut core, &[0.21]);
    let [service] = &core.schedule().services[..] else { panic!("{:?}", core.schedule()) };
    assert_eq!(service.mode, Mode::Swap { spare: id("spare-1") });
    let capacity = core.capacity(at(2.0));
    let here = capacity.stations.iter().find(|station| station.station.as_ref() == "s").unwrap();
    // The exchange itself, and the charge of the pack that comes out where the station charges it; a further robot would need another spare.
    assert_eq!((here.robots_promised, here.lacks_spare), (1, true), "{here:?}");
    assert_eq!(named(&here.promises), [&id::<RobotId>("r0")]);
    let taken_wh = here.promises[0].need_wh.value;
    assert!((service.pack_energy_wh.value - 1e-9..service.pack_energy_wh.value + 6.0).contains(&taken_wh), "{taken_wh} {service:?}");
    // When that is handed out and what robots leave is put aside, a spare is what is lacking, not a bay.
    let mut core = core_of_two();
    let used = SpareState { spare: id("spare-1"), soc: Estimate::new(0.0, 0.2), ready: false, battery: None };
    opens(&mut core, "s", StationState { bays: Vec::new(), spares: vec![used], ..ready(0.0) });
    opens(&mut core, "t", StationState { powered: false, packs: Vec::new(), active_pack: None, ..ready(0.0) });
    come(&mut core, &[0.21]);
    let capacity = core.capacity(at(2.0));
    let here = capacity.stations.iter().find(|station| station.station.as_ref() == "s").unwrap();
    assert_eq!((here.robots_promised, here.lacks_bay, here.lacks_spare), (0, false, true), "{here:?}");
}

#[test]
fn a_bay_that_does_not_work_serves_nobody() {
    let told = |phase: BayPhase, powered: bool| {
        let mut core = core_of_two();
        let bays = vec![BayState { bay: id("bay-1"), phase, robot: None }];
        opens(&mut core, "s", StationState { bays, powered, ..ready(0.0) });
        come(&mut core, &[0.24, 0.21]);
        let capacity = core.capacity(at(2.0));
        let of_s = capacity.stations.iter().find(|station| station.station.as_str() == "s").expect("it is known").clone();
        let of_pack = capacity.packs.iter().find(|pack| pack.station == of_s.station).expect("it has a pack");
        assert_eq!((of_pack.lacks_bay, of_pack.lacks_power), (of_s.lacks_bay, of_s.lacks_power));
        (of_s.robots_promised > 0, of_s.lacks_bay, of_s.lacks_power)
    };
    assert!(told(BayPhase::Free, true).0);
    // Where there is no power, a bay more would be of no use.
    assert_eq!([told(BayPhase::Failed, true), told(BayPhase::Free, false)], [(false, true, false), (false, false, true)]);
}

#[test]
fn who_is_planned_a_part_of_a_charge_is_told_with_how_much() {
    let told = |soc: f64| {
        let mut core = core_of_two();
        core.handle(at(0.0), Input::StationState(id("s"), ready(0.0)));
        core.handle(at(0.0), Input::PackGauge(id("s"), id("p"), gauge(0.0, soc, 84.0)));
        opens(&mut core, "t", StationState { powered: false, packs: Vec::new(), active_pack: None, ..ready(0.0) });
        // It is not sent in at once: what has begun is no promise any more.
        come(&mut core, &[0.3]);
        let service = core.schedule().services.first()?;
        let Mode::Recharge { to_soc } = service.mode else { panic!("{service:?}") };
        let capacity = core.capacity(at(2.0));
        let here = capacity.stations.iter().find(|station| station.station == service.station).unwrap();
        let of_pack = capacity.packs.iter().find(|pack| pack.station == service.station).unwrap();
        assert_eq!(of_pack.promises[0].part_to_soc, here.promises[0].part_to_soc, "{soc}");
        Some((to_soc, here.promises[0].part_to_soc))
    };
    let (whole_soc, marked) = told(1.0).expect("a full pack charges one robot");
    assert_eq!(marked, None);
    let of_less: Vec<(f64, Option<f64>)> = (10..30).filter_map(|percent| told(0.01 * f64::from(percent))).collect();
    assert!(of_less.iter().all(|&(to_soc, marked)| marked == (to_soc < whole_soc).then_some(to_soc)), "{of_less:?}");
    assert!(of_less.iter().any(|(_, marked)| marked.is_some()), "{of_less:?}");
}
