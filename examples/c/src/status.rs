//! What functions return, and why.

use core::cell::{Cell, RefCell};
use core::ffi::{CStr, c_char};
use core::panic::AssertUnwindSafe;
use std::ffi::CString;
use std::panic::catch_unwind;

/// What a function returns: 0 if all went well, else why not. `fogbow_message` says more.
#[repr(i32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum fogbow_status {
    /// All went well.
    FOGBOW_OK = 0,
    /// A pointer is null that must not be.
    FOGBOW_ERROR_NULL = 1,
    /// A handle is of another kind, was freed, or is none at all.
    FOGBOW_ERROR_HANDLE = 2,
    /// A value is outside its range, or not a number.
    FOGBOW_ERROR_ARGUMENT = 3,
    /// The `size` of a structure is not set, or has fields that this library does not know.
    FOGBOW_ERROR_SIZE = 4,
    /// What is asked for must wait until some other work is done or freed.
    FOGBOW_ERROR_BUSY = 5,
    /// A job is not due, or a result is of other work.
    FOGBOW_ERROR_JOB = 6,
    /// Bytes are damaged, or of something else.
    FOGBOW_ERROR_DATA = 7,
    /// A callback of the host gave an answer that cannot be. What was computed is there, and may be wrong.
    FOGBOW_ERROR_HOST = 8,
    /// There is no memory for it.
    FOGBOW_ERROR_MEMORY = 9,
    /// A mistake in this library. The objects that took part should not be used again.
    FOGBOW_ERROR_PANIC = 10,
}

pub(crate) use fogbow_status::*;

/// Why something failed.
#[derive(Debug)]
pub(crate) struct Failure(pub(crate) fogbow_status, pub(crate) String);

pub(crate) type Outcome<T = ()> = Result<T, Failure>;

/// An argument outside its range.
pub(crate) fn wrong<T>(message: impl Into<String>) -> Outcome<T> {
    Err(Failure(FOGBOW_ERROR_ARGUMENT, message.into()))
}

/// What the core says of an argument.
pub(crate) fn refused(what: &str) -> impl Fn(&dyn core::fmt::Display) -> Failure {
    move |error| Failure(FOGBOW_ERROR_ARGUMENT, format!("{what}: {error}"))
}

pub(crate) fn no_memory(what: &str) -> Failure {
    Failure(FOGBOW_ERROR_MEMORY, format!("there is no memory for {what}"))
}

thread_local! {
    static MESSAGE: RefCell<CString> = RefCell::default();
    /// What a callback did wrong during the call of this thread at hand.
    static COMPLAINT: Cell<Option<&'static str>> = const { Cell::new(None) };
}

/// Notes that a callback gave an answer that cannot be; the first is told.
pub(crate) fn complain(about: &'static str) {
    COMPLAINT.with(|slot| slot.set(slot.get().or(Some(about))));
}

/// Runs what a function of the interface does: no panic leaves it, and its error is kept for [`fogbow_message`].
pub(crate) fn guard(body: impl FnOnce() -> Outcome) -> fogbow_status {
    // A callback may call a function itself: what it is blamed for is then told by the outer call, too.
    let before = COMPLAINT.with(|slot| slot.replace(None));
    let outcome = catch_unwind(AssertUnwindSafe(body)).unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<String>().map(String::as_str);
        let text = text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no message");
        Err(Failure(FOGBOW_ERROR_PANIC, format!("a mistake in fogbow, please report it: {text}")))
    });
    let complaint = COMPLAINT.with(|slot| slot.replace(before));
    let outcome = match (outcome, complaint) {
        (Ok(()), Some(about)) => Err(Failure(FOGBOW_ERROR_HOST, about.to_owned())),
        (outcome, _) => outcome,
    };
    let (status, text) = match outcome {
        Ok(()) => (FOGBOW_OK, String::new()),
        Err(Failure(status, text)) => (status, text),
    };
    MESSAGE.with(|message| {
        if let (Ok(mut message), Ok(text)) = (message.try_borrow_mut(), CString::new(text)) {
            *message = text;
        }
    });
    status
}

/// Why the last function that this thread called failed, in a sentence; empty if it did not. Valid until the next call.
#[unsafe(no_mangle)]
pub extern "C" fn fogbow_message() -> *const c_char {
    MESSAGE.with(|message| message.try_borrow().map_or(c"".as_ptr(), |message| message.as_ptr()))
}

/// What a status means, in a few words, whatever thread it came from. Never null.
#[unsafe(no_mangle)]
pub extern "C" fn fogbow_status_text(status: i32) -> *const c_char {
    let text: &CStr = match status {
        0 => c"ok",
        1 => c"a pointer is null",
        2 => c"a handle is wrong or was freed",
        3 => c"an argument is outside its range",
        4 => c"the size of a structure is not known",
        5 => c"other work must be done first",
        6 => c"a job is not due",
        7 => c"bytes are damaged or of something else",
        8 => c"a callback gave an answer that cannot be",
        9 => c"there is no memory",
        10 => c"a mistake in fogbow",
        _ => c"no status of fogbow",
    };
    text.as_ptr()
}

/// The first number of the version of the interface.
pub const FOGBOW_VERSION_MAJOR: u32 = 0;
/// The second one. Until 1.0, versions that differ in it do not fit each other.
pub const FOGBOW_VERSION_MINOR: u32 = 1;
/// The third one.
pub const FOGBOW_VERSION_PATCH: u32 = 0;

/// The version of the library that runs: `major << 16 | minor << 8 | patch`.
#[unsafe(no_mangle)]
pub extern "C" fn fogbow_version() -> u32 {
    FOGBOW_VERSION_MAJOR << 16 | FOGBOW_VERSION_MINOR << 8 | FOGBOW_VERSION_PATCH
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message() -> String {
        // SAFETY: a string of this module, and no other call in between.
        unsafe { CStr::from_ptr(fogbow_message()) }.to_str().unwrap().to_owned()
    }

    #[test]
    fn a_panic_is_a_status_with_its_words() {
        assert_eq!(guard(|| panic!("no {}", "way")), FOGBOW_ERROR_PANIC);
        assert!(message().ends_with("no way"), "{}", message());
        assert_eq!((guard(|| Ok(())), message().as_str()), (FOGBOW_OK, ""));
    }

    #[test]
    fn a_complaint_is_told_by_the_call_that_it_belongs_to_and_by_no_other() {
        let inner = || {
            guard(|| {
                complain("inner");
                Ok(())
            })
        };
        let outer = guard(|| {
            assert_eq!(inner(), FOGBOW_ERROR_HOST);
            complain("first");
            complain("second");
            Ok(())
        });
        assert_eq!((outer, message().as_str()), (FOGBOW_ERROR_HOST, "first"));
        assert_eq!(guard(|| Ok(())), FOGBOW_OK);
    }

    #[test]
    fn messages_belong_to_threads() {
        assert_eq!(guard(|| wrong("here")), FOGBOW_ERROR_ARGUMENT);
        std::thread::spawn(|| assert_eq!(message(), "")).join().unwrap();
        assert_eq!(message(), "here");
    }

    #[test]
    fn the_version_is_that_of_the_package() {
        let number = |part: &str| part.parse::<u32>().unwrap();
        let package =
            [env!("CARGO_PKG_VERSION_MAJOR"), env!("CARGO_PKG_VERSION_MINOR"), env!("CARGO_PKG_VERSION_PATCH")];
        assert_eq!(package.map(number), [FOGBOW_VERSION_MAJOR, FOGBOW_VERSION_MINOR, FOGBOW_VERSION_PATCH]);
    }
}
