//! Lines for those who watch. Where nobody reads any more (`2>&1 | head`), `eprintln!` ends the program, and a render with it; these go on.

/// A line on standard error.
macro_rules! say {
    ($($words:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stderr().lock(), $($words)*);
    }};
}

/// A line on standard output, for other programs.
macro_rules! report {
    ($($words:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stdout().lock(), $($words)*);
    }};
}
