//! Handles: numbers in the form of pointers, which nobody follows. A table says what they stand for, so that one that was freed,
//! is of another kind or is none at all is an error and never a crash.

use core::any::Any;
use core::ptr;
use std::sync::{Arc, PoisonError, RwLock};

use crate::arguments;
use crate::status::{FOGBOW_ERROR_HANDLE, Failure, Outcome, no_memory};

/// What a handle of type [`Object::Handle`] stands for.
pub(crate) trait Object: Any + Send + Sync {
    /// The type that C sees.
    type Handle;
    /// Its name in messages.
    const NAME: &'static str;
}

/// Handles at a time, a million: more, and pointers of 32 bits have no place for generations.
const INDEX_BITS: u32 = 20;

/// Generations of a slot that a handle has room for.
const MOST_GENERATIONS: usize = usize::MAX >> (INDEX_BITS + 1);

struct Slot {
    /// How often the slot was used; of the handle at hand if there is an object.
    generation: usize,
    object: Option<(Arc<dyn Any + Send + Sync>, &'static str)>,
}

struct Table {
    slots: Vec<Slot>,
    free: Vec<usize>,
}

static TABLE: RwLock<Table> = RwLock::new(Table { slots: Vec::new(), free: Vec::new() });

/// Odd, so that no pointer to anything with an alignment is taken for one.
fn bits(index: usize, generation: usize) -> usize {
    (generation << INDEX_BITS | index) << 1 | 1
}

/// A new handle.
pub(crate) fn put<T: Object>(object: T) -> Outcome<*mut T::Handle> {
    let mut table = TABLE.write().unwrap_or_else(PoisonError::into_inner);
    let index = match table.free.pop() {
        Some(index) => index,
        None if table.slots.len() >> INDEX_BITS == 0 => {
            table.slots.push(Slot { generation: 0, object: None });
            table.slots.len() - 1
        }
        None => return Err(no_memory("one more handle")),
    };
    let slot = &mut table.slots[index];
    slot.generation += 1;
    slot.object = Some((Arc::new(object), T::NAME));
    Ok(ptr::without_provenance_mut(bits(index, slot.generation)))
}

fn decode<H>(handle: *const H, name: &str) -> Outcome<(usize, usize)> {
    if handle.is_null() {
        return Err(arguments::null(name));
    }
    let bits = handle.addr();
    if bits & 1 == 0 {
        return Err(Failure(FOGBOW_ERROR_HANDLE, format!("`{name}` is no handle of fogbow")));
    }
    Ok((bits >> 1 & ((1 << INDEX_BITS) - 1), bits >> 1 >> INDEX_BITS))
}

/// What stands in the slot of a handle, if it is still the same.
fn found<'t, H>(
    table: &'t Table,
    handle: *const H,
    name: &str,
) -> Outcome<(usize, &'t Arc<dyn Any + Send + Sync>, &'static str)> {
    let (index, generation) = decode(handle, name)?;
    match table.slots.get(index) {
        Some(Slot { generation: current, object: Some((object, kind)) }) if *current == generation => {
            Ok((index, object, kind))
        }
        Some(slot) if generation >= 1 && generation <= slot.generation => {
            Err(Failure(FOGBOW_ERROR_HANDLE, format!("`{name}` was freed")))
        }
        _ => Err(Failure(FOGBOW_ERROR_HANDLE, format!("`{name}` is no handle of fogbow"))),
    }
}

fn of_kind<T: Object>(object: &Arc<dyn Any + Send + Sync>, kind: &str, name: &str) -> Outcome<Arc<T>> {
    let other = || Failure(FOGBOW_ERROR_HANDLE, format!("`{name}` is a handle of {kind}, not of {}", T::NAME));
    Arc::clone(object).downcast::<T>().map_err(|_| other())
}

/// What a handle stands for; alive as long as the answer is, even if the handle is freed meanwhile.
pub(crate) fn get<T: Object>(handle: *const T::Handle, name: &str) -> Outcome<Arc<T>> {
    let table = TABLE.read().unwrap_or_else(PoisonError::into_inner);
    let (_, object, kind) = found(&table, handle, name)?;
    of_kind(object, kind, name)
}

/// Takes a handle back. Null is nothing, and no mistake.
pub(crate) fn take<T: Object>(handle: *const T::Handle, name: &str) -> Outcome<Option<Arc<T>>> {
    if handle.is_null() {
        return Ok(None);
    }
    let mut table = TABLE.write().unwrap_or_else(PoisonError::into_inner);
    let (index, object, kind) = found(&table, handle, name)?;
    let object = of_kind::<T>(object, kind, name)?;
    let slot = &mut table.slots[index];
    slot.object = None;
    // A slot whose generations are used up is left: its handles stay freed for ever.
    if slot.generation < MOST_GENERATIONS {
        table.free.push(index);
    }
    // What the object holds is freed once nobody looks at the table.
    drop(table);
    Ok(Some(object))
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Apple(u32);
    struct Pear;
    impl Object for Apple {
        type Handle = u8;
        const NAME: &'static str = "an apple";
    }
    impl Object for Pear {
        type Handle = u8;
        const NAME: &'static str = "a pear";
    }

    fn why(outcome: Outcome<Arc<Apple>>) -> String {
        outcome.err().unwrap().1
    }

    #[test]
    fn wrong_handles_are_told_from_right_ones() {
        let apple = put(Apple(7)).unwrap();
        let pear = put(Pear).unwrap();
        assert_eq!(get::<Apple>(apple, "fruit").unwrap().0, 7);
        assert_eq!(why(get(pear, "fruit")), "`fruit` is a handle of a pear, not of an apple");
        assert_eq!(why(get(ptr::null(), "fruit")), "`fruit` is null");
        let local = 0_u64;
        for foreign in [(&raw const local).cast(), ptr::without_provenance(1), ptr::without_provenance(usize::MAX)] {
            assert_eq!(why(get(foreign, "fruit")), "`fruit` is no handle of fogbow");
        }
        // In use while it is freed: alive until it is let go.
        let held = get::<Apple>(apple, "fruit").unwrap();
        assert!(take::<Apple>(apple, "fruit").unwrap().is_some());
        assert_eq!((held.0, why(get(apple, "fruit"))), (7, "`fruit` was freed".to_owned()));
        assert!(take::<Apple>(apple, "fruit").is_err() && take::<Apple>(ptr::null(), "fruit").unwrap().is_none());
        // The slot has another object now, the old handle does not find it.
        let other = put(Apple(8)).unwrap();
        assert!(other != apple && get::<Apple>(apple, "fruit").is_err());
        assert!(take::<Apple>(other, "fruit").is_ok() && take::<Pear>(pear, "fruit").is_ok());
    }
}
