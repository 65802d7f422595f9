//! Whether kernels see what is around particles: a look at some of them.
//!
//! Where spacing differs much by direction, supports may end before the next neighbour in one of them. A particle then
//! conducts nothing there, as one of a thin body rightly does; but volumes that were given overfill the support, and
//! densities that are summed are those of what is near alone.

use super::state::{Input, State};
use crate::error::{Error, Result};
use crate::kernel::Kernel;
use crate::memory;
use crate::model::fields;
use crate::operator::{Matrix, Normalise, sides, tensor};
use crate::space::{Row, Scratch, rows::Rows};
use nalgebra::Matrix3;

/// Particles that are looked at.
const SAMPLE: usize = 1024;
/// Fewest that say anything.
const FEWEST: usize = 10;

/// How round a particle's surroundings are: the least of Σ V W d² over directions, relative to the largest. Sheets and strings
/// of one layer with 30 % jitter have 0 to 0.04, of two layers 0.5, Poisson clouds 0.5 at the median.
const FLAT: f64 = 0.15;
/// Hardly seen, and the share of particles of which that is too much: it is 4 to 16 % in Poisson clouds, and 30 to 100 % in
/// lattices squeezed 4:1, and 3:1 in 3-D, where summed densities are off by a fifth and more.
const THIN: f64 = 0.3;
const MOST_THIN: f64 = 0.2;
const MOST_THIN_OF_FEW: f64 = 0.5;
/// The roundness of all surroundings together, away from surfaces: 0.97 in Poisson clouds, 0.8 in bodies of three layers and
/// 0.6 of two. Lattices squeezed 2:1 have 0.53 to 0.87, and 1.03 of their density; where it is less, or disorder makes single
/// particles see by far less than all together, 1.07 to 2.5.
const LEAST_ROUND: f64 = 0.5;
const LEAST_ROUND_OF_DISORDER: f64 = 0.75;
const DISORDER: f64 = 0.87;
const ROUND: f64 = 0.85;
/// The same with surfaces, where fewer than so many are away from them: 0.53 to 0.57 in sheets, strips and beams two particles
/// thick, whose densities leave them 1.1 to 1.3 times too conductive where kernels see so much of what is empty, 0.58 and more
/// where not.
const LEAST_ROUND_OF_BODIES: f64 = 0.575;
const ALL_INSIDE: f64 = 0.6;
const FEWEST_OF_BODIES: usize = 60;
/// Particles from which their mean says something.
const SAMPLED: usize = 200;
/// Length of Σ V W d/h beyond which a particle is at a surface.
const INSIDE: f64 = 0.25;

/// What a particle conducts at least in its worst direction, and by how much more than fill it its neighbours' volumes may.
/// Both are missed by 0 to 2 % of Poisson clouds and others with noise, by 9 to 90 % of lattices squeezed 6:1 and more, and by
/// 6 % of particles graded 10:1 along each axis, whose modes converge all the same.
const CONDUCTS: f64 = 0.3;
const OVERFULL: f64 = 1.1;
const MOST_LACKING: f64 = 0.08;
/// What those that are overfull conduct together, if they are this share.
const CONDUCT: f64 = 0.7;
const MANY: f64 = 0.2;

/// The share of Σ V W that a particle and what is nearer than a quarter of its size may make where that is full: with
/// neighbours that are all in pairs it is 0.9, in Poisson clouds of one dimension 0.75 and more at one particle in ten.
const FULL: f64 = 1.02;
const ALONE: f64 = 0.75;
const NEAR: f64 = 0.25;
const MOST_ALONE: f64 = 0.25;

/// Neighbours that count, (Σ ω)²/Σ ω² with ω = V w r²/2, for each direction that is there: 2 in lattices of which only the nearest are within
/// the support, which are right. With jitter of 20 to 80 % particles conduct 0.5 to 0.9 where the tenth that has fewest has 1.5,
/// and less and less below.
const FEW: f64 = 1.5;
const MOST_WITH_FEW: f64 = 0.1;
/// Σ V W from which on there should be some: drops of a spray, and surfaces, have less.
const INHABITED: f64 = 0.8;
/// The share of a summed density that a particle makes by itself where the sum means nothing, by dimension: of a lattice it is a
/// tenth too large there, and grows as fast as the share.
const ITSELF: [f64; 3] = [0.9, 0.8, 0.65];

/// What one particle sees.
struct Seen {
    i: usize,
    /// Neighbours that count.
    count: f64,
    /// Σ V W d dᵀ/h²
    around: Matrix3<f64>,
    /// Σ V w d dᵀ/2, w the operator's weights, by what is asked for of it: I where it is right.
    conducts: Matrix3<f64>,
    /// Σ V W, of it the particle's own and what is near, and the length of Σ V W d/h.
    filled: f64,
    own: f64,
    near: f64,
    aside: f64,
}

/// What is to be found out.
struct Wanted {
    /// The operator needs thickness.
    thick: bool,
    /// rho is summed.
    summed: bool,
    /// Particles should conduct alike in all directions that they have.
    even: bool,
}

impl State {
    /// Refuses clouds in which kernels do not reach the neighbours in every direction that there is.
    pub(super) fn refuse_what_is_not_seen(&self, matrix: &Matrix) -> Result<()> {
        let (operator, allow) = (self.choices.operator, self.choices.allow);
        let isotropic = self.directions.as_ref().is_none_or(|d| d.shape.is_empty());
        let one_matrix = self.choices.normalise == Normalise::Tensor && operator.is_one_matrix();
        let insisted = allow.volumes || allow.flat;
        let summed = self.inputs[fields::RHO] == Input::Unset;
        let wanted = Wanted {
            thick: self.needs_thickness() && self.dim() > 1,
            summed: summed && self.dim() > 1 && !allow.volumes,
            even: !summed && isotropic && (one_matrix || operator.is_exact()) && self.dim() > 1 && !insisted,
        };
        if self.len() < FEWEST || (insisted && !wanted.thick && !wanted.summed) {
            return Ok(());
        }
        let seen = self.with_rows(|rows| self.look_around(rows, matrix))?;
        let dim = self.dim();
        if wanted.thick && median(seen.iter().map(|s| s.roundness(dim))) < FLAT {
            return Err(self.too_thin("one direction"));
        }
        if !insisted {
            self.refuse_what_sees_itself(&seen, summed)?;
        }
        if wanted.summed {
            self.refuse_wrong_sums(&seen)?;
        }
        if wanted.even {
            self.refuse_what_does_not_conduct(&seen)?;
        }
        if one_matrix && !insisted { self.refuse_few_neighbours(&seen) } else { Ok(()) }
    }

    fn refuse_wrong_sums(&self, seen: &[Seen]) -> Result<()> {
        let dim = self.dim();
        let thin = share(seen, |s| s.roundness(dim) < THIN);
        let inside: Vec<&Seen> = seen.iter().filter(|s| s.aside < INSIDE).collect();
        let together = inside.iter().map(|s| s.around).sum::<Matrix3<f64>>();
        let (round, single) = (roundness(&together, dim), median(inside.iter().map(|s| s.roundness(dim))));
        let disordered = single < DISORDER * round && round < LEAST_ROUND_OF_DISORDER;
        // Few particles are no sample.
        let many = inside.len() >= SAMPLED && 3 * inside.len() >= seen.len();
        let squeezed = many && (round < LEAST_ROUND || disordered);
        let all = roundness(&seen.iter().map(|s| s.around).sum::<Matrix3<f64>>(), dim);
        let emptied = thin > if many { MOST_THIN } else { MOST_THIN_OF_FEW } && round < ROUND;
        let body = seen.len() >= FEWEST_OF_BODIES && (inside.len() as f64) < ALL_INSIDE * seen.len() as f64;
        let thin_body = body && all < LEAST_ROUND_OF_BODIES;
        if !(squeezed || emptied || thin_body) {
            return Ok(());
        }
        let worst = seen.iter().min_by(|a, b| a.roundness(dim).total_cmp(&b.roundness(dim)));
        let value = format!(
            "summed over neighbours that are not all around: in one direction there is {:.0} % of what there is in another",
            100.0 * round.min(median(seen.iter().map(|s| s.roundness(dim))))
        );
        let rule = "it may be a fifth and more off: give rho, or a larger h_fac where spacing differs by direction, or insist \
                    with allow=volumes";
        Err(Error::bad_at("rho", self.host(worst.map_or(0, |s| s.i)), value, rule))
    }

    fn refuse_what_does_not_conduct(&self, seen: &[Seen]) -> Result<()> {
        let least = |conducts: &Matrix3<f64>| extremes(conducts, self.dim()).0;
        let overfull: Vec<&Seen> = seen.iter().filter(|s| s.filled > OVERFULL).collect();
        let lacking = share(seen, |s| s.filled > OVERFULL && least(&s.conducts) < CONDUCTS);
        let together = overfull.iter().map(|s| s.conducts).sum::<Matrix3<f64>>() / overfull.len().max(1) as f64;
        let many = overfull.len() as f64 > MANY * seen.len() as f64;
        if lacking <= MOST_LACKING && !(many && least(&together) < CONDUCT) {
            return Ok(());
        }
        let worst = overfull.iter().min_by(|a, b| least(&a.conducts).total_cmp(&least(&b.conducts)));
        let (i, conducts) = worst.map_or((0, 0.0), |s| (s.i, least(&s.conducts)));
        let rule = format!(
            "in one direction it has hardly a neighbour, though volumes m/rho reach that far, and conducts {:.2} of what it \
             should, {:.2} with the others: give a larger h_fac, h, or more particles, or insist with allow=volumes",
            conducts.max(0.0),
            least(&together).max(0.0)
        );
        Err(Error::bad_at("h", self.host(i), "too short for the spacing", &rule))
    }

    fn refuse_what_sees_itself(&self, seen: &[Seen], summed: bool) -> Result<()> {
        // Where rho is summed, whatever is seen fills space.
        let full = if summed { 0.0 } else { FULL };
        let near = |s: &Seen| s.near > s.own && s.near > ALONE * s.filled && s.filled > full;
        let alone = |s: &Seen| near(s) || (summed && s.own > ITSELF[self.dim() - 1] * s.filled);
        let Some(first) = seen.iter().find(|s| alone(s)).filter(|_| share(seen, alone) > MOST_ALONE) else {
            return Ok(());
        };
        let value = format!("too short, as that of {:.0} % of the particles", 100.0 * share(seen, alone));
        let rule = "it sees hardly more than itself and what is in the same place, and what is around it too far: give a larger \
                    h_fac or h, one particle in each place, or insist with allow=volumes";
        Err(Error::bad_at("h", self.host(first.i), value, rule))
    }

    fn refuse_few_neighbours(&self, seen: &[Seen]) -> Result<()> {
        let lonely = |s: &Seen| s.filled > INHABITED && s.count < FEW * s.directions();
        let few = share(seen, lonely);
        let Some(first) = seen.iter().find(|s| lonely(s)).filter(|_| few > MOST_WITH_FEW) else { return Ok(()) };
        let rule = format!(
            "{:.0} % of the particles have less than {FEW} neighbours that count for each direction, among which heat does not \
             spread as in a continuum: give a larger h_fac or h, or insist with allow=volumes",
            100.0 * few
        );
        Err(Error::bad_at("h", self.host(first.i), "too short for the spacing", &rule))
    }

    fn look_around(&self, rows: &Rows, matrix: &Matrix) -> Result<Vec<Seen>> {
        let (n, kernel) = (self.len(), &self.choices.kernel);
        let volume = self.geometry.as_ref().map_or(&[][..], |g| &g.volume);
        let count = n.min(SAMPLE);
        let one = |k: usize| {
            let (i, mut seen) = (k * n / count, None);
            rows.visit(i..i + 1, &mut Scratch::default(), |row| {
                seen = Some(Seen::of(kernel, &row, rows.h[i], volume, matrix.coefficients(i))?);
                Ok(())
            })?;
            Ok(seen)
        };
        let seen: Result<Vec<Option<Seen>>> = self.pool.map(count, one).into_iter().collect();
        Ok(seen?.into_iter().flatten().collect())
    }
}

impl Seen {
    fn of(kernel: &Kernel, row: &Row, h: f64, volume: &[f64], coefficients: &[f64]) -> Result<Seen> {
        let i = row.i;
        let (dim, unit) = (kernel.dim(), h.powi(-(kernel.dim() as i32)));
        let q = memory::collected("a sample", row.r.iter().map(|r| r / h))?;
        let mut w = memory::filled("a sample", q.len(), 0.0)?;
        kernel.w(&q, &mut w);
        w.iter_mut().zip(row.j).for_each(|(w, &j)| *w *= volume[j as usize] * unit);
        let own = volume[i] * unit * kernel.w_at(0.0);
        let reach = NEAR * volume[i].powf(1.0 / dim as f64);
        let near = w.iter().zip(row.r).filter(|(_, r)| **r < reach).map(|(w, _)| w);
        let aside = (0..dim).map(|a| (w.iter().zip(row.d[a]).map(|(w, d)| w * d).sum::<f64>() / h).powi(2));
        let (mut omega, mut squared) = (0.0, 0.0);
        for (g, r) in coefficients.iter().zip(row.r) {
            omega += g * r * r;
            squared += (g * r * r).powi(2);
        }
        let second = tensor::second(row, dim, coefficients) * (0.5 / volume[i]);
        let whole = sides::kept(dim, row, coefficients).and_then(|kept| kept.try_inverse());
        Ok(Seen {
            i,
            count: if squared > 0.0 { omega * omega / squared } else { 0.0 },
            around: tensor::second(row, dim, &w) / (h * h),
            conducts: whole.map_or(second, |whole| whole * second * whole),
            filled: own + w.iter().sum::<f64>(),
            own,
            near: own + near.sum::<f64>(),
            aside: aside.sum::<f64>().sqrt(),
        })
    }

    /// In how many it conducts: 1 in a string, 2 in a sheet.
    fn directions(&self) -> f64 {
        let (sum, squares) = (self.conducts.trace(), self.conducts.norm_squared());
        if squares > 0.0 { sum * sum / squares } else { 1.0 }
    }

    fn roundness(&self, dim: usize) -> f64 {
        roundness(&self.around, dim)
    }
}

fn roundness(around: &Matrix3<f64>, dim: usize) -> f64 {
    let (least, most) = extremes(around, dim);
    if most > 0.0 { least / most } else { 0.0 }
}

/// The least and the largest over the directions that there are.
fn extremes(second: &Matrix3<f64>, dim: usize) -> (f64, f64) {
    let ends = |values: &[f64]| {
        let least = values.iter().copied().fold(f64::INFINITY, f64::min);
        (least, values.iter().copied().fold(0.0, f64::max))
    };
    match dim {
        1 => (second[(0, 0)], second[(0, 0)]),
        2 => ends(second.fixed_view::<2, 2>(0, 0).symmetric_eigenvalues().as_slice()),
        _ => ends(second.symmetric_eigenvalues().as_slice()),
    }
}

fn share(seen: &[Seen], of: impl Fn(&Seen) -> bool) -> f64 {
    seen.iter().filter(|s| of(s)).count() as f64 / seen.len().max(1) as f64
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    let middle = values.len() / 2;
    if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(middle, f64::total_cmp).1 }
}
