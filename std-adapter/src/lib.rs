//! Threads, film and files.
