//! Adaptive maps: filled cells are marked, and progress shows no final total.

use super::*;

/// A map along a border, most of it filled.
const ADAPTIVE: &str = "--set axis.0.count=81 --set axis.1.count=65 --set refine.minimum_grid=8 --set refine.max_error=0.05 \
     --set refine.rounds=2";

#[test]
fn filled_cells_have_no_error_of_the_exponent() {
    let folder = folder();
    let run = map(&folder, ADAPTIVE).success();
    let said = String::from_utf8_lossy(&run.get_output().stderr).into_owned();
    assert!(said.contains(" of at least ") && !said.contains(" s left"), "{said}");
    let out = folder.path().join("out/s");
    let (_, rows) = rows(&out.join("cells.csv"));
    let of =
        |source: &str| rows.iter().filter(|row| row[15] == source && row[4] == "chaotic").collect::<Vec<_>>();
    let [filled, integrated] = ["filled", "integrated"].map(of);
    assert!(filled.len() > 20 && integrated.len() > 20, "{} {}", filled.len(), integrated.len());
    assert!(filled.iter().all(|row| !row[6].is_empty() && row[7].is_empty()));
    assert!(integrated.iter().all(|row| !row[7].is_empty()));
    let array = fs::read(out.join("cells.npy")).unwrap();
    let from = 10 + usize::from(u16::from_le_bytes([array[8], array[9]]));
    for (row, packed) in rows.iter().zip(array[from..].chunks((array.len() - from) / rows.len())) {
        let error = f64::from_le_bytes(packed[35..43].try_into().unwrap());
        assert_eq!(error.is_nan(), row[7].is_empty(), "{row:?}");
    }
}
