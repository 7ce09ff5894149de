use super::*;
use crate::real::{Dual, derivative, variable};

fn read(text: &str) -> Result<Formula, FormulaError> {
    let resolve = |name: &str| match name {
        "x" => Some(Name::Parameter(0)),
        "y" => Some(Name::Parameter(1)),
        "soc" => Some(Name::Channel(Channel::Soc)),
        _ => None,
    };
    Formula::parse(text, &resolve, &["x", "y", "soc"])
}

fn value(text: &str, x: f64, y: f64) -> f64 {
    read(text).unwrap_or_else(|error| panic!("{text}: {error:?}")).value(&Channels::filled(0.25), &[x, y], &[])
}

#[test]
fn precedence_is_that_of_the_blackboard() {
    for (text, expected) in [
        ("1 + 2 * 3", 7.0),
        ("-2^2", -4.0),
        ("2^-1", 0.5),
        ("2^3^2", 512.0),
        ("(1 + 2) * 3 - -1", 10.0),
        ("8 / 4 / 2", 1.0),
        ("1e3 + .5 - 1.5e-1", 1000.35),
        ("min(x, y) + max(x, y) * soc", 2.0 + 0.25 * 3.0),
        ("sign(-x) * abs(-y) + sqrt(4) + pi - pi", 1.0),
        ("exp(ln(x)) ^ y", 0.0),
    ] {
        let expected = if text.starts_with("exp") { 9.0 } else { expected };
        let (x, y) = if text.starts_with("sign") { (2.0, 1.0) } else { (3.0, 2.0) };
        assert!((value(text, x, y) - expected).abs() < 1e-12, "{text} = {}", value(text, x, y));
    }
}

#[test]
fn derivatives_agree_with_differences() {
    for text in [
        "x^2.5 * y",
        "exp(-x / y)",
        "x^y",
        "sin(x) / cos(y)",
        "tanh(x) * atan(y)",
        "asinh(x * y)",
        "sqrt(x) * ln(y)",
        "abs(-x) * y^3",
        "min(x, y)",
    ] {
        let (formula, x, y) = (read(text).unwrap(), 1.3, 0.7);
        let exact = formula.value(&Channels::filled(Dual::from(0.0)), &[variable(x, 0), variable(y, 1)], &[]);
        let h = 1e-6;
        let by_x = (value(text, x + h, y) - value(text, x - h, y)) / (2.0 * h);
        let by_y = (value(text, x, y + h) - value(text, x, y - h)) / (2.0 * h);
        assert!((derivative(&exact, 0) - by_x).abs() < 1e-8 && (derivative(&exact, 1) - by_y).abs() < 1e-8, "{text}");
    }
}

#[test]
fn a_root_has_no_slope_at_a_standstill() {
    let root = read("sqrt(x)").unwrap().value(&Channels::filled(Dual::from(0.0)), &[variable(0.0, 0), Dual::from(0.0)], &[]);
    assert_eq!((root.re, derivative(&root, 0)), (0.0, 0.0));
}

#[test]
fn errors_name_the_place_and_what_was_probably_meant() {
    for (text, at, words) in [
        ("x * socc", 4..8, "unknown name `socc`; did you mean `soc`?"),
        ("sine(x)", 0..4, "unknown function `sine`; did you mean `sin`?"),
        ("2 * (x + 1", 4..5, "not closed"),
        ("x y", 2..3, "an operator"),
        ("x + * y", 4..5, "`*` where a number"),
        ("x +", 3..3, "the formula ends"),
        ("max(x)", 0..3, "takes 2 arguments, not 1"),
        ("exp * 2", 0..3, "needs its argument"),
        ("1.2.3", 0..5, "not a number"),
    ] {
        let error = read(text).unwrap_err();
        assert!(error.at == at && error.message.contains(words), "{text}: {error:?}");
    }
    assert!(read(&"(".repeat(5000)).is_err());
    assert!(read(&("x^(".repeat(20) + "x" + &")".repeat(20))).unwrap_err().message.contains("intermediate"));
}
