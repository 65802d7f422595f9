//! Clouds for the tests of this room.

use super::{Data, Field, Snapshot};

/// Every awkward double.
pub const AWKWARD: [f64; 7] =
    [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -0.0, 5e-324, -2.2e-308, 1.7976931348623157e308];

/// A cloud of `n` points with arrays of every type.
pub fn cloud(n: usize) -> Snapshot {
    let awkward = |i: usize| AWKWARD.get(i % 11).copied().unwrap_or((i as f64).sin());
    let field = |name: &str, components, data| Field { name: name.into(), components, data };
    Snapshot {
        points: (0..n).map(|i| [(i as f64).sqrt(), -(i as f64) / 3.0, 1e-3 * (i % 17) as f64]).collect(),
        fields: vec![
            field("T", 1, Data::F64((0..n).map(awkward).collect())),
            field("v <&\"> m/s", 3, Data::F32((0..3 * n).map(|i| awkward(i) as f32).collect())),
            field("σ", 9, Data::F64((0..9 * n).map(|i| i as f64 * 0.1).collect())),
            field("id", 1, Data::I64((0..n).map(|i| i as i64 - (1 << 60)).collect())),
            field("u64", 1, Data::U64((0..n).map(|i| u64::MAX - i as u64).collect())),
            field("i32", 2, Data::I32((0..2 * n).map(|i| i as i32 - 70_000).collect())),
            field("u32", 1, Data::U32((0..n).map(|i| u32::MAX - i as u32).collect())),
            field("i16", 1, Data::I16((0..n).map(|i| (i % 999) as i16 - 300).collect())),
            field("u16", 1, Data::U16((0..n).map(|i| u16::MAX - (i % 999) as u16).collect())),
            field("i8", 1, Data::I8((0..n).map(|i| i as i8).collect())),
            field("kind", 1, Data::U8((0..n).map(|i| i as u8).collect())),
        ],
        time: Some(0.1 + 0.2),
        notes: vec![("diffusph".into(), "heat dim=3 <κ> & \"more\"\nkernel=M6".into()), ("none".into(), "".into())],
        ..Snapshot::default()
    }
}

/// Equality to the bit: NaN equals itself, 0 is not -0.
pub fn same(a: &Snapshot, b: &Snapshot) -> bool {
    let bits = |s: &Snapshot| {
        let mut all: Vec<u8> = bytemuck::cast_slice(&s.points).to_vec();
        for f in &s.fields {
            all.extend(format!("{} {} {}", f.name, f.components, f.data.type_name()).bytes());
            all.extend(f.data.values().bytes().unwrap());
        }
        all
    };
    bits(a) == bits(b) && a.time.map(f64::to_bits) == b.time.map(f64::to_bits) && a.notes == b.notes
}
