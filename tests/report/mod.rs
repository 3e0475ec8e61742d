//! What people look at: the report in a browser, figures pixel by pixel.

mod figures;
mod live;
mod page;
