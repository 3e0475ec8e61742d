//! Tables of a map of shares: its attractors, its cells, and the share of each attractor in each cell.

use std::io;

use crate::map::scene::Scene;
use crate::map::shares::{CellShares, Kind, Names, Share, requested};
use crate::model_file::subjects;
use crate::show::error::WriteError;
use crate::show::names::float;

/// What the tables show.
pub struct ShareTables<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// The cells, in order of their numbers.
    pub cells: &'a [CellShares],
    /// The names of their attractors.
    pub names: &'a Names,
}

/// Returns the name of a kind in tables.
pub fn kind(kind: Kind) -> &'static str {
    match kind {
        Kind::Free => "no_contact",
        Kind::Cycle => "cycle",
        Kind::Chaos => "chaos",
        Kind::Torus => "quasi_periodic",
    }
}

impl ShareTables<'_> {
    /// Returns the names of both axes.
    fn axes(&self) -> [String; 2] {
        [0, 1].map(|i| self.scene.axes()[i].parameter().name.to_string())
    }

    /// Returns the indices of a cell and the values of both axes.
    fn place(&self, cell: &CellShares) -> [String; 4] {
        let columns = self.scene.axes()[0].count();
        let indices = [cell.cell as usize % columns, cell.cell as usize / columns];
        let [x, y] = [0, 1].map(|i| float(self.scene.axes()[i].value(indices[i])));
        [indices[0].to_string(), indices[1].to_string(), x, y]
    }

    /// Returns the names of the requested measured quantities.
    fn quantities(&self) -> Vec<String> {
        let names = subjects(self.scene.base());
        requested(self.scene).iter().map(|measure| measure.name(&names)).collect()
    }

    /// Writes `share_attractors.csv`: one row for each attractor of the map.
    ///
    /// # Errors
    /// If the table cannot be written.
    pub fn write_attractors(&self, out: impl io::Write) -> Result<(), WriteError> {
        let mut table = csv::Writer::from_writer(out);
        table.write_record(["attractor", "kind", "period", "word", "cells", "share"])?;
        for (place, name) in self.names.list.iter().enumerate() {
            table.write_record([
                place.to_string(),
                kind(name.kind).to_owned(),
                period(name.period),
                name.word.clone(),
                name.cells.to_string(),
                float(name.share),
            ])?;
        }
        Ok(table.flush()?)
    }

    /// Writes `shares.csv`: one row for each cell and attractor.
    ///
    /// # Errors
    /// If the table cannot be written.
    pub fn write_shares(&self, out: impl io::Write) -> Result<(), WriteError> {
        let mut table = csv::Writer::from_writer(out);
        let [x, y] = self.axes();
        let head =
            ["i", "j", &x, &y, "attractor", "kind", "period", "word", "share", "share_low", "share_high"];
        let head =
            head.map(str::to_owned).into_iter().chain(["periods_run".to_owned()]).chain(self.quantities());
        table.write_record(head.chain(self.scene.base().state_names().into_iter().map(str::to_owned)))?;
        for (cell, names) in self.cells.iter().zip(&self.names.of_cells) {
            for (attractor, name) in cell.attractors.iter().zip(names) {
                let starts = attractor.starts.iter().sum::<u32>();
                let row = self.place(cell).into_iter();
                let row =
                    row.chain([name.to_string(), kind(attractor.kind).to_owned(), period(attractor.period)]);
                let row = row.chain([attractor.word.clone()]).chain(numbers(cell.share(&attractor.starts)));
                let row = row.chain([float(attractor.periods as f64 / f64::from(starts))]);
                let row = row.chain(attractor.numbers.iter().map(|number| float(number.unwrap_or(f64::NAN))));
                let state = (0..self.scene.base().state_names().len())
                    .map(|i| float(attractor.strobe.get(i).copied().unwrap_or(f64::NAN)));
                table.write_record(row.chain(state))?;
            }
        }
        Ok(table.flush()?)
    }

    /// Writes `share_cells.csv`: one row for each cell.
    ///
    /// # Errors
    /// If the table cannot be written.
    pub fn write_cells(&self, out: impl io::Write) -> Result<(), WriteError> {
        let mut table = csv::Writer::from_writer(out);
        let [x, y] = self.axes();
        let head = ["i", "j", &x, &y, "starts", "attractors"].map(str::to_owned).into_iter();
        let shares = ["chaos", "undecided"]
            .into_iter()
            .flat_map(|of| ["", "_low", "_high"].map(|end| format!("{of}{end}")));
        let expected = self.quantities().into_iter().map(|name| format!("expected_{name}"));
        table.write_record(head.chain(shares).chain(expected))?;
        for cell in self.cells {
            let chaos = cell.attractors.iter().find(|attractor| attractor.kind == Kind::Chaos);
            let chaos = cell.share(&chaos.map_or([0; 8], |attractor| attractor.starts));
            let row = self.place(cell).into_iter();
            let row = row.chain([cell.count.to_string(), cell.attractors.len().to_string()]);
            let row = row.chain(numbers(chaos)).chain(numbers(cell.undecided()));
            let expected =
                (0..self.quantities().len()).map(|place| float(cell.expected(place).unwrap_or(f64::NAN)));
            table.write_record(row.chain(expected))?;
        }
        Ok(table.flush()?)
    }
}

fn numbers(share: Share) -> [String; 3] {
    [share.mean, share.interval[0], share.interval[1]].map(float)
}

/// Returns a period for a table; empty for motion without one.
fn period(period: u32) -> String {
    if period > 0 { period.to_string() } else { String::new() }
}
