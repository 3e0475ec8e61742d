//! Expressions in parameters, as in scenes and models: `0.5*k1`, `F0*omega^2`. Pure.
//!
//! Values are computed in f64, from left to right, with the functions of the crate `libm`, so that every machine
//! computes the same bits.

mod grammar;

use thiserror::Error;

use grammar::Tree;

/// Largest number of characters of an expression: enough for any formula, and few enough for recursion.
pub const LONGEST: usize = 500;

/// Largest number of characters of unreadable text in a message.
const LONGEST_REST: usize = 20;

/// The elements of expressions, for messages.
pub const TAKES: &str = "numbers, parameters, pi, + - * / ^, parentheses, and sqrt exp log sin cos tan abs (of one), min max (of two)";

type Unary = fn(f64) -> f64;
type Binary = fn(f64, f64) -> f64;

/// Functions of one argument.
const UNARY: [(&str, Unary); 7] = [
    ("sqrt", libm::sqrt),
    ("exp", libm::exp),
    ("log", libm::log),
    ("sin", libm::sin),
    ("cos", libm::cos),
    ("tan", libm::tan),
    ("abs", f64::abs),
];

/// Functions of two arguments.
const BINARY: [(&str, Binary); 2] = [("min", smaller), ("max", larger)];

/// Why a text is not an expression.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum ExpressionError {
    /// The text does not follow the grammar.
    #[error("cannot be read {}; an expression has {TAKES}", place(.rest))]
    Syntax {
        /// The text after the readable part.
        rest: String,
    },
    /// A name is not a parameter.
    #[error("unknown name `{name}`")]
    Unknown {
        /// The name.
        name: String,
    },
    /// An unknown function, or a wrong number of arguments.
    #[error("{name}")]
    Call {
        /// The message.
        name: String,
    },
    /// The text has more than [`LONGEST`] characters.
    #[error("it has {count} characters, and may have {LONGEST}")]
    TooLong {
        /// Number of characters.
        count: usize,
    },
}

fn place(rest: &str) -> String {
    let excerpt: String = rest.chars().take(LONGEST_REST).collect();
    let more = if excerpt.len() < rest.len() { "..." } else { "" };
    let power = if rest.starts_with('*') { " (a power is `^`, not `**`)" } else { "" };
    if rest.trim().is_empty() { "to its end".to_owned() } else { format!("from `{excerpt}{more}` on{power}") }
}

/// An expression that can be evaluated.
#[derive(Clone, Debug)]
pub struct Expression {
    text: String,
    term: Term,
    /// Indices of the names in the expression, increasing.
    uses: Vec<usize>,
}

#[derive(Clone, Debug)]
enum Term {
    Number(f64),
    /// A name, by its index.
    Name(usize),
    Negative(Box<Term>),
    /// A function, with its name.
    Unary((&'static str, Unary), Box<Term>),
    Binary(Binary, Box<[Term; 2]>),
    /// One of the operators `+ - * / ^`.
    Operator(char, Box<[Term; 2]>),
}

/// The function `constant + factor x^power` of one variable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PowerLaw {
    /// Value at 0, if the power is positive.
    pub(crate) constant: f64,
    /// Factor of the power.
    pub(crate) factor: f64,
    /// Exponent; without effect if the factor is 0.
    pub(crate) power: f64,
}

impl PowerLaw {
    fn constant(constant: f64) -> PowerLaw {
        PowerLaw { constant, factor: 0.0, power: 1.0 }
    }

    /// Returns the value if it does not depend on the variable.
    fn as_constant(self) -> Option<f64> {
        (self.factor == 0.0).then_some(self.constant)
    }

    fn times(self, number: f64) -> PowerLaw {
        PowerLaw { constant: self.constant * number, factor: self.factor * number, ..self }
    }

    /// Returns `a + sign b`; none if the powers differ.
    fn sum(a: PowerLaw, b: PowerLaw, sign: f64) -> Option<PowerLaw> {
        let power = match (a.as_constant(), b.as_constant()) {
            (_, Some(_)) => a.power,
            (Some(_), None) => b.power,
            (None, None) => (a.power == b.power).then_some(a.power)?,
        };
        Some(PowerLaw { constant: a.constant + sign * b.constant, factor: a.factor + sign * b.factor, power })
    }

    /// Returns `self^power`; none if it has another form.
    fn to_the(self, power: f64) -> Option<PowerLaw> {
        match self.as_constant() {
            Some(constant) => Some(PowerLaw::constant(libm::pow(constant, power))),
            None if power == 1.0 => Some(self),
            None if power == 0.0 => Some(PowerLaw::constant(1.0)),
            None => (self.constant == 0.0).then(|| PowerLaw {
                constant: 0.0,
                factor: libm::pow(self.factor, power),
                power: self.power * power,
            }),
        }
    }

    /// Returns `a b`; none if it has another form.
    fn product(a: PowerLaw, b: PowerLaw) -> Option<PowerLaw> {
        match (a.as_constant(), b.as_constant()) {
            (Some(a), _) => Some(b.times(a)),
            (_, Some(b)) => Some(a.times(b)),
            _ if a.constant != 0.0 || b.constant != 0.0 => None,
            _ if a.power + b.power == 0.0 => Some(PowerLaw::constant(a.factor * b.factor)),
            _ => Some(PowerLaw { constant: 0.0, factor: a.factor * b.factor, power: a.power + b.power }),
        }
    }
}

impl Expression {
    /// Reads an expression in `names`. `-a^2` means `-(a^2)`, and `a^b^c` means `a^(b^c)`.
    ///
    /// # Errors
    /// [`ExpressionError`] for the first error.
    pub fn parse(text: &str, names: &[&str]) -> Result<Expression, ExpressionError> {
        let count = text.chars().count();
        if count > LONGEST {
            return Err(ExpressionError::TooLong { count });
        }
        let tree = grammar::parse(text).map_err(|rest| ExpressionError::Syntax { rest: rest.to_owned() })?;
        let mut uses = Vec::new();
        let term = resolved(tree, names, &mut uses)?;
        uses.sort_unstable();
        uses.dedup();
        Ok(Expression { text: text.trim().to_owned(), term, uses })
    }

    /// Builds an expression from a number.
    pub(crate) fn number(number: f64) -> Expression {
        Expression { text: format!("{number:?}"), term: Term::Number(number), uses: Vec::new() }
    }

    /// Returns the number if the expression is only a number, possibly with a sign.
    pub(crate) fn as_number(&self) -> Option<f64> {
        match &self.term {
            Term::Number(number) => Some(*number),
            Term::Negative(of) => match **of {
                Term::Number(number) => Some(-number),
                _ => None,
            },
            _ => None,
        }
    }

    /// Returns the expression as written.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Returns the indices of the names in the expression, increasing.
    pub fn uses(&self) -> &[usize] {
        &self.uses
    }

    /// Computes the value. `value(index)` returns the value of a name. The result may be infinite or NaN.
    pub fn evaluate(&self, value: &dyn Fn(usize) -> f64) -> f64 {
        self.term.evaluate(value)
    }

    /// Returns the expression as a function of the name with the index `variable`; none if it is no [`PowerLaw`]. `value(index)` returns
    /// the value of any other name.
    pub(crate) fn power_law(&self, variable: usize, value: &dyn Fn(usize) -> f64) -> Option<PowerLaw> {
        self.term.power_law(variable, value)
    }
}

impl Term {
    fn evaluate(&self, value: &dyn Fn(usize) -> f64) -> f64 {
        match self {
            Term::Number(number) => *number,
            Term::Name(place) => value(*place),
            Term::Negative(of) => -of.evaluate(value),
            Term::Unary((_, function), of) => function(of.evaluate(value)),
            Term::Binary(function, of) => function(of[0].evaluate(value), of[1].evaluate(value)),
            Term::Operator(sign, of) => operator(*sign)(of[0].evaluate(value), of[1].evaluate(value)),
        }
    }

    fn power_law(&self, variable: usize, value: &dyn Fn(usize) -> f64) -> Option<PowerLaw> {
        let of = |term: &Term| term.power_law(variable, value);
        match self {
            Term::Name(place) if *place == variable => {
                Some(PowerLaw { constant: 0.0, factor: 1.0, power: 1.0 })
            }
            Term::Number(_) | Term::Name(_) => Some(PowerLaw::constant(self.evaluate(value))),
            Term::Negative(term) => Some(of(term)?.times(-1.0)),
            Term::Unary((name, function), term) => {
                let argument = of(term)?;
                match argument.as_constant() {
                    Some(constant) => Some(PowerLaw::constant(function(constant))),
                    None if *name == "sqrt" => argument.to_the(0.5),
                    None => None,
                }
            }
            Term::Binary(function, terms) => {
                let [a, b] = terms.each_ref().map(|term| of(term).and_then(PowerLaw::as_constant));
                Some(PowerLaw::constant(function(a?, b?)))
            }
            Term::Operator(sign, terms) => {
                let [a, b] = terms.each_ref().map(of);
                let (a, b) = (a?, b?);
                if let (Some(a), Some(b)) = (a.as_constant(), b.as_constant()) {
                    return Some(PowerLaw::constant(operator(*sign)(a, b)));
                }
                match sign {
                    '+' => PowerLaw::sum(a, b, 1.0),
                    '-' => PowerLaw::sum(a, b, -1.0),
                    '*' => PowerLaw::product(a, b),
                    '/' => match b.as_constant() {
                        Some(b) => Some(PowerLaw { constant: a.constant / b, factor: a.factor / b, ..a }),
                        None => PowerLaw::product(a, b.to_the(-1.0)?),
                    },
                    _ => a.to_the(b.as_constant()?),
                }
            }
        }
    }
}

/// Looks up the names and functions of a tree.
fn resolved(tree: Tree<'_>, names: &[&str], uses: &mut Vec<usize>) -> Result<Term, ExpressionError> {
    Ok(match tree {
        Tree::Number(number) => Term::Number(number),
        Tree::Name("pi") => Term::Number(std::f64::consts::PI),
        Tree::Name(name) => match names.iter().position(|known| *known == name) {
            Some(place) => {
                uses.push(place);
                Term::Name(place)
            }
            None if arity(name).is_some() => return Err(call(name, 0)),
            None => return Err(ExpressionError::Unknown { name: name.to_owned() }),
        },
        Tree::Negative(of) => Term::Negative(Box::new(resolved(*of, names, uses)?)),
        Tree::Binary(sign, of) => {
            let [a, b] = *of;
            let of = [resolved(a, names, uses)?, resolved(b, names, uses)?];
            Term::Operator(sign, Box::new(of))
        }
        Tree::Call(name, arguments) => {
            let given = arguments.len();
            let mut terms = Vec::with_capacity(given);
            for argument in arguments {
                terms.push(resolved(argument, names, uses)?);
            }
            let one = UNARY.iter().find(|(known, _)| *known == name).copied();
            let two = BINARY.iter().find(|(known, _)| *known == name).map(|&(_, function)| function);
            match (one, two, <[Term; 2]>::try_from(terms)) {
                (_, Some(function), Ok(both)) => Term::Binary(function, Box::new(both)),
                (Some(function), _, Err(mut terms)) if given == 1 => {
                    Term::Unary(function, Box::new(terms.remove(0)))
                }
                _ => return Err(call(name, given)),
            }
        }
    })
}

/// Whether a name is a function or `pi`.
pub fn is_reserved(name: &str) -> bool {
    name == "pi" || arity(name).is_some()
}

fn arity(name: &str) -> Option<usize> {
    let one = UNARY.iter().any(|(known, _)| *known == name);
    let two = BINARY.iter().any(|(known, _)| *known == name);
    if one { Some(1) } else { two.then_some(2) }
}

fn call(name: &str, given: usize) -> ExpressionError {
    let name = match arity(name) {
        Some(1) => format!("`{name}` takes one argument, as in {name}(x), and has {given}"),
        Some(_) => format!("`{name}` takes two arguments, as in {name}(x, y), and has {given}"),
        None => format!("there is no function `{name}`; an expression has {TAKES}"),
    };
    ExpressionError::Call { name }
}

fn operator(sign: char) -> Binary {
    match sign {
        '+' => |a, b| a + b,
        '-' => |a, b| a - b,
        '*' => |a, b| a * b,
        '/' => |a, b| a / b,
        _ => libm::pow,
    }
}

/// Returns the smaller number; NaN if one of them is NaN.
fn smaller(a: f64, b: f64) -> f64 {
    if a < b || a.is_nan() { a } else { b }
}

/// Returns the larger number; NaN if one of them is NaN.
fn larger(a: f64, b: f64) -> f64 {
    if a > b || a.is_nan() { a } else { b }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAMES: [&str; 3] = ["k1", "omega", "x"];

    fn value(text: &str) -> f64 {
        let expression = Expression::parse(text, &NAMES).unwrap_or_else(|error| panic!("{text}: {error}"));
        expression.evaluate(&|place| [30.0, 5.6, 3.0][place])
    }

    #[test]
    fn expressions_are_read_as_mathematics_writes_them() {
        for (text, expected) in [
            ("0.5*k1", 15.0),
            ("-x^2", -9.0),
            ("(-x)^2", 9.0),
            ("2^3^2", 512.0),
            ("2^-1", 0.5),
            ("2^-x^2", 0.001953125),
            ("1 - 2 - 3", -4.0),
            ("6/2*3", 9.0),
            ("6*x/9", 2.0),
            ("1-2+3*2^2/4", 2.0),
            ("--1", 1.0),
            ("2*-x", -6.0),
            ("+x", 3.0),
            ("1e3 + 2.5E-1 + .5 + 1.", 1001.75),
            ("min(x, 2)*max(x, k1)", 60.0),
            ("sqrt(x*x)", 3.0),
            ("abs(-2) + exp(0) + log(1) + cos(0)", 4.0),
            ("  ( ( x ) )\t", 3.0),
        ] {
            assert_eq!(value(text), expected, "{text}");
        }
        // The order of operations is from left to right, also for constants.
        assert_eq!(value("0.1 + 0.2 + x"), 0.1 + 0.2 + 3.0);
        assert_eq!(value("x*0.1*0.2"), 3.0 * 0.1 * 0.2);
        assert_eq!(value("sin(pi/6)"), libm::sin(std::f64::consts::PI / 6.0));
        assert_eq!(value("omega^1.7"), libm::pow(5.6, 1.7));
        assert!(value("min(0/0, 1)").is_nan() && value("max(1, 0/0)").is_nan() && value("log(-1)").is_nan());
    }

    #[test]
    fn power_laws_of_one_name_are_recognised() {
        let law = |text: &str| {
            let expression = Expression::parse(text, &NAMES).unwrap();
            let law = expression.power_law(2, &|place| [30.0, 0.5, f64::NAN][place]);
            law.map(|law| [law.constant, law.factor, law.power])
        };
        for (text, expected) in [
            ("0.8", [0.8, 0.0, 1.0]),
            ("0.8 - 0.05*x", [0.8, -0.05, 1.0]),
            ("0.9 - 0.1*x^0.2", [0.9, -0.1, 0.2]),
            ("k1 + x^omega/3", [30.0, 1.0 / 3.0, 0.5]),
            ("2*(1 - k1*sqrt(x))", [2.0, -60.0, 0.5]),
            ("(2*x)^omega", [0.0, libm::pow(2.0, 0.5), 0.5]),
            ("x*x - 3*x^2 + min(k1, 2)", [2.0, -2.0, 2.0]),
            ("1/x", [0.0, 1.0, -1.0]),
            ("x/x + cos(0)", [2.0, 0.0, 1.0]),
            ("1 + 0*x", [1.0, 0.0, 1.0]),
            ("-x + 1 + x", [1.0, 0.0, 1.0]),
        ] {
            assert_eq!(law(text), Some(expected), "{text}");
        }
        for text in
            ["exp(-x)", "x + x^2", "(1 + x)^2", "max(0, 1 - x)", "2^x", "x*(1 - x)", "1/(1 + x)", "abs(x)"]
        {
            assert_eq!(law(text), None, "{text}");
        }
    }

    #[test]
    fn uses_are_the_indices_of_the_names() {
        let uses = |text| Expression::parse(text, &NAMES).unwrap().uses().to_vec();
        assert_eq!(uses("x + k1*x"), [0, 2]);
        assert!(uses("2*pi").is_empty());
    }

    #[test]
    fn errors_name_the_unreadable_part() {
        for (text, expected) in [
            ("", "cannot be read to its end"),
            ("2*", "cannot be read to its end"),
            ("2 x", "cannot be read from `x` on"),
            ("2*(x+1", "cannot be read to its end"),
            ("x)", "cannot be read from `)` on"),
            ("x ** 2", "cannot be read from `* 2` on (a power is `^`, not `**`)"),
            ("x, 2", "cannot be read from `, 2` on"),
            ("#", "cannot be read from `#` on"),
            ("omgea*2", "unknown name `omgea`"),
            ("sqrt", "`sqrt` takes one argument, as in sqrt(x), and has 0"),
            ("sqrt(1, 2)", "`sqrt` takes one argument, as in sqrt(x), and has 2"),
            ("min(1)", "`min` takes two arguments, as in min(x, y), and has 1"),
            ("min(1, 2, 3)", "and has 3"),
            ("ln(2)", "there is no function `ln`"),
            ("x(2)", "there is no function `x`"),
        ] {
            let error = Expression::parse(text, &NAMES).expect_err(text).to_string();
            assert!(error.contains(expected), "{text}: {error}");
        }
    }

    /// The deepest nesting fits on the stack of a thread.
    #[test]
    fn the_deepest_expressions_are_read() {
        let nested = |count: usize| format!("{}x{}", "(".repeat(count), ")".repeat(count));
        assert_eq!(value(&nested(LONGEST / 2 - 1)), 3.0);
        assert_eq!(value(&("-".repeat(LONGEST - 2) + "x")), 3.0);
        assert_eq!(value(&("1^".repeat(LONGEST / 2 - 1) + "x")), 1.0);
        assert!(Expression::parse(&"abs(".repeat(LONGEST / 4), &NAMES).is_err());
        let error = Expression::parse(&nested(LONGEST / 2), &NAMES).unwrap_err();
        assert_eq!(error, ExpressionError::TooLong { count: LONGEST + 1 });
    }
}
