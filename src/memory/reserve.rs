//! The allocator of this library: the system's, and behind it a reserve for small allocations that the system refuses.
//!
//! A host must outlive an allocation that fails. What grows with the number of particles is asked for in a way that can
//! be refused (see [`super::reserved`]); the small rest (a message, a list of passes, a path) cannot be, and Rust would
//! end the process. That rest comes out of the reserve, which takes no memory until it is needed. While more than half of
//! it is in use, nothing that can be refused is granted, so that a call ends with `NoMemory` long before it is empty.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::{Cell, UnsafeCell};
use std::sync::atomic::{AtomicBool, Ordering};

/// Bytes.
const SIZE: usize = 1 << 20;
/// Blocks begin at multiples of this.
const GRAIN: usize = 64;
const GRAINS: usize = SIZE / GRAIN;

pub struct Allocator;

#[repr(align(4096))]
struct Bytes(UnsafeCell<[u8; SIZE]>);

// SAFETY: bytes of the reserve are handed out once, by who holds its lock.
unsafe impl Sync for Bytes {}

static BYTES: Bytes = Bytes(UnsafeCell::new([0; SIZE]));
static RESERVE: Lock = Lock { taken: AtomicBool::new(false), map: UnsafeCell::new(Map::EMPTY) };

thread_local! {
    /// Whether this thread can take a refusal.
    static REFUSABLE: Cell<bool> = const { Cell::new(false) };
}

/// Which grains are taken.
struct Map {
    taken: [bool; GRAINS],
    count: usize,
}

struct Lock {
    taken: AtomicBool,
    map: UnsafeCell<Map>,
}

// SAFETY: `with` lets one thread in at a time.
unsafe impl Sync for Lock {}

impl Lock {
    fn with<T>(&self, work: impl FnOnce(&mut Map) -> T) -> T {
        while self.taken.swap(true, Ordering::Acquire) {
            std::hint::spin_loop();
        }
        // SAFETY: the lock is taken, and `work` neither allocates nor panics.
        let result = work(unsafe { &mut *self.map.get() });
        self.taken.store(false, Ordering::Release);
        result
    }
}

impl Map {
    const EMPTY: Map = Map { taken: [false; GRAINS], count: 0 };

    /// Where the first gap begins that this layout fits in.
    fn take(&mut self, layout: Layout) -> Option<usize> {
        let (grains, step) = (layout.size().div_ceil(GRAIN), layout.align().div_ceil(GRAIN));
        let mut first = 0;
        while first + grains <= GRAINS {
            match self.taken[first..first + grains].iter().rposition(|taken| *taken) {
                None => {
                    self.mark(first, grains, true);
                    return Some(first * GRAIN);
                }
                Some(last) => first = (first + last + 1).next_multiple_of(step),
            }
        }
        None
    }

    fn give_back(&mut self, start: usize, size: usize) {
        self.mark(start / GRAIN, size.div_ceil(GRAIN), false);
    }

    fn mark(&mut self, first: usize, grains: usize, taken: bool) {
        self.taken[first..first + grains].fill(taken);
        self.count = if taken { self.count + grains } else { self.count - grains };
    }
}

/// Runs `work`, whose allocations may be refused.
pub fn refusable<T>(work: impl FnOnce() -> T) -> T {
    let before = REFUSABLE.replace(true);
    let result = work();
    REFUSABLE.set(before);
    result
}

/// Whether so much of the reserve is in use that nothing large should begin.
pub fn is_low() -> bool {
    RESERVE.with(|map| map.count > GRAINS / 2)
}

fn take(layout: Layout) -> *mut u8 {
    if REFUSABLE.get() {
        return std::ptr::null_mut();
    }
    match RESERVE.with(|map| if layout.align() > align_of::<Bytes>() { None } else { map.take(layout) }) {
        // SAFETY: the block lies inside.
        Some(start) => unsafe { BYTES.0.get().cast::<u8>().add(start) },
        None => std::ptr::null_mut(),
    }
}

/// Where in the reserve a block begins, if it does.
fn place(block: *mut u8) -> Option<usize> {
    let offset = (block as usize).wrapping_sub(BYTES.0.get() as usize);
    (offset < SIZE).then_some(offset)
}

// SAFETY: blocks come from the system or are parts of the reserve that nobody else has; sizes and alignments are kept.
unsafe impl GlobalAlloc for Allocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: passed on to the caller.
        let block = unsafe { System.alloc(layout) };
        if block.is_null() { take(layout) } else { block }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: passed on to the caller.
        let block = unsafe { System.alloc_zeroed(layout) };
        if !block.is_null() {
            return block;
        }
        let block = take(layout);
        if !block.is_null() {
            // SAFETY: the block is as long as the layout says.
            unsafe { block.write_bytes(0, layout.size()) };
        }
        block
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        match place(block) {
            Some(start) => RESERVE.with(|map| map.give_back(start, layout.size())),
            // SAFETY: what is not the reserve's is the system's.
            None => unsafe { System.dealloc(block, layout) },
        }
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        if place(block).is_none() {
            // SAFETY: what is not the reserve's is the system's.
            let moved = unsafe { System.realloc(block, layout, size) };
            if !moved.is_null() {
                return moved;
            }
        }
        // SAFETY: the caller keeps to sizes that round up without overflow.
        let wanted = unsafe { Layout::from_size_align_unchecked(size, layout.align()) };
        // SAFETY: both blocks are at least as long as what is copied; the old one is free after.
        unsafe {
            let moved = if place(block).is_some() { self.alloc(wanted) } else { take(wanted) };
            if !moved.is_null() {
                moved.copy_from_nonoverlapping(block, layout.size().min(size));
                self.dealloc(block, layout);
            }
            moved
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_do_not_overlap_and_gaps_are_used_again() {
        let mut map = Map::EMPTY;
        let layout = |size, align| Layout::from_size_align(size, align).unwrap();
        let blocks = [map.take(layout(3, 1)), map.take(layout(65, 8)), map.take(layout(1, 256))];
        assert_eq!(blocks, [Some(0), Some(64), Some(256)]);
        assert_eq!(map.take(layout(SIZE, 1)), None);
        assert_eq!(map.take(layout(128, 64)), Some(320));
        map.give_back(64, 65);
        assert_eq!(map.take(layout(192, 64)), Some(64), "with the gap behind it");
        [(0, 3), (64, 192), (256, 1), (320, 128)].into_iter().for_each(|(start, size)| map.give_back(start, size));
        assert_eq!((map.count, map.take(layout(SIZE, 4096))), (0, Some(0)));
    }

    #[test]
    fn what_the_system_refuses_comes_from_the_reserve_unless_it_can_be_refused() {
        let layout = Layout::from_size_align(100, 64).unwrap();
        assert!(refusable(|| take(layout)).is_null());
        // SAFETY: the layout is not empty, and what is taken is given back with the layout that it has.
        unsafe {
            let block = take(layout);
            assert!(place(block).is_some() && (block as usize).is_multiple_of(64));
            block.write_bytes(7, 100);
            let moved = Allocator.realloc(block, layout, 200);
            assert!(place(moved).is_none(), "the system has memory again");
            assert!((0..100).all(|i| moved.add(i).read() == 7));
            Allocator.dealloc(moved, Layout::from_size_align(200, 64).unwrap());
        }
        assert!(!is_low());
    }
}
