//! A point cloud with named arrays: owned, as read from a file ([`Snapshot`]), or borrowed, as handed to a writer
//! ([`View`]).

use crate::error::{Error, Result};
use crate::memory;
use std::borrow::Cow;

/// A point cloud with named arrays, as read from a file. Every field has one tuple per point.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Snapshot {
    pub points: Vec<[f64; 3]>,
    pub fields: Vec<Field>,
    /// The file's `TimeValue`.
    pub time: Option<f64>,
    /// Texts that belong to the whole file: (name, text).
    pub notes: Vec<(String, String)>,
}

/// One array: `components` values per point, point after point.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    pub name: String,
    pub components: usize,
    pub data: Data,
}

impl Snapshot {
    /// The field of that name.
    pub fn field(&self, name: &str) -> Option<&Field> {
        self.fields.iter().find(|f| f.name == name)
    }

    /// The same content, borrowed for a writer.
    pub fn view(&self) -> View<'_> {
        View {
            n: self.points.len(),
            points: Values::stored(self.points.as_flattened()),
            fields: self.fields.iter().map(Field::column).collect(),
            time: self.time,
            notes: self.notes.iter().map(|(k, v)| (k.as_str().into(), v.as_str().into())).collect(),
        }
    }
}

impl Field {
    /// The same array, borrowed for a writer.
    pub fn column(&self) -> Column<'_> {
        Column { name: self.name.as_str().into(), components: self.components, values: self.data.values() }
    }
}

/// A number as VTK files store it.
pub trait Element: bytemuck::Pod + std::str::FromStr {
    /// The name of the type in VTK's XML files, e.g. `Float64`.
    const NAME: &'static str;

    fn wrap(values: Vec<Self>) -> Data;

    /// The same number as f64, if f64 has it.
    fn exact(self) -> Option<f64>;
}

/// Something that yields values of any asked type: see [`Data::read_as`].
pub(super) trait ReadValues {
    fn values<T: Element>(self) -> Result<Vec<T>>;
}

macro_rules! kinds {
    ($($variant:ident($type:ty) = $name:literal, $back:ty;)*) => {
        /// The values of a field, in the type that the file has: nothing is rounded on the way through.
        #[derive(Debug, Clone, PartialEq)]
        pub enum Data { $($variant(Vec<$type>),)* }

        $(impl Element for $type {
            const NAME: &'static str = $name;

            fn wrap(values: Vec<Self>) -> Data {
                Data::$variant(values)
            }

            fn exact(self) -> Option<f64> {
                let wide = self as f64;
                // Through a wider type: `as` saturates, and u64::MAX would seem to survive the way there and back.
                (<$type>::NAME.starts_with("Float") || wide as $back == self as $back).then_some(wide)
            }
        })*

        impl Data {
            /// The values of `reader` in the type of that name, or `None` for an unknown name.
            pub(super) fn read_as(name: &str, reader: impl ReadValues) -> Option<Result<Data>> {
                match name {
                    $($name => Some(reader.values::<$type>().map(Data::$variant)),)*
                    _ => None,
                }
            }

            /// Number of values (not of tuples).
            pub fn len(&self) -> usize {
                match self { $(Data::$variant(v) => v.len(),)* }
            }

            /// The name of the type in VTK's XML files, e.g. `Float64`.
            pub fn type_name(&self) -> &'static str {
                match self { $(Data::$variant(_) => $name,)* }
            }

            /// The values, borrowed for a writer.
            pub fn values(&self) -> Values<'_> {
                match self { $(Data::$variant(v) => Values::stored(v),)* }
            }

            /// The values as f64. A number that f64 does not have (an integer beyond 2^53) is an error, as is a lack
            /// of memory.
            pub fn to_f64(&self) -> Result<Vec<f64>> {
                match self { $(Data::$variant(v) => exact(v),)* }
            }

            /// Appends the values of `more`; false if its type is another.
            pub(super) fn append(&mut self, more: &Data) -> Result<bool> {
                match (self, more) {
                    $((Data::$variant(to), Data::$variant(from)) => extend(to, from).map(|()| true),)*
                    _ => Ok(false),
                }
            }
        }
    };
}

kinds! {
    F64(f64) = "Float64", f64;
    F32(f32) = "Float32", f64;
    I64(i64) = "Int64", i128;
    U64(u64) = "UInt64", i128;
    I32(i32) = "Int32", i128;
    U32(u32) = "UInt32", i128;
    I16(i16) = "Int16", i128;
    U16(u16) = "UInt16", i128;
    I8(i8) = "Int8", i128;
    U8(u8) = "UInt8", i128;
}

impl Data {
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

fn exact<T: Element>(values: &[T]) -> Result<Vec<f64>> {
    let mut out = memory::reserved("an array as f64", values.len())?;
    for (i, &value) in values.iter().enumerate() {
        let rule = "this integer has no exact double; read the field in its own type";
        out.push(value.exact().ok_or_else(|| Error::bad_at("field", i, "beyond 2^53", rule))?);
    }
    Ok(out)
}

pub(super) fn extend<T: Copy>(to: &mut Vec<T>, from: &[T]) -> Result<()> {
    to.try_reserve(from.len()).map_err(|_| memory::no_memory::<T>("an array in pieces", from.len()))?;
    to.extend_from_slice(from);
    Ok(())
}

/// What a writer writes, borrowed: a solver's arrays go to the file without a second copy.
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
    Computed(Box<dyn Fn(usize, &mut [u8]) + 'a>),
}

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
}

/// Bytes per block of writing and of compression: a multiple of every element's size.
pub(super) const BLOCK: usize = 1 << 18;

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
    use super::*;

    #[test]
    fn only_exact_doubles_are_given_as_doubles() {
        assert_eq!(Data::I64(vec![-(1 << 53), 7]).to_f64().unwrap(), [-9007199254740992.0, 7.0]);
        assert_eq!(Data::F32(vec![0.1]).to_f64().unwrap(), [0.1f32 as f64]);
        assert!(Data::F64(vec![f64::NAN]).to_f64().unwrap()[0].is_nan());
        for lossy in [Data::I64(vec![0, (1 << 53) + 1]), Data::U64(vec![0, u64::MAX]), Data::I64(vec![0, i64::MAX])] {
            assert!(matches!(lossy.to_f64(), Err(Error::BadElement { index: 1, .. })), "{lossy:?}");
        }
    }

    #[test]
    fn computed_values_arrive_once_each_and_in_order() {
        let n = 3 * BLOCK / 8 + 5;
        let values = Values::computed(n, |first, block: &mut [f64]| {
            block.iter_mut().enumerate().for_each(|(i, v)| *v = (first + i) as f64);
        });
        let mut seen = Vec::new();
        values.blocks::<()>(|bytes| Ok(seen.extend_from_slice(bytes))).unwrap();
        let expected: Vec<u8> = (0..n).flat_map(|i| (i as f64).to_le_bytes()).collect();
        assert!(seen == expected);
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
