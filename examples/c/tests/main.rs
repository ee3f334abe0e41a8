//! All tests of the interface: one program.

mod header;
