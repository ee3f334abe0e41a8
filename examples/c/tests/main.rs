//! All tests of the interface: one program.

mod header;
mod smoke_box;
mod threads;
