//! The navigation graph of Open-RMF: where chargers are, and how far it is to them.

use std::collections::{BTreeMap, BinaryHeap};

use anyhow::{bail, ensure};
use energy::document::hint;

use super::node::{self, Node};

/// A navigation graph.
#[derive(Debug, Clone, Default)]
pub struct Graph {
    waypoints: Vec<Waypoint>,
    /// Lanes by where they end: where from, and how long.
    into: Vec<Vec<(usize, f64)>>,
}

#[derive(Debug, Clone)]
struct Waypoint {
    name: String,
    charger: bool,
    lift: Option<String>,
    at_m: [f64; 2],
}

impl Graph {
    /// Reads a navigation graph (`levels` with `vertices` and `lanes`).
    ///
    /// # Errors
    /// Names the place and what is allowed.
    pub fn parse(file: &str, text: &str) -> anyhow::Result<Self> {
        let value = node::parse(file, text)?;
        let root = Node::root(file, &value);
        let mut graph = Self::default();
        for (_, level) in root.need("levels")?.entries()? {
            let first = graph.waypoints.len();
            for vertex in level.need("vertices")?.list()? {
                graph.waypoints.push(waypoint(&vertex)?);
            }
            graph.into.resize(graph.waypoints.len(), Vec::new());
            for lane in level.need("lanes")?.list()? {
                graph.lane(&lane, first)?;
            }
        }
        graph.lifts();
        ensure!(!graph.waypoints.is_empty(), "{file}: a graph without vertices");
        Ok(graph)
    }

    /// A lane runs one way; indices count within the level.
    fn lane(&mut self, lane: &Node<'_>, first: usize) -> anyhow::Result<()> {
        let ends = lane.list()?;
        let [begin, end, options @ ..] = ends.as_slice() else { bail!("{}: must be [from, to, {{...}}]", lane.place()) };
        let vertices = self.waypoints.len() - first;
        ensure!(vertices > 0, "{}: a lane joins two vertices, and this level has none", lane.place());
        let index = |node: &Node<'_>| -> anyhow::Result<usize> {
            let index = node.number(0.0..=(vertices - 1) as f64)?;
            ensure!(index.fract() == 0.0, "{} = {index}: must be a whole number", node.place());
            Ok(first + index as usize)
        };
        let (begin, end) = (index(begin)?, index(end)?);
        let [a, b] = [begin, end].map(|index| self.waypoints[index].at_m);
        let length_m = (a[0] - b[0]).hypot(a[1] - b[1]);
        self.into[end].push((begin, length_m));
        if options.first().and_then(|options| options.get("is_bidirectional")).is_some_and(|node| node.is_true()) {
            self.into[begin].push((end, length_m));
        }
        Ok(())
    }

    /// A lift joins its waypoints on all levels; a ride is no way.
    fn lifts(&mut self) {
        let mut lifts: BTreeMap<String, Vec<usize>> = BTreeMap::new();
        for (index, waypoint) in self.waypoints.iter().enumerate() {
            if let Some(lift) = &waypoint.lift {
                lifts.entry(lift.clone()).or_default().push(index);
            }
        }
        for inside in lifts.values() {
            for &one in inside {
                self.into[one].extend(inside.iter().filter(|other| **other != one).map(|&other| (other, 0.0)));
            }
        }
    }

    /// Names of its chargers.
    pub fn chargers(&self) -> impl Iterator<Item = &str> {
        self.waypoints.iter().filter(|waypoint| waypoint.charger).map(|waypoint| waypoint.name.as_str())
    }

    /// How far it is to a waypoint, m: the mean of the shortest ways from all waypoints from which there is one.
    ///
    /// # Errors
    /// When there is no such waypoint, or no way to it.
    pub fn distance_m(&self, name: &str) -> anyhow::Result<f64> {
        let Some(goal) = self.waypoints.iter().position(|waypoint| waypoint.name == name) else {
            let named: Vec<&str> = self.waypoints.iter().map(|waypoint| waypoint.name.as_str()).filter(|name| !name.is_empty()).collect();
            let near = hint(name, named.iter().copied());
            bail!("the navigation graph has no waypoint `{name}`{near} Its chargers: {}", self.chargers().collect::<Vec<_>>().join(", "))
        };
        let mut shortest = vec![f64::INFINITY; self.waypoints.len()];
        let mut open = BinaryHeap::from([Open { length_m: 0.0, at: goal }]);
        shortest[goal] = 0.0;
        while let Some(Open { length_m, at }) = open.pop() {
            if length_m > shortest[at] {
                continue;
            }
            for &(from, more_m) in &self.into[at] {
                let whole_m = length_m + more_m;
                if whole_m < shortest[from] {
                    shortest[from] = whole_m;
                    open.push(Open { length_m: whole_m, at: from });
                }
            }
        }
        let ways: Vec<f64> = shortest.into_iter().enumerate().filter(|(at, m)| *at != goal && m.is_finite()).map(|(_, m)| m).collect();
        ensure!(!ways.is_empty(), "the navigation graph has no lane that leads to `{name}`");
        Ok(ways.iter().sum::<f64>() / ways.len() as f64)
    }
}

fn waypoint(vertex: &Node<'_>) -> anyhow::Result<Waypoint> {
    let parts = vertex.list()?;
    let [x, y, options @ ..] = parts.as_slice() else { bail!("{}: must be [x, y, {{...}}]", vertex.place()) };
    let option = |key: &str| options.first().and_then(|options| options.get(key));
    let text = |key: &str| option(key).map_or(Ok(String::new()), |node| node.text().map(str::to_owned));
    Ok(Waypoint {
        name: text("name")?,
        charger: option("is_charger").is_some_and(|node| node.is_true()),
        lift: Some(text("lift")?).filter(|lift| !lift.is_empty()),
        at_m: [x.number(-1e7..=1e7)?, y.number(-1e7..=1e7)?],
    })
}

/// A waypoint to go on from, the nearest first.
#[derive(Debug, PartialEq)]
struct Open {
    length_m: f64,
    at: usize,
}

impl Eq for Open {}

impl Ord for Open {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        other.length_m.total_cmp(&self.length_m).then(other.at.cmp(&self.at))
    }
}

impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}
