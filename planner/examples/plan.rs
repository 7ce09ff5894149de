//! dev
fn cpu() -> f64 {
    let t = std::fs::read_to_string("/proc/self/schedstat").unwrap();
    t.split(' ').next().unwrap().parse::<f64>().unwrap() * 1e-9
}
struct Cpu(f64);
impl Cpu {
    fn elapsed(&self) -> f64 {
        cpu() - self.0
    }
}
use planner::optimise::{Knobs, optimise};
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let f = |i: usize, d: f64| args.get(i).and_then(|a| a.parse().ok()).unwrap_or(d);
    let text = std::fs::read_to_string(&args[1]).unwrap();
    let t = std::time::Instant::now();
    let inst = planner::instance::Instance::parse(&text).unwrap();
    let t1 = t.elapsed();
    let t = Cpu(cpu());
    let ways = planner::way::Ways::new(&inst.problem);
    let n: usize = (0..inst.problem.robots.len()).map(|r| ways.of(r).ways.len()).sum();
    eprintln!("parse {t1:?} ways {n} {:?}", t.elapsed());
    let b = f(2, 1.0);
    let knobs = Knobs { hot: f(3, 8.0), cold: f(4, 0.3), dual: f(5, 0.25), trace: args.len() > 6 };
    let mut budget = |_m: u64| t.elapsed() / b;
    let r = optimise(&ways, 1, &mut budget, knobs);
    println!("{:?} bounds {} {} gap {:.2} %", r.score, r.stranded_bound, r.cost_bound, 100.0 * (r.score.cost - r.cost_bound) as f64 / r.cost_bound as f64);
}
