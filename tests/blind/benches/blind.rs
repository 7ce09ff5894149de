use blind::*;
fn main() {
    let start = std::time::Instant::now();
    let only = std::env::args().nth(1).filter(|a| !a.starts_with("--"));
    for (i, e) in plan().iter().enumerate() {
        if only.as_ref().is_some_and(|o| !e.name.contains(o.as_str())) { continue; }
        let t = std::time::Instant::now();
        let case = make(e, 1 + i as u64);
        let rows: usize = case.train.iter().map(|l| l.time_s.len()).sum();
        println!("{:60} {:.2}-{:.2} leaves {:.3} {:?} rows {rows} {:.2}s {}", e.name, e.strength.0, e.strength.1, case.truth.leaves().strength, case.truth.leaves().by_channel, t.elapsed().as_secs_f64(), case.truth.story);
    }
    println!("{} {:?}", plan().len(), start.elapsed());
}
