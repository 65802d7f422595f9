//! What a step did, as a C struct that may grow.

use super::pointers::place;
use crate::error::{Error, Result};
use crate::plan;

/// What a step did. Start with `diffusph_report report = DIFFUSPH_REPORT_INIT;`.
#[repr(C)]
#[allow(non_snake_case)]
#[derive(Debug, Clone, Copy, Default)]
pub struct Report {
    /// Bytes of this struct as the host knows it, set by the host; the library writes no more than that.
    pub size: i64,
    /// Time reached, s.
    pub time: f64,
    /// The step, s.
    pub dt: f64,
    /// Sub-steps that it took.
    pub substeps: i64,
    /// Stages of the last sub-step.
    pub stages: i64,
    /// Applications of the operator.
    pub applications: i64,
    /// A stable explicit step, s, as far as it was known without more work: diffusph_limit finds the largest.
    pub limit: f64,
    /// Smallest temperature, K.
    pub T_min: f64,
    /// Largest temperature, K.
    pub T_max: f64,
    /// Sum of m c_v T before the step, J.
    pub energy_before: f64,
    /// Sum of m c_v T after the step, J.
    pub energy: f64,
    /// Seconds of wall-clock time that it took.
    pub seconds: f64,
    /// Sub-steps that were done again, shorter, for the tolerance.
    pub rejected: i64,
    /// Iterations of conjugate gradients, of implicit integrators.
    pub iterations: i64,
    /// Heat that sources brought in, J.
    pub heat_source: f64,
    /// Heat that came in through surfaces (flux_in, h_conv, emissivity), J.
    pub heat_surface: f64,
    /// Heat that came in from particles of fixed T, J; with the two above it makes up energy - energy_before.
    pub heat_fixed: f64,
}

impl From<plan::Report> for Report {
    fn from(r: plan::Report) -> Report {
        let count = |v: u64| i64::try_from(v).unwrap_or(i64::MAX);
        Report {
            size: size_of::<Report>() as i64,
            time: r.time,
            dt: r.dt,
            substeps: count(r.substeps),
            stages: count(r.stages),
            applications: count(r.applications),
            limit: r.limit,
            T_min: r.t_min,
            T_max: r.t_max,
            energy_before: r.energy_before,
            energy: r.energy,
            seconds: r.seconds,
            rejected: count(r.rejected),
            iterations: count(r.iterations),
            heat_source: r.heat_source,
            heat_surface: r.heat_surface,
            heat_fixed: r.heat_fixed,
        }
    }
}

/// A host's report that may be written to.
pub struct Place {
    to: *mut Report,
    bytes: usize,
}

impl Place {
    /// Checks the pointer and the size; NULL means that no report is wanted.
    ///
    /// # Safety
    /// `to` is NULL or has as many writable bytes as its first member says.
    pub unsafe fn new(to: *mut Report) -> Result<Option<Place>> {
        if to.is_null() {
            return Ok(None);
        }
        // SAFETY: not NULL; only the first member is touched, which every version has.
        let size = *unsafe { place("report", to.cast::<i64>()) }?;
        let first = size_of::<i64>();
        let bytes = usize::try_from(size).ok().filter(|s| *s >= first && s.is_multiple_of(first));
        let rule = "set it to sizeof(diffusph_report), or start with DIFFUSPH_REPORT_INIT";
        let bytes = bytes.ok_or_else(|| Error::bad("report.size", size, rule))?;
        Ok(Some(Place { to, bytes: bytes.min(size_of::<Report>()) }))
    }

    /// Writes all but the size.
    pub fn write(self, report: &Report) {
        let first = size_of::<i64>();
        // SAFETY: both have `bytes` bytes, by `new`.
        unsafe {
            let from = std::ptr::from_ref(report).cast::<u8>().add(first);
            std::ptr::copy_nonoverlapping(from, self.to.cast::<u8>().add(first), self.bytes - first);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_older_host_gets_what_it_has_room_for() {
        let ours = Report { time: 1.0, dt: 2.0, substeps: 3, ..Report::default() };
        let mut host = Report { size: 24, substeps: -1, ..Report::default() };
        // SAFETY: the host's report is larger than it says.
        unsafe { Place::new(&mut host) }.unwrap().unwrap().write(&ours);
        assert_eq!((host.size, host.time, host.dt, host.substeps), (24, 1.0, 2.0, -1));
        for size in [0, -8, 7, 12] {
            host.size = size;
            // SAFETY: as above.
            let error = unsafe { Place::new(&mut host) }.err().unwrap();
            assert!(error.to_string().starts_with("report.size"), "{error}");
        }
    }
}
