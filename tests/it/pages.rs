//! Pages show what the programs print: commands that stand in a page are run, and what the page shows of their output is looked for in it.

use std::path::Path;
use std::process::Command;

use tests::{program, workspace};

/// A command of a page, and the lines that the page shows below it.
#[derive(Debug)]
struct Shown {
    command: String,
    lines: Vec<String>,
}

/// Every command of a page's code blocks.
fn shown(page: &str) -> Vec<Shown> {
    let mut all: Vec<Shown> = Vec::new();
    let (mut in_block, mut goes_on, mut below) = (false, false, false);
    // Blocks of a list stand in its depth.
    for line in page.lines().map(str::trim_start) {
        if line.starts_with("```") {
            (in_block, goes_on, below) = (!in_block, false, false);
        } else if let Some(command) = line.strip_prefix("$ ").filter(|_| in_block) {
            all.push(Shown { command: command.trim_end_matches('\\').to_owned(), lines: Vec::new() });
            (goes_on, below) = (command.ends_with('\\'), true);
        } else if let Some(last) = all.last_mut().filter(|_| below) {
            if goes_on {
                last.command += line.trim_end_matches('\\');
                goes_on = line.ends_with('\\');
            } else {
                last.lines.push(line.to_owned());
            }
        }
    }
    all
}

/// A line without what the width of a table makes of it; nothing of one that only rules off, or says that lines are left out.
fn words(line: &str) -> String {
    let joined = line.split_whitespace().collect::<Vec<_>>().join(" ");
    if joined == "..." || joined.chars().all(|c| c == '\u{2500}') { String::new() } else { joined }
}

/// How far a number of a page may be off: mathematical libraries differ from machine to machine, and a sum over a run amplifies their last bit.
const ROUNDING: f64 = 0.02;

/// Whether a line of a page is that line, or its beginning.
fn begins(printed: &str, shown: &str) -> bool {
    let number = |word: &str| word.trim_start_matches(['(', '+']).trim_end_matches([',', ';', ':', ')', '%']).parse::<f64>().ok();
    let same = |(shown, printed): (&str, &str)| {
        let near = |shown: f64, printed: f64| (shown - printed).abs() <= ROUNDING * shown.abs();
        shown == printed || matches!((number(shown), number(printed)), (Some(shown), Some(printed)) if near(shown, printed))
    };
    let (all, there) = (shown.split(' ').count(), printed.split(' ').count());
    printed.starts_with(shown) || all <= there && shown.split(' ').zip(printed.split(' ')).all(same)
}

/// What of a page is not printed, in its order; a page may leave lines out and cut their ends off.
fn not_printed<'a>(shown: &'a Shown, printed: &str) -> Vec<&'a str> {
    let printed: Vec<String> = printed.lines().map(words).collect();
    let mut at = 0;
    let mut missing = Vec::new();
    for line in shown.lines.iter().filter(|line| !words(line).is_empty()) {
        match printed[at..].iter().position(|one| begins(one, &words(line))) {
            Some(found) => at += found + 1,
            None => missing.push(line.as_str()),
        }
    }
    missing
}

/// Runs the commands of a page that end by themselves and need nothing but what the repository holds, in `folder`, and compares.
fn check(page: &str, folder: &Path, not_here: &[&str], at_least: usize) {
    let text = std::fs::read_to_string(workspace().join(page)).unwrap();
    let programs = Path::new(program("lab").get_program()).parent().unwrap().to_owned();
    let path = format!("{}:{}", programs.display(), std::env::var("PATH").unwrap_or_default());
    let mut compared = 0;
    for mut shown in shown(&text) {
        shown.command = shown.command.replace("cargo run --release -p coordinator -- ", "coordinator ");
        let ours = ["coordinator ", "lab "].iter().any(|program| shown.command.starts_with(program));
        if !ours || not_here.iter().any(|word| shown.command.contains(word)) {
            continue;
        }
        let ran =
            Command::new("sh").args(["-c", &shown.command]).current_dir(folder).env("PATH", &path).env_remove("TENDER_CONFIG").output();
        let ran = ran.unwrap();
        let missing = not_printed(&shown, &String::from_utf8_lossy(&ran.stdout));
        assert!(
            missing.is_empty(),
            "{page}: {} does not print:\n{}\nbut:\n{}{}",
            shown.command,
            missing.join("\n"),
            String::from_utf8_lossy(&ran.stdout),
            String::from_utf8_lossy(&ran.stderr)
        );
        compared += usize::from(!shown.lines.is_empty());
    }
    assert!(compared >= at_least, "{page}: only {compared} commands with an output were run");
}

/// A folder in which the paths of a page lead somewhere, and files that its commands write harm nothing.
fn folder(shows: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let link = |from: &Path| std::os::unix::fs::symlink(from, folder.path().join(from.file_name().unwrap())).unwrap();
    link(&workspace().join("scenarios"));
    if !shows.is_empty() {
        std::fs::read_dir(workspace().join(shows)).unwrap().flatten().for_each(|file| link(&file.path()));
    }
    folder
}

/// Programs that do not end by themselves, and what only they keep.
const LIVE: [&str; 4] = ["--serve", "coordinator demo", "coordinator run", "tender-demo"];

#[test]
fn the_readme_shows_what_is_printed() {
    check("README.md", folder("").path(), &LIVE, 3);
}

/// `cell.toml`, `base.toml`, `train-*.csv` and `long.csv` are the reader's own.
#[test]
fn the_readme_of_the_lab_shows_what_is_printed() {
    let own = ["cell.toml", "base.toml", "long.csv"];
    check("lab/README.md", folder("scenarios/measured/enertech-lco-2280mah").path(), &own, 5);
}

/// `my-cell.toml` comes of the first command; `M`, `M2` and what stands for logs are the reader's own.
#[test]
fn the_way_to_a_battery_shows_what_is_printed() {
    check("docs/how-to/calibrate-a-battery.md", folder("scenarios/measured/enertech-lco-2280mah").path(), &["lab fit --model M"], 2);
}
