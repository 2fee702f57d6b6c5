//! TensorBoard event files, made from the metrics.
//!
//! The format is TFRecord (length, masked CRC-32C, payload, masked CRC-32C) around the protobuf message `Event`:
//!
//! ```text
//! Event   { 1: double wall_time   2: int64 step   3: string file_version   5: Summary }
//! Summary { 1: Value }            Value { 1: string tag   2: float simple_value }
//! ```
//!
//! The two crates that write it bring a protobuf compiler or an image library along, and stamp the wall clock; ours
//! takes the time from a column, so the same metrics give the same bytes.

use super::MetricsTable;

/// Name of the event file: TensorBoard looks for `tfevents`.
pub const EVENTS_FILE: &str = "events.out.tfevents.0000000000.sarah";

/// The event file for a metrics table, whole.
///
/// Every other column becomes a curve over `step_column`; `time_column` (s, for instance simulated time) is the wall
/// time. Rows without a step are left out, as are holes and values that are not finite.
pub fn event_file(table: &MetricsTable, step_column: &str, time_column: &str) -> Vec<u8> {
    let mut file = Vec::new();
    record(&mut file, &event(0.0, 0, |out| bytes(out, 3, b"brain.Event:2")));
    let index = |name: &str| table.columns.iter().position(|column| column == name);
    let (step_at, time_at) = (index(step_column), index(time_column));
    for row in &table.rows {
        let value = |at: Option<usize>| row.get(at?).copied().flatten().filter(|value| value.is_finite());
        let Some(step) = value(step_at) else { continue };
        for (at, tag) in table.columns.iter().enumerate() {
            if Some(at) == step_at || Some(at) == time_at {
                continue;
            }
            let Some(number) = value(Some(at)) else {
                continue;
            };
            let summary = event(value(time_at).unwrap_or(0.0), step as i64, |out| {
                let mut scalar = Vec::new();
                bytes(&mut scalar, 1, tag.as_bytes());
                key(&mut scalar, 2, 5);
                scalar.extend((number as f32).to_le_bytes());
                let mut summary = Vec::new();
                bytes(&mut summary, 1, &scalar);
                bytes(out, 5, &summary);
            });
            record(&mut file, &summary);
        }
    }
    file
}

fn event(wall_time_s: f64, step: i64, what: impl FnOnce(&mut Vec<u8>)) -> Vec<u8> {
    let mut out = Vec::new();
    key(&mut out, 1, 1);
    out.extend(wall_time_s.to_le_bytes());
    key(&mut out, 2, 0);
    varint(&mut out, step as u64);
    what(&mut out);
    out
}

fn record(file: &mut Vec<u8>, payload: &[u8]) {
    let length = (payload.len() as u64).to_le_bytes();
    file.extend(length);
    file.extend(masked_crc(&length).to_le_bytes());
    file.extend(payload);
    file.extend(masked_crc(payload).to_le_bytes());
}

/// CRC-32C, rotated and shifted, so that a record within a record does not confuse the check.
fn masked_crc(bytes: &[u8]) -> u32 {
    const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISCSI);
    CRC.checksum(bytes).rotate_right(15).wrapping_add(0xa282_ead8)
}

fn key(out: &mut Vec<u8>, field: u8, wire_type: u8) {
    out.push(field << 3 | wire_type);
}

fn bytes(out: &mut Vec<u8>, field: u8, content: &[u8]) {
    key(out, field, 2);
    varint(out, content.len() as u64);
    out.extend(content);
}

fn varint(out: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn begins_as_tensorboard_expects() {
        let file = event_file(&MetricsTable::default(), "episode", "time_s");
        // Length 26: wall time 9, step 2, version 15.
        assert_eq!(file[..8], 26_u64.to_le_bytes());
        assert_eq!(&file[file.len() - 4 - 13..file.len() - 4], b"brain.Event:2");
    }

    #[test]
    fn the_checksum_is_the_masked_castagnoli_one() {
        // "123456789" has the CRC-32C 0xe3069283.
        let unmasked = masked_crc(b"123456789").wrapping_sub(0xa282_ead8).rotate_left(15);
        assert_eq!(unmasked, 0xe306_9283);
    }

    #[test]
    fn holes_make_no_points_and_equal_metrics_equal_bytes() {
        let columns = ["episode", "time_s", "reward"].map(String::from).to_vec();
        let full = MetricsTable { columns, rows: vec![vec![Some(300.0), Some(30.0), Some(0.5)]] };
        let hole = MetricsTable { rows: vec![vec![Some(300.0), Some(30.0), None]], ..full.clone() };
        let empty = MetricsTable { rows: vec![], ..full.clone() };
        let file = |table| event_file(table, "episode", "time_s");
        assert_eq!(file(&hole), file(&empty));
        assert_eq!(file(&full), file(&full));
        assert!(file(&full).windows(6).any(|window| window == b"reward"));
    }
}
