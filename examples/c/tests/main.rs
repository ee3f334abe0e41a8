//! All tests of the interface: one program.

mod atrium;
mod header;
mod smoke_box;
mod threads;
