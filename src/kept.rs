//! Objects that an executor keeps from pass to pass because they are expensive to make, found by content.
//!
//! One rule holds for all of them: an object stays while a prepared pass holds it, and otherwise until
//! [`KEPT_PASSES`] passes in a row have not used it. So an executor that draws the same shaders in every
//! frame makes nothing twice, and an executor that draws new shaders in every frame does not grow.

use std::{
    borrow::Borrow,
    collections::{HashMap, hash_map::Entry},
    hash::Hash,
    sync::{Arc, Weak},
};

/// Passes without a use after which a thing goes.
pub(crate) const KEPT_PASSES: u64 = 64;

/// Things by key.
pub(crate) struct Kept<K, V> {
    entries: HashMap<K, Used<V>>,
    /// Passes so far.
    pass: u64,
    /// Things that were ever inserted.
    made: u64,
}

struct Used<V> {
    value: V,
    /// The last pass that used it.
    used: u64,
}

impl<K, V> Default for Kept<K, V> {
    fn default() -> Self {
        Self { entries: HashMap::new(), pass: 0, made: 0 }
    }
}

impl<K: Eq + Hash, V> Kept<K, V> {
    /// Begins another pass, and drops values by the rule. `is_held` tells whether a prepared pass holds a
    /// value.
    pub fn next_pass(&mut self, is_held: impl Fn(&V) -> bool) {
        self.pass += 1;
        let pass = self.pass;
        self.entries.retain(|_, entry| pass - entry.used <= KEPT_PASSES || is_held(&entry.value));
    }

    /// The value of `key`, which the pass then has used.
    pub fn get<Q: Eq + Hash + ?Sized>(&mut self, key: &Q) -> Option<&V>
    where
        K: Borrow<Q>,
    {
        let entry = self.entries.get_mut(key)?;
        entry.used = self.pass;
        Some(&entry.value)
    }

    /// Keeps `value`.
    pub fn insert(&mut self, key: K, value: V) {
        self.made += 1;
        self.entries.insert(key, Used { value, used: self.pass });
    }

    /// Things that are kept.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Things that were ever made.
    pub fn made(&self) -> u64 {
        self.made
    }
}

/// What follows from shared objects, found by their identity.
pub(crate) struct ByIdentity<T, V> {
    /// By address. The weak reference keeps the address from being used for another object.
    known: HashMap<usize, (Weak<T>, V)>,
    /// Objects that were known after the last sweep.
    swept: usize,
}

/// Objects that are remembered before the first sweep.
const FEW: usize = 1 << 10;

impl<T, V> Default for ByIdentity<T, V> {
    fn default() -> Self {
        Self { known: HashMap::new(), swept: 0 }
    }
}

impl<T, V> ByIdentity<T, V> {
    /// The value of `object`, which `make` makes if it is not known.
    ///
    /// # Errors
    /// Those of `make`.
    pub fn get<E>(
        &mut self,
        object: &Arc<T>,
        make: impl FnOnce() -> Result<V, E>,
    ) -> Result<&V, E> {
        // Objects that are gone are forgotten once there are twice as many as the last sweep left.
        if self.known.len() >= FEW.max(2 * self.swept) {
            self.known.retain(|_, (object, _)| object.strong_count() > 0);
            self.swept = self.known.len();
        }
        Ok(match self.known.entry(Arc::as_ptr(object) as usize) {
            Entry::Occupied(known) => &known.into_mut().1,
            Entry::Vacant(new) => &new.insert((Arc::downgrade(object), make()?)).1,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    #[test]
    fn a_thing_goes_when_it_is_neither_held_nor_used() {
        let mut kept = Kept::default();
        let is_held = |value: &Arc<&str>| Arc::strong_count(value) > 1;
        let held = Arc::new("held");
        kept.insert(1, held.clone());
        kept.insert(2, Arc::new("used"));
        kept.insert(3, Arc::new("neither"));
        for _ in 0..=KEPT_PASSES {
            assert_eq!(kept.len(), 3);
            kept.next_pass(is_held);
            assert!(kept.get(&2).is_some());
        }
        assert!(kept.get(&1).is_some() && kept.get(&3).is_none());
        drop(held);
        for _ in 0..=KEPT_PASSES {
            kept.next_pass(is_held);
        }
        assert_eq!((kept.len(), kept.made()), (0, 3));
    }

    #[test]
    fn what_is_known_of_an_object_goes_with_it() {
        let mut known = ByIdentity::default();
        let one = Arc::new(1);
        for n in 0..10 * FEW {
            let other = Arc::new(n);
            let found = known.get(&other, || Ok::<_, ()>(n));
            assert_eq!(found, Ok(&n));
            assert_eq!(known.get(&one, || Ok::<_, ()>(usize::MAX)), Ok(&usize::MAX));
        }
        assert!(known.known.len() <= FEW, "{}", known.known.len());
        assert_eq!(known.get(&Arc::new(7), || Err("refused")), Err("refused"));
        assert_eq!(known.get(&one, || Err("never made again")), Ok(&usize::MAX));
    }

    #[test]
    fn what_is_new_in_every_pass_does_not_add_up() {
        let mut kept = Kept::default();
        for n in 0..10 * KEPT_PASSES {
            kept.next_pass(|_: &()| false);
            kept.insert(n, ());
        }
        assert_eq!(kept.len() as u64, KEPT_PASSES + 1);
    }
}
