//! Numbers in the types that files have them in.

use super::broken;
use super::element::Element;
use super::view::Values;
use crate::error::{Error, Result};
use crate::memory;

/// Something that yields values of any asked type: see [`Data::read_as`].
pub(super) trait ReadValues {
    fn values<T: Element>(self) -> Found<Vec<T>>;
}

/// The values of an array, or why there are none.
pub(super) type Found<T> = std::result::Result<T, Fault>;

/// Why an array has no values.
#[derive(Debug)]
pub(super) enum Fault {
    /// It is not what its head says: whoever does not need it goes on without.
    Unfit(String),
    /// The file is damaged, or the system refused: the rest cannot be trusted either.
    Fatal(Error),
}

impl From<Error> for Fault {
    fn from(error: Error) -> Fault {
        Fault::Fatal(error)
    }
}

impl Fault {
    /// The error where the file cannot do without the array.
    pub(super) fn error(self) -> Error {
        match self {
            Fault::Unfit(reason) => broken(reason),
            Fault::Fatal(error) => error,
        }
    }
}

/// A fault that only those who need the array must hear of, as its reason.
pub(super) fn unless_fatal<T>(found: Found<T>) -> Result<std::result::Result<T, String>> {
    match found {
        Ok(values) => Ok(Ok(values)),
        Err(Fault::Unfit(reason)) => Ok(Err(reason)),
        Err(Fault::Fatal(error)) => Err(error),
    }
}

macro_rules! kinds {
    ($($variant:ident($type:ty) = $name:literal, $back:ty;)*) => {
        /// The values of a field, in the type that the file has: nothing is rounded on the way through.
        #[derive(Debug, Clone, PartialEq)]
        pub enum Data { $($variant(Vec<$type>),)* }

        $(impl Element for $type {
            const NAME: &'static str = $name;

            fn exact(self) -> Option<f64> {
                let wide = self as f64;
                // Through a wider type: `as` saturates, and u64::MAX would seem to survive the way there and back.
                (<$type>::NAME.starts_with("Float") || wide as $back == self as $back).then_some(wide)
            }
        })*

        impl Data {
            /// The values of `reader` in the type of that name.
            pub(super) fn read_as(name: &str, reader: impl ReadValues) -> Found<Data> {
                match name {
                    $($name => reader.values::<$type>().map(Data::$variant),)*
                    _ => Err(Fault::Unfit(format!("its type '{name:.40}' is not one of numbers"))),
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

            /// Keeps the tuples of so many components that are wanted.
            pub(super) fn keep(&mut self, wanted: &[bool], components: usize) {
                match self { $(Data::$variant(v) => keep(v, wanted, components),)* }
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

    /// Appends the values of `more`, all as f64 where the types are two; false where f64 has not all of them.
    pub(super) fn join(&mut self, more: &Data) -> Result<bool> {
        if self.append(more)? {
            return Ok(true);
        }
        let widened = self.to_f64().and_then(|mine| Ok((mine, more.to_f64()?)));
        match widened {
            Ok((mine, more)) => {
                *self = Data::F64(mine);
                self.append(&Data::F64(more))
            }
            Err(Error::BadElement { .. }) => Ok(false),
            Err(error) => Err(error),
        }
    }

    /// Which of these bytes have none of the bits; `None` where they are no bytes.
    pub(super) fn without_bits(&self, bits: u8) -> Result<Option<Vec<bool>>> {
        let what = "the marks of ghosts";
        Ok(Some(match self {
            Data::U8(marks) => memory::collected(what, marks.iter().map(|m| m & bits == 0))?,
            Data::I8(marks) => memory::collected(what, marks.iter().map(|m| *m as u8 & bits == 0))?,
            _ => return Ok(None),
        }))
    }
}

/// Keeps the tuples of so many components that are wanted.
pub(super) fn keep<T: Copy>(values: &mut Vec<T>, wanted: &[bool], components: usize) {
    let mut at = 0;
    values.retain(|_| {
        at += 1;
        wanted[(at - 1) / components]
    });
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
}
