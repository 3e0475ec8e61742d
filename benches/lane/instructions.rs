//! Arithmetic in the shader's text, counted in naga's intermediate form.

use naga::{Block, Expression, Function, Handle, Literal, Module, Statement};
use rattlemap::gpu::Precision;

/// Parts of the lane: function, and whether only its loop is meant.
const PARTS: [(&str, bool, &str); 4] = [
    ("scan", true, "a scan step"),
    ("careful", false, "a careful pass, all branches once"),
    ("root", true, "a root trip"),
    ("sweep", false, "the whole text with every call copied in"),
];

pub(crate) fn print(source: &str, precision: Precision) {
    let module = naga::front::wgsl::parse_str(source)
        .unwrap_or_else(|error| panic!("{precision:?}: {}", error.emit_to_string(source)));
    for (name, only_loop, what) in PARTS {
        let function = function(&module, name);
        let count = if only_loop {
            loops(&function.body).map(|body| block(&module, function, body)).sum()
        } else {
            block(&module, function, &function.body)
        };
        println!("  {count:8} {what}");
    }
}

fn function<'a>(module: &'a Module, name: &str) -> &'a Function {
    let named = |function: &&Function| function.name.as_deref() == Some(name);
    let entries = module.entry_points.iter().map(|entry| &entry.function);
    module.functions.iter().map(|(_, f)| f).chain(entries).find(named).expect("the shader has the function")
}

/// Bodies of the loops of a block, not of those within them.
fn loops(body: &Block) -> impl Iterator<Item = &Block> {
    body.iter().filter_map(|statement| match statement {
        Statement::Loop { body, .. } => Some(body),
        _ => None,
    })
}

/// Arithmetic of a block, calls included as often as they are written.
fn block(module: &Module, function: &Function, body: &Block) -> usize {
    body.iter().map(|statement| statement_count(module, function, statement)).sum()
}

fn statement_count(module: &Module, function: &Function, statement: &Statement) -> usize {
    let within = |body: &Block| block(module, function, body);
    match statement {
        Statement::Emit(range) => range.clone().filter(|&e| is_arithmetic(function, e)).count(),
        Statement::Block(body) => within(body),
        Statement::If { condition, accept, reject } => match fixed(module, function, *condition) {
            Some(true) => within(accept),
            Some(false) => within(reject),
            None => within(accept) + within(reject),
        },
        Statement::Loop { body, continuing, .. } => within(body) + within(continuing),
        Statement::Switch { cases, .. } => cases.iter().map(|case| within(&case.body)).sum(),
        Statement::Call { function: called, .. } => {
            let called = &module.functions[*called];
            block(module, called, &called.body)
        }
        _ => 0,
    }
}

/// The value of a condition that the variant fixes.
fn fixed(module: &Module, function: &Function, condition: Handle<Expression>) -> Option<bool> {
    match function.expressions[condition] {
        Expression::Literal(Literal::Bool(value)) => Some(value),
        Expression::Constant(constant) => match module.global_expressions[module.constants[constant].init] {
            Expression::Literal(Literal::Bool(value)) => Some(value),
            _ => None,
        },
        _ => None,
    }
}

fn is_arithmetic(function: &Function, expression: Handle<Expression>) -> bool {
    matches!(
        function.expressions[expression],
        Expression::Binary { .. }
            | Expression::Unary { .. }
            | Expression::Math { .. }
            | Expression::Select { .. }
            | Expression::Relational { .. }
            | Expression::As { .. }
    )
}
