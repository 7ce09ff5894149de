//! What capacity and schedule of one moment say of the same services and packs, all along a run.

use proto::{Capacity, Schedule, ServiceStatus};
use sqlx::Connection as _;

use super::{scenario_folder, simulate};

/// Schedules of a run with the capacity that was told at the same moment.
fn told(scenario: &str) -> Vec<(Schedule, Capacity)> {
    let folder = tempfile::tempdir().unwrap();
    let file = scenario_folder().join(scenario);
    let answer = simulate(folder.path(), &[file.to_str().unwrap(), "--store", "run.db"]);
    assert_eq!(answer.code, 0, "{}", answer.stderr);
    let address = format!("sqlite://{}", folder.path().join("run.db").display());
    let rows = async {
        sqlx::any::install_default_drivers();
        let mut store = sqlx::AnyConnection::connect(&address).await?;
        let both = "SELECT plans.body, capacities.body FROM plans JOIN capacities ON capacities.at_ms = plans.at_ms ORDER BY number";
        sqlx::query_as::<_, (String, String)>(both).fetch_all(&mut store).await
    };
    let rows = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap().block_on(rows).unwrap();
    rows.iter().map(|(plan, capacity)| (serde_json::from_str(plan).unwrap(), serde_json::from_str(capacity).unwrap())).collect()
}

/// The packs' probability is found to a hundredth.
const ALIKE: f64 = 0.02;

#[test]
fn a_service_is_as_sure_in_the_capacity_as_it_is_in_the_schedule() {
    let (mut compared, mut unsure) = (0, 0);
    for (schedule, capacity) in ["tight-pack.toml", "demo.toml", "depot-supply.toml"].iter().flat_map(|scenario| told(scenario)) {
        let planned = || schedule.services.iter().filter(|service| service.status == ServiceStatus::Planned);
        for (service, sure) in planned().filter_map(|service| Some((service, service.probability?))) {
            let station = capacity.stations.iter().find(|station| station.station == service.station).unwrap();
            let promise = station.promises.iter().find(|promise| promise.robot.as_ref() == Some(&service.robot));
            let promise = promise.unwrap_or_else(|| panic!("{}: {service:?} beside {station:?}", capacity.at)).probability;
            assert!(promise > sure - ALIKE, "{}: {promise} beside {service:?}", capacity.at);
            // The schedule also counts what others that begin later draw until it ends; the capacity counts one after the other.
            let begins = |other: &proto::Service| service.start < other.start && other.start < service.end;
            if planned().any(|other| other.station == service.station && begins(other)) {
                continue;
            }
            assert!((promise - sure).abs() < ALIKE, "{}: {promise} beside {service:?}", capacity.at);
            compared += 1;
            unsure += u32::from(sure < 0.9995);
        }
    }
    assert!(compared > 400 && unsure > 80, "{compared} services, {unsure} of them unsure");
}

#[test]
fn no_pack_has_more_than_all_packs_together() {
    for (_, capacity) in ["demo.toml", "selector-rule.toml"].iter().flat_map(|scenario| told(scenario)) {
        for pack in &capacity.packs {
            let all = capacity.stations.iter().find(|station| station.station == pack.station).unwrap();
            assert!(pack.robots_promised <= all.robots_promised, "{}: {pack:?} beside {all:?}", capacity.at);
            assert!(pack.usable_wh.value <= all.usable_wh.value + 1e-9, "{}: {pack:?} beside {all:?}", capacity.at);
        }
    }
}
