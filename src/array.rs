//! A host's array as the host keeps it: `n` items of `components` doubles, item `i` starting at `i * stride`.

use crate::error::{Error, Result};

/// Read access to a host array. LAMMPS' `x[n][3]` is `stride = 3, components = 3`; column 4 of Phantom's `xyzh(4, n)`
/// is a slice that starts at `h` with `stride = 4, components = 1`.
#[derive(Clone, Copy, Debug)]
pub struct Strided<'a> {
    data: &'a [f64],
    n: usize,
    stride: usize,
    components: usize,
}

impl<'a> Strided<'a> {
    /// # Errors
    /// `WrongCount` when the stride is shorter than an item or the slice shorter than `n` items.
    pub fn new(name: &str, data: &'a [f64], n: usize, stride: usize, components: usize) -> Result<Self> {
        check(name, data.len(), n, stride, components)?;
        Ok(Strided { data, n, stride, components })
    }

    /// A packed array of one double per item.
    pub fn packed(data: &'a [f64]) -> Self {
        Strided { data, n: data.len(), stride: 1, components: 1 }
    }

    pub fn len(&self) -> usize {
        self.n
    }

    pub fn is_empty(&self) -> bool {
        self.n == 0
    }

    pub fn components(&self) -> usize {
        self.components
    }

    /// One component of every item.
    pub fn component(&self, component: usize) -> Strided<'a> {
        Strided { data: self.data.get(component..).unwrap_or(&[]), components: 1, ..*self }
    }

    pub fn at(&self, item: usize, component: usize) -> f64 {
        self.data[item * self.stride + component]
    }

    /// The first item and component that breaks `rule`.
    pub fn check(&self, name: &str, sentence: &str, rule: impl Fn(f64) -> bool) -> Result<()> {
        for i in 0..self.n {
            for c in 0..self.components {
                if !rule(self.at(i, c)) {
                    return Err(Error::bad_at(name, i, self.at(i, c), sentence));
                }
            }
        }
        Ok(())
    }
}

/// Write access to a host array; the gaps between items are not touched.
#[derive(Debug)]
pub struct StridedMut<'a> {
    data: &'a mut [f64],
    n: usize,
    stride: usize,
    components: usize,
}

impl<'a> StridedMut<'a> {
    /// # Errors
    /// As [`Strided::new`].
    pub fn new(name: &str, data: &'a mut [f64], n: usize, stride: usize, components: usize) -> Result<Self> {
        check(name, data.len(), n, stride, components)?;
        Ok(StridedMut { data, n, stride, components })
    }

    /// A packed array of one double per item.
    pub fn packed(data: &'a mut [f64]) -> Self {
        StridedMut { n: data.len(), data, stride: 1, components: 1 }
    }

    pub fn len(&self) -> usize {
        self.n
    }

    pub fn is_empty(&self) -> bool {
        self.n == 0
    }

    pub fn components(&self) -> usize {
        self.components
    }

    pub fn set(&mut self, item: usize, component: usize, value: f64) {
        self.data[item * self.stride + component] = value;
    }
}

/// How many doubles `n` strided items span; `None` where that overflows.
pub fn span(n: usize, stride: usize, components: usize) -> Option<usize> {
    if n == 0 { Some(0) } else { (n - 1).checked_mul(stride)?.checked_add(components) }
}

fn check(name: &str, len: usize, n: usize, stride: usize, components: usize) -> Result<()> {
    let wrong = |got: usize, expected: usize, remedy: &str| {
        let (got, expected) = (got as i64, expected as i64);
        Err(Error::WrongCount { argument: name.into(), got, expected, remedy: remedy.into() })
    };
    if stride < components {
        return wrong(stride, components, "the stride counts doubles from one particle to the next, at least one item");
    }
    match span(n, stride, components) {
        Some(needed) if needed <= len => Ok(()),
        Some(needed) => wrong(len, needed, "pass (n - 1) * stride + components doubles"),
        None => wrong(len, usize::MAX, "n * stride does not fit the address space"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phantom_and_lammps_layouts() {
        let xyzh: Vec<f64> = (0..12).map(f64::from).collect();
        let x = Strided::new("x", &xyzh, 3, 4, 3).unwrap();
        let h = Strided::new("h", &xyzh[3..], 3, 4, 1).unwrap();
        assert_eq!((x.at(2, 1), h.at(0, 0), h.at(2, 0)), (9.0, 3.0, 11.0));
        let mut out = [-1.0; 12];
        let mut view = StridedMut::new("h", &mut out[3..], 3, 4, 1).unwrap();
        view.set(1, 0, 5.0);
        assert_eq!(out.iter().filter(|&&v| v != -1.0).count(), 1);
    }

    #[test]
    fn wrong_layouts_are_errors() {
        assert_eq!(Strided::new("x", &[0.0; 9], 3, 2, 3).unwrap_err().code(), -3);
        assert_eq!(Strided::new("x", &[0.0; 8], 3, 3, 3).unwrap_err().code(), -3);
        assert_eq!(Strided::new("x", &[0.0; 8], usize::MAX, 3, 3).unwrap_err().code(), -3);
        let e = Strided::packed(&[1.0, f64::NAN]).check("T", "must be finite", f64::is_finite).unwrap_err();
        assert_eq!(e.to_string(), "T[1] is NaN; must be finite");
    }
}
