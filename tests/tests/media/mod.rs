//! Media: bounds hold along every ray, values and derivatives are those of an independent
//! implementation, faces carry what the interior gradient leaves out.

mod common;
mod faces;
mod grid;
mod mean;
mod mistakes;
mod others;
mod pyramid;
mod refusals;
mod sparse;
mod speed;
