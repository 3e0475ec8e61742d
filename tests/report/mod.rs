//! What people look at: the report in a browser, figures pixel by pixel.

mod devtools;
mod figures;
mod live;
mod page;
