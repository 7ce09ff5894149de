//! dev
fn cpu() -> f64 {
    let t = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    t.tv_sec as f64 + t.tv_nsec as f64 * 1e-9
}
struct Cpu(f64);
impl Cpu {
    fn elapsed(&self) -> f64 {
        cpu() - self.0
    }
}
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let budget_s: f64 = args[2].parse().unwrap();
    let seed: u64 = args.get(3).map_or(1, |s| s.parse().unwrap());
    let text = std::fs::read_to_string(&args[1]).unwrap();
    let instance = match planner::Instance::parse(&text) {
        Ok(i) => i,
        Err(e) => {
            println!("{e}");
            std::process::exit(2)
        }
    };
    let policy = args.get(4).map_or("optimise", |p| p.as_str());
    let t = Cpu(cpu());
    let plan = match planner::plan(&instance.problem, policy, seed, &mut |_| t.elapsed() / budget_s) {
        Ok(p) => p,
        Err(e) => {
            println!("{e}");
            std::process::exit(1)
        }
    };
    let took = t.elapsed();
    println!("{} cpu {took:.4} {:?} bound {:?} gap {:.2?} %", instance.problem.name, plan.objective.all(), plan.bound.all(), plan.gaps().map(|g| 100.0 * g));
    if let Some(out) = args.get(5) {
        let t = Cpu(cpu());
        let capacity = planner::capacity(&instance.problem);
        let took = t.elapsed();
        println!("capacity {took:.4} atomic {}/{} split {}/{}", capacity.atomic.len(), capacity.atomic_bound, capacity.split, capacity.split_bound);
        std::fs::write(out, planner::solution::to_json(&instance, policy, &plan, &capacity)).unwrap();
    }
}
