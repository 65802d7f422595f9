//! kappa(T): named laws, or a function of the host's.

use crate::error::{Error, Result};
use crate::pool::{BLOCK, Pool};
use crate::sum;
use crate::words::Words;

/// How far below zero, relative to the largest |T|, a temperature may be and still count as zero where a power of it
/// does not exist. Methods without a maximum principle undershoot by less at a front; a host that counts from another
/// zero does not stay within it.
const UNDERSHOOT: f64 = 0.01;

/// A law kappa(T) given in words.
#[derive(Debug, Clone, PartialEq)]
pub enum Law {
    /// kappa0 (T/T0)^n
    Power { kappa0: f64, t0: f64, n: f64 },
    /// Straight lines between points, constant outside.
    Table { t: Vec<f64>, kappa: Vec<f64> },
}

/// In words that [`Law::parse`] reads to the same bits.
impl std::fmt::Display for Law {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        let list = |values: &[f64]| values.iter().map(|v| format!("{v:?}")).collect::<Vec<_>>().join(",");
        match self {
            Law::Power { kappa0, t0, n } => write!(f, "power kappa0={kappa0:?} T0={t0:?} n={n:?}"),
            Law::Table { t, kappa } => write!(f, "table T={} kappa={}", list(t), list(kappa)),
        }
    }
}

/// Every law with its words.
pub static LAWS: &[(&str, &str)] = &[
    (
        "power",
        "kappa0 (T/T0)^n: 'power kappa0=1 T0=300 n=2.5'; T0 defaults to 1, kappa0 to 1; fronts into the cold need mean=arithmetic, the default of kappa(T)",
    ),
    ("table", "straight lines between points, constant outside: 'table T=300,400,600 kappa=1,1.2,2'"),
];

impl Law {
    /// Reads a law from its words.
    ///
    /// # Errors
    /// `UnknownWord` or `BadValue` naming the word.
    pub fn parse(line: &str) -> Result<Law> {
        let mut words = Words::parse("law", line)?;
        let name = words.bare().unwrap_or("");
        let law = match name {
            "power" => Law::power(&mut words)?,
            "table" => Law::table(&mut words)?,
            _ => return Err(Error::unknown("law", name, LAWS.iter().map(|(name, _)| name))),
        };
        words.done()?;
        Ok(law)
    }

    fn power(words: &mut Words) -> Result<Law> {
        let not_negative = |v: f64| v.is_finite() && v >= 0.0;
        let positive = |v: f64| v.is_finite() && v > 0.0;
        let kappa0 = words.number("kappa0", "kappa0 must be finite and not negative", not_negative)?.unwrap_or(1.0);
        let t0 = words.number("T0", "T0 must be positive", positive)?.unwrap_or(1.0);
        let n = words.number("n", "n must be finite", f64::is_finite)?;
        let n = n.ok_or_else(|| Error::bad("law", "'power' without n", "give the exponent, like n=2.5"))?;
        Ok(Law::Power { kappa0, t0, n })
    }

    fn table(words: &mut Words) -> Result<Law> {
        let missing = |what: &str| Error::bad("law", format!("'table' without {what}"), "give T=… and kappa=…");
        let t = words.list("T")?.ok_or_else(|| missing("T"))?;
        let kappa = words.list("kappa")?.ok_or_else(|| missing("kappa"))?;
        if t.len() != kappa.len() {
            let (got, expected) = (kappa.len() as i64, t.len() as i64);
            let remedy = "one kappa for each T".into();
            return Err(Error::WrongCount { argument: "kappa".into(), got, expected, remedy });
        }
        if let Some(i) = (1..t.len()).find(|&i| t[i] <= t[i - 1]) {
            return Err(Error::bad_at("T", i, t[i], "the temperatures of a table must increase"));
        }
        if let Some(i) = kappa.iter().position(|&k| k < 0.0) {
            return Err(Error::bad_at("kappa", i, kappa[i], "conductivity must not be negative"));
        }
        Ok(Law::Table { t, kappa })
    }

    /// kappa at all these temperatures.
    pub fn evaluate(&self, pool: &Pool, t: &[f64], kappa: &mut [f64]) {
        pool.chunks(kappa, BLOCK, |start, part| {
            part.iter_mut().zip(&t[start..]).for_each(|(k, &t)| *k = self.at(t));
        });
        if sum::first(pool, kappa.len(), |i| undefined(kappa[i])).is_none() {
            return;
        }
        let (cold, lowest) = (self.at(0.0), -UNDERSHOOT * sum::max(pool, t.len(), |i| t[i].abs()));
        pool.chunks(kappa, BLOCK, |start, part| {
            let undershot =
                part.iter_mut().zip(&t[start..]).filter(|(k, t)| undefined(**k) && (lowest..0.0).contains(*t));
            undershot.for_each(|(k, _)| *k = cold);
        });
    }

    pub fn at(&self, temperature: f64) -> f64 {
        match self {
            Law::Power { kappa0, t0, n } => kappa0 * (temperature / t0).powf(*n),
            Law::Table { t, kappa } => interpolate(t, kappa, temperature),
        }
    }
}

/// Of a conductivity that a law gives where it does not hold.
fn undefined(kappa: f64) -> bool {
    kappa.is_nan() || kappa < 0.0
}

fn interpolate(t: &[f64], kappa: &[f64], at: f64) -> f64 {
    let above = t.partition_point(|&x| x <= at);
    if above == 0 {
        return kappa[0];
    }
    if above == t.len() {
        return kappa[above - 1];
    }
    let (t0, t1, k0, k1) = (t[above - 1], t[above], kappa[above - 1], kappa[above]);
    k0 + (k1 - k0) * ((at - t0) / (t1 - t0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn laws_have_their_values() {
        let power = Law::parse("power kappa0=2 T0=10 n=2.5").unwrap();
        assert!((power.at(40.0) - 2.0 * 32.0).abs() < 1e-12);
        assert_eq!(power.at(0.0), 0.0);
        let table = Law::parse("table T=300,400,600 kappa=1,2,1").unwrap();
        for (t, k) in [(0.0, 1.0), (300.0, 1.0), (350.0, 1.5), (400.0, 2.0), (500.0, 1.5), (600.0, 1.0), (1e9, 1.0)] {
            assert_eq!(table.at(t), k, "kappa({t})");
        }
    }

    #[test]
    fn a_power_of_an_undershoot_is_that_of_zero() {
        let (pool, mut kappa) = (Pool::new(1).unwrap(), [0.0; 4]);
        Law::parse("power n=2.5").unwrap().evaluate(&pool, &[4.0, -1e-3, 0.0, 1.0], &mut kappa);
        assert_eq!(kappa, [32.0, 0.0, 0.0, 1.0]);
        Law::parse("power n=2.5").unwrap().evaluate(&pool, &[4.0, -1.0, 0.0, 1.0], &mut kappa);
        assert!(kappa[1].is_nan() && kappa[0] == 32.0);
        Law::parse("power n=2").unwrap().evaluate(&pool, &[4.0, -0.01, -1.0, 1.0], &mut kappa);
        assert_eq!(kappa, [16.0, 1e-4, 1.0, 1.0]);
        let mut table = Law::parse("table T=-1,1 kappa=0,2").unwrap();
        table.evaluate(&pool, &[4.0, -0.01, -1.0, 1.0], &mut kappa);
        assert_eq!(kappa, [2.0, 0.99, 0.0, 2.0]);
        table = Law::parse("power n=-1").unwrap();
        table.evaluate(&pool, &[4.0, -0.01, -1.0, 1.0], &mut kappa);
        assert_eq!((kappa[0], kappa[1]), (0.25, f64::INFINITY));
    }

    #[test]
    fn wrong_laws_say_what_is_wrong() {
        let cases = [
            ("powr n=1", "did you mean 'power'"),
            ("power", "without n"),
            ("power n=x", "n is 'x'"),
            ("power n=1 T0=0", "T0 must be positive"),
            ("power n=1 T1=3", "T1"),
            ("table T=1,2 kappa=1", "kappa has 1 values, expected 2"),
            ("table T=2,1 kappa=1,1", "T[1] is 1"),
            ("table T=1,2 kappa=1,-1", "kappa[1] is -1"),
            ("", "unknown law"),
        ];
        for (line, expected) in cases {
            let text = Law::parse(line).unwrap_err().to_string();
            assert!(text.contains(expected), "{line}: {text}");
        }
    }
}
