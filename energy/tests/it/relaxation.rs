//! Rests of a measured cell: what five minutes tell of where an hour ends.

use std::path::Path;

use energy::relaxation::extrapolate;

/// Rests of half an hour and more in a CSV of time, current and voltage: time since the current
/// ended, and voltage.
fn rests(path: &Path) -> Vec<Vec<(f64, f64)>> {
    let text = std::fs::read_to_string(path).unwrap();
    let mut rests: Vec<Vec<(f64, f64)>> = vec![Vec::new()];
    let mut ended_s = 0.0;
    for line in text.lines().skip(1) {
        let cells: Vec<f64> = line.split(',').take(3).map(|cell| cell.parse().unwrap()).collect();
        if cells[1].abs() > 0.01 {
            ended_s = cells[0];
            if !rests[rests.len() - 1].is_empty() {
                rests.push(Vec::new());
            }
        } else {
            rests.last_mut().unwrap().push((cells[0] - ended_s, cells[2]));
        }
    }
    rests.retain(|rest| rest.len() > 10 && rest[rest.len() - 1].0 > 1800.0 && rest[0].0 < 61.0);
    rests
}

/// Kottas, section 3.2: five minutes suffice for 1 % of the final voltage. Measured rests of a
/// 3.7 Ah LiPo cell; skipped where the data set is not there.
#[test]
fn five_minutes_tell_the_voltage_after_half_an_hour() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/melasta_lipo_hv_pouch_3p7ah/hppc_25c_90kpa.csv");
    if !path.exists() {
        return;
    }
    let (mut worst, mut squares_extrapolated, mut squares_waited, mut count) = (0.0_f64, 0.0, 0.0, 0.0);
    for rest in rests(&path) {
        let early: Vec<_> = rest.iter().copied().filter(|(time_s, _)| *time_s < 301.0).collect();
        let Ok(relaxation) = extrapolate(&early, 1e-3) else { continue };
        let (end_v, waited_v) = (rest[rest.len() - 1].1, early[early.len() - 1].1);
        worst = worst.max((relaxation.emf_v.value / end_v - 1.0).abs());
        squares_extrapolated += (relaxation.emf_v.value - end_v).powi(2);
        squares_waited += (waited_v - end_v).powi(2);
        count += 1.0;
    }
    println!(
        "{count} rests: extrapolated {:.2} mV RMS, last voltage of 5 min {:.2} mV RMS, worst {:.3} %",
        1e3 * f64::sqrt(squares_extrapolated / count),
        1e3 * f64::sqrt(squares_waited / count),
        100.0 * worst
    );
    assert!(count >= 5.0 && worst < 0.01, "{worst}");
    assert!(squares_extrapolated < squares_waited);
}
