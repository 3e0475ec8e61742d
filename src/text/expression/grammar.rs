//! The grammar of expressions: numbers, names, calls, and operators with their precedence.

use winnow::ascii::{digit0, digit1, multispace0};
use winnow::combinator::{Infix, Prefix, alt, cut_err, delimited, expression, opt, preceded, separated};
use winnow::error::{ContextError, ErrMode};
use winnow::prelude::*;
use winnow::token::{one_of, take_while};

/// The syntax tree of an expression.
pub(super) enum Tree<'t> {
    Number(f64),
    Name(&'t str),
    Call(&'t str, Vec<Tree<'t>>),
    Negative(Box<Tree<'t>>),
    /// One of the operators `+ - * / ^` with its operands.
    Binary(char, Box<[Tree<'t>; 2]>),
}

type ParseResult<T> = Result<T, ErrMode<ContextError>>;

// Precedence of the operators: a larger number binds more tightly.
const SUM: i64 = 1;
const PRODUCT: i64 = 2;
const SIGN: i64 = 3;
const POWER: i64 = 4;

/// Reads a whole text. The error is the text after the readable part.
pub(super) fn parse(text: &str) -> Result<Tree<'_>, &str> {
    sum.parse(text).map_err(|error| &text[error.offset().min(text.len())..])
}

fn sum<'t>(input: &mut &'t str) -> ParseResult<Tree<'t>> {
    expression(delimited(multispace0, operand, multispace0))
        .prefix(preceded(multispace0, sign))
        .infix(operator)
        .parse_next(input)
}

fn sign<'t>(input: &mut &'t str) -> ParseResult<Prefix<&'t str, Tree<'t>, ErrMode<ContextError>>> {
    match one_of(['+', '-']).parse_next(input)? {
        '-' => Ok(Prefix(SIGN, |_, of| Ok(Tree::Negative(Box::new(of))))),
        _ => Ok(Prefix(SIGN, |_, of| Ok(of))),
    }
}

fn operator<'t>(input: &mut &'t str) -> ParseResult<Infix<&'t str, Tree<'t>, ErrMode<ContextError>>> {
    match one_of(['+', '-', '*', '/', '^']).parse_next(input)? {
        '+' => Ok(Infix::Left(SUM, |_, a, b| Ok(Tree::Binary('+', Box::new([a, b]))))),
        '-' => Ok(Infix::Left(SUM, |_, a, b| Ok(Tree::Binary('-', Box::new([a, b]))))),
        '*' => Ok(Infix::Left(PRODUCT, |_, a, b| Ok(Tree::Binary('*', Box::new([a, b]))))),
        '/' => Ok(Infix::Left(PRODUCT, |_, a, b| Ok(Tree::Binary('/', Box::new([a, b]))))),
        _ => Ok(Infix::Right(POWER, |_, a, b| Ok(Tree::Binary('^', Box::new([a, b]))))),
    }
}

fn operand<'t>(input: &mut &'t str) -> ParseResult<Tree<'t>> {
    alt((number, named, delimited('(', cut_err(sum), cut_err(')')))).parse_next(input)
}

/// Reads a number, with an optional fraction and an optional exponent.
fn number<'t>(input: &mut &'t str) -> ParseResult<Tree<'t>> {
    let mantissa = alt(((digit1, opt(('.', digit0))).void(), ('.', digit1).void()));
    let exponent = (one_of(['e', 'E']), opt(one_of(['+', '-'])), digit1);
    (mantissa, opt(exponent)).take().parse_to().map(Tree::Number).parse_next(input)
}

/// Reads a name, or a call if arguments follow.
fn named<'t>(input: &mut &'t str) -> ParseResult<Tree<'t>> {
    let is_first = |c: char| c.is_alphabetic() || c == '_';
    let name = (one_of(is_first), take_while(0.., move |c: char| c.is_alphanumeric() || c == '_')).take();
    let arguments = delimited((multispace0, '('), cut_err(separated(1.., sum, ',')), cut_err(')'));
    let (name, arguments): (&str, Option<Vec<Tree<'t>>>) = (name, opt(arguments)).parse_next(input)?;
    Ok(match arguments {
        Some(arguments) => Tree::Call(name, arguments),
        None => Tree::Name(name),
    })
}
