//! `rattlemap models`: lists the models, or describes one.

use crate::cli::arguments::Models;
use crate::cli::failure::Failure;
use crate::cli::stdout::print;
use crate::job::{model_choice, models};

/// Prints the list of models, or the page or the file of one.
pub(crate) fn run(arguments: &Models) -> Result<(), Failure> {
    let Some(name) = &arguments.name else {
        let list = models::list();
        let width = list.iter().map(|(name, _)| name.len()).max().unwrap_or_default();
        return list.iter().try_for_each(|(name, summary)| print(&format!("{name:<width$}  {summary}")));
    };
    let model = model_choice::find(name)?;
    print(&if arguments.file { model.definition().text.clone() } else { models::page(&model) })
}
