//! Metrics as they come: an append-only CSV file that can be cut back and continued bit for bit.
//!
//! A checkpoint records [`MetricsCsv::len_bytes`] after [`MetricsCsv::sync`]. Whatever a killed process appended
//! after its last checkpoint is cut off on resuming, and then written again by the same computation.

use super::RunError;
use std::fs::File;
use std::io::{BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// An open metrics file.
#[derive(Debug)]
pub struct MetricsCsv {
    file: BufWriter<File>,
    path: PathBuf,
    columns: usize,
    len_bytes: u64,
    row: String,
}

impl MetricsCsv {
    /// Opens the file: a new one (`truncate_to` is `None`; an old one is replaced), or one to go on with, cut back
    /// to `truncate_to` bytes.
    pub fn open(path: &Path, columns: &[&str], truncate_to: Option<u64>) -> Result<Self, RunError> {
        let header = format!("{}\n", columns.join(","));
        let mut file = File::options()
            .read(true)
            .write(true)
            .create(truncate_to.is_none())
            .truncate(truncate_to.is_none())
            .open(path)
            .map_err(RunError::io("open", path))?;
        let len_bytes = match truncate_to {
            None => {
                file.write_all(header.as_bytes()).map_err(RunError::io("write", path))?;
                header.len() as u64
            }
            Some(len) => {
                check_prefix(&file, path, &header, len)?;
                file.set_len(len).map_err(RunError::io("truncate", path))?;
                file.seek(SeekFrom::End(0)).map_err(RunError::io("read", path))?;
                len
            }
        };
        Ok(Self {
            file: BufWriter::new(file),
            path: path.to_path_buf(),
            columns: columns.len(),
            len_bytes,
            row: String::new(),
        })
    }

    /// Appends a row of `f64` or `Option<f64>`; `None` is an empty field. Numbers are written so that they read back
    /// exactly, in as few digits as that takes.
    ///
    /// # Errors
    /// If the row does not have one value per column, or cannot be written.
    pub fn append<V: Into<Option<f64>>>(&mut self, row: impl IntoIterator<Item = V>) -> Result<(), RunError> {
        self.row.clear();
        let mut count = 0;
        for value in row {
            if count > 0 {
                self.row.push(',');
            }
            count += 1;
            if let Some(value) = value.into() {
                self.row.push_str(&number(value));
            }
        }
        if count != self.columns {
            let why = format!("a row of {count} values for {} columns", self.columns);
            return Err(RunError::damaged(&self.path, why));
        }
        self.row.push('\n');
        self.file.write_all(self.row.as_bytes()).map_err(RunError::io("write", &self.path))?;
        self.len_bytes += self.row.len() as u64;
        Ok(())
    }

    /// The length of the file with everything appended so far, in bytes.
    pub fn len_bytes(&self) -> u64 {
        self.len_bytes
    }

    /// Brings everything to the disk. Call it before the checkpoint that records [`Self::len_bytes`].
    pub fn sync(&mut self) -> Result<(), RunError> {
        self.file.flush().map_err(RunError::io("write", &self.path))?;
        self.file.get_ref().sync_data().map_err(RunError::io("write", &self.path))
    }
}

/// The file must begin with our header and have a row's end at `len`: otherwise it is not the file that the
/// checkpoint speaks of.
fn check_prefix(file: &File, path: &Path, header: &str, len: u64) -> Result<(), RunError> {
    let mut bytes = Vec::new();
    file.take(len).read_to_end(&mut bytes).map_err(RunError::io("read", path))?;
    if (bytes.len() as u64) < len {
        return Err(RunError::damaged(path, format!("{} bytes, the checkpoint has seen {len}", bytes.len())));
    }
    if !bytes.starts_with(header.as_bytes()) {
        return Err(RunError::damaged(path, "its columns are not those of this version"));
    }
    if bytes.last() != Some(&b'\n') {
        return Err(RunError::damaged(path, format!("no row ends at byte {len}")));
    }
    Ok(())
}

/// The shortest text that reads back as the same number.
fn number(value: f64) -> String {
    let size = value.abs();
    if size != 0.0 && !(1e-5..1e15).contains(&size) && value.is_finite() {
        format!("{value:e}")
    } else {
        format!("{value}")
    }
}

/// Metrics read back.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MetricsTable {
    /// Column names.
    pub columns: Vec<String>,
    /// Rows; an empty field is `None`.
    pub rows: Vec<Vec<Option<f64>>>,
}

impl MetricsTable {
    /// The values of a column, top to bottom; `None` if there is no such column.
    pub fn column(&self, name: &str) -> Option<Vec<Option<f64>>> {
        let index = self.columns.iter().position(|column| column == name)?;
        Some(self.rows.iter().map(|row| row.get(index).copied().flatten()).collect())
    }

    /// The column as plain numbers, holes as NaN (figures leave gaps there).
    pub fn numbers(&self, name: &str) -> Option<Vec<f64>> {
        Some(self.column(name)?.into_iter().map(|value| value.unwrap_or(f64::NAN)).collect())
    }
}

/// Reads a metrics file. A last row without its line end was cut off by a kill and is left out.
pub fn read_metrics(path: &Path) -> Result<MetricsTable, RunError> {
    let text = super::read_text(path)?;
    let whole = text.rfind('\n').map_or("", |end| &text[..=end]);
    let mut reader = csv::ReaderBuilder::new().from_reader(whole.as_bytes());
    let damaged = |error: csv::Error| RunError::damaged(path, error);
    let columns = reader.headers().map_err(damaged)?.iter().map(str::to_owned).collect();
    let mut rows = Vec::new();
    for record in reader.records() {
        let record = record.map_err(damaged)?;
        let row: Result<Vec<_>, _> = record
            .iter()
            .map(|field| match field {
                "" => Ok(None),
                field => field
                    .parse()
                    .map(Some)
                    .map_err(|_| RunError::damaged(path, format!("row {}: \"{field}\" is no number", rows.len() + 1))),
            })
            .collect();
        rows.push(row?);
    }
    Ok(MetricsTable { columns, rows })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cut_back_and_continued_it_is_the_same_file() {
        let folder = tempfile::tempdir().unwrap();
        let [whole, killed] = ["whole.csv", "killed.csv"].map(|name| folder.path().join(name));
        let columns = ["episode", "reward"];
        let row = |i: i32| [f64::from(i), 0.1 * f64::from(i)];

        let mut metrics = MetricsCsv::open(&whole, &columns, None).unwrap();
        (0..9).for_each(|i| metrics.append(row(i)).unwrap());
        metrics.sync().unwrap();

        let mut metrics = MetricsCsv::open(&killed, &columns, None).unwrap();
        (0..4).for_each(|i| metrics.append(row(i)).unwrap());
        metrics.sync().unwrap();
        let checkpoint = metrics.len_bytes();
        (4..6).for_each(|i| metrics.append(row(i)).unwrap());
        metrics.sync().unwrap();
        metrics.file.get_mut().write_all(b"6,0.60").unwrap();
        drop(metrics);
        let mut metrics = MetricsCsv::open(&killed, &columns, Some(checkpoint)).unwrap();
        (4..9).for_each(|i| metrics.append(row(i)).unwrap());
        metrics.sync().unwrap();

        let bytes = std::fs::read(&whole).unwrap();
        assert_eq!(bytes, std::fs::read(&killed).unwrap());
        assert_eq!(bytes.len() as u64, metrics.len_bytes());
    }

    #[test]
    fn a_file_that_is_not_the_checkpoints_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("metrics.csv");
        let mut metrics = MetricsCsv::open(&path, &["a", "b"], None).unwrap();
        metrics.append([1.0, 2.0]).unwrap();
        metrics.sync().unwrap();
        let len = metrics.len_bytes();
        for (columns, cut) in [(["a", "b"], len + 1), (["a", "c"], len), (["a", "b"], len - 1)] {
            let error = MetricsCsv::open(&path, &columns, Some(cut)).unwrap_err();
            assert!(matches!(error, RunError::Damaged { .. }), "{error}");
        }
        assert_eq!(std::fs::metadata(&path).unwrap().len(), len, "refusing changes nothing");
        assert!(metrics.append([1.0]).is_err(), "a row of the wrong width");
    }

    #[test]
    fn holes_and_torn_rows_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("metrics.csv");
        let mut metrics = MetricsCsv::open(&path, &["a", "b"], None).unwrap();
        metrics.append([Some(1e-300), None]).unwrap();
        metrics.file.write_all(b"7,8").unwrap();
        metrics.sync().unwrap();
        let table = read_metrics(&path).unwrap();
        assert_eq!(table.rows, vec![vec![Some(1e-300), None]]);
        assert!(table.numbers("b").unwrap()[0].is_nan());
        assert_eq!(table.column("c"), None);
    }

    proptest::proptest! {
        #[test]
        fn every_number_reads_back_exactly(value in proptest::num::f64::NORMAL | proptest::num::f64::ZERO | proptest::num::f64::SUBNORMAL) {
            proptest::prop_assert_eq!(number(value).parse::<f64>().unwrap().to_bits(), value.to_bits());
        }
    }
}
