//! Jobs on many threads, in any order, with results that are lost or come twice: the bits of one thread.

use core::ptr;
use core::sync::atomic::{AtomicU32, Ordering};
use std::thread;

use fogbow_c::*;

use super::smoke_box::{DIGESTS, caches, check, digests, view, world};

/// A handle, which all threads may use.
struct Shared(*mut fogbow_work);
// SAFETY: the interface says so.
unsafe impl Send for Shared {}
// SAFETY: as above.
unsafe impl Sync for Shared {}

impl Shared {
    fn get(&self) -> *mut fogbow_work {
        self.0
    }
}

#[test]
fn any_order_on_any_thread_gives_the_same_bits() {
    let (world, view) = (world(), view());
    let caches = caches(world);
    let mut work = ptr::null_mut();
    // SAFETY: pointers to what lives until the end of the call.
    check(unsafe { fogbow_fill_view(caches, world, &raw const view, &raw mut work) });
    let (handle, mut rounds) = (Shared(work), 0);
    loop {
        let (mut first, mut end) = (0, 0);
        // SAFETY: as above.
        check(unsafe { fogbow_work_jobs(work, &raw mut first, &raw mut end) });
        if first == end {
            break;
        }
        rounds += 1;
        let next = AtomicU32::new(0);
        thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    loop {
                        let number = next.fetch_add(1, Ordering::Relaxed);
                        if number >= end - first {
                            break;
                        }
                        // From the last to the first, so that all results come early but one.
                        let job = end - 1 - number;
                        let mut result = ptr::null_mut();
                        // SAFETY: as above.
                        unsafe {
                            check(fogbow_work_run(handle.get(), job, &raw mut result));
                            if (number + rounds).is_multiple_of(7) {
                                check(fogbow_result_free(result)); // lost
                                continue;
                            }
                            if (number + rounds).is_multiple_of(5) {
                                let mut again = ptr::null_mut();
                                check(fogbow_work_run(handle.get(), job, &raw mut again));
                                check(fogbow_work_accept(handle.get(), again));
                            }
                            check(fogbow_work_accept(handle.get(), result));
                        }
                    }
                });
            }
        });
    }
    // SAFETY: a handle of this test.
    check(unsafe { fogbow_work_free(work) });
    assert!(rounds > 10);
    assert_eq!(digests(world, caches), DIGESTS);
    // SAFETY: as above; the caches do not need the world's handle.
    unsafe {
        check(fogbow_world_free(world));
        check(fogbow_caches_free(caches));
    }
}

#[test]
fn handles_may_be_freed_while_others_use_them() {
    let (world, view) = (world(), view());
    let caches = caches(world);
    let mut work = ptr::null_mut();
    // SAFETY: pointers to what lives until the end of the call.
    check(unsafe { fogbow_fill_view(caches, world, &raw const view, &raw mut work) });
    let handle = Shared(work);
    let worker = thread::spawn(move || {
        for job in 0.. {
            let mut result = ptr::null_mut();
            // SAFETY: the callback of this world has no context.
            let status = unsafe { fogbow_work_run(handle.get(), job % 4, &raw mut result) };
            if status == fogbow_status::FOGBOW_ERROR_HANDLE {
                return job;
            }
            assert_eq!(status, fogbow_status::FOGBOW_OK);
            // SAFETY: a handle of this thread.
            check(unsafe { fogbow_result_free(result) });
        }
        0
    });
    thread::sleep(core::time::Duration::from_millis(20));
    // SAFETY: handles of this test.
    unsafe {
        check(fogbow_caches_free(caches));
        check(fogbow_world_free(world));
        check(fogbow_work_free(work));
    }
    assert!(worker.join().is_ok());
}
