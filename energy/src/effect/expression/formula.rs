//! A formula as people write it, read once and calculated at every step without allocation.
//!
//! Read by a small parser of our own: `exmex` takes `-soc^2` for `(-soc)^2`, names no place in its
//! errors and copies its numbers at every evaluation. Here `^` binds tighter than the sign before
//! it and groups to the right, and every error knows its characters.

use std::ops::Range;

use crate::document::hint;
use crate::real::{Real, exp};
use crate::{Channel, Channels};

/// What is wrong in a formula, and in which of its bytes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FormulaError {
    /// Bytes of the formula.
    pub at: Range<usize>,
    /// What is wrong, and what is allowed.
    pub message: String,
}

/// What a name stands for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Name {
    Channel(Channel),
    Parameter(usize),
    State(usize),
}

/// Intermediate results that a formula may hold at a time.
const DEPTH: usize = 16;
/// Parentheses within parentheses.
const NESTING: usize = 64;

#[derive(Debug, Clone, Copy, PartialEq)]
enum Op {
    Number(f64),
    Get(Name),
    Negate,
    Add,
    Subtract,
    Multiply,
    Divide,
    Power,
    PowerOf(f64),
    PowerInt(i32),
    Call(Function),
}

macro_rules! functions {
    ($($variant:ident $name:literal $arguments:literal,)*) => {
        #[derive(Debug, Clone, Copy, PartialEq)]
        enum Function { $($variant,)* }

        /// Functions with their numbers of arguments.
        const FUNCTIONS: &[(&str, Function, usize)] = &[$(($name, Function::$variant, $arguments),)*];
    };
}

functions! {
    Abs "abs" 1, Asinh "asinh" 1, Atan "atan" 1, Cos "cos" 1, Exp "exp" 1, Ln "ln" 1, Max "max" 2, Min "min" 2,
    Sign "sign" 1, Sin "sin" 1, Sqrt "sqrt" 1, Tanh "tanh" 1,
}

/// Names of all functions.
pub fn function_names() -> impl Iterator<Item = &'static str> {
    FUNCTIONS.iter().map(|(name, ..)| *name)
}

/// A formula in the order of its calculation (postfix).
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Formula {
    ops: Box<[Op]>,
}

impl Formula {
    /// Reads a formula. `resolve` knows the names, `known` lists them for errors.
    pub(crate) fn parse(text: &str, resolve: &dyn Fn(&str) -> Option<Name>, known: &[&str]) -> Result<Formula, FormulaError> {
        let mut parser = Parser { text, at: 0, nesting: 0, ops: Vec::new(), resolve, known };
        parser.sum()?;
        parser.blanks();
        if parser.at < text.len() {
            let rest = parser.rest().chars().next().map_or(1, char::len_utf8);
            return parser.fail(parser.at..parser.at + rest, "an operator (+ - * / ^) or the end of the formula belongs here".to_owned());
        }
        let formula = Formula { ops: parser.ops.into() };
        if formula.depth() > DEPTH {
            let message = format!("the formula holds {} intermediate results at a time; {DEPTH} are allowed", formula.depth());
            return Err(FormulaError { at: 0..text.len(), message });
        }
        Ok(formula)
    }

    fn depth(&self) -> usize {
        let (mut now, mut most) = (0_usize, 0);
        for op in &self.ops {
            match op {
                Op::Number(_) | Op::Get(_) => now += 1,
                Op::Add | Op::Subtract | Op::Multiply | Op::Divide | Op::Power | Op::Call(Function::Max | Function::Min) => now -= 1,
                Op::Negate | Op::PowerOf(_) | Op::PowerInt(_) | Op::Call(_) => {}
            }
            most = most.max(now);
        }
        most
    }

    /// Every name that the formula uses.
    pub(crate) fn names(&self) -> impl Iterator<Item = Name> + '_ {
        self.ops.iter().filter_map(|op| if let Op::Get(name) = op { Some(*name) } else { None })
    }

    /// The value.
    /// Whether it reads a battery's current, or what goes with that.
    pub(crate) fn reads_current(&self) -> bool {
        use Channel::{CellCurrentA, CurrentA, OverpotentialV, PowerW, TerminalCurrentA};
        self.names().any(|name| matches!(name, Name::Channel(CellCurrentA | CurrentA | OverpotentialV | PowerW | TerminalCurrentA)))
    }

    pub(crate) fn value<S: Real>(&self, channels: &Channels<S>, parameters: &[S], states: &[S]) -> S {
        let mut stack = [S::from(0.0); DEPTH];
        let mut top = 0;
        for op in &self.ops {
            match *op {
                Op::Number(number) => {
                    stack[top] = S::from(number);
                    top += 1;
                }
                Op::Get(name) => {
                    stack[top] = match name {
                        Name::Channel(channel) => channels[channel],
                        Name::Parameter(index) => parameters[index],
                        Name::State(index) => states[index],
                    };
                    top += 1;
                }
                Op::Add | Op::Subtract | Op::Multiply | Op::Divide | Op::Power | Op::Call(Function::Max | Function::Min) => {
                    top -= 1;
                    let (a, b) = (stack[top - 1], stack[top]);
                    stack[top - 1] = two(*op, a, b);
                }
                Op::Negate => stack[top - 1] = -stack[top - 1],
                Op::PowerOf(exponent) => stack[top - 1] = power(stack[top - 1], exponent),
                Op::PowerInt(exponent) => stack[top - 1] = stack[top - 1].powi(exponent),
                Op::Call(function) => stack[top - 1] = one(function, stack[top - 1]),
            }
        }
        stack[0]
    }
}

fn two<S: Real>(op: Op, a: S, b: S) -> S {
    match op {
        Op::Add => a + b,
        Op::Subtract => a - b,
        Op::Multiply => a * b,
        Op::Divide => a / b,
        Op::Call(Function::Max) => {
            if a.re() >= b.re() {
                a
            } else {
                b
            }
        }
        Op::Call(Function::Min) => {
            if a.re() <= b.re() {
                a
            } else {
                b
            }
        }
        // As [`power`]: beside a standstill a logarithm has no slope.
        _ if a.re() == 0.0 && b.re() > 0.0 => S::from(0.0),
        _ => (a.ln() * b).exp(),
    }
}

fn one<S: Real>(function: Function, x: S) -> S {
    match function {
        Function::Abs => {
            if x.re() < 0.0 {
                -x
            } else {
                x
            }
        }
        Function::Asinh => x.asinh(),
        Function::Atan => x.atan(),
        Function::Cos => x.cos(),
        Function::Exp => exp(x),
        Function::Ln => x.ln(),
        Function::Sign => S::from(if x.re() == 0.0 { 0.0 } else { x.re().signum() }),
        Function::Sin => x.sin(),
        Function::Sqrt => power(x, 0.5),
        Function::Tanh => x.tanh(),
        Function::Max | Function::Min => unreachable!("they take two arguments"),
    }
}

/// x^exponent; 0 at 0 without a slope, which would be endless for a root and spoil every fit that
/// meets a standstill.
fn power<S: Real>(x: S, exponent: f64) -> S {
    if x.re() == 0.0 && exponent > 0.0 { S::from(0.0) } else { x.powf(exponent) }
}

struct Parser<'a> {
    text: &'a str,
    at: usize,
    nesting: usize,
    ops: Vec<Op>,
    resolve: &'a dyn Fn(&str) -> Option<Name>,
    known: &'a [&'a str],
}

impl Parser<'_> {
    fn fail<T>(&self, at: Range<usize>, message: String) -> Result<T, FormulaError> {
        Err(FormulaError { at, message })
    }

    fn rest(&self) -> &str {
        &self.text[self.at..]
    }

    fn blanks(&mut self) {
        self.at += self.rest().len() - self.rest().trim_start().len();
    }

    /// Takes the next character if it is one of these.
    fn take(&mut self, wanted: &[char]) -> Option<char> {
        self.blanks();
        let found = self.rest().chars().next().filter(|c| wanted.contains(c))?;
        self.at += found.len_utf8();
        Some(found)
    }

    fn sum(&mut self) -> Result<(), FormulaError> {
        self.product()?;
        while let Some(sign) = self.take(&['+', '-']) {
            self.product()?;
            self.ops.push(if sign == '+' { Op::Add } else { Op::Subtract });
        }
        Ok(())
    }

    fn product(&mut self) -> Result<(), FormulaError> {
        self.signed()?;
        while let Some(sign) = self.take(&['*', '/']) {
            self.signed()?;
            self.ops.push(if sign == '*' { Op::Multiply } else { Op::Divide });
        }
        Ok(())
    }

    fn signed(&mut self) -> Result<(), FormulaError> {
        self.nesting += 1;
        if self.nesting > NESTING {
            return self.fail(self.at..self.at, "the formula is nested too deeply".to_owned());
        }
        match self.take(&['+', '-']) {
            Some('-') => {
                self.signed()?;
                match self.ops.last_mut() {
                    Some(Op::Number(number)) => *number = -*number,
                    _ => self.ops.push(Op::Negate),
                }
            }
            Some(_) => self.signed()?,
            None => self.power()?,
        }
        self.nesting -= 1;
        Ok(())
    }

    fn power(&mut self) -> Result<(), FormulaError> {
        self.atom()?;
        if self.take(&['^']).is_none() {
            return Ok(());
        }
        let before = self.ops.len();
        self.signed()?;
        match self.ops[before..] {
            [Op::Number(number)] => {
                self.ops.pop();
                let whole = number.fract() == 0.0 && number.abs() <= 64.0;
                self.ops.push(if whole { Op::PowerInt(number as i32) } else { Op::PowerOf(number) });
            }
            _ => self.ops.push(Op::Power),
        }
        Ok(())
    }

    fn atom(&mut self) -> Result<(), FormulaError> {
        if self.take(&['(']).is_some() {
            let opened = self.at - 1;
            self.sum()?;
            return self.close(opened);
        }
        let (begin, rest) = (self.at, self.rest());
        match rest.chars().next() {
            Some(c) if c.is_ascii_digit() || c == '.' => {
                let length = number_length(rest);
                let number = rest[..length].parse::<f64>().ok().filter(|number| number.is_finite());
                self.at += length;
                match number {
                    Some(number) => self.ops.push(Op::Number(number)),
                    None => return self.fail(begin..begin + length, format!("`{}` is not a number", &self.text[begin..self.at])),
                }
                Ok(())
            }
            Some(c) if c.is_ascii_alphabetic() || c == '_' => {
                let length = rest.find(|c: char| !c.is_ascii_alphanumeric() && c != '_').unwrap_or(rest.len());
                self.at += length;
                self.name(begin)
            }
            Some(c) => self.fail(begin..begin + c.len_utf8(), format!("`{c}` where a number, a name or a parenthesis belongs")),
            None => self.fail(begin..begin, "the formula ends where a number, a name or a parenthesis belongs".to_owned()),
        }
    }

    fn close(&mut self, opened: usize) -> Result<(), FormulaError> {
        match self.take(&[')']) {
            Some(_) => Ok(()),
            None => self.fail(opened..opened + 1, "this parenthesis is not closed".to_owned()),
        }
    }

    /// The name that ends here: of a function, if a parenthesis follows.
    fn name(&mut self, begin: usize) -> Result<(), FormulaError> {
        let at = begin..self.at;
        let name = &self.text[at.clone()];
        let function = FUNCTIONS.iter().find(|(known, ..)| *known == name);
        if self.take(&['(']).is_none() {
            let value = if name == "pi" { Some(Op::Number(std::f64::consts::PI)) } else { (self.resolve)(name).map(Op::Get) };
            return match (value, function) {
                (Some(value), _) => {
                    self.ops.push(value);
                    Ok(())
                }
                (None, Some(_)) => self.fail(at, format!("the function `{name}` needs its argument in parentheses")),
                (None, None) => {
                    let mut known: Vec<&str> = self.known.to_vec();
                    function_names().for_each(|function| known.push(function));
                    let message = format!("unknown name `{name}`{} Known: {}, pi", hint(name, known.iter().copied()), known.join(", "));
                    self.fail(at, message)
                }
            };
        }
        let Some(&(_, function, wanted)) = function else {
            let message = format!(
                "unknown function `{name}`{} Known: {}",
                hint(name, function_names()),
                function_names().collect::<Vec<_>>().join(", ")
            );
            return self.fail(at, message);
        };
        let (opened, mut given) = (self.at - 1, 1);
        self.sum()?;
        while self.take(&[',']).is_some() {
            self.sum()?;
            given += 1;
        }
        self.close(opened)?;
        if given != wanted {
            return self.fail(at, format!("`{name}` takes {wanted} argument{}, not {given}", if wanted == 1 { "" } else { "s" }));
        }
        self.ops.push(Op::Call(function));
        Ok(())
    }
}

/// Bytes of the number at the beginning of a text: digits, a point, an exponent.
fn number_length(text: &str) -> usize {
    let bytes = text.as_bytes();
    let digits = |from: usize| bytes[from..].iter().take_while(|b| b.is_ascii_digit() || **b == b'.').count();
    let mantissa = digits(0);
    if !matches!(bytes.get(mantissa), Some(b'e' | b'E')) {
        return mantissa;
    }
    let sign = usize::from(matches!(bytes.get(mantissa + 1), Some(b'+' | b'-')));
    match digits(mantissa + 1 + sign) {
        0 => mantissa,
        exponent => mantissa + 1 + sign + exponent,
    }
}

#[cfg(test)]
mod tests;
