//! Arithmetic in the shader's text, counted in naga's intermediate form.

use wgpu::naga::{self, Block, Expression, Function, Handle, Literal, Module, Statement};

/// Arithmetic instructions that the text of a lane holds: operators, built-in functions,
/// selections and conversions, of reals and whole numbers alike, each once wherever it is
/// written; what a variant rules out is not counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Instructions {
    /// One scan step.
    pub scan: usize,
    /// A careful pass, all branches once.
    pub careful: usize,
    /// One iteration of the root search.
    pub root: usize,
    /// The whole text with every call copied in.
    pub all: usize,
}

/// Counts the instructions of a shader.
///
/// # Panics
/// If the source is no lane of this crate.
pub fn instructions(source: &str) -> Instructions {
    let module = match naga::front::wgsl::parse_str(source) {
        Ok(module) => module,
        Err(error) => panic!("{}", error.emit_to_string(source)),
    };
    let whole = |name: &str| {
        let function = function(&module, name);
        block(&module, function, &function.body)
    };
    let in_loops = |name: &str| {
        let function = function(&module, name);
        loops(&function.body).map(|body| block(&module, function, body)).sum()
    };
    Instructions {
        scan: in_loops("scan"),
        careful: whole("careful"),
        root: in_loops("root"),
        all: whole("sweep"),
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
