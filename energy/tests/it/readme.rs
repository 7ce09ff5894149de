//! The README's tables name files and tests: they must be there.

use std::path::Path;

use energy::catalogue;

/// Rows of all tables whose heading begins with one of these words.
const TABLES: [&str; 2] = ["| row ", "| as printed "];

fn folder() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn readme() -> String {
    std::fs::read_to_string(folder().join("README.md")).expect("the README is there")
}

/// Rows of the tables that name files, without heading and rule.
fn rows(text: &str) -> Vec<&str> {
    let mut rows = Vec::new();
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        if TABLES.iter().any(|heading| line.starts_with(heading)) {
            rows.extend(lines.by_ref().skip(1).take_while(|line| line.starts_with('|')));
        }
    }
    rows
}

/// Words in backticks that are paths, each with the test that is named in it, if one is.
fn paths(text: &str) -> impl Iterator<Item = (&str, Option<&str>)> {
    let quoted = text.split('`').skip(1).step_by(2);
    quoted.flat_map(str::split_whitespace).filter_map(|word| {
        let (path, test) = word.split_once("::").map_or((word, None), |(path, test)| (path, Some(test)));
        let known = [".rs", ".toml", ".md", "/"].iter().any(|end| path.ends_with(end));
        (known && path.contains('/')).then_some((path, test))
    })
}

/// Paths stand relative to this crate; those in a command line, relative to the workspace.
fn find(path: &str) -> Option<std::path::PathBuf> {
    [folder().join(path), folder().join("..").join(path)].into_iter().find(|path| path.exists())
}

#[test]
fn every_file_and_test_that_the_readme_names_exists() {
    let text = readme();
    let rows = rows(&text);
    assert!(rows.len() > 35, "{} rows: has a table's heading changed?", rows.len());
    let mut missing = Vec::new();
    for (path, test) in paths(&text) {
        if path.contains('<') {
            continue;
        }
        match (find(path), test) {
            (None, _) => missing.push(format!("no file {path}")),
            (Some(_), None) => {}
            (Some(file), Some(test)) => {
                let source = std::fs::read_to_string(file).expect("a text");
                if !source.contains(&format!("fn {test}()")) {
                    missing.push(format!("no fn {test} in {path}"));
                }
            }
        }
    }
    assert!(missing.is_empty(), "the README names what is not there:\n{}", missing.join("\n"));
}

#[test]
fn every_row_of_the_thesis_names_a_file_and_a_test() {
    let text = readme();
    for row in rows(&text) {
        let cells: Vec<&str> = row.split('|').map(str::trim).collect();
        let named = |cell: &str, test: bool| paths(cell).any(|(_, name)| name.is_some() == test);
        if let [_, _, place, shown, used, _] = cells[..] {
            assert!(named(place, false) && named(shown, true) && !used.is_empty(), "{row}");
        } else {
            assert!(named(cells[3], false), "{row}");
        }
    }
}

/// What an effect's file has to hold; `recovery.rs` tests the rest of every effect.
#[test]
fn every_effect_has_tests_of_its_own() {
    let effects = folder().join("src/effect");
    let files = ["battery", "sensor", "robot", "station"].into_iter().flat_map(|system| {
        let entries = std::fs::read_dir(effects.join(system)).expect("a folder of effects");
        entries.map(|entry| entry.expect("an entry").path())
    });
    let files: Vec<_> = files.filter(|path| path.extension().is_some_and(|extension| extension == "rs")).collect();
    assert_eq!(files.len(), catalogue().len(), "one file, one effect");
    for file in files {
        let text = std::fs::read_to_string(&file).expect("a text");
        assert!(text.contains("#[cfg(test)]") && text.contains("#[test]"), "{} has no test", file.display());
    }
}
