//! How the axes of a solver lie in the three of a file: a plane or a line may be along any of them.

use crate::error::{Error, Result};

const NAMES: [&str; 3] = ["x", "y", "z"];

/// How much thinner than wide a file's particles are along an axis on which nothing varies but rounding.
const FLAT: f64 = 1e-12;

/// The axes of a file that a solver's are, in order, and where the others are.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    axes: Vec<usize>,
    rest: [f64; 3],
}

impl Frame {
    /// x; x and y; or all three.
    pub fn first(dim: usize) -> Frame {
        Frame { axes: (0..dim).collect(), rest: [0.0; 3] }
    }

    /// The axes along which particles of a file vary, filled up by the first of the others; or those that the file names.
    ///
    /// # Errors
    /// `BadValue` where they vary along more than `dim`.
    pub fn of(points: &[[f64; 3]], dim: usize, named: Option<&str>) -> Result<Frame> {
        let rest = points.first().copied().unwrap_or_default();
        let varying = varying(points);
        if varying.len() > dim {
            let axes: Vec<&str> = varying.iter().map(|&axis| NAMES[axis]).collect();
            let rule = format!(
                "the particles of the file vary along {}: create the solver with dim={}, or leave out what is not in a plane \
                 or on a line",
                axes.join(", "),
                axes.len()
            );
            return Err(Error::bad("dim", dim, &rule));
        }
        let named: Vec<usize> = named.into_iter().flat_map(str::split_whitespace).filter_map(axis).collect();
        if named.len() == dim && varying.iter().all(|axis| named.contains(axis)) {
            return Ok(Frame { axes: named, rest });
        }
        let mut axes = varying;
        (0..3)
            .filter(|axis| !axes.contains(axis))
            .collect::<Vec<_>>()
            .into_iter()
            .take(dim - axes.len())
            .for_each(|axis| axes.push(axis));
        axes.sort_unstable();
        Ok(Frame { axes, rest })
    }

    /// A point of a file, as the solver has it.
    pub fn inward(&self, point: [f64; 3]) -> impl Iterator<Item = f64> + '_ {
        self.axes.iter().map(move |&axis| point[axis])
    }

    /// One coordinate of a point, as a file has it.
    pub fn outward(&self, point: &[f64], axis: usize) -> f64 {
        self.axes.iter().position(|&a| a == axis).map_or(self.rest[axis], |at| point[at])
    }

    /// One component of a vector, as a file has it.
    pub fn outward_vector(&self, vector: &[f64], axis: usize) -> f64 {
        self.axes.iter().position(|&a| a == axis).map_or(0.0, |at| vector[at])
    }

    pub fn dim(&self) -> usize {
        self.axes.len()
    }

    /// Which of a file's axes the solver's is.
    pub fn file_axis(&self, axis: usize) -> Option<usize> {
        self.axes.get(axis).copied()
    }

    /// The solver's axis of this name; none where it is not one of them.
    pub fn axis(&self, name: &str) -> Option<usize> {
        self.axes.iter().position(|&axis| NAMES[axis] == name)
    }

    /// The names of its axes.
    pub fn names(&self) -> Vec<&'static str> {
        self.axes.iter().map(|&axis| NAMES[axis]).collect()
    }

    /// Where it is, unless it is along the first axes at 0: `x z at y = 5`.
    pub fn about(&self) -> Option<String> {
        let others: Vec<usize> = (0..3).filter(|axis| !self.axes.contains(axis)).collect();
        let plain = others.iter().all(|&axis| axis >= self.axes.len() && self.rest[axis] == 0.0);
        let rest: Vec<String> = others.iter().map(|&axis| format!("{} = {}", NAMES[axis], self.rest[axis])).collect();
        (!plain).then(|| format!("{} at {}", self.names().join(" "), rest.join(", ")))
    }
}

fn axis(name: &str) -> Option<usize> {
    NAMES.iter().position(|known| *known == name)
}

/// The axes along which points are not all in one place, to rounding.
pub fn varying(points: &[[f64; 3]]) -> Vec<usize> {
    let extents = [0, 1, 2].map(|axis| {
        let bounds = (f64::INFINITY, f64::NEG_INFINITY);
        let (low, high) = points.iter().fold(bounds, |(low, high), p| (low.min(p[axis]), high.max(p[axis])));
        high - low
    });
    let widest = extents.iter().copied().fold(0.0, f64::max);
    // A coordinate that is not finite is for others to refuse.
    let odd = |axis: usize| points.iter().any(|p| !p[axis].is_finite());
    (0..3).filter(|&axis| odd(axis) || extents[axis] > FLAT * widest).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_and_lines_are_found_along_any_axis() {
        let names = |points: &[[f64; 3]], dim, named| Frame::of(points, dim, named).map(|f| f.names().concat());
        let xz = [[0.0, 5.0, 0.0], [1.0, 5.0, 2.0], [3.0, 5.0, 1.0]];
        let z = [[1.0, 2.0, 0.0], [1.0, 2.0, 4.0]];
        assert_eq!(names(&xz, 2, None).unwrap(), "xz");
        assert_eq!(names(&xz, 3, None).unwrap(), "xyz");
        assert_eq!(names(&z, 1, None).unwrap(), "z");
        assert_eq!(names(&z, 2, None).unwrap(), "xz");
        assert_eq!(names(&z, 2, Some("y z")).unwrap(), "yz");
        assert_eq!(names(&z, 2, Some("x y")).unwrap(), "xz");
        assert_eq!(names(&[[1.0, 2.0, 3.0]], 2, None).unwrap(), "xy");
        assert_eq!(names(&[], 1, None).unwrap(), "x");
        let solid = [[0.0; 3], [1.0, 0.0, 1.0], [0.0, 1.0, 0.0]];
        let text = names(&solid, 2, None).unwrap_err().to_string();
        assert!(text.contains("x, y, z") && text.contains("dim=3"), "{text}");
        assert!(names(&xz, 1, None).unwrap_err().to_string().contains("x, z"));
    }

    #[test]
    fn points_go_in_and_out() {
        let frame = Frame::of(&[[0.0, 5.0, 0.0], [1.0, 5.0, 2.0]], 2, None).unwrap();
        let inside: Vec<f64> = frame.inward([1.0, 5.0, 2.0]).collect();
        assert_eq!(inside, [1.0, 2.0]);
        assert_eq!([0, 1, 2].map(|axis| frame.outward(&inside, axis)), [1.0, 5.0, 2.0]);
        assert_eq!((frame.axis("z"), frame.axis("y")), (Some(1), None));
        assert_eq!(frame.about().unwrap(), "x z at y = 5");
        assert_eq!(Frame::first(2).about(), None);
    }
}
