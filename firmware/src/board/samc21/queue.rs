//! A queue between two priorities: one side sends, the other receives, neither waits, masks or panics.
//!
//! Two counters, each written by its own side alone, say how many items ever went in and came out; so loads and stores
//! suffice, which is all this core has.

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicU32, Ordering};

/// Room for `N` items, a power of two. The counters come first, where an emulator finds them.
#[repr(C)]
pub struct Queue<T: Copy, const N: usize> {
    /// Items ever sent; wraps.
    sent: AtomicU32,
    /// Items ever received; wraps.
    received: AtomicU32,
    slots: UnsafeCell<[MaybeUninit<T>; N]>,
}

/// The sending side.
pub struct Sender<'a, T: Copy, const N: usize>(&'a Queue<T, N>);

/// The receiving side.
pub struct Receiver<'a, T: Copy, const N: usize>(&'a Queue<T, N>);

// SAFETY: a slot is touched by the sender until `sent` passes it and by the receiver until `received` does; the items
// themselves may change context.
unsafe impl<T: Copy + Send, const N: usize> Sync for Queue<T, N> {}

impl<T: Copy, const N: usize> Queue<T, N> {
    /// Empty.
    pub const fn new() -> Self {
        const { assert!(N.is_power_of_two() && N <= 1 << 16) };
        Queue {
            slots: UnsafeCell::new([const { MaybeUninit::uninit() }; N]),
            sent: AtomicU32::new(0),
            received: AtomicU32::new(0),
        }
    }

    /// Its two sides.
    pub fn split(&mut self) -> (Sender<'_, T, N>, Receiver<'_, T, N>) {
        (Sender(self), Receiver(self))
    }

    fn slot(&self, counter: u32) -> *mut MaybeUninit<T> {
        // Below N, since N is a power of two.
        self.slots.get().cast::<MaybeUninit<T>>().wrapping_add(counter as usize & (N - 1))
    }
}

impl<T: Copy, const N: usize> Default for Queue<T, N> {
    fn default() -> Self {
        Queue::new()
    }
}

impl<T: Copy, const N: usize> Sender<'_, T, N> {
    /// Adds an item; gives it back if there is no room.
    pub fn send(&mut self, item: T) -> Result<(), T> {
        let sent = self.0.sent.load(Ordering::Relaxed);
        if sent.wrapping_sub(self.0.received.load(Ordering::Acquire)) as usize >= N {
            return Err(item);
        }
        // SAFETY: the slot is free, and this is the only sender.
        unsafe { self.0.slot(sent).write(MaybeUninit::new(item)) };
        self.0.sent.store(sent.wrapping_add(1), Ordering::Release);
        Ok(())
    }
}

impl<T: Copy, const N: usize> Receiver<'_, T, N> {
    /// Nothing to receive.
    pub fn is_empty(&self) -> bool {
        self.0.sent.load(Ordering::Acquire) == self.0.received.load(Ordering::Relaxed)
    }

    /// The oldest item.
    pub fn receive(&mut self) -> Option<T> {
        self.receive_with(|item| *item)
    }

    /// What `use_it` makes of the oldest item, which is looked at where it lies.
    pub fn receive_with<R>(&mut self, use_it: impl FnOnce(&T) -> R) -> Option<R> {
        if self.is_empty() {
            return None;
        }
        let received = self.0.received.load(Ordering::Relaxed);
        // SAFETY: the slot was written before `sent` passed it, this is the only receiver, and the sender leaves the slot
        // alone until `received` passes it below.
        let made = use_it(unsafe { (*self.0.slot(received)).assume_init_ref() });
        self.0.received.store(received.wrapping_add(1), Ordering::Release);
        Some(made)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::VecDeque;

    proptest! {
        #[test]
        fn it_is_a_bounded_queue(actions in prop::collection::vec(any::<Option<u16>>(), 0..200), start: u32) {
            let mut queue = Queue::<u16, 4>::new();
            queue.sent = AtomicU32::new(start);
            queue.received = AtomicU32::new(start);
            let (mut sender, mut receiver) = queue.split();
            let mut model = VecDeque::new();
            for action in actions {
                match action {
                    Some(item) if model.len() < 4 => {
                        model.push_back(item);
                        prop_assert_eq!(sender.send(item), Ok(()));
                    }
                    Some(item) => prop_assert_eq!(sender.send(item), Err(item)),
                    None => prop_assert_eq!(receiver.receive(), model.pop_front()),
                }
                prop_assert_eq!(receiver.is_empty(), model.is_empty());
            }
        }
    }

    #[test]
    fn nothing_is_lost_or_torn_between_two_threads() {
        let mut queue = Queue::<[u32; 8], 4>::new();
        let (mut sender, mut receiver) = queue.split();
        std::thread::scope(|scope| {
            scope.spawn(move || {
                for n in 0..20_000 {
                    while sender.send([n; 8]).is_err() {
                        std::thread::yield_now();
                    }
                }
            });
            for n in 0..20_000 {
                let item = loop {
                    match receiver.receive() {
                        Some(item) => break item,
                        None => std::thread::yield_now(),
                    }
                };
                assert_eq!(item, [n; 8]);
            }
        });
    }
}
