//! Numbers of things, for people.

/// `1 robot`, `3 robots`, `0 services`.
#[must_use]
pub fn counted(count: usize, one: &str) -> String {
    if count == 1 { format!("1 {one}") } else { format!("{count} {one}s") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_is_singular() {
        assert_eq!([0, 1, 2].map(|count| counted(count, "robot")), ["0 robots", "1 robot", "2 robots"]);
    }
}
