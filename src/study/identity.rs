//! What a run is beside its solver: snapshots remember it, so that only the same run goes on from them.

use super::scene::{Output, Time};

/// The note of a snapshot that has it.
pub const NOTE: &str = "run";

/// What decides how T starts; as it goes on, it says nothing of that.
const START: &str = "T";
const ENCODING: &str = "output.encoding";

/// `time.start=0.0 time.steps=10 … T=…`: keys of the scene with their values.
pub fn of(start: f64, time: &Time, output: &Output, t: &[f64]) -> String {
    let Time { end, steps, .. } = time;
    let Output { every, fields, encoding, .. } = output;
    let encoding = format!("{encoding:?}").to_lowercase();
    format!(
        "time.start={start:?} time.end={end:?} time.steps={steps} output.every={every} output.fields={} {ENCODING}={encoding} \
         {START}={:016x}",
        fields.join(","),
        digest(t)
    )
}

/// FNV-1a of the bits: not to guard against anybody, only to notice.
fn digest(values: &[f64]) -> u64 {
    let bytes = values.iter().flat_map(|v| v.to_bits().to_le_bytes());
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3))
}

/// How two runs differ.
#[derive(Default)]
pub struct Compared {
    /// So that one cannot go on as the other.
    pub different: Option<String>,
    /// So that it can, and ought to say so.
    pub harmless: Option<String>,
}

/// Holds what is known of a run against what a snapshot says of its own.
pub fn compare(own: &str, other: &str) -> Compared {
    let value = |text: &str, key: &str| {
        let words = text.split(' ').filter_map(|word| word.split_once('='));
        words.filter(|(k, _)| *k == key).map(|(_, value)| value.to_string()).next()
    };
    let mut compared = Compared::default();
    for (key, here) in own.split(' ').filter_map(|word| word.split_once('=')) {
        let there = value(other, key).unwrap_or("unknown".into());
        if there == here {
            continue;
        }
        match key {
            ENCODING => {
                compared.harmless =
                    Some(format!("{key} was {there}: snapshots from here on are {here}, which reads the same"));
            }
            _ if compared.different.is_none() => compared.different = Some(difference(key, &there, here)),
            _ => {}
        }
    }
    compared
}

fn difference(key: &str, there: &str, here: &str) -> String {
    match key {
        START => "T at the start has other values there".into(),
        _ if key.starts_with("time.") => format!(
            "{key} is {there} there, and {here} here (a scene with file = this snapshot in its [particles] may run beyond the end)"
        ),
        _ => format!("{key} is '{there}' there, and '{here}' here"),
    }
}

#[cfg(test)]
mod tests {
    use super::super::scene::Stored;
    use super::*;

    #[test]
    fn what_changes_a_run_is_named_by_its_key() {
        let time = |end, steps| Time { start: None, end, steps };
        let output = |every, fields: &[&str], encoding| Output {
            pvd: "a.pvd".into(),
            every,
            fields: fields.iter().map(|f| f.to_string()).collect(),
            encoding,
        };
        let usual = || output(2, &["flux", "rate"], Stored::Raw);
        let own = of(0.5, &time(1.0, 10), &usual(), &[1.0, 2.0]);
        let against = |other: String| compare(&own, &other);
        let same = against(own.clone());
        assert!(same.different.is_none() && same.harmless.is_none());
        for (other, says) in [
            (of(0.0, &time(1.0, 10), &usual(), &[1.0, 2.0]), "time.start is 0.0 there, and 0.5 here"),
            (of(0.5, &time(2.0, 10), &usual(), &[1.0, 2.0]), "time.end is 2.0"),
            (of(0.5, &time(1.0, 20), &usual(), &[1.0, 2.0]), "time.steps is 20"),
            (of(0.5, &time(1.0, 10), &output(1, &["flux", "rate"], Stored::Raw), &[1.0, 2.0]), "output.every is '1'"),
            (of(0.5, &time(1.0, 10), &output(2, &[], Stored::Raw), &[1.0, 2.0]), "output.fields is '' there"),
            (of(0.5, &time(1.0, 10), &usual(), &[2.0, 1.0]), "T at the start"),
            ("of a later version".into(), "time.start is unknown there"),
        ] {
            let text = against(other).different.unwrap_or_default();
            assert!(text.contains(says), "{says}: {text}");
        }
        let stored = against(of(0.5, &time(1.0, 10), &output(2, &["flux", "rate"], Stored::Zlib), &[1.0, 2.0]));
        assert!(stored.different.is_none() && stored.harmless.is_some_and(|text| text.contains("was zlib")));
    }
}
