//! Every kernel, as data. To add one, add a row: norm, moments, derivatives, catalogue and tests follow from it.

use super::form::Piece;

/// The shape f of a kernel as the literature writes it, without its norm: that is derived, never written here.
#[derive(Debug, Clone, Copy)]
pub enum Shape {
    /// A sum of `(R - q)₊^k p(q)`; smooth at q = 0, that is f'(0) = 0, and k >= 3.
    Pieces(&'static [Piece]),
    /// `exp(-q²)`, cut at this radius.
    Gaussian(f64),
}

#[derive(Debug)]
pub struct Row {
    pub name: &'static str,
    pub about: &'static str,
    /// Default smoothing length in units of the particle spacing.
    pub h_fac: f64,
    /// Shape in one dimension.
    pub line: Shape,
    /// Shape in two and three dimensions.
    pub space: Shape,
}

const fn row(name: &'static str, h_fac: f64, about: &'static str, shape: Shape) -> Row {
    Row { name, about, h_fac, line: shape, space: shape }
}

impl Row {
    /// The same kernel with a shape of its own in one dimension.
    const fn line(self, shape: Shape) -> Row {
        Row { line: shape, ..self }
    }
}

/// `c (R - q)₊^k`
const fn term(c: f64, radius: f64, power: u32) -> Piece {
    Piece::new(radius, power, [c, 0.0, 0.0, 0.0])
}

/// `(1 - q/2)₊^k (p0 + p1 q + p2 q² + p3 q³)`
const fn wendland(power: u32, [p0, p1, p2, p3]: [f64; 4]) -> Piece {
    let half = 1.0 / (1u32 << power) as f64;
    Piece::new(2.0, power, [p0 * half, p1 * half, p2 * half, p3 * half])
}

/// (R - 3q/2)^5 = (3/2)^5 (2R/3 - q)^5
const SQUEEZE: f64 = 243.0 / 32.0;

use Shape::{Gaussian, Pieces};

/// B-splines M_n are the binomial sums of Schoenberg (1946), as Monaghan (1985) brought them to SPH; Wendland's are
/// those of Dehnen & Aly (2012), stretched to R = 2.
pub static KERNELS: &[Row] = &[
    row(
        "M4",
        1.2,
        "cubic B-spline: (2-q)^3/4 - (1-q)^3, R = 2 (Monaghan & Lattanzio 1985)",
        Pieces(&[term(0.25, 2.0, 3), term(-1.0, 1.0, 3)]),
    ),
    row(
        "M5",
        1.1,
        "quartic B-spline: (5/2-q)^4 - 5 (3/2-q)^4 + 10 (1/2-q)^4, R = 2.5 (Schoenberg 1946)",
        Pieces(&[term(1.0, 2.5, 4), term(-5.0, 1.5, 4), term(10.0, 0.5, 4)]),
    ),
    row(
        "M6",
        1.0,
        "quintic B-spline: (3-q)^5 - 6 (2-q)^5 + 15 (1-q)^5, R = 3 (Schoenberg 1946, Morris 1996)",
        Pieces(&[term(1.0, 3.0, 5), term(-6.0, 2.0, 5), term(15.0, 1.0, 5)]),
    ),
    row(
        "M7",
        0.95,
        "sextic B-spline: (7/2-q)^6 - 7 (5/2-q)^6 + 21 (3/2-q)^6 - 35 (1/2-q)^6, R = 3.5 (Schoenberg 1946)",
        Pieces(&[term(1.0, 3.5, 6), term(-7.0, 2.5, 6), term(21.0, 1.5, 6), term(-35.0, 0.5, 6)]),
    ),
    row(
        "M8",
        0.9,
        "septic B-spline: (4-q)^7 - 8 (3-q)^7 + 28 (2-q)^7 - 56 (1-q)^7, R = 4 (Schoenberg 1946)",
        Pieces(&[term(1.0, 4.0, 7), term(-8.0, 3.0, 7), term(28.0, 2.0, 7), term(-56.0, 1.0, 7)]),
    ),
    row(
        "M6/2",
        1.5,
        "M6 squeezed to R = 2: M6(3q/2)",
        Pieces(&[term(SQUEEZE, 2.0, 5), term(-6.0 * SQUEEZE, 4.0 / 3.0, 5), term(15.0 * SQUEEZE, 2.0 / 3.0, 5)]),
    ),
    row(
        "C2",
        1.3,
        "Wendland C2: (1-q/2)^4 (2q+1), in 1-D (1-q/2)^3 (3q/2+1), R = 2 (Wendland 1995)",
        Pieces(&[wendland(4, [1.0, 2.0, 0.0, 0.0])]),
    )
    .line(Pieces(&[wendland(3, [1.0, 1.5, 0.0, 0.0])])),
    row(
        "C4",
        1.5,
        "Wendland C4: (1-q/2)^6 (35q^2/12+3q+1), in 1-D (1-q/2)^5 (2q^2+5q/2+1), R = 2 (Wendland 1995)",
        Pieces(&[wendland(6, [1.0, 3.0, 35.0 / 12.0, 0.0])]),
    )
    .line(Pieces(&[wendland(5, [1.0, 2.5, 2.0, 0.0])])),
    row(
        "C6",
        1.6,
        "Wendland C6: (1-q/2)^8 (4q^3+25q^2/4+4q+1), in 1-D (1-q/2)^7 (21q^3/8+19q^2/4+7q/2+1), R = 2 (Wendland 1995)",
        Pieces(&[wendland(8, [1.0, 4.0, 6.25, 4.0])]),
    )
    .line(Pieces(&[wendland(7, [1.0, 3.5, 4.75, 2.625])])),
    row(
        "Lucy",
        1.3,
        "Lucy's quartic: (1-q/2)^3 (1+3q/2), R = 2 (Lucy 1977)",
        Pieces(&[wendland(3, [1.0, 1.5, 0.0, 0.0])]),
    ),
    // Cut where M8, the nearest spline, ends too. There exp(-q²) is 1e-7 of its height and 5e-7 of the mass in 3-D is
    // left outside: below every error of discretisation, at an eighth of the neighbours of a cut at 8.
    row("Gaussian", 1.0, "Gaussian: exp(-q^2) cut at R = 4 (Gingold & Monaghan 1977)", Gaussian(4.0)),
];
