//! Counting what is heard, for those who wait until it is so much.

use std::sync::{Condvar, Mutex};

use crate::common::events::Patience;

/// How many messages were heard.
#[derive(Default)]
pub struct Count {
    heard: Mutex<u64>,
    more: Condvar,
}

impl Count {
    pub fn get(&self) -> u64 {
        *self.heard.lock().unwrap()
    }

    /// One more; how many they are then.
    pub fn add(&self) -> u64 {
        let mut heard = self.heard.lock().unwrap();
        *heard += 1;
        self.more.notify_all();
        *heard
    }

    /// Waits until there are so many.
    pub fn wait_for(&self, enough: u64) {
        let (mut heard, patience) = (self.heard.lock().unwrap(), Patience::new());
        while *heard < enough {
            let left = patience.left(format_args!("{enough} messages: {} came", *heard));
            heard = self.more.wait_timeout(heard, left).unwrap().0;
        }
    }
}
