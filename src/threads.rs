//! Work on the host split over its cores.

use std::panic::resume_unwind;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Runs `work(i)` for i in 0..count on all cores and returns the results in order. A panic in `work` goes on to the caller.
pub fn parallel<T: Send>(count: usize, work: impl Fn(usize) -> T + Sync) -> Vec<T> {
    parallel_on(std::thread::available_parallelism().map_or(1, |n| n.get()), count, work)
}

/// [`parallel`] on `threads` threads.
fn parallel_on<T: Send>(threads: usize, count: usize, work: impl Fn(usize) -> T + Sync) -> Vec<T> {
    let next = AtomicUsize::new(0);
    let take = || {
        let index = next.fetch_add(1, Ordering::Relaxed);
        (index < count).then_some(index)
    };
    let done = std::thread::scope(|scope| {
        let of_thread = || std::iter::from_fn(take).map(|index| (index, work(index))).collect::<Vec<_>>();
        let handles: Vec<_> = (0..threads.clamp(1, count.max(1))).map(|_| scope.spawn(of_thread)).collect();
        handles.into_iter().map(|handle| handle.join()).collect::<Vec<_>>() // all have ended when one panics on
    });
    let mut results: Vec<Option<T>> = (0..count).map(|_| None).collect();
    for of_thread in done {
        for (index, result) in of_thread.unwrap_or_else(|panic| resume_unwind(panic)) {
            results[index] = Some(result);
        }
    }
    results.into_iter().flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_are_in_order_on_any_number_of_threads() {
        for threads in [1, 2, 3, 16] {
            for count in [0, 1, 2, 7, 1000] {
                let expected: Vec<_> = (0..count).map(|i| i * i).collect();
                assert_eq!(parallel_on(threads, count, |i| i * i), expected, "{threads} threads");
            }
        }
    }

    #[test]
    fn a_panic_goes_on_to_the_caller_with_what_it_says() {
        for threads in [1, 4] {
            let run = || parallel_on(threads, 100, |i| if i == 37 { std::panic::panic_any("item 37") } else { i });
            let panic = std::panic::catch_unwind(run).unwrap_err();
            assert_eq!(panic.downcast_ref::<&str>(), Some(&"item 37"), "{threads} threads");
        }
    }
}
