//! The newest word of each who speaks, until somebody looks: an older one is worth nothing beside it.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard};

use tokio::sync::Notify;

/// What was said and not looked at yet, by who said it. Copies share it.
#[derive(Debug)]
pub struct Newest<K, V> {
    /// Of no more than so many.
    most: usize,
    shared: Arc<(Mutex<BTreeMap<K, V>>, Notify)>,
}

impl<K, V> Clone for Newest<K, V> {
    fn clone(&self) -> Self {
        Self { most: self.most, shared: Arc::clone(&self.shared) }
    }
}

impl<K: Ord, V> Newest<K, V> {
    /// Keeps words of at most so many.
    #[must_use]
    pub fn of(most: usize) -> Self {
        Self { most, shared: Arc::new((Mutex::default(), Notify::new())) }
    }

    /// Somebody said this: it takes the place of what he said before. Where too many have spoken already, one more is not heard.
    pub fn say(&self, who: K, word: V) {
        let mut words = self.words();
        if words.len() < self.most || words.contains_key(&who) {
            words.insert(who, word);
            self.shared.1.notify_one();
        }
    }

    /// Waits until somebody has spoken, and takes what all have said. It may be dropped while it waits: nothing is lost.
    pub async fn taken(&self) -> BTreeMap<K, V> {
        loop {
            let words = std::mem::take(&mut *self.words());
            if !words.is_empty() {
                return words;
            }
            self.shared.1.notified().await;
        }
    }

    fn words(&self) -> MutexGuard<'_, BTreeMap<K, V>> {
        self.shared.0.lock().expect("nobody panics while he holds it")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn the_newest_word_of_each_is_heard_however_many_were_said_before() {
        let newest = Newest::of(2);
        (0..5000).for_each(|word| newest.clone().say("r1", word));
        newest.say("r2", 1);
        newest.say("r3", 1);
        newest.say("r1", 7);
        assert_eq!(newest.taken().await, BTreeMap::from([("r1", 7), ("r2", 1)]));
        // Nothing is told twice, and who waits is woken.
        let waits = newest.clone();
        let waiting = tokio::spawn(async move { waits.taken().await });
        tokio::task::yield_now().await;
        newest.say("r3", 2);
        assert_eq!(waiting.await.unwrap(), BTreeMap::from([("r3", 2)]));
    }
}
