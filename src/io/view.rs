//! What a writer writes, borrowed: a solver's arrays go to the file without a second copy.

use super::element::Element;
use crate::error::{Error, Result};
use std::borrow::Cow;

/// A point cloud with named arrays, borrowed.
pub struct View<'a> {
    /// Number of points.
    pub n: usize,
    /// Three coordinates per point.
    pub points: Values<'a>,
    pub fields: Vec<Column<'a>>,
    pub time: Option<f64>,
    pub notes: Vec<(Cow<'a, str>, Cow<'a, str>)>,
}

/// One named array of a [`View`].
pub struct Column<'a> {
    pub name: Cow<'a, str>,
    pub components: usize,
    pub values: Values<'a>,
}

/// Values to write: a slice, or a function that computes them a block at a time.
pub struct Values<'a> {
    pub(super) type_name: &'static str,
    pub(super) width: usize,
    pub(super) count: usize,
    source: Source<'a>,
}

enum Source<'a> {
    Stored(&'a [u8]),
    Computed(Box<Fill<'a>>),
}

/// Sets a block of bytes to the values from that number on.
type Fill<'a> = dyn Fn(usize, &mut [u8]) + 'a;

/// Bytes per block of writing and of compression: a multiple of every element's size.
pub(super) const BLOCK: usize = 1 << 18;

impl<'a> Values<'a> {
    pub fn stored<T: Element>(values: &'a [T]) -> Values<'a> {
        let source = Source::Stored(bytemuck::cast_slice(values));
        Values { type_name: T::NAME, width: size_of::<T>(), count: values.len(), source }
    }

    /// `count` values; `fill(first, block)` sets `block` to the values from number `first` on.
    pub fn computed<T: Element>(count: usize, fill: impl Fn(usize, &mut [T]) + 'a) -> Values<'a> {
        let fill = move |first: usize, block: &mut [u8]| fill(first, bytemuck::cast_slice_mut(block));
        Values { type_name: T::NAME, width: size_of::<T>(), count, source: Source::Computed(Box::new(fill)) }
    }

    /// The little-endian bytes of all values, handed on in blocks of [`BLOCK`] bytes (the last may be shorter).
    pub(super) fn blocks<E>(
        &self,
        mut sink: impl FnMut(&[u8]) -> std::result::Result<(), E>,
    ) -> std::result::Result<(), E> {
        // Of u64, so that the bytes are aligned for every element type.
        let mut scratch = vec![0u64; BLOCK / 8];
        let scratch: &mut [u8] = bytemuck::cast_slice_mut(&mut scratch);
        let step = BLOCK / self.width;
        for first in (0..self.count).step_by(step) {
            let bytes = step.min(self.count - first) * self.width;
            let start = first * self.width;
            match &self.source {
                Source::Stored(all) if cfg!(target_endian = "little") => sink(&all[start..start + bytes])?,
                Source::Stored(all) => scratch[..bytes].copy_from_slice(&all[start..start + bytes]),
                Source::Computed(fill) => fill(first, &mut scratch[..bytes]),
            }
            if cfg!(target_endian = "big") {
                scratch[..bytes].chunks_exact_mut(self.width).for_each(|value| value.reverse());
            }
            if cfg!(target_endian = "big") || matches!(self.source, Source::Computed(_)) {
                sink(&scratch[..bytes])?;
            }
        }
        Ok(())
    }

    /// The little-endian bytes of all values at once.
    pub(super) fn bytes(&self) -> Result<Vec<u8>> {
        let mut all = crate::memory::reserved("a copy of an array", self.count * self.width)?;
        self.blocks(|block| -> Result<()> {
            all.extend_from_slice(block);
            Ok(())
        })?;
        Ok(all)
    }
}

impl View<'_> {
    /// Every array has its `components` values per point, every name can be written, and time is a number.
    pub(super) fn check(&self) -> Result<()> {
        count_is("points", self.points.count, self.n, 3)?;
        if !self.points.type_name.starts_with("Float") {
            return Err(Error::bad("points", self.points.type_name, "coordinates must be Float64 or Float32"));
        }
        for (i, field) in self.fields.iter().enumerate() {
            name_is_writable(&field.name)?;
            count_is(&field.name, field.values.count, self.n, field.components)?;
            if field.components == 0 {
                return Err(Error::bad(&field.name, 0, "a field needs at least one component"));
            }
            if self.fields[..i].iter().any(|f| f.name == field.name) {
                return Err(Error::bad("field name", &field.name, "two fields of one file cannot share a name"));
            }
        }
        for (name, text) in &self.notes {
            name_is_writable(name)?;
            if text.contains('\0') || name == "TimeValue" {
                return Err(Error::bad("note", name, "a note holds no NUL and is not called TimeValue"));
            }
        }
        match self.time {
            Some(t) if !t.is_finite() => Err(Error::bad("time", t, "the time of a file must be finite")),
            _ => Ok(()),
        }
    }
}

fn count_is(name: &str, got: usize, n: usize, components: usize) -> Result<()> {
    if n.checked_mul(components) == Some(got) {
        return Ok(());
    }
    let expected = n as i64 * components as i64;
    let remedy = format!("pass {components} for each of the {n} points");
    Err(Error::WrongCount { argument: name.into(), got: got as i64, expected, remedy })
}

fn name_is_writable(name: &str) -> Result<()> {
    let legal = |c: char| !c.is_control() && c != '\u{fffe}' && c != '\u{ffff}';
    if name.is_empty() || !name.chars().all(legal) {
        return Err(Error::bad(
            "name",
            format!("{name:?}"),
            "a name needs at least one letter and no control character",
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::{Data, Field, Snapshot};
    use super::*;

    #[test]
    fn computed_values_arrive_once_each_and_in_order() {
        let n = 3 * BLOCK / 8 + 5;
        let values = Values::computed(n, |first, block: &mut [f64]| {
            block.iter_mut().enumerate().for_each(|(i, v)| *v = (first + i) as f64);
        });
        let expected: Vec<u8> = (0..n).flat_map(|i| (i as f64).to_le_bytes()).collect();
        assert!(values.bytes().unwrap() == expected);
    }

    #[test]
    fn a_view_that_no_file_can_hold_is_refused() {
        let good = || Snapshot {
            points: vec![[0.0; 3]; 2],
            fields: vec![Field { name: "T".into(), components: 1, data: Data::F64(vec![1.0, 2.0]) }],
            ..Snapshot::default()
        };
        assert_eq!(good().view().check(), Ok(()));
        let broken: [fn(&mut Snapshot); 6] = [
            |s| s.points.push([0.0; 3]),
            |s| s.fields[0].name = "a\u{1}b".into(),
            |s| s.fields[0].components = 2,
            |s| s.fields.push(s.fields[0].clone()),
            |s| s.time = Some(f64::NAN),
            |s| s.notes.push(("diffusph".into(), "a\0b".into())),
        ];
        for (i, breaking) in broken.iter().enumerate() {
            let mut s = good();
            breaking(&mut s);
            assert!(s.view().check().is_err(), "case {i}");
        }
    }
}
