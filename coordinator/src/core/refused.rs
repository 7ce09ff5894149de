//! Which inputs were refused, so that each kind is told once, however often it comes and with whatever numbers.

use std::collections::BTreeMap;

use proto::Timestamp;

/// How many kinds are remembered; a flood of bad messages must fill neither memory nor journal.
const KINDS_MAX: usize = 1000;
/// Where there are so many, a kind that was told so long ago makes room for another, s; one that goes on may then be told once more.
const REMEMBERED_S: f64 = 3600.0;

/// Kinds of inputs that were refused, and when each was told: what nobody was told changes nothing here, since no journal has it.
#[derive(Debug, Default)]
pub(super) struct Refused(BTreeMap<String, Timestamp>);

impl Refused {
    /// Takes in that an input of this kind was refused; whether that is to be told.
    pub(super) fn is_new(&mut self, now: Timestamp, kind: String) -> bool {
        if self.0.contains_key(&kind) {
            return false;
        }
        if self.0.len() >= KINDS_MAX {
            self.0.retain(|_, told| now.seconds_since(*told) < REMEMBERED_S);
        }
        let has_room = self.0.len() < KINDS_MAX;
        if has_room {
            self.0.insert(kind, now);
        }
        has_room
    }
}

/// What is wrong, without what is another in every message: numbers, and the bytes of the message that are quoted.
pub(super) fn kind_of_refusal(what: &str) -> String {
    // The bytes may hold the mark that they are quoted with.
    let quoted = what.find("near `").and_then(|begin| Some((begin, what.rfind('`').filter(|end| *end > begin + 5)?)));
    let said = quoted.map_or_else(|| what.to_owned(), |(begin, end)| format!("{}{}", &what[..begin], &what[end..]));
    let is_number = |word: &&str| word.trim_matches([',', ';', ':', ')', '(', '`', '"']).parse::<f64>().is_ok();
    said.split(' ').filter(|word| !is_number(word)).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_another_in_every_message_is_no_other_refusal() {
        let told =
            |column: u32, near: &str| format!("site/robot/r1/gauge: invalid type at line 1 column {column}, near `{near}`; a number");
        let null = |ms: u32| format!("{ms},\"seq\":77,\"n\":\"`{ms}\",\"soc\":{{\"value\":null");
        assert_eq!(kind_of_refusal(&told(101, &null(600_123))), kind_of_refusal(&told(9, &null(612_345))));
        for [one, other] in [
            ["robot a is not configured, and its battery `x` is", "robot a is not configured, and its battery `y` is"],
            ["robot r1 is not configured", "robot r2 is not configured"],
        ] {
            assert_ne!(kind_of_refusal(one), kind_of_refusal(other));
        }
    }

    #[test]
    fn a_flood_of_kinds_is_told_to_its_bound_and_what_is_over_makes_room() {
        let mut refused = Refused::default();
        let at = |s: f64| Timestamp::from_unix_ms(0).plus_s(s);
        let mut told = |s: f64, robots: std::ops::Range<usize>| {
            robots.filter(|n| refused.is_new(at(s), format!("robot r{n} is not configured"))).count()
        };
        // More senders than are remembered, each again every ten seconds: for an hour nothing is told twice.
        assert_eq!(told(0.0, 0..KINDS_MAX + 500), KINDS_MAX);
        assert_eq!((1..360).map(|round| told(10.0 * f64::from(round), 0..KINDS_MAX + 500)).sum::<usize>(), 0);
        // Then who was never told of, and as many of the others again as there is room for.
        assert_eq!((told(3_600.0, KINDS_MAX..KINDS_MAX + 500), told(3_601.0, 0..KINDS_MAX)), (500, 500));
        assert_eq!(told(3_610.0, 0..KINDS_MAX + 500), 0);
    }

    #[test]
    fn what_a_parser_says_of_a_number_is_one_kind() {
        let why = |field: &str| {
            let text = format!("{{\"schema\": \"tender.gauge/1\", {field}, \"seq\": 1}}");
            proto::decode::<proto::Gauge>(text.as_bytes()).unwrap_err().to_string()
        };
        for (one, other) in [("\"at\": 1700000000123.4", "\"at\": 1700000000999.25"), ("\"at\": \"0.5\"", "\"at\": \"17.25\"")] {
            assert_ne!(why(one), why(other));
            assert_eq!(kind_of_refusal(&why(one)), kind_of_refusal(&why(other)), "{}", why(one));
        }
    }
}
