//! The particles that lie where a mark says.

use super::scene::{Space, Where};
use crate::error::{Error, Result};
use crate::memory;
use crate::solver::frame::Frame;

/// Which particles fulfil the conditions on their place: axes, distance, picture. `x` has `dim` coordinates each.
///
/// # Errors
/// `BadValue` for an axis that the scene does not have, a centre of nothing, or a picture without a frame.
pub fn by_place(place: &Where, space: Option<&Space>, x: &[f64], axes: &Frame) -> Result<Vec<bool>> {
    let dim = axes.dim();
    let mut chosen = memory::filled("marks", x.len() / dim, true)?;
    let mut keep = |holds: &dyn Fn(&[f64]) -> bool| {
        chosen.iter_mut().zip(x.chunks(dim)).for_each(|(chosen, p)| *chosen &= holds(p));
    };
    for (name, range) in [("x", place.x), ("y", place.y), ("z", place.z)] {
        match (range, axes.axis(name)) {
            (Some(range), Some(axis)) => keep(&|p| inside(range, p[axis])),
            (Some(_), None) => {
                let rule = format!("the scene has dim={dim}, and its particles vary along {}", axes.names().join(", "));
                return Err(Error::bad("where", name, &rule));
            }
            (None, _) => {}
        }
    }
    if !place.centre.is_empty() && (place.r.is_none() || place.centre.len() != dim) {
        let rule = format!("it is what the distance r is counted from: give r = [from, to], and {dim} numbers");
        return Err(Error::bad("centre", format!("{:?}", place.centre), &rule));
    }
    if let Some(range) = place.r {
        let centre = |axis: usize| place.centre.get(axis).copied().unwrap_or(0.0);
        let r2 = |p: &[f64]| p.iter().enumerate().map(|(a, x)| (x - centre(a)).powi(2)).sum::<f64>();
        keep(&|p| inside(range, r2(p).sqrt()));
    }
    if let Some(picture) = &place.picture {
        let frame = frame(place, space, axes)?;
        keep(&|p| painted(picture, frame, p[0], p[1]));
    }
    Ok(chosen)
}

fn inside(range: [f64; 2], v: f64) -> bool {
    v >= range[0] && v <= range[1]
}

/// The rectangle that a picture is stretched over: [x, y] of the condition, or else the box.
fn frame(place: &Where, space: Option<&Space>, axes: &Frame) -> Result<[[f64; 2]; 2]> {
    let range = |axis: usize| {
        let given = axes.file_axis(axis).and_then(|axis| [place.x, place.y, place.z][axis]);
        given.or_else(|| space.and_then(|s| Some([*s.lo.get(axis)?, *s.hi.get(axis)?])))
    };
    match (range(0), range(1)) {
        (Some(x), Some(y)) if axes.dim() >= 2 => Ok([x, y]),
        _ => Err(Error::bad("picture", "without a frame", "it needs dim=2 or 3, and x and y or a [box]")),
    }
}

/// Whether (x, y) lies under a letter of the picture; its first line is at the top.
fn painted(picture: &[String], [across, up]: [[f64; 2]; 2], x: f64, y: f64) -> bool {
    let width = picture.iter().map(|line| line.chars().count()).max().unwrap_or(0);
    let share = |v: f64, [from, to]: [f64; 2]| (v - from) / (to - from);
    let (column, row) = (share(x, across) * width as f64, (1.0 - share(y, up)) * picture.len() as f64);
    if !(column >= 0.0 && row >= 0.0) {
        return false;
    }
    let letter = picture.get(row as usize).and_then(|line| line.chars().nth(column as usize));
    letter.is_some_and(|c| !c.is_whitespace())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of the centres of 4 x 2 unit squares, row by row from below.
    fn chosen(place: Where) -> String {
        let x: Vec<f64> = (0..8).flat_map(|i| [f64::from(i % 4) + 0.5, f64::from(i / 4) + 0.5]).collect();
        let chosen = by_place(&place, None, &x, &Frame::first(2)).unwrap();
        chosen.iter().map(|c| if *c { '#' } else { '.' }).collect()
    }

    fn picture(lines: &[&str]) -> Where {
        let lines = lines.iter().map(|l| l.to_string()).collect();
        Where { picture: Some(lines), x: Some([0.0, 4.0]), y: Some([0.0, 2.0]), ..Where::default() }
    }

    #[test]
    fn places_are_ranges_distances_and_pictures() {
        assert_eq!(chosen(Where::default()), "########");
        assert_eq!(chosen(Where { x: Some([1.0, 3.0]), y: Some([1.0, 2.0]), ..Where::default() }), ".....##.");
        let near = Where { r: Some([0.0, 0.8]), centre: vec![1.0, 1.0], ..Where::default() };
        assert_eq!(chosen(near), "##..##..");
        // The first line is at the top.
        assert_eq!(chosen(picture(&["#  #", " o"])), ".#..#..#");
        assert_eq!(chosen(picture(&["# "])), "##..##..");
        assert_eq!(chosen(picture(&[])), "........");
    }

    #[test]
    fn what_is_not_there_is_said() {
        let deep = Where { z: Some([0.0, 1.0]), ..Where::default() };
        let axes = Frame::first(2);
        assert!(by_place(&deep, None, &[0.0; 2], &axes).unwrap_err().to_string().contains("dim=2"));
        let loose = Where { picture: Some(Vec::new()), ..Where::default() };
        assert!(by_place(&loose, None, &[0.0; 2], &axes).unwrap_err().to_string().contains("frame"));
        for place in [
            Where { centre: vec![0.0, 0.0], ..Where::default() },
            Where { centre: vec![0.0], r: Some([0.0, 1.0]), ..Where::default() },
        ] {
            assert!(by_place(&place, None, &[0.0; 2], &axes).unwrap_err().to_string().contains("2 numbers"));
        }
        // In a plane along x and z, its axes have these names.
        let axes = Frame::of(&[[0.0, 5.0, 0.0], [1.0, 5.0, 1.0]], 2, None).unwrap();
        let high = Where { z: Some([0.5, 1.0]), ..Where::default() };
        assert_eq!(by_place(&high, None, &[0.0, 0.0, 0.0, 1.0], &axes).unwrap(), [false, true]);
        let across = Where { y: Some([0.5, 1.0]), ..Where::default() };
        assert!(by_place(&across, None, &[0.0; 2], &axes).unwrap_err().to_string().contains("vary along x, z"));
    }
}
