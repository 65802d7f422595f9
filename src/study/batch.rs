//! Many small cases side by side: one on each processor, each on one thread.

use crate::error::Result;
use crate::pool::Pool;

/// Cases for each thread between two looks at whether to go on.
const BETWEEN: usize = 4;

/// What `of` answers to each case, in order, as far as `goes_on` lets them: it is told how many are done.
///
/// # Errors
/// The first of theirs.
pub fn map<C: Sync, T: Send>(
    cases: &[C],
    of: impl Fn(&C) -> Result<T> + Sync + Send,
    mut goes_on: impl FnMut(usize) -> bool,
) -> Result<Vec<T>> {
    let pool = Pool::new(0)?;
    let mut found = Vec::new();
    for batch in cases.chunks(BETWEEN * pool.threads()) {
        if !goes_on(found.len()) {
            break;
        }
        for answer in pool.map(batch.len(), |i| of(&batch[i])) {
            found.push(answer?);
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Error;

    #[test]
    fn answers_come_in_order_until_someone_has_enough() {
        let cases: Vec<u64> = (0..500).collect();
        assert_eq!(map(&cases, |c| Ok(2 * c), |_| true).unwrap(), (0..500).map(|c| 2 * c).collect::<Vec<_>>());
        let some = map(&cases, |c| Ok(*c), |done| done == 0).unwrap();
        assert!(!some.is_empty() && some.len() < 500);
        let fails = |c: &u64| if *c == 7 { Err(Error::Cancelled) } else { Ok(()) };
        assert_eq!(map(&cases, fails, |_| true), Err(Error::Cancelled));
    }
}
