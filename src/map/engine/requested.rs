//! Records with the requested quantities.

use crate::map::plan::Needs;
use crate::record::{Record, measures, valid};
use rattlemap_dynamics::orbit::Measurement;

/// Converts a measurement to a record with the requested quantities.
pub fn measured_record(measured: &Measurement, needs: &Needs) -> Record {
    let mut record = Record {
        strobe: measured.strobe.into(),
        periods_run: measured.periods_run,
        status: measured.status.code(),
        valid: valid::STROBE,
        ..Record::default()
    };
    if measured.status.is_failure() {
        return record;
    }
    record.valid |= valid::PERIOD | valid::IMPACTS | valid::MESH;
    if measured.is_quasi_periodic {
        record.valid |= valid::QUASI_PERIODIC;
    }
    record.period = measured.period.unwrap_or(0);
    record.impacts_per_period = measured.impacts_per_period;
    record.mesh_fraction = measured.mesh_fraction;
    if let Some([lyapunov, error]) = measured.lyapunov {
        record.valid |= valid::LYAPUNOV;
        (record.lyapunov, record.lyapunov_error) = (lyapunov, error);
    }
    if let Some(symmetric) = measured.symmetric {
        record.valid |= valid::SYMMETRIC;
        record.symmetric = symmetric.into();
    }
    if let Some(word) = &measured.word {
        record.set_word(word);
        record.set_pattern(&word.pattern());
    }
    if needs.measures != 0 || needs.gaps {
        record.set_measures(&measured.into());
    }
    drop_unrequested(&mut record, needs);
    record
}

/// Clears the fields of a record that the scene did not request.
pub(crate) fn drop_unrequested(record: &mut Record, needs: &Needs) {
    let mut clear_unless = |is_requested: bool, bits: u32, clear: fn(&mut Record)| {
        if !is_requested {
            record.valid &= !bits;
            clear(record);
        }
    };
    clear_unless(needs.exponent, valid::LYAPUNOV, |r| (r.lyapunov, r.lyapunov_error) = (0.0, 0.0));
    clear_unless(needs.impacts, valid::IMPACTS, |r| r.impacts_per_period = 0.0);
    clear_unless(needs.mesh, valid::MESH, |r| r.mesh_fraction = 0.0);
    clear_unless(needs.symmetric, valid::SYMMETRIC, |r| r.symmetric = 0);
    clear_unless(needs.word, valid::WORD, |r| (r.word, r.word_hash, r.word_length) = ([0; 4], 0, 0));
    clear_unless(needs.pattern, valid::PATTERN, |r| {
        (r.pattern, r.pattern_hash, r.pattern_length) = ([0; 4], 0, 0)
    });
    if record.valid & (measures::bits() & !needs.measures | valid::GAPS) != 0 {
        record.clear_measures(|group| !needs.has(group));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::measures::MEASURES;

    #[test]
    fn quantities_that_are_not_requested_are_cleared() {
        let mut record = Record {
            lyapunov: 1.0,
            lyapunov_error: 1.0,
            impacts_per_period: 1.0,
            mesh_fraction: 1.0,
            word: [1; 4],
            word_hash: 1,
            word_length: 1,
            pattern: [1; 4],
            pattern_hash: 1,
            pattern_length: 1,
            symmetric: 1,
            measures: [1.0; MEASURES].into(),
            valid: !valid::FILLED & (u32::MAX >> 13),
            ..Record::default()
        };
        let whole = record.clone();
        drop_unrequested(&mut record, &Needs::EVERYTHING);
        assert_eq!(record, whole);
        drop_unrequested(
            &mut record,
            &Needs {
                exponent: false,
                lyapunov: false,
                impacts: false,
                mesh: false,
                symmetric: false,
                word: false,
                pattern: false,
                measures: 0,
                state: false,
                gaps: false,
            },
        );
        assert_eq!(record, Record { valid: valid::PERIOD | valid::STROBE, ..Record::default() });
    }
}
