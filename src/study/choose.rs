//! The particles that lie where a mark says.

use super::scene::{Space, Where};
use crate::error::{Error, Result};
use crate::memory;

/// Which particles fulfil the conditions on their place: axes, distance, picture. `x` has `dim` coordinates each.
///
/// # Errors
/// `BadValue` for an axis that the scene does not have, or a picture without a frame.
pub fn by_place(place: &Where, space: Option<&Space>, x: &[f64], dim: usize) -> Result<Vec<bool>> {
    let mut chosen = memory::filled("marks", x.len() / dim, true)?;
    let mut keep = |holds: &dyn Fn(&[f64]) -> bool| {
        chosen.iter_mut().zip(x.chunks(dim)).for_each(|(chosen, p)| *chosen &= holds(p));
    };
    for (axis, range) in [place.x, place.y, place.z].into_iter().enumerate() {
        match range {
            Some(range) if axis < dim => keep(&|p| inside(range, p[axis])),
            Some(_) => return Err(Error::bad("where", ["x", "y", "z"][axis], &format!("the scene has dim={dim}"))),
            None => {}
        }
    }
    if let Some(range) = place.r {
        let centre = |axis: usize| place.centre.get(axis).copied().unwrap_or(0.0);
        let r2 = |p: &[f64]| p.iter().enumerate().map(|(a, x)| (x - centre(a)).powi(2)).sum::<f64>();
        keep(&|p| inside(range, r2(p).sqrt()));
    }
    if let Some(picture) = &place.picture {
        let frame = frame(place, space, dim)?;
        keep(&|p| painted(picture, frame, p[0], p[1]));
    }
    Ok(chosen)
}

fn inside(range: [f64; 2], v: f64) -> bool {
    v >= range[0] && v <= range[1]
}

/// The rectangle that a picture is stretched over: [x, y] of the condition, or else the box.
fn frame(place: &Where, space: Option<&Space>, dim: usize) -> Result<[[f64; 2]; 2]> {
    let bounds = |axis: usize| space.and_then(|s| Some([*s.lo.get(axis)?, *s.hi.get(axis)?]));
    match (place.x.or(bounds(0)), place.y.or(bounds(1))) {
        (Some(x), Some(y)) if dim >= 2 => Ok([x, y]),
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
        let chosen = by_place(&place, None, &x, 2).unwrap();
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
        assert!(by_place(&deep, None, &[0.0; 2], 2).unwrap_err().to_string().contains("dim=2"));
        let loose = Where { picture: Some(Vec::new()), ..Where::default() };
        assert!(by_place(&loose, None, &[0.0; 2], 2).unwrap_err().to_string().contains("frame"));
    }
}
